"""Boundaries over two parameters against closed forms and an independent solver in 40 digits."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from test_steady_rubs import TURN, light_heat, oscillator, with_numbers

from scenes import cases, chain, of_entries
from workflow.models import Cases, Rayleigh, Structure, critical_alpha, growth_rate
from workflow.orbits import (
    BIFURCATIONS,
    ENDS,
    Boundaries,
    Number,
    Options,
    _boundary,
    bifurcation_shifts,
    boundaries,
    follow,
    tabulate,
)

Pair = Callable[[float, float], tuple[Structure, Cases]]


def of_two(structure: Structure, scene: Cases, first: str, other: str) -> Pair:
    return lambda a, b: (structure, with_numbers(scene, **{first: a, other: b}))


def found(problem: Pair, start: float, stop: float, low: float, high: float, count: int = 9) -> Boundaries:
    ends = (low, high)
    branches = [follow(lambda a, b=b: problem(a, b), start, stop, Options(periods=1, samples=2)) for b in ends]  # type: ignore[misc]
    curves, message = boundaries(problem, *branches, low, high, count)
    assert message == ""
    return curves


def curve(curves: Boundaries, kind: str) -> tuple[np.ndarray, np.ndarray, np.ndarray, str]:
    """The one curve of a kind: both numbers, the largest other multiplier, and how it ends."""
    (k,) = np.flatnonzero(curves.kind == BIFURCATIONS.index(kind))
    return curves.branched[k], curves.other_parameter[k], curves.other[k], ENDS[curves.end[k]]


def heated(frequency: float, **values: float) -> tuple[Structure, Cases]:
    """A mass that contact heats, with a load of 10 N."""
    lumps = {"spacing": 0.1, "expansion": 2.4e-5, "heat_capacity": 0.2, "conductance": 1.1, "convection": 0.4}
    structure = chain(nodes=1, mass=0.01, stiffness=4e4, damping=Rayleigh(40.0, 0.0), **lumps)
    return structure, cases(structure, e=0.4, amplitude=10.0, frequency=frequency, heating=2.0, **values)


def test_folds_doublings_and_grazings_of_one_mass_meet_where_the_fold_begins() -> None:
    """One impact a period adds v G to the free motion: (|H|)² = (d - v G)² + (v S/ω)² has a double root at the fold."""
    damping = 0.01
    structure = oscillator(2 * damping)
    scene = cases(structure, e=0.5, gap=1.0, amplitude=1.0, frequency=1.0)

    def grazing(omega: float) -> float:
        return 1 / abs(1 - omega**2 + 2j * damping * omega)

    def fold(omega: float) -> float:
        pole = complex(-damping, np.sqrt(1 - damping**2))
        rest = 1 - np.exp(pole * TURN / omega)
        z = complex(*np.linalg.solve([[rest.real, -rest.imag], [(pole * rest).real, -(pole * rest).imag]], [0, -1.5]))
        place, speed = z.real, (0.5 + (pole * z).real) / omega
        return grazing(omega) * np.hypot(place, speed) / abs(speed)

    assert fold(1.6) == pytest.approx(1.340622087, abs=1e-9)
    curves = found(of_two(structure, scene, "gaps", "omega"), 0.2, 3.0, 1.6, 2.1)
    gap, omega, other, end = curve(curves, "fold")
    np.testing.assert_allclose(gap, [fold(each) for each in omega], rtol=0, atol=1e-10)
    assert (end, omega[0]) == ("grazing", 1.6)
    assert [omega[-1], gap[-1]] == pytest.approx([1.9998999975, 0.3333481], abs=1e-7)
    assert np.all(other[:-1] < 1)
    steps = np.hypot(np.diff(gap) / 2.8, np.diff(omega) / 0.5)
    assert np.ptp(steps) < 0.01 * steps.mean()
    gap, omega, _, end = curve(curves, "grazing")
    np.testing.assert_allclose(gap, [grazing(each) for each in omega], rtol=0, atol=1e-10)
    assert (end, omega[0], omega[-1]) == ("range", 1.6, pytest.approx(2.1))
    gap, omega, _, end = curve(curves, "period_doubling")
    assert (end, omega[-1], gap[-1]) == ("grazing", pytest.approx(1.9999, abs=1e-6), pytest.approx(0.33335, abs=1e-5))


def test_grazing_of_a_damped_oscillator_over_amplitude_and_frequency() -> None:
    """A² = (1 - ω²)² + 0.01 ω²."""
    structure = oscillator(0.1)
    scene = cases(structure, e=0.8, gap=1.0, amplitude=1.0, frequency=1.0, phase=np.pi / 2)
    curves = found(of_two(structure, scene, "amplitude", "omega"), 0.05, 1.0, 1.0, 1.3)
    amplitude, omega, _, end = curve(curves, "grazing")
    np.testing.assert_allclose(amplitude, np.sqrt((1 - omega**2) ** 2 + 0.01 * omega**2), rtol=0, atol=1e-10)
    assert end == "range"


def test_the_fold_of_a_heated_mass_passes_the_critical_coupling() -> None:
    structure, scene = heated(2500 / TURN, displacement=-0.0015, velocity=-0.36, temperature=225.0)
    assert critical_alpha(structure) == pytest.approx(31.25)
    curves = found(of_two(structure, scene, "gaps", "alpha"), 1.3e-3, 2.1e-3, 8.0, 33.0)
    gap, alpha, other, end = curve(curves, "fold")
    assert [alpha[0], gap[0]] == pytest.approx([8.0, 1.647611482479e-3], rel=1e-9)
    assert [alpha[-1], gap[-1]] == pytest.approx([33.0, 1.959765457980e-3], rel=1e-9)
    assert (end, other[0], other[-1]) == ("range", pytest.approx(0.9679304390), pytest.approx(0.9349692857))


def test_a_fold_by_heat_alone_begins_at_grazing() -> None:
    structure, scene = heated(4200 / TURN, displacement=-1.6e-4, velocity=-0.15, temperature=107.8)
    curves = found(of_two(structure, scene, "gaps", "alpha"), 7e-5, 1.6e-4, 20.0, 0.0)
    gap, alpha, _, end = curve(curves, "fold")
    assert [alpha[0], gap[0]] == pytest.approx([20.0, 1.441420391018e-4], rel=1e-9)
    assert [alpha[-1], gap[-1]] == pytest.approx([3.506377453501, 7.490822271906e-5], rel=1e-9)
    assert end == "grazing"
    gap, alpha, other, end = curve(curves, "period_doubling")
    assert [gap[0], gap[-1]] == pytest.approx([8.309611160536e-5, 7.295916921261e-5], rel=1e-9)
    assert [other[0], other[-1]] == pytest.approx([1.0425, 0.9888], abs=1e-4)  # it passes multipliers 1 and -1
    assert end == "range"
    assert curves.angle[curves.kind == BIFURCATIONS.index("period_doubling")] == pytest.approx(np.pi)
    assert np.isnan(curves.angle[curves.kind == BIFURCATIONS.index("grazing")]).all()


@pytest.mark.parametrize("kind", ["elastic", "massless", "both"])
def test_a_curve_that_comes_back_is_stored_once(kind: str) -> None:
    """A compliance of 0.05 m/N of the casing, of the contact without mass, or of both."""
    if kind == "elastic":
        structure = oscillator(0.04, 0.05)
    else:
        one = np.ones((1, 1))
        entries: dict[str, Any] = {"mass": one, "stiffness": one, "damping": 0.04 * one, "contact": one}
        entries |= {"load": np.ones(1), "residual_flexibility": (0.05 if kind == "massless" else 0.03) * one}
        structure = of_entries(entries).on_casing(0.0 if kind == "massless" else 0.02)
    start = {"displacement": -0.6218697579918219, "velocity": 0.8883123193561026}
    scene = cases(structure, mean=0.1, amplitude=1.0, frequency=0.1, phase=0.25, **start)
    curves = found(of_two(structure, scene, "omega", "gaps"), 1.1, 0.85, 0.5, 0.9, 15)
    omega, gap, other, end = curve(curves, "period_doubling")
    assert [omega[0], omega[-1]] == pytest.approx([1.003217668948, 0.904845650355], abs=1e-9)
    assert (gap[0], gap[-1], end) == (0.5, pytest.approx(0.5, abs=1e-12), "range")
    assert 0.86 < gap.max() < 0.877458117150
    assert [other[0], other[-1]] == pytest.approx([0.778394886308, 0.757480700427], abs=1e-8)


@pytest.mark.slow
def test_folds_of_an_elastic_casing_pass_their_cusp() -> None:
    structure = oscillator(0.04, 0.05)
    start = {"displacement": -2.4981210350381513, "velocity": 4.2020412256701025}
    scene = cases(structure, mean=0.1, amplitude=1.0, frequency=0.1, phase=0.25, **start)
    omega, gap, _, end = curve(found(of_two(structure, scene, "omega", "gaps"), 1.35, 1.65, 1.2, 0.6), "fold")
    assert [omega[0], omega[-1]] == pytest.approx([1.609368218015, 1.380690273047], abs=1e-9)
    assert (gap[0], gap[-1], end) == (1.2, pytest.approx(1.2, abs=1e-12), "range")
    assert gap.min() > 0.676439870267


@pytest.mark.slow
def test_a_torus_is_followed() -> None:
    """A pressed tip flutters at one coupling, whatever the gap."""
    structure = light_heat()
    scene, limit = cases(structure, gap=1e-3, mean=20.0, amplitude=1.0, frequency=0.7), critical_alpha(structure)
    flutter = brentq(lambda alpha: growth_rate(structure, alpha), 0.3 * limit, 0.5 * limit, xtol=1e-12)
    curves = found(of_two(structure, scene, "alpha", "gaps"), 0.3 * limit, 0.6 * limit, 1e-3, 2e-3, 5)
    alpha, gap, other, end = curve(curves, "torus")
    assert alpha == pytest.approx(flutter, rel=1e-9)
    assert (gap[0], gap[-1], end) == (1e-3, pytest.approx(2e-3), "range")
    assert np.all(other < 1)


@pytest.mark.slow
def test_a_torus_ends_where_its_multipliers_are_real() -> None:
    """A pressed tip flutters at one coupling and ω whatever the load: its angle is ω T over full turns, -1 at π."""
    structure = light_heat()
    scene, limit = cases(structure, gap=1e-3, mean=20.0, amplitude=1.0, frequency=0.7), critical_alpha(structure)
    curves = found(of_two(structure, scene, "alpha", "frequency"), 0.3 * limit, 0.6 * limit, 0.7, 0.75, 5)
    assert curves.kind[:3].tolist() == [BIFURCATIONS.index("torus"), BIFURCATIONS.index("torus"), 0]  # from both ends
    turn = 4 * TURN - curves.angle[0, 0]  # at 0.7 Hz
    assert curves.other_parameter[:2, -1] == pytest.approx(0.7 * turn / (7 * np.pi), abs=5e-7)
    assert [ENDS[end] for end in curves.end[:2]] == ["resonance", "resonance"]


def test_the_boundary_of_one_contact_ends_where_another_strikes_at_once() -> None:
    """The fold of the first of two uncoupled masses does not move; the second strikes earlier at larger gaps of it."""
    structure = of_entries(
        {"mass": np.eye(2), "contact": np.eye(2), "load": np.array([1.0, -1.0])}
        | {"stiffness": np.diag([1.0, 5.3]), "damping": 0.02 * np.eye(2)}
    )
    scene = cases(structure, e=0.5, gaps=[0.3, 0.06], amplitude=1.0, frequency=1.8 / TURN)

    def problem(first: float, second: float) -> tuple[Structure, Cases]:
        return structure, replace(scene, gaps=np.array([[first, second]]))

    curves = found(problem, 0.3, 0.9, 0.06, 0.085, 5)
    first, second, _, end = (each[0] for each in (curves.branched, curves.other_parameter, curves.other, curves.end))
    assert (BIFURCATIONS[curves.kind[0]], ENDS[end]) == ("fold", "corner")
    np.testing.assert_allclose(first, 0.599992325, rtol=0, atol=1e-9)
    one = chain(nodes=1, mass=1.0, stiffness=5.3, damping=Rayleigh(0.02, 0.0))
    alone = cases(one, e=0.5, gap=0.06, amplitude=-1.0, frequency=1.8 / TURN)
    followed = follow(lambda gap: (one, with_numbers(alone, gaps=gap)), 0.06, float(second[-1]), Options(periods=1))
    motion = followed.trace[-1].point.orbit.motion
    phases = (motion.begin + motion.times) * 1.8 / TURN % 1
    assert np.abs(phases - 0.63096998).min() < 1e-6  # of the first mass at its fold


def test_without_a_bifurcation_there_is_no_curve() -> None:
    structure = oscillator(0.1)
    scene = cases(structure, e=0.8, gap=1.0, amplitude=0.1, frequency=2.0)
    curves = found(of_two(structure, scene, "gaps", "frequency"), 1.0, 2.0, 2.0, 3.0)
    assert not curves.kind.any()
    assert not curves.end.any()
    assert np.isnan(curves.branched).all()


def test_what_is_not_followed_to_an_end_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    structure = chain(nodes=1, mass=1.0, stiffness=1.0, damping=Rayleigh(0.1, 0.0))
    scene = cases(structure, e=0.8, gap=1.0, amplitude=1.0, frequency=1.0)
    problem = of_two(structure, scene, "gaps", "frequency")
    branches = [follow(lambda a, b=b: problem(a, b), 0.2, 3.0, Options(1, 2)) for b in (0.25, 0.3)]  # type: ignore[misc]
    monkeypatch.setattr(_boundary, "_MOST_STEPS", 2)
    curves, message = boundaries(problem, *branches, 0.25, 0.3, 3)
    ends = [ENDS[end] for end in curves.end]
    said = [f"boundary {k + 1} is not followed: " for k, end in enumerate(ends) if end == "not_followed"]
    assert said
    assert all(each in message for each in said)
    assert "2 steps do not reach its end" in message


@pytest.mark.parametrize(
    ("frequency", "gap", "shifts"),
    [
        (2500, 0.001647611482478861, {"gaps": 0.0797663246, "e": -2.404591992697}),
        (4200, 8.214583381235637e-5, {"gaps": 0.3252737357}),
    ],
)
def test_a_fold_moves_with_numbers_of_the_scene(frequency: float, gap: float, shifts: dict[str, float]) -> None:
    start = {2500: (-0.0015032685925289858, -0.35712883162359016, 225.07), 4200: (-1.6e-4, -0.15, 107.8)}[frequency]
    named = dict(zip(("displacement", "velocity", "temperature"), start, strict=True))
    structure, scene = heated(frequency / TURN, gap=gap, **named)
    followed = follow(lambda alpha: (structure, with_numbers(scene, alpha=alpha)), 20.0, 0.0, Options(periods=1))
    values, _ = tabulate(followed, 12, Options(periods=1))
    given = {"gaps": (gap, 1e-6), "e": (0.4, 0.01)}
    numbers = [Number(of_two(structure, scene, "alpha", name), *given[name]) for name in shifts]
    found_shifts = bifurcation_shifts(followed, 12, numbers)
    (fold,) = np.flatnonzero(values["bifurcation"] == BIFURCATIONS.index("fold"))
    assert values["value"][fold] == pytest.approx(8.0, abs=1e-9)
    np.testing.assert_allclose(found_shifts[fold], list(shifts.values()), rtol=1e-8)
    assert np.isnan(found_shifts[values["bifurcation"] == 0]).all()


@pytest.mark.parametrize("start", [20.0, 25.0])
def test_a_doubling_close_to_the_end_of_a_range_is_marked(start: float) -> None:
    """The last step to 20 W/N passes it."""
    beside = {"gap": 8.214583381235637e-5, "displacement": -1.6e-4, "velocity": -0.15, "temperature": 107.8}
    structure, scene = heated(4200 / TURN, **beside)
    followed = follow(lambda alpha: (structure, with_numbers(scene, alpha=alpha)), start, 0.0, Options(periods=1))
    (doubling,) = (place.point for place in followed.trace if BIFURCATIONS[place.flag] == "period_doubling")
    assert followed.curve.value(doubling.q) == pytest.approx(18.12398228, abs=1e-8)
    said = [tabulate(followed, points, Options(periods=1, samples=2))[1] for points in (3, 4)]
    assert said == ["steady: 2 bifurcations leave few of the 3 points to the arms between them; ask for more", ""]


def two_contacts(omega: float) -> tuple[Structure, Cases]:
    """Two equal masses with a contact each, driven against each other."""
    start = {"displacement": [-0.24624493489465, -0.10312516560556738], "velocity": [0.8241482402055442, -0.83224753]}
    entries: dict[str, Any] = {"mass": np.eye(2), "contact": np.eye(2), "load": np.array([1.0, -1.0])}
    entries |= {"stiffness": np.array([[5.65, -1.45], [-1.45, 5.65]])}
    structure = of_entries(entries | {"damping": np.array([[0.18, -0.07], [-0.07, 0.18]])})
    load = {"amplitude": 1.0, "frequency": omega / TURN, "phase": 0.25}
    return structure, cases(structure, e=0.62, gaps=[0.3, 0.3], **load, **start)


def test_a_symmetric_rub_that_loses_its_symmetry_is_no_fold() -> None:
    """Two equal contacts half a period apart: a multiplier is 1, the branch does not turn, and is not followed."""
    structure, scene = two_contacts(2.8)
    followed = follow(lambda gap: (structure, with_numbers(scene, gaps=gap)), 0.3, 0.4, Options(periods=1))
    values, _ = tabulate(followed, 12, Options(periods=1, samples=2))
    (point,) = np.flatnonzero(values["bifurcation"])
    assert BIFURCATIONS[values["bifurcation"][point]] == "branch_point"
    assert values["value"][point] == pytest.approx(0.326101578849, abs=2e-9)
    assert values["floquet_multiplier"][point] == pytest.approx(1.0, abs=1e-7)


@pytest.mark.parametrize(
    ("omega", "gap", "kind", "multipliers"),
    [
        (2.985956697503248, 0.3, "branch_point", [1, 0.1273288339170674 + 0.5716668555436962j, 0.2019586652387377]),
        (3.199164686932802, 0.26, "branch_point", [1, 0.2798539454605508 + 0.5130394594880479j, 0.2133418061933887]),
        (
            2.996961696241059,
            0.2995498491454248,
            "fold",
            [1, 0.1386139823967455 + 0.5684144039731601j, 0.2029394311775934],
        ),
    ],
)
def test_multipliers_of_two_contacts(omega: float, gap: float, kind: str, multipliers: list[complex]) -> None:
    """Both gaps vary, or the second one beside a first of 0.3."""
    structure, scene = two_contacts(omega)

    def problem(second: float) -> tuple[Structure, Cases]:
        return structure, replace(scene, gaps=np.array([[0.3 if kind == "fold" else second, second]]))

    followed = follow(problem, 0.24, 0.33, Options(periods=1))
    flagged = [place.point for place in followed.trace if BIFURCATIONS[place.flag] == kind]
    found = {followed.curve.value(point.q): point.orbit for point in flagged}
    value = min(found, key=lambda each: abs(each - gap))
    assert value == pytest.approx(gap, abs=1e-9)
    first, second, conjugate, last = found[value].multipliers
    assert second == pytest.approx(np.conj(conjugate))
    assert [first, second, last] == pytest.approx(multipliers, abs=1e-8)


def test_folds_of_two_contacts_with_unequal_gaps() -> None:
    structure, scene = two_contacts(3.0)

    def problem(gap: float, omega: float) -> tuple[Structure, Cases]:
        return structure, replace(with_numbers(scene, omega=omega), gaps=np.array([[0.3, gap]]))

    curves = found(problem, 0.27, 0.33, 2.996961696241059, 3.072336825736888)
    kinds = curves.kind == BIFURCATIONS.index("fold")
    (k,) = np.flatnonzero(kinds & np.isclose(curves.branched[:, 0], 0.2995498491454248, rtol=0, atol=1e-10))
    assert curves.branched[k, -1] == pytest.approx(0.2913680185885769, abs=1e-10)
    assert curves.other_parameter[k, -1] == pytest.approx(3.072336825736888)
    assert curves.other[k, [0, -1]] == pytest.approx([0.585072, 0.579516], abs=1e-6)
