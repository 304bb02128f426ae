"""Branches of steady rubs: folds, period doublings and grazing where closed forms and publications put them."""

from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from test_steady_rubs import TURN, light_heat, oscillator, pressed, with_numbers

from scenes import blade, blade_rub, cases, chain, of_entries, relative
from workflow.models import Cases, Rayleigh, Structure, critical_alpha, growth_rate
from workflow.orbits import BIFURCATIONS, STATES, Options, branch, steady_rubs
from workflow.orbits._branch import follow
from workflow.orbits._curve import Problem
from workflow.reduction import reduce_structure


def along(name: str, structure: Structure, batch: Cases) -> Problem:
    """Return a problem along one number of a case."""
    return lambda value: (structure, with_numbers(batch, **{name: value}))


def followed(problem: Problem, start: float, stop: float, points: int) -> dict[str, Any]:
    values, message = branch(problem, start, stop, points, Options(samples=4))
    assert message == ""
    return values


def flagged(values: dict[str, Any], name: str) -> np.ndarray:
    return np.flatnonzero(values["bifurcation"] == BIFURCATIONS.index(name))


def states(values: dict[str, Any]) -> list[str]:
    return [STATES[state] for state in values["steady_state"]]


def test_the_intermittent_rub_of_the_blade_runs_away_in_a_fold() -> None:
    """It is stable up to α = 8.4308, three times α_c; beyond it is unstable, and transients run away above it."""
    structure = reduce_structure(blade(), 3, 12).structure
    values = followed(along("alpha", structure, blade_rub(structure)), 0.0, 40.0, 40)
    (fold,) = flagged(values, "fold")
    assert values["value"][0] == 0.0
    assert values["value"][fold] == pytest.approx(8.4308307735, abs=1e-8 * 40)
    assert values["value"][fold] > 3 * critical_alpha(structure)
    assert values["floquet_multiplier"][fold] == pytest.approx(1.0, abs=1e-8)
    assert np.nanmax(values["value"]) == values["value"][fold]
    assert set(states(values)[:fold]) == {"settles"}
    assert set(states(values)[fold + 1 :]) == {"unstable"}
    assert np.all(np.diff(values["steady_mean_temperature"]) > 0)
    beside, _ = steady_rubs(structure, blade_rub(structure, alpha=values["value"][fold] + 0.5), Options())
    assert states(beside) == ["runs_away"]
    i = 5
    same, _ = steady_rubs(structure, blade_rub(structure, alpha=values["value"][i]), Options(samples=4))
    for name in ("orbit_temperature", "orbit_displacement", "floquet_multiplier", "steady_impulse"):
        np.testing.assert_allclose(values[name][i], same[name][0], rtol=1e-9, atol=1e-14)


def test_the_oscillator_of_shaw_and_holmes_doubles_its_period() -> None:
    structure = oscillator()
    scene = cases(structure, e=0.8, amplitude=1.0, frequency=2 / TURN, phase=np.pi / 2, displacement=-0.5)
    values = followed(along("omega", structure, scene), 2.0, 3.0, 40)
    (doubling,) = flagged(values, "period_doubling")
    assert values["value"][[0, -1]].tolist() == [2.0, 3.0]
    assert values["value"][doubling] == pytest.approx(2.653347727855, abs=1e-9)
    assert values["floquet_angle"][doubling] == pytest.approx(np.pi)
    assert states(values)[:doubling] == doubling * ["settles"]
    assert states(values)[doubling + 1 :] == (39 - doubling) * ["unstable"]
    stable = values["floquet_multiplier"][:doubling]
    np.testing.assert_allclose(stable[values["floquet_angle"][:doubling] < 3.0], 0.8, rtol=1e-9)


