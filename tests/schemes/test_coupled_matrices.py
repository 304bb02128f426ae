"""Structures that modes do not separate in fixed steps: coupling damping, a load elsewhere, a casing that moves.

Every scheme is compared with its own plain matrices, step by step.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import plain_carpenter
import plain_casing
import plain_events
import plain_moreau
import plain_penalty
import pytest
from plain_moreau import Trajectory

from scenes import alone, cases, chain, heavy_chain, relative, same_bits, sampling, step, taken
from sliding import random_structure
from workflow.models import Cases, Harmonics, Matrices, Rayleigh, static_equilibrium
from workflow.reduction import reduce_structure
from workflow.schemes import Status, moreau, penalty

SLOW = pytest.mark.slow

STEPS, H = 1000, 5e-6


def dashpot(nodes: int, first: int, second: int, factor: float) -> np.ndarray:
    """C1 of a dashpot between two nodes, which couples all modes."""
    matrix = np.zeros((nodes, nodes))
    matrix[np.ix_([first, second], [first, second])] = factor * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return matrix


def coupled(nodes: int = 6) -> Matrices:
    """Rayleigh's damping and a dashpot, under a load on the middle and, a little, on the tip."""
    load = np.zeros(nodes)
    load[[1, 3, -1]] = 0.5, 1.0, 0.2
    return replace(heavy_chain(nodes=nodes).matrices(), damper=dashpot(nodes, 1, 3, 20.0), load=load)


def rub(structure: Matrices, **more: Any) -> Cases:
    """Three cases of all that acts, on a casing in motion."""
    values: dict[str, Any] = {
        "e": [0.0, 0.5, 0.9],
        "alpha": [5.0, 0.0, 8.0],
        "gap": 5e-5,
        "mean": 30.0,
        "amplitude": 900.0,
        "frequency": 300.0,
        "phase": 0.3,
        "steady": 2.0,
        "heating": 0.3,
        "temperature": 1.0,
        "velocity": 0.1,
        "casing_harmonics": [[4e-6, 330.0, 0.4], [1.5e-6, 90.0, 2.0]],
        "load_harmonics": [[30.0, 410.0, 1.0], [12.0, 37.0, 0.2]],
    }
    return cases(structure, 3, **{**values, **more})


Plain = Callable[[Matrices, Cases], Trajectory]

STIFF = {"stiffness": 1e8, "damping": 50.0}

FIXED: dict[str, tuple[str, dict[str, Any], Plain, float]] = {
    "midpoint": ("moreau", {"theta": 0.5}, lambda s, c: plain_moreau.march(s, c, H, 0.5, STEPS), 1e-13),
    "implicit_euler": ("moreau", {"theta": 1.0}, lambda s, c: plain_moreau.march(s, c, H, 1.0, STEPS), 0.5),
    "carpenter": ("carpenter", {}, lambda s, c: plain_carpenter.march(s, c, H, STEPS, implicit=True), 1e-13),
    "lagged": (
        "carpenter",
        {"damping": "lagged", "heat": "explicit"},
        lambda s, c: plain_carpenter.march(s, c, H, STEPS, lagged=True),
        1e-13,
    ),
    "spring": ("penalty", STIFF, lambda s, c: plain_penalty.explicit(s, c, H, STEPS, *STIFF.values()), 0.05),
    "implicit_spring": (
        "penalty",
        {**STIFF, "integration": "implicit", "theta": 1.0},
        lambda s, c: plain_penalty.implicit(s, c, H, STEPS, *STIFF.values(), 1.0),
        0.5,
    ),
    "middle_spring": (
        "penalty",
        {**STIFF, "integration": "implicit", "theta": 0.5},
        lambda s, c: plain_penalty.implicit(s, c, H, STEPS, *STIFF.values(), 0.5),
        0.05,
    ),
}
"""Method, options, its plain matrices, and what its balance of energy leaves at most: rounding where it conserves."""

EVERY = [name if name == "midpoint" else pytest.param(name, marks=SLOW) for name in FIXED]
"""Each contact law compiles kernels of its own."""


@pytest.mark.parametrize("name", EVERY)
@pytest.mark.parametrize("moves", [True, pytest.param(False, marks=SLOW)])
def test_steps_are_those_of_plain_matrices(name: str, moves: bool) -> None:
    method, options, plain, created = FIXED[name]
    structure = coupled()
    batch = rub(structure) if moves else rub(structure, casing_harmonics=[])
    results = step(structure, batch, H, replace(sampling(STEPS * H, H), balances=True), method, **options)
    assert np.all(results.status == Status.OK)
    assert results.metrics["impacts"].min() > 1
    for case in range(3):
        expected = plain(structure, alone(batch, case))
        for quantity in ("displacement", "velocity", "temperature"):
            assert relative(results.histories[quantity][case], getattr(expected, quantity)[:, -1]) < 1e-12
    assert np.abs(results.metrics["energy_residual"]).max() < created
    assert np.abs(results.metrics["heat_residual"]).max() < 1e-12


