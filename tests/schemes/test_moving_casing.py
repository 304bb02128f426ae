"""A casing that moves and loads with harmonics: a pressed tip, closed forms, the same said in other words."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from plain_steps import place
from scenes import cases, chain, heavy_chain, relative, sampling, static_equilibrium, step, with_dashpot
from workflow.models import Cases, Rayleigh, Structure
from workflow.schemes import Recorder, Results, Sampling, Status

CHAIN = chain(nodes=3, mass=0.01, stiffness=1e5, damping=Rayleigh(10.0, 0.0))
COUPLED = with_dashpot(CHAIN, 0, 1, 5.0)
ELSEWHERE = replace(COUPLED, load=np.array([0.0, 1.0, 0.5]))


def pressed(structure: Structure = CHAIN) -> Cases:
    """A chain pressed on its casing at t = 0, in equilibrium with its constant load."""
    batch = cases(structure, gap=1e-5, mean=20.0, casing_harmonics=[[5e-6, 50.0, 0.3], [2e-6, 150.0, 1.0]])
    x, _ = static_equilibrium(
        structure, 20.0 * structure.load_direction, np.zeros(3), float(batch.casing_of_contacts(0.0)[0][0, 0])
    )
    v = np.zeros((1, 3))
    v[:, -1] = batch.casing_of_contacts(0.0)[1][:, 0]
    return replace(batch, displacement=x[None], velocity=v)


MIDPOINT, EULER = (("moreau", {"theta": theta}) for theta in (0.5, 1.0))


@pytest.mark.parametrize(
    ("structure", "scheme"),
    [
        (CHAIN, MIDPOINT),
        (COUPLED, MIDPOINT),
        (COUPLED, EULER),
        (CHAIN, ("event_driven", {})),
        *(pytest.param(*one, marks=pytest.mark.slow) for one in ((CHAIN, EULER), (ELSEWHERE, MIDPOINT))),
    ],
)
def test_a_pressed_tip_follows_the_casing_for_a_thousand_periods(structure: Structure, scheme: Any) -> None:
    """Rounding of the time: eps t ḋ, 2e-16 · 20 s · 3.5e-3 m/s."""
    batch, over, (method, options) = pressed(structure), sampling(20.0, 0.01, balances=structure is CHAIN), scheme
    results = step(structure, batch, 1e-4, over, method, **options)
    assert results.metrics["impacts"] == (method == "moreau")
    assert results.metrics["contact_time"] == pytest.approx(20.0, rel=1e-10)  # 2e5 additions of h
    assert results.metrics["max_penetration"] < 2e-17
    casing = np.concatenate([place(batch, t) for t in over.times])
    assert np.abs(results.histories["displacement"][0] - casing).max() < 2e-17
    if method == "event_driven":
        speed = np.concatenate([batch.casing_of_contacts(t)[1][:, 0] for t in over.times])
        assert np.abs(results.histories["velocity"][0] - speed).max() < 1e-11 * np.abs(speed).max()  # of its phase


def test_a_scheme_of_plain_states_ends_on_its_casing_within_a_step() -> None:
    """The casing comes inwards while the duration ends a third into a step: a pressed tip is on it, by rounding.

    Counted against the casing at the step's end it would be beyond it by two thirds of the casing's way in the step.
    """
    structure, batch = CHAIN, pressed()
    h, steps = 1e-4, 80
    over = sampling((steps - 2 / 3) * h, (steps - 2 / 3) * h)
    path = step(structure, batch, h, sampling(steps * h, h), theta=0.5)
    x, v = path.histories["displacement"][0], path.histories["velocity"][0]
    recorded = Recorder(structure, batch, over, h)
    for k in range(1, steps + 1):
        recorded.record(np.full((1, 3), x[k]), np.full((1, 3), v[k]), np.zeros((1, 3)), np.ones(1))
    results = recorded.results()
    inwards = float((batch.casing_of_contacts((steps - 1) * h)[0] - batch.casing_of_contacts(steps * h)[0])[0, 0])
    assert inwards > 1e-8
    assert results.histories["displacement"][0, -1] == pytest.approx(x[-2] + (x[-1] - x[-2]) / 3, rel=1e-12)
    assert results.metrics["max_penetration"][0] < 1e-9 * inwards


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
        batch.displacement[case] = np.linspace(0.2, 1.0, 5) * batch.casing_of_contacts(0.0)[0][0, 0] * turned
        batch.velocity[case, -1] = batch.casing_of_contacts(0.0)[1][0, 0] * turned
    results = run(structure, batch, sampling(0.05, 1e-3))
    assert (results.metrics["impacts"] == 0).all()
    assert (results.metrics["contact_time"] == 0.05).all()