def test_the_oscillator_of_recipes_for_continuation_grazes() -> None:
    """At an amplitude of 0.1 its resonance reaches the stop; the impacting motion begins there, before a fold.

    At resonance x is 10 A sin(t + φ) and a free vibration h, h(0) = h(2π), h'(0) - h'(2π) = -(1 + e) v, linear in v; so
    100 A² = (1 - h(0))² + (e v + h'(0))², which is least at the fold.
    """
    structure = oscillator(0.1)
    scene = cases(structure, e=0.8, gap=1.0, amplitude=1.0, frequency=1 / TURN, phase=np.pi / 2)
    values = followed(along("amplitude", structure, scene), 1.0, 0.05, 12)
    (grazing,) = flagged(values, "grazing")
    assert values["value"][grazing] == pytest.approx(0.1, abs=1e-12)
    assert values["value"][-1] == pytest.approx(0.05)
    assert states(values)[grazing:] == (12 - grazing) * ["no_contact"]
    pole = complex(-0.05, np.sqrt(1 - 0.05**2))  # h = Re(z exp(pole t)), per v
    after = np.exp(TURN * pole)
    rows = [[(1 - after).real, -(1 - after).imag], [(pole * (1 - after)).real, -(pole * (1 - after)).imag]]
    z = complex(*np.linalg.solve(rows, [0.0, -1.8]))
    place, speed = z.real, 0.8 + (pole * z).real
    (fold,) = flagged(values, "fold")
    assert values["value"][fold] == pytest.approx(0.1 * abs(speed) / np.hypot(place, speed), abs=1e-9)
    assert values["steady_impulse"][fold] == pytest.approx(1.8 * place / (place**2 + speed**2), rel=1e-4)


def test_an_impact_in_the_middle_of_two_periods_is_no_doubling() -> None:
    """The halves' velocities are exchanged there, at 367 Hz; a rub has a multiplier -1 where its period doubles."""
    omega = 2 * np.pi * 420
    structure = chain(nodes=1, mass=1 / 81, stiffness=omega**2 / 81, damping=Rayleigh(0.04 * omega, 0.0))
    scene = cases(structure, e=0.3, gap=101e-6, amplitude=3.0, frequency=400.0)
    values = followed(along("frequency", structure, scene), 360.0, 500.0, 40)
    np.testing.assert_allclose(values["floquet_multiplier"][flagged(values, "period_doubling")], 1.0, rtol=1e-8)
    assert np.all(values["value"][flagged(values, "period_doubling")] > 390)
    assert set(states(values)[: flagged(values, "grazing")[0]]) == {"settles"}
    assert values["value"][-1] == 500.0


def test_every_rub_of_a_branch_is_a_motion_that_repeats() -> None:
    """At 89 Hz the rub of one impact in two periods grazes: beyond it would pass through its casing before that."""
    frequency = 2 * np.pi * np.array([420.0, 1310.0])
    modes = {"mass": np.eye(2), "stiffness": np.diag(frequency**2), "contact": [9.0, 9.5]}
    structure = of_entries(modes | {"damping": np.diag(0.02 * frequency)})

    def problem(speed: float) -> tuple[Structure, Cases]:
        casing = [[92e-6, 4 * speed, 0.0], [12e-6, 8 * speed, 0.0]]
        return structure, cases(structure, e=0.3, gap=90e-6, casing_harmonics=casing)

    trace = follow(problem, 5000 / 60, 7500 / 60, Options(samples=4)).trace
    motions = [place.point.orbit.motion for place in trace]
    assert [place.point.q for place in trace if BIFURCATIONS[place.flag] == "grazing"]
    assert max(relative(motion.X, motion.start) for motion in motions) < 1e-6  # a grazing halves the digits


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2, 3, 5, 7, 8, 12, 16])
def test_rubs_of_random_branches_repeat_and_marks_have_their_multiplier(seed: int) -> None:
    """Over the frequency of the load of one to three modes; low bounces that accumulate are no doubling."""
    rng = np.random.default_rng(seed)
    n = rng.integers(1, 4)
    omega, w = TURN * np.sort(rng.uniform(80, 1500, n)), rng.uniform(3, 10, n) * rng.choice([-1, 1], n)
    modes = {"mass": np.eye(n), "stiffness": np.diag(omega**2), "contact": w.tolist()}
    structure = of_entries(modes | {"damping": np.diag(rng.uniform(0.006, 0.06, n) * omega)})
    way = float(np.sum(w**2 / omega**2))
    scene = cases(
        structure, e=rng.uniform(0.05, 0.9), gap=way * rng.uniform(0, 6), amplitude=rng.uniform(1, 4), phase=0.3
    )
    trace = follow(along("omega", structure, scene), 0.6 * omega[0], 1.4 * omega[0], Options(samples=4)).trace
    for point, flag in trace:
        motion, multipliers = point.orbit.motion, point.orbit.multipliers
        assert relative(motion.X, motion.start) < 1e-4  # the last of many bounces have few digits
        name = BIFURCATIONS[flag]
        if name in ("fold", "period_doubling", "branch_point"):
            assert np.abs(multipliers - (-1 if name == "period_doubling" else 1)).min() < 1e-4


