"""Damping that is not Rayleigh's: a ratio of every mode in every scheme, a matrix of its own by fixed steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import plain_moreau
import pytest
from plain_events import Reference
from test_event_driven_random import TIMES, scene

from given_matrices import given, turned
from scenes import cases, heavy_chain, relative, sampling, step
from workflow import schemes
from workflow.models import (
    Matrices,
    Rayleigh,
    Structure,
    critical_alpha,
    growth_rate,
    mechanical_modes,
    modal_damping,
    structure_from_matrices,
)
from workflow.reduction import reduce_structure
from workflow.schemes import Status, event_driven


def damped(ratio: float, nodes: int = 6) -> Structure:
    return heavy_chain(nodes=nodes, damping=Rayleigh(ratio=ratio))


def test_every_mode_has_the_ratio_and_rigid_ones_none() -> None:
    structure = heavy_chain(nodes=6, stiffness=(0.0, *[2e7] * 5), damping=Rayleigh(ratio=0.03))
    modes = mechanical_modes(structure)
    by_ratio = np.diag(2 * 0.03 * modes.values)
    modal = modes.shapes.T @ structure.damping_matrix @ modes.shapes
    assert np.abs(modal - by_ratio).max() <= 1e-12 * by_ratio.max()
    assert modal[0, 0] == pytest.approx(0.0, abs=1e-12 * by_ratio.max())
    reduced = reduce_structure(damped(0.03), 2, 2).structure
    modes = mechanical_modes(reduced)
    modal = modes.shapes.T @ reduced.damping_matrix @ modes.shapes
    assert np.abs(modal - np.diag(0.06 * modes.values)).max() <= 1e-12 * modal.max()


def held_growth(s: Structure, alpha: float) -> float:
    """Largest real part of the eigenvalues with the tip held, by the matrices of the equations."""
    n, heats = s.mechanical_size - 1, s.thermal_size
    inverse, capacity = np.linalg.inv(s.mass[:-1, :-1]), np.linalg.inv(s.heat_capacity)
    A = np.zeros((2 * n + heats, 2 * n + heats))
    x, v, t = slice(0, n), slice(n, 2 * n), slice(2 * n, None)
    A[x, v] = np.eye(n)
    for columns, matrix in ((x, s.stiffness_matrix), (v, s.damping_matrix)):
        A[v, columns] = -inverse @ matrix[:-1, :-1]
    A[v, t] = -inverse @ s.coupling_matrix[:-1]
    force = -s.mass[-1, :-1] @ A[v]
    force[x] -= s.stiffness_matrix[-1, :-1]
    force[v] -= s.damping_matrix[-1, :-1]
    force[t] -= s.coupling_matrix[-1]
    A[t, t] = -capacity @ s.conductance_matrix
    A[t] += alpha * np.outer(capacity[:, -1], force)
    return float(np.linalg.eigvals(A).real.max())


@pytest.mark.parametrize("alpha", [0.5, 3.0])
def test_the_growth_rate_has_the_damping_of_the_held_tip(alpha: float) -> None:
    for structure in (damped(0.2), reduce_structure(damped(0.2), 3, 4).structure):
        assert growth_rate(structure, alpha) == pytest.approx(held_growth(structure, alpha), rel=1e-9)
        assert (growth_rate(structure, alpha) > 0) == (alpha > critical_alpha(structure))


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    ("seed", "ratio"),
    [(38, 1.7), *(pytest.param(*one, marks=SLOW) for one in ((1, 0.05), (4, 0.3), (10, 1.7), (6, 1.0)))],
)
def test_a_ratio_is_exact_against_the_independent_solution(seed: int, ratio: float) -> None:
    """With the tip held its modes are coupled by damping, with and without friction heat."""
    structure, case = scene(np.random.default_rng(seed))
    structure = replace(structure, damping=Rayleigh(ratio=ratio))  # type: ignore[type-var]
    results = event_driven.compute(event_driven.init(structure, 0.0, event_driven.Options()), case, TIMES)
    reference = Reference(structure, case).solve(TIMES.times)
    reached = TIMES.times < reference.reached - 1e-9
    for name in ("displacement", "temperature", "impulse"):
        theirs = getattr(reference, name)[reached]
        assert np.linalg.norm(results.histories[name][0, reached] - theirs) <= 1e-8 * max(np.linalg.norm(theirs), 1e-3)


LOAD = {"alpha": 5.0, "gap": 5e-5, "amplitude": 400.0, "frequency": 200.0}


@pytest.mark.parametrize("scheme", ["moreau", "carpenter", "penalty"])
def test_a_ratio_in_schemes_with_a_step(scheme: str) -> None:
    """They come to the exact solution; the balances of the spring close."""
    structure = damped(0.05)
    over = replace(sampling(0.01, 1e-4), balances=True)
    if scheme == "penalty":
        exact = step(structure, cases(structure, **LOAD), 1e-7, over, "penalty", stiffness=1e10)
        finer = step(structure, cases(structure, **LOAD), 2e-7, over, "penalty", stiffness=1e10)
        assert abs(exact.metrics["energy_residual"][0]) < 1e-3
        assert abs(exact.metrics["heat_residual"][0]) < 1e-6
    else:
        exact = step(structure, cases(structure, **LOAD), 0.0, over, "event_driven")
        finer = step(structure, cases(structure, **LOAD), 1e-7, over, scheme)
    assert relative(finer.histories["displacement"][0], exact.histories["displacement"][0]) < 2e-3


def with_damper(nodes: int = 6) -> Matrices:
    """A dashpot between nodes 2 and 4 beside Rayleigh's damping: it couples all modes."""
    structure = heavy_chain(nodes=nodes).matrices()
    damper = np.zeros((nodes, nodes))
    damper[[1, 1, 3, 3], [1, 3, 1, 3]] = 20 * np.array([1.0, -1.0, -1.0, 1.0])
    return replace(structure, damper=damper)