@pytest.mark.parametrize("name", EVERY)
def test_random_structures_are_stepped_as_by_plain_matrices(name: str) -> None:
    """No symmetry between degrees of freedom, a casing that moves and slides, a load and a damping of any direction.

    Plain central differences step places, whose rounding each step carries on as a velocity: N² ε / 2 = 1e-10 of them.
    """
    (method, options, plain, _), struck = FIXED[name], 0
    rounding = 1e-9 if name in ("carpenter", "lagged", "spring") else 1e-11
    for seed in range(8):
        rng = np.random.default_rng(seed)
        structure = random_structure(rng, int(rng.integers(2, 6)))
        root = rng.normal(size=structure.mass.shape)
        structure = replace(structure, damper=root @ root.T, load=rng.normal(size=len(root)))
        sway = [[3e-5, 900.0, rng.uniform(0, 6)], [3e-5, rng.uniform(50, 200), 1.0]]
        slides = {"friction": [0.0, 0.1, 0.2], "alpha": 0.2, "casing_harmonics": sway}
        batch = rub(structure, gap=1e-4, velocity=0.3, mean=20.0, amplitude=20.0, **slides)
        results = step(structure, batch, H, sampling(STEPS * H, H), method, **options)
        for case in range(3):
            expected = plain(structure, alone(batch, case))
            assert relative(results.histories["displacement"][case], expected.displacement[:, -1]) < rounding, seed
        struck += int(results.metrics["impacts"].min() > 0)
    assert struck > 3


@pytest.mark.parametrize("theta", [0.5, pytest.param(1.0, marks=SLOW)])
@pytest.mark.parametrize("basis", [pytest.param("massless", marks=SLOW), pytest.param("macneal", marks=SLOW)])
def test_a_tip_without_mass_is_the_plain_scheme(basis: str, theta: float) -> None:
    """θ = ½ keeps each rounding of the tip's own block, which alternates: ε, 1000 steps, its poles' condition 30."""
    whole = coupled()
    reduction = reduce_structure(whole, 3, 4, basis)
    structure, batch = reduction.structure, reduction.project(rub(whole))
    results = step(structure, batch, H, replace(sampling(STEPS * H, H), balances=True), theta=theta)
    assert results.metrics["impacts"].min() > 1
    rounding = 1e-11 if theta == 0.5 else 1e-12
    for case in range(3):
        expected = plain_moreau.march_by_place(structure, alone(batch, case), H, theta, STEPS)
        assert relative(results.histories["displacement"][case], expected.displacement[:, -1]) < rounding
    assert theta == 1.0 or np.abs(results.metrics["energy_residual"]).max() < rounding


def pressed(load: np.ndarray | None) -> tuple[Matrices, Cases]:
    """A chain with a dashpot inside, pressed on its casing at t = 0 in equilibrium with its load."""
    structure = chain(nodes=3, mass=0.01, stiffness=1e5, damping=Rayleigh(10.0, 0.0)).matrices()
    structure = replace(structure, damper=dashpot(3, 0, 1, 5.0), load=load)
    batch = cases(structure, gap=1e-5, mean=20.0, casing_harmonics=[[5e-6, 50.0, 0.3], [2e-6, 150.0, 1.0]])
    place = float(batch.casing_at(0.0)[0])
    x, _ = static_equilibrium(structure, 20.0 * structure.load_direction, np.zeros(3), place)
    v = np.zeros((1, 3))
    v[:, -1] = batch.casing_velocity_at(0.0)
    return structure, replace(batch, displacement=x[None], velocity=v)


@pytest.mark.parametrize(
    ("theta", "load"),
    [(0.5, None), (1.0, None), pytest.param(0.5, np.array([0.0, 1.0, 0.5]), marks=SLOW)],
)
def test_a_pressed_tip_follows_the_casing_for_a_thousand_periods(theta: float, load: np.ndarray | None) -> None:
    """Rounding of the time: eps t ḋ, 2e-16 · 20 s · 3.5e-3 m/s."""
    structure, batch = pressed(load)
    over = sampling(20.0, 0.01)
    results = step(structure, batch, 1e-4, over, theta=theta)
    assert results.metrics["impacts"] == 1
    assert results.metrics["contact_time"] == pytest.approx(20.0, rel=1e-10)
    place = np.array([plain_casing.place(batch, t) for t in over.times])
    assert np.abs(results.histories["displacement"][0] - place).max() < 2e-17


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_newton_s_law_holds_for_the_relative_velocity(theta: float) -> None:
    """u⁺ = -e u⁻ with u = v - V, wherever contact acts after a step without."""
    structure, h = coupled(), H
    batch = alone(rub(structure), 1)
    results = step(structure, batch, h, sampling(STEPS * h, h), theta=theta)
    speed = np.array([plain_casing.velocity(batch, k * h, h, theta) for k in range(STEPS + 1)])
    u, p = results.histories["velocity"][0] - speed, np.diff(results.histories["impulse"][0])
    strikes = np.flatnonzero(p > 0)
    assert strikes.size > 3
    np.testing.assert_allclose(u[strikes + 1], -0.5 * u[strikes], rtol=0, atol=1e-14 * np.abs(speed).max())