def test_behind_a_grazing_a_branch_turns_back_to_a_rub_far_from_it() -> None:
    """The free motion grazes at 4/50 + 10 |H|; the impacting one goes back to its fold and is stable behind it."""
    structure = chain(nodes=1, mass=2.0, stiffness=50.0, damping=Rayleigh(0.12, 0.002))
    omega = 5.6
    scene = cases(structure, e=0.6, gap=4.0, mean=4.0, amplitude=10.0, frequency=omega / TURN, phase=0.4)
    values = followed(along("gaps", structure, scene), 4.0, 0.5, 40)
    (grazing,), (fold,) = flagged(values, "grazing"), flagged(values, "fold")
    free = 4 / 50 + 10 / abs(50 - 2 * omega**2 + 0.34j * omega)
    assert values["value"][grazing] == pytest.approx(free, abs=1e-10)
    assert values["value"][fold] == pytest.approx(3.525615812709, abs=1e-10)
    assert states(values)[: grazing + 1] == (grazing + 1) * ["no_contact"]
    assert set(states(values)[grazing + 1 : fold]) == {"unstable"}
    assert set(states(values)[fold + 1 :]) == {"settles"}
    assert values["value"][-1] == 0.5


def test_an_elastic_casing_is_met_without_a_mark() -> None:
    """The free motion, whose largest x is |H| = 2.4, turns into the rub, and the rub into one of smaller gaps."""
    structure = oscillator(0.04, 0.05)
    scene = cases(structure, gap=4.0, amplitude=1.0, frequency=1.19 / TURN)
    values = followed(along("gaps", structure, scene), 4.0, 0.5, 20)
    assert values["value"][-1] == pytest.approx(0.5)
    assert not flagged(values, "grazing").size
    assert values["value"][values["steady_contact"] > 0].max() > 2.0
    assert np.isin(states(values), ["no_contact", "settles", "unstable"]).all()


def test_where_a_branch_on_an_elastic_casing_is_lost_nothing_is_marked() -> None:
    """The load jumps, and the rub with it: that is no grazing, which such a rub passes."""
    structure = oscillator(0.2, 0.05)

    def problem(gap: float) -> tuple[Structure, Cases]:
        amplitude = 1.0 if gap > 0.75 else 0.7
        return structure, cases(structure, gap=gap, amplitude=amplitude, frequency=1.19 / TURN)

    values = followed(problem, 1.0, 0.5, 5)
    assert values["value"][[0, -1]] == pytest.approx([1.0, 0.75])
    assert not values["bifurcation"].any()


def test_a_branch_is_followed_back_from_the_end_of_its_range() -> None:
    """At its start the rub of one period is unstable, and no transient comes to it; places by a solver of 40 digits."""
    structure = oscillator(0.04, 0.05)
    start = {"displacement": -0.6218697579918219, "velocity": 0.8883123193561026}
    scene = cases(structure, gap=0.5, mean=0.1, amplitude=1.0, frequency=0.1, phase=0.25, **start)
    values, _ = branch(along("omega", structure, scene), 0.95, 1.1, 12, Options(periods=1, samples=4))
    (doubling,) = flagged(values, "period_doubling")
    assert values["value"][[0, doubling, -1]] == pytest.approx([0.95, 1.003217668948, 1.1], abs=1e-9)


