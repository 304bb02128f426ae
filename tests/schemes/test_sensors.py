"""Sensors: rows of the whole structure beside the tip, in every scheme and basis; and the list of events."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scenes import blade, cases, chain, heavy_chain, movable, rubs, sampling, step, watched
from workflow import reduction, schemes
from workflow.models import Matrices, Sensors
from workflow.reduction import reduce_structure
from workflow.schemes import Recorder, Status

IMPACT, TOUCHES, LEAVES = range(3)


def test_a_part_that_is_not_linked_to_the_tip_moves_on_while_the_tip_is_held_and_heats() -> None:
    """The exact scheme left its motion out while the tip was held, at α > 0."""
    structure = chain(nodes=2, mass=1.0, stiffness=[4.0, 0.0], spacing=1.0, conductance=0.5)
    sensors = Sensors(np.array([[1.0, 0.0]]), np.zeros((1, 2)), np.zeros((1, 1)))
    batch = cases(structure, alpha=0.3, gap=0.1, mean=1.0, velocity=[0.2, 1.0])
    over = sampling(5.0, 0.1)
    results = step(replace(structure, sensors=sensors), batch, 0.0, over, "event_driven")
    assert results.status[0] == Status.OK
    assert results.metrics["contact_time"][0] > 4
    np.testing.assert_allclose(results.histories["sensor_value"][0, 0], 0.1 * np.sin(2 * over.times), atol=1e-13)


SCHEMES = [
    *((name, {}) for name in schemes.names()),
    ("moreau", {"theta": 0.5}),
    ("penalty", {"integration": "implicit"}),
]


@pytest.mark.parametrize("method", ["event_driven", "moreau"])
def test_a_sensor_at_a_contact_on_an_elastic_casing_shows_its_displacement(method: str) -> None:
    structure = watched(heavy_chain(nodes=6).matrices().on_casing(1e-8))
    batch = movable(rubs(structure, 2, amplitude=400.0, frequency=300.0))
    results = step(structure, batch, 5e-6, sampling(0.0098, 7e-5), method)
    assert results.metrics["max_penetration"].min() > 1e-6
    tip = results.histories["displacement"]
    assert np.abs(results.histories["sensor_value"][:, 0] - tip).max() <= 1e-11 * np.abs(tip).max()


@pytest.mark.parametrize("basis", reduction.names())
def test_a_reduced_sensor_elsewhere_comes_to_that_of_the_full_structure(basis: str) -> None:
    full, over = blade(), sampling(0.2, 1e-3)
    batch = cases(full, e=0.0, alpha=5.0, gap=20e-6, amplitude=24.0, frequency=5.0)
    x = np.zeros((1, 20))
    x[0, 9] = 1.0
    sensors = Sensors(x, np.zeros((1, 20)), np.zeros((1, 1)))
    truth = step(replace(full, sensors=sensors), batch, 0.0, over, "event_driven").histories["sensor_value"]
    reduced = reduce_structure(full, 6, 12, basis, 0.2)
    structure = replace(reduced.structure, sensors=reduced.sensors(sensors, full))
    ours = step(structure, reduced.project(batch), 0.0, over, "event_driven").histories["sensor_value"]
    assert np.linalg.norm(ours - truth) < 0.02 * np.linalg.norm(truth)


@pytest.mark.parametrize(("method", "options"), SCHEMES)
def test_a_mode_that_does_not_move_the_tip_moves_a_sensor(method: str, options: dict[str, Any]) -> None:
    """A mass beside the tip's, on a spring of its own: a free oscillation."""
    two = chain(nodes=1, mass=2.0, stiffness=50.0).matrices()
    pair = replace(
        two.mechanical,
        inertia=np.diag([1.0, 2.0]),
        weights=np.array([400.0, 50.0]),
        deformation=np.eye(2),
    )
    sensors = Sensors(np.array([[1.0, 0.0]]), np.zeros((1, 1)), np.zeros((1, 1)))
    structure = Matrices(pair, two.thermal, np.zeros((2, 1)), two.uniform_rise, sensors=sensors)
    batch = cases(structure, gap=1.0, mean=3.0)
    batch.displacement[:, 0] = 1e-3
    over = sampling(1.0, 0.01)
    results = step(structure, batch, 1e-4, over, method, **options)
    apart = results.histories["sensor_value"][0, 0] - 1e-3 * np.cos(20 * over.times)
    assert np.abs(apart).max() < 1e-4  # implicit Euler damps it by ω²ht/2 = 2 %
    assert results.histories["displacement"][0, -1] != 0


def test_a_recorder_interpolates_between_the_states_that_it_is_given() -> None:
    structure = watched(heavy_chain(nodes=3))
    batch = cases(structure, 2, gap=1.0)
    recorder = Recorder(structure, batch, sampling(1.0, 0.25), 0.5)
    rng = np.random.default_rng(5)
    states = [(batch.displacement, batch.temperature)]
    for _ in range(recorder.steps):
        x, theta = rng.normal(size=(2, 2, 3))
        recorder.record(x, 0 * x, theta, np.zeros(2))
        states.append((x, theta))
    ends = [structure.sensors.of(*state) for state in states]
    truth = [ends[0], (ends[0] + ends[1]) / 2, ends[1], (ends[1] + ends[2]) / 2, ends[2]]
    shown = recorder.results().histories["sensor_value"]
    np.testing.assert_allclose(shown, np.moveaxis(truth, 0, 2), rtol=1e-13)


def test_events_of_a_bouncing_ball() -> None:
    """It falls from d with g, hits at √(2gd) and flies for 2 e^k √(2gd)/g after its k-th impact."""
    g, d, e, m = 9.81, 0.5, 0.7, 2.0
    ball = chain(nodes=1, mass=m, stiffness=0.0)
    over = replace(sampling(2.0, 0.5), events=6)
    results = step(ball, cases(ball, e=e, mean=m * g, gap=d), 0.0, over, "event_driven")
    speed = np.sqrt(2 * g * d)
    times = speed / g * np.append(1, 1 + 2 * np.cumsum(e ** np.arange(1, 6)))
    approach = speed * e ** np.arange(6)
    events = {name: values[0] for name, values in results.events.items()}
    np.testing.assert_allclose(events["event_time"], times[:6], rtol=1e-11)
    np.testing.assert_allclose(events["event_approach"], approach, rtol=1e-10)
    np.testing.assert_allclose(events["event_impulse"], (1 + e) * m * approach, rtol=1e-10)
    assert np.all(events["event_kind"] == IMPACT)
    assert np.all(events["event_contact"] == 0)
    assert events["event_count"] > 6


def test_a_contact_that_lasts_is_listed_as_it_begins_and_ends() -> None:
    structure = heavy_chain(nodes=6)
    over = replace(sampling(0.004, 1e-4), events=1000)
    results = step(structure, rubs(structure, 3, amplitude=400.0, frequency=300.0), 0.0, over, "event_driven")
    events, metrics = results.events, results.metrics
    for case in range(3):
        count = int(events["event_count"][case])
        kind, time = events["event_kind"][case], events["event_time"][case]
        assert np.all(np.isnan(time[count:]))
        assert np.all(np.diff(time[:count]) >= 0)
        assert np.sum(kind == LEAVES) == metrics["releases"][case]
        assert np.sum(events["event_impulse"][case] > 0) == metrics["impacts"][case]
        starts, ends = time[kind == TOUCHES], time[kind == LEAVES]
        last = np.append(ends, over.duration)[: starts.size]
        assert np.sum(last - starts) == pytest.approx(metrics["contact_time"][case], rel=1e-4)  # less chattering
