"""The event-driven scheme against an independent solution on random scenes; its motion from state to state."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from plain_events import Reference

from scenes import blade, blade_rub, cases, chain, sampling, step, watched
from workflow.models import Cases, Harmonics, Rayleigh, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Sampling, event_driven
from workflow.schemes._exact.batch import make_operator
from workflow.schemes._exact.set_motion import Budget
from workflow.schemes._exact.trajectory import Trajectory, one_case, trajectory

SLOW = pytest.mark.slow
TIMES = sampling(20.0, 0.1)
NAMES = ("displacement", "temperature", "impulse")
DAMPING = (Rayleigh(), Rayleigh(0.1, 0.0), Rayleigh(0.05, 0.02), Rayleigh(2.0, 1.0))


def scene(rng: np.random.Generator) -> tuple[Structure, Cases]:
    """Return a chain of 1 to 8 nodes with masses, springs and heat of order one, and one case."""

    def within(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    n = int(rng.integers(1, 9))
    stiffness = rng.uniform(0.5, 4, n)
    if rng.random() < 0.2:
        stiffness[0] = 0.0  # a free root
    if rng.random() < 0.1:
        stiffness[rng.integers(0, n)] = 0.0  # a part that is not linked
    structure = chain(
        nodes=n,
        mass=tuple(rng.uniform(0.5, 2, n)),
        stiffness=tuple(stiffness),
        damping=DAMPING[rng.integers(0, len(DAMPING))],
        spacing=1.0,
        expansion=within(0, 0.1) * rng.integers(0, 2),
        heat_capacity=tuple(rng.uniform(0.5, 3, n)),
        conductance=tuple(rng.uniform(0, 2, n) * (rng.random(n) < 0.9)),
        convection=within(0, 0.3) * rng.integers(0, 2),
    )
    gap = float(rng.choice([within(0.1, 1), 0.0, -within(0.05, 0.3)]))
    start = rng.normal(0, 0.3, n)
    start[-1] = gap - abs(rng.normal(0, 0.5)) if rng.random() < 0.85 else gap
    case = cases(
        structure,
        e=float(rng.choice([0.0, within(0.2, 0.95), 1.0])),
        alpha=float(rng.choice([0.0, within(0, 2), within(0, 0.3)])),
        gap=gap,
        mean=within(-0.5, 1.5),
        amplitude=within(0, 2) * rng.integers(0, 2),
        frequency=float(rng.choice([within(0.05, 0.5), 0.1])),
        phase=within(0, 6),
        steady=rng.normal(0, 0.3, n) * rng.integers(0, 2),
        heating=rng.normal(0, 0.3, n) * rng.integers(0, 2),
        displacement=start,
        velocity=rng.normal(0, 0.5, n),
        temperature=rng.normal(0, 1, n) * rng.integers(0, 2),
    )
    return structure, case


def moving_scene(rng: np.random.Generator) -> tuple[Structure, Cases]:
    """Return such a scene with one to three harmonics in casing and load, which may act elsewhere than at the tip."""
    structure, case = scene(rng)

    def sinusoids(size: float) -> Harmonics:
        shape = 1, int(rng.integers(1, 4))
        return Harmonics(size * rng.uniform(0.1, 1, shape), rng.uniform(0.05, 0.8, shape), rng.uniform(0, 6, shape))

    case = replace(case, load_harmonics=case.load_harmonics.joined(sinusoids(1.0)), casing_harmonics=sinusoids(0.2))
    place = case.casing_of_contacts(0.0)[0][0, 0]
    touches = rng.random() < 0.15
    case.displacement[0, -1] = place if touches else place - abs(rng.normal(0, 0.5))
    if touches and rng.random() < 0.5:
        case.velocity[0, -1] = case.casing_of_contacts(0.0)[1][0, 0]
    if rng.random() < 0.3:
        structure = replace(structure.matrices(), load=rng.normal(0, 1, structure.mechanical_size))
    return structure, case


def coupled_scene(rng: np.random.Generator) -> tuple[Structure, Cases]:
    """Return such a scene whose damping, weak or strong, couples all modes."""
    structure, case = moving_scene(rng)
    root = rng.normal(size=2 * [structure.mechanical_size])
    damper = float(rng.choice([0.05, 0.5, 5.0])) * root @ root.T / len(root)
    return replace(structure.matrices(), damper=damper), case


def compare(structure: Structure, case: Cases, over: Sampling = TIMES, accuracy: float = 1e-8) -> int:
    """Compare a scene as far as it can be predicted and return its number of impacts."""
    structure = watched(structure)
    operator = event_driven.init(structure, 0.0, event_driven.Options(events=1000))
    results = event_driven.compute(operator, case, over)
    begins = case.displacement[:, -1:] == case.casing_of_contacts(0.0)[0]
    moved = np.where(begins, 0.0, 1e-12 * np.maximum(np.abs(case.gaps), 0.1))
    nearby = event_driven.compute(operator, replace(case, gaps=case.gaps + moved), over)
    reference = Reference(structure, case).solve(over.times)
    reached = over.times < reference.reached - 1e-9
    apart = ~(np.abs(nearby.histories["displacement"][0] - results.histories["displacement"][0]) < 3e-11)
    reached &= np.cumsum(apart) == 0
    if not reached.any():  # events that cannot be told apart at the start, as where speed and casing agree to rounding
        return 0
    for name in NAMES:
        ours, theirs = results.histories[name][0, reached], getattr(reference, name)[reached]
        assert np.linalg.norm(ours - theirs) <= accuracy * max(float(np.linalg.norm(theirs)), 1e-3), name
    shown = structure.sensors.of(reference.places.T, reference.warmth.T).T[:, reached]
    apart = np.linalg.norm(results.histories["sensor_value"][0][:, reached] - shown, axis=1)
    assert np.all(apart <= 3 * accuracy * np.maximum(np.linalg.norm(shown, axis=1), 1e-3))
    last = int(np.flatnonzero(reached)[-1])
    if last > 0:  # run to there with no sample between: the largest temperature knows of none
        end = float(over.times[last])
        ours = event_driven.compute(operator, case, Sampling(end, end, 2)).metrics["max_temperature"][0]
        assert abs(ours - reference.hottest[last]) <= accuracy * max(abs(reference.hottest[last]), 1e-3)
    return reference.impacts


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=30, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
def test_random_scenes(seed: int) -> None:
    compare(*scene(np.random.default_rng(seed)))


@pytest.mark.parametrize(
    ("seeds", "over", "drawn", "hotter", "struck"),
    [
        pytest.param(range(10), sampling(4.0, 0.1), moving_scene, 1.0, 10, id="in motion"),
        pytest.param(range(6), sampling(8.0, 0.1), coupled_scene, 1.0, 20, id="coupled modes"),
        pytest.param(range(12), sampling(4.0, 0.1), scene, 10.0, 10, id="strong friction heat"),
        pytest.param(range(1000, 1200), sampling(10.0, 0.1), moving_scene, 1.0, 500, id="200 in motion", marks=SLOW),
        pytest.param(range(1000), TIMES, scene, 1.0, 5000, id="1000", marks=SLOW),
    ],
)
def test_many_random_scenes(seeds: range, over: Sampling, drawn: Any, hotter: float, struck: int) -> None:
    """In motion of casing and load; with ``hotter`` heat poles of the held tip are no start for those with heat."""
    impacts = 0
    for seed in seeds:
        structure, case = drawn(np.random.default_rng(seed))
        accuracy = 1e-8 if drawn is scene else 1e-9
        impacts += compare(structure, replace(case, alpha=hotter * case.alpha), over, accuracy)
    assert impacts > struck


def against_reference(structure: Structure, case: Cases, over: Sampling = TIMES) -> float:
    """Return the largest relative error of the three histories, as far as the reference came."""
    results = step(structure, case, 0.0, over, "event_driven")
    reference = Reference(structure, case).solve(over.times)
    reached = over.times < reference.reached - 1e-9
    assert reached.sum() > 3
    errors = []
    for name in NAMES:
        ours, theirs = results.histories[name][0, reached], getattr(reference, name)[reached]
        errors.append(float(np.linalg.norm(ours - theirs)) / (float(np.linalg.norm(theirs)) or 1.0))
    return max(errors)


@pytest.mark.parametrize("alpha", [1e-12, 1e-6, 0.3])
@pytest.mark.parametrize("damping", [4.0, 4.0 * (1 + 1e-9)])
def test_a_critically_damped_mode_under_friction_heat(alpha: float, damping: float) -> None:
    """Its double pole has one eigenvector, and heat splits it by a little."""
    structure = chain(
        nodes=2, mass=1.0, stiffness=2.0, damping=Rayleigh(damping), spacing=1.0, expansion=0.1, conductance=0.5
    )
    load = {"mean": 1.0, "amplitude": 0.5, "frequency": 0.1}
    assert against_reference(structure, cases(structure, alpha=alpha, gap=0.1, **load)) <= 1e-10


def advanced(structure: Structure, batch: Cases, span: float, kept: int, events: int = 10**5) -> Trajectory:
    one = one_case(make_operator(structure, Budget(events, 10**6)), batch, 1.0)
    return trajectory(one, one.own.modal, np.zeros(1, dtype=bool), 0.0, span, kept=kept)


def test_more_events_than_are_guessed_are_kept() -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    few, many = (advanced(structure, blade_rub(structure, e=0.5), 0.6, kept) for kept in (1, 1000))
    assert few.times.size > 6
    assert np.array_equal(few.times, many.times)
    assert np.array_equal(few.X, many.X)


def test_a_state_that_is_not_reached_is_told() -> None:
    ball = chain(nodes=1, mass=1.0, stiffness=0.0)
    course = advanced(ball, cases(ball, e=1.0, mean=1.0, gap=1.0), 100.0, 1, events=10)
    assert np.isnan(course.X).all()
    assert "after 10 contact events" in course.failure