def test_a_stiff_casing_is_passed_to_the_motion_without_contact() -> None:
    """Its branch turns where the free motion, whose largest x is |H|, grazes, but for the square of the flexibility."""
    structure = oscillator(0.2, 1e-3)
    free = 1 / abs(1 - 1.2**2 + 0.2j * 1.2)
    scene = cases(structure, gap=4.0, amplitude=1.0, frequency=1.2 / TURN)
    values = followed(along("gaps", structure, scene), 0.3 * free, 3 * free, 30)
    first, last = flagged(values, "fold")
    assert np.count_nonzero(values["bifurcation"]) == 2
    assert values["value"][last] == pytest.approx(free, abs=1e-6)
    assert values["value"][-1] == pytest.approx(3 * free)
    assert states(values)[:first] == first * ["settles"]
    assert states(values)[first : last + 1] == (last + 1 - first) * ["unstable"]
    assert set(states(values)[last + 1 :]) == {"no_contact"}


def test_a_branch_does_not_go_over_to_another_one_at_the_same_place() -> None:
    """A blade on a contact without mass: rubs of two branches have nearly the same displacements at one phase."""
    structure = reduce_structure(blade(damping=Rayleigh(10.0, 2e-6)), 3, 12, "macneal").structure
    scene = cases(structure, amplitude=4.0, frequency=3700.0, gap=2e-5)
    values = followed(along("gaps", structure, scene), 1e-5, 8e-5, 12)
    first, last = values["value"][flagged(values, "fold")]
    assert first == pytest.approx(3.09481e-5, rel=1e-5)
    assert last < 1.82e-5
    assert states(values)[-1] == "no_contact"


def test_a_branch_goes_along_bases_whose_modes_have_other_signs() -> None:
    """Modes of a blade whose length varies, none of which is the displacement of the contact."""
    structures = dict[float, Structure]()

    def problem(length: float) -> tuple[Structure, Cases]:
        if length not in structures:
            whole = blade(nodes=8, damping=Rayleigh(10.0, 2e-6), length=length)
            structures[length] = reduce_structure(whole, 5, 2, "macneal").structure
        return structures[length], cases(structures[length], amplitude=4.0, frequency=3700.0, gap=2e-5)

    values = followed(problem, 0.04, 0.042, 6)
    signs = {tuple(np.sign(one.contacts.normal[0] @ one.mass).tolist()) for one in structures.values()}
    assert len(signs) > 1
    assert values["value"][[0, -1]].tolist() == [0.04, 0.042]
    assert np.isfinite(values["value"]).all()


def test_equilibria_of_permanent_contact_under_a_constant_load() -> None:
    """λ = (F - k d/n)/(1 - α/α_c) along F."""
    structure = pressed()
    scene = cases(structure, alpha=0.5 * critical_alpha(structure), gap=1e-3)
    values = followed(along("mean", structure, scene), 2.0, 5.0, 8)
    np.testing.assert_allclose(values["value"], np.linspace(2, 5, 8), rtol=1e-3)
    np.testing.assert_allclose(values["steady_impulse"], 2 * (values["value"] - 1.0), rtol=1e-8)
    assert set(states(values)) == {"permanent_contact"}
    assert np.isnan(values["floquet_multiplier"]).all()


def test_permanent_contact_flutters_where_its_growth_rate_passes_zero() -> None:
    """Below α_c, by a pair of poles: a torus under a load that is periodic."""
    structure = light_heat()
    scene, limit = cases(structure, gap=1e-3, mean=20.0, amplitude=1.0, frequency=0.7), critical_alpha(structure)
    flutter = brentq(lambda alpha: growth_rate(structure, alpha), 0.3 * limit, 0.5 * limit, xtol=1e-12)
    values = followed(along("alpha", structure, scene), 0.3 * limit, 0.6 * limit, 10)
    (torus,) = flagged(values, "torus")
    assert values["value"][torus] == pytest.approx(flutter, abs=1e-8 * 0.3 * limit)
    assert states(values)[:torus] == torus * ["permanent_contact"]
    assert states(values)[torus + 1 :] == (9 - torus) * ["unstable"]


def test_without_a_periodic_rub_it_says_so() -> None:
    structure = oscillator(0.1)
    scene = cases(structure, gap=1.0, amplitude=1.0, frequency=1.0, load_harmonics=[[1.0, np.sqrt(2), 0.0]])
    values, message = branch(along("gaps", structure, scene), 1.0, 2.0, 5, Options())
    assert message == "steady: no periodic rub was found at 1, at 2 or between"
    assert np.isnan(values["value"]).all()
    assert states(values) == 5 * ["not_found"]
    assert not values["bifurcation"].any()