def test_a_case_is_alone_as_in_a_batch() -> None:
    structure = coupled()
    batch = rub(structure).take(np.arange(21) % 3)
    batch = replace(batch, gap=np.linspace(4e-5, 6e-5, 21), frequency=np.linspace(200.0, 400.0, 21))
    over = replace(sampling(2e-3, 1e-4), balances=True)
    results = step(structure, batch, 1e-5, over, theta=0.5)
    for case in (0, 7, 20):
        single = step(structure, alone(batch, case), 1e-5, over, theta=0.5)
        shown = taken(results, slice(case, case + 1))
        width = single.period_impulse.shape[1]
        shown = replace(shown, **{f"period_{name}": getattr(shown, f"period_{name}")[:, :width] for name in PERIODS})
        assert same_bits(single, shown)


PERIODS = ("impulse", "temperature", "contact")


def test_a_casing_of_no_amplitude_is_one_at_rest() -> None:
    """Up to rounding: what is stepped is relative to the casing."""
    structure, over = coupled(), sampling(2e-3, 1e-4)
    still = rub(structure, casing_harmonics=[])
    moved = replace(still, casing_harmonics=Harmonics(*np.zeros((3, 3, 1))))
    one, other = (step(structure, batch, 1e-5, over) for batch in (still, moved))
    assert relative(one.histories["displacement"], other.histories["displacement"]) < 1e-12


def test_a_free_root_is_stable() -> None:
    """Its double eigenvalue 1 errs by the root of rounding, which is no growth."""
    structure = heavy_chain(nodes=6, stiffness=(0.0, *[2e7] * 5)).matrices()
    structure = replace(structure, damper=dashpot(6, 1, 3, 20.0))
    results = step(structure, cases(structure, gap=1e-4, mean=1.0, e=0.5), 1e-5, sampling(0.01, 1e-4))
    assert results.status[0] == Status.OK


@SLOW
def test_steps_that_are_too_long_are_said_to_grow() -> None:
    structure = coupled()
    for method, options in (("carpenter", {}), ("penalty", STIFF), ("moreau", {"theta": 0.3})):
        results = step(structure, rub(structure), 1e-4, sampling(2e-3, 1e-4), method, **options)
        assert np.all(results.status == Status.DIVERGED)
        assert "grows" in results.messages[0]


def test_what_a_contact_spring_asks_of_a_structure_needs_no_modal_damping() -> None:
    """Its default stiffness and the steps up to which it holds: of M and K1 alone."""
    structure = coupled()
    plain = replace(structure, damper=None, load=None)
    for function in (penalty.contact_stiffness_of, penalty.contact_limit):
        assert function(structure, penalty.Options()) == function(plain, penalty.Options())


def test_a_plan_says_what_a_structure_is_stepped_by() -> None:
    assert "6 + 6 modes with the tip's own, coupled by damping" in moreau.operator_name(coupled())
    assert moreau.operator_name(heavy_chain(nodes=6)) == "6 + 6 modes with the tip's own"


@pytest.mark.parametrize(
    ("e", "alpha"), [(0.0, 5.0), pytest.param(0.5, 0.0, marks=SLOW), pytest.param(0.8, 5.0, marks=SLOW)]
)
def test_the_exact_solution_of_a_load_elsewhere_on_a_moving_casing_is_that_of_dop853(e: float, alpha: float) -> None:
    structure = replace(heavy_chain(nodes=3).matrices(), load=np.array([0.5, 1.0, 0.2]))
    batch = alone(rub(structure, e=e, alpha=alpha, amplitude=300.0, gap=2e-5), 0)
    over = sampling(3e-3, 5e-5)
    results = step(structure, batch, 0.0, over, "event_driven")
    expected = plain_events.Reference(structure, batch).solve(over.times)
    reached = over.times < expected.reached - 1e-9
    assert expected.impacts > 1
    for name in ("displacement", "impulse", "temperature"):
        theirs = getattr(expected, name)[reached]
        assert np.abs(results.histories[name][0][reached] - theirs).max() <= 1e-9 * np.abs(theirs).max()
