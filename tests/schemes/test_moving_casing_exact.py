"""The event-driven scheme on a casing in motion and under harmonics of the load, in other words."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from scenes import cases, chain, heavy_chain, relative, sampling, step
from workflow.models import Cases, Rayleigh, Structure
from workflow.schemes import Results, Sampling, Status

TURN = 2 * np.pi


def run(structure: Structure, batch: Cases, over: Sampling) -> Results:
    results = step(structure, batch, 0.0, over, "event_driven")
    assert (results.status == Status.OK).all()
    return results


@pytest.mark.parametrize("e", [0.0, 0.5, 0.9, 1.0])
@pytest.mark.parametrize("alpha", [0.0, 2.0])
def test_a_lump_on_a_moving_casing_is_one_under_a_load(e: float, alpha: float) -> None:
    """Its gap obeys the same equation where - m d'' - c d' - k d is a load; impacts that accumulate included."""
    m, c, k, gap = 1.0, 0.3, 9.0, 0.1
    heat = {"spacing": 1.0, "expansion": 0.01, "heat_capacity": 2.0, "conductance": 0.7}
    structure = chain(nodes=1, mass=m, stiffness=k, damping=Rayleigh(c), **heat)
    places, loads = [[0.05, 0.23, 0.4], [0.02, 0.71, 5.0]], [[2.0, 0.1, 0.7], [1.0, 0.37, 1.0]]
    tip = -0.2 + sum(a * np.sin(phase) for a, _, phase in places)
    moving = sum(a * TURN * f * np.cos(phase) for a, f, phase in places)
    equal = []
    for a, f, phase in places:
        answer = -a * complex(k - m * (TURN * f) ** 2, c * TURN * f)
        equal.append([abs(answer), f, phase + np.angle(answer)])
    over, rub = sampling(20.0, 0.05), {"e": e, "alpha": alpha, "gap": gap, "mean": 3.0}
    on_casing = cases(
        structure, displacement=tip, velocity=moving, load_harmonics=loads, casing_harmonics=places, **rub
    )
    under_load = cases(structure, displacement=-0.2, load_harmonics=loads + equal, **rub)
    moved, loaded = run(structure, on_casing, over), run(structure, under_load, over)
    place = gap + sum(a * np.sin(TURN * f * over.times + phase) for a, f, phase in places)
    gaps = place - moved.histories["displacement"], gap - loaded.histories["displacement"]
    assert loaded.metrics["contact_time"][0] > 0.3 or e == 1.0
    assert loaded.metrics["impacts"][0] > 1
    assert relative(*gaps) <= 1e-9
    for name in ("impulse", "temperature") if alpha else ("impulse",):
        assert relative(moved.histories[name], loaded.histories[name]) <= 1e-9
    for name in ("contact_time", "max_temperature"):
        assert moved.metrics[name][0] == pytest.approx(loaded.metrics[name][0], rel=1e-9)
    if e in (0.0, 1.0):  # else how many are counted depends on where the rest is summed up
        assert moved.metrics["impacts"][0] == loaded.metrics["impacts"][0]


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (
            {"amplitude": 100.0, "frequency": 20.0, "phase": 0.2},
            {"load_harmonics": [[60.0, 20.0, 0.2], [0.0, 500.0, 0.0], [40.0, 20.0, 0.2]]},
        ),
        (
            {"amplitude": 100.0, "frequency": 20.0, "mean": 3.0},
            {"amplitude": 100.0, "frequency": 20.0, "mean": 1.0, "load_harmonics": [[2.0, 0.0, np.pi / 2]]}
            | {"gap": 8e-6, "casing_harmonics": [[4e-6, 0.0, np.pi / 6]]},
        ),
    ],
    ids=["parts of the load's sinusoid", "constants that stand still"],
)
def test_harmonics_say_in_other_words(one: dict[str, Any], other: dict[str, Any]) -> None:
    structure, rub, over = heavy_chain(nodes=5), {"e": 0.5, "alpha": 20.0, "gap": 1e-5}, sampling(0.1, 1e-3)
    first, second = (run(structure, cases(structure, **(rub | said)), over) for said in (one, other))
    for name in ("displacement", "temperature", "impulse"):
        assert relative(second.histories[name], first.histories[name]) <= 1e-10
    np.testing.assert_allclose(second.period_impulse, first.period_impulse, rtol=1e-10)


def test_a_casing_shakes_the_node_behind_its_tip_at_resonance() -> None:
    """y'' + 2 y = d + 3, y = d0/2 + 3 (1 - cos ωt)/2 + a (sin ωt - ωt cos ωt)/4 with ω² = 2; λ = F - d'' - d + y."""
    structure, over, d0, a, w = chain(nodes=2, mass=1.0, stiffness=1.0), sampling(30.0, 0.5), 1.0, 0.1, np.sqrt(2)
    start = {"displacement": [[d0 / 2, d0]], "velocity": [[0.0, a * w]]}
    batch = cases(structure, gap=d0, mean=20.0, steady=[[3.0, 0.0]], casing_harmonics=[[a, w / TURN, 0.0]], **start)
    results, t = run(structure, batch, over), over.times
    risen, swung = (1 - np.cos(w * t)) / w, t * np.sin(w * t) / w + (np.cos(w * t) - 1) / 2
    impulse = (20.0 - d0 / 2) * t + 1.5 * (t - np.sin(w * t) / w) + a * risen + a / 4 * (risen - w * swung)
    assert results.metrics["contact_time"][0] == 30.0
    np.testing.assert_allclose(results.histories["impulse"][0], impulse, rtol=1e-12)


def test_a_static_start_on_a_moving_casing_is_a_contact() -> None:
    """Place and velocity of the casing up to rounding are those of a tip that touches it."""
    structure = heavy_chain(nodes=5)
    places = [[4e-6, 40.0, 0.1], [1e-6, 300.0, 2.0]]
    batch = cases(structure, 3, e=0.9, gap=-1e-5, mean=10.0, casing_harmonics=places)
    for case, turned in enumerate((1.0, 1 + 2e-16, 1 - 2e-16)):
        batch.displacement[case] = np.linspace(0.2, 1.0, 5) * batch.casing_at(0.0)[0] * turned
        batch.velocity[case, -1] = batch.casing_velocity_at(0.0)[0] * turned
    results = run(structure, batch, sampling(0.05, 1e-3))
    assert (results.metrics["impacts"] == 0).all()
    assert (results.metrics["contact_time"] == 0.05).all()