@pytest.mark.parametrize("theta", [1.0, 0.5])
def test_a_damping_matrix_of_its_own_is_stepped_by_moreau(theta: float) -> None:
    """Against the plain θ-method, to rounding, beside other cases and alone."""
    structure = with_damper()
    batch = cases(structure, 3, e=np.array([0.0, 0.5, 0.9]), **LOAD)
    over = replace(sampling(0.005, 5e-5), balances=True)
    results = step(structure, batch, 1e-5, over, theta=theta)
    assert np.all(results.status == Status.OK)
    assert results.metrics["impacts"].min() > 0
    for case in range(3):
        plain = plain_moreau.march(structure, batch.take(np.array([case])), 1e-5, theta, 500)
        assert relative(results.histories["displacement"][case], plain.displacement[::5, -1]) < 1e-10
        assert relative(results.histories["temperature"][case], plain.temperature[::5, -1]) < 1e-10
        alone = step(structure, batch.take(np.array([case])), 1e-5, over, theta=theta)
        assert np.array_equal(alone.histories["displacement"][0], results.histories["displacement"][case])
    assert np.abs(results.metrics["energy_residual"]).max() < (1e-10 if theta == 0.5 else 0.5)


def test_what_a_mode_loses_by_itself_holds_its_part_of_a_damping_matrix() -> None:
    structure = with_damper()
    modes = mechanical_modes(structure)
    diagonal = np.diag(modes.shapes.T @ structure.damping_matrix @ modes.shapes)
    np.testing.assert_allclose(modal_damping(structure, modes), diagonal, rtol=1e-12)
    assert np.all(modal_damping(replace(structure, damper=None), modes) < diagonal)


def test_a_damping_matrix_that_couples_no_modes_is_stepped_in_modes() -> None:
    structure = heavy_chain(nodes=6)
    by_matrix = replace(structure.matrices(), damping=Rayleigh(), damper=structure.damping_matrix)
    over = sampling(0.005, 5e-5)
    for scheme in ("moreau", "carpenter", "event_driven"):
        one, other = (step(s, cases(s, **LOAD), 1e-6, over, scheme) for s in (structure, by_matrix))
        assert relative(other.histories["displacement"][0], one.histories["displacement"][0]) < 1e-9


def test_a_scheme_that_takes_neither_refuses_it() -> None:
    """As one from outside that says nothing."""
    silent = replace(schemes.load("moreau"), GENERAL=frozenset())
    reasons = [silent.refusal(structure, None) or "" for structure in (with_damper(), loaded_elsewhere())]
    assert "couples its modes" in reasons[0]
    assert "does not act on the tip" in reasons[1]


def test_it_survives_reduction_and_other_coordinates() -> None:
    structure = with_damper()
    matrices = replace(given(structure), damping=structure.damping, damper=structure.damper)
    mixed = np.triu(np.random.default_rng(2).integers(-1, 2, (6, 6)), 1) + np.eye(6)
    changed = replace(turned(matrices, mixed.T, np.eye(6)), damper=mixed @ structure.damper @ mixed.T)
    rebuilt = structure_from_matrices(changed)
    over = sampling(0.005, 5e-5)
    displacement = step(structure, cases(structure, **LOAD), 1e-5, over).histories["displacement"]
    assert relative(step(rebuilt, cases(rebuilt, **LOAD), 1e-5, over).histories["displacement"], displacement) < 1e-8
    reduced = reduce_structure(structure, 5, 5).structure
    assert relative(step(reduced, cases(reduced, **LOAD), 1e-5, over).histories["displacement"], displacement) < 1e-9


def loaded_elsewhere(nodes: int = 6) -> Matrices:
    """The load acts on two nodes in the middle."""
    direction = np.zeros(nodes)
    direction[[1, 3]] = 0.5, 1.0
    return replace(heavy_chain(nodes=nodes).matrices(), load=direction)


def test_a_load_elsewhere_is_exact_and_moreau_comes_to_it() -> None:
    """Against constant loads for a constant one, then the schemes against each other."""
    structure, over = loaded_elsewhere(), replace(sampling(0.005, 5e-5), balances=True)
    rub = {"alpha": 5.0, "gap": 5e-5}
    steady = cases(structure, mean=900.0, **rub)
    same = replace(cases(structure, **rub), steady=900.0 * structure.load_direction[None, :])
    tip_loaded = replace(structure, load=None)
    for scheme, h in (("moreau", 1e-6), ("event_driven", 0.0)):
        one, other = step(structure, steady, h, over, scheme), step(tip_loaded, same, h, over, scheme)
        assert one.metrics["impacts"][0] > 0
        assert relative(one.histories["displacement"][0], other.histories["displacement"][0]) < 1e-9
        assert scheme == "event_driven" or abs(one.metrics["energy_residual"][0]) < 0.5
    swinging = cases(structure, amplitude=900.0, frequency=300.0, **rub)
    exact = step(structure, swinging, 0.0, over, "event_driven")
    errors = [
        relative(step(structure, swinging, h, over).histories["displacement"][0], exact.histories["displacement"][0])
        for h in (1e-6, 5e-7)
    ]
    assert exact.metrics["impacts"][0] > 0
    assert errors[1] < errors[0] < 0.05  # nine impacts without restitution: slower than first order
    reduced = reduce_structure(structure, 5, 5).structure
    again = step(reduced, cases(reduced, amplitude=900.0, frequency=300.0, **rub), 0.0, over, "event_driven")
    assert relative(again.histories["displacement"][0], exact.histories["displacement"][0]) < 1e-9
