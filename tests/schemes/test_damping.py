"""Damping that is not Rayleigh's: a ratio of every mode in every scheme, a matrix of its own by fixed steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_event_driven_random import against_reference, scene

from given_matrices import given, turned
from scenes import WAVES, cases, heavy_chain, held_matrix, relative, sampling, step, with_dashpot
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
from workflow.schemes import Status, moreau, penalty


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


@pytest.mark.parametrize("alpha", [0.5, 3.0])
def test_the_growth_rate_has_the_damping_of_the_held_tip(alpha: float) -> None:
    for structure in (damped(0.2), reduce_structure(damped(0.2), 3, 4).structure):
        largest = np.linalg.eigvals(held_matrix(structure, alpha)).real.max()
        assert growth_rate(structure, alpha) == pytest.approx(largest, rel=1e-9)
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
    assert against_reference(structure, case) <= 1e-8


LOAD = {"alpha": 5.0, "gap": 5e-5, "amplitude": 400.0, "frequency": 200.0}


@pytest.mark.parametrize("scheme", ["moreau", "carpenter", "penalty"])
def test_a_ratio_in_schemes_with_a_step(scheme: str) -> None:
    """They come to the exact solution; the balances of the spring close."""
    structure = damped(0.05)
    over = sampling(0.01, 1e-4, balances=True)
    if scheme == "penalty":
        exact = step(structure, cases(structure, **LOAD), 1e-7, over, "penalty", stiffness=1e10)
        finer = step(structure, cases(structure, **LOAD), 2e-7, over, "penalty", stiffness=1e10)
        assert abs(exact.metrics["energy_residual"][0]) < 1e-3
        assert abs(exact.metrics["heat_residual"][0]) < 1e-6
    else:
        exact = step(structure, cases(structure, **LOAD), 0.0, over, "event_driven")
        finer = step(structure, cases(structure, **LOAD), 1e-7, over, scheme)
    assert relative(finer.histories["displacement"][0], exact.histories["displacement"][0]) < 2e-3


def test_what_a_mode_loses_by_itself_holds_its_part_of_a_damping_matrix() -> None:
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
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
    reasons = [
        silent.refusal(structure, None) or ""
        for structure in (with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0), loaded_elsewhere())
    ]
    assert "couples its modes" in reasons[0]
    assert "does not act on the tip" in reasons[1]


def test_it_survives_reduction_and_other_coordinates() -> None:
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
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
    structure, over = loaded_elsewhere(), sampling(0.005, 5e-5, balances=True)
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


def test_a_free_root_is_stable() -> None:
    """Its double eigenvalue 1 errs by the root of rounding, which is no growth."""
    structure = with_dashpot(heavy_chain(nodes=6, stiffness=(0.0, *[2e7] * 5)), 1, 3, 20.0)
    results = step(structure, cases(structure, gap=1e-4, mean=1.0, e=0.5), 1e-5, sampling(0.01, 1e-4))
    assert results.status[0] == Status.OK


def test_what_a_contact_spring_asks_of_a_structure_needs_no_modal_damping() -> None:
    """Its default stiffness and the steps up to which it holds: of M and K1 alone."""
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
    plain = replace(structure, damper=None)
    for function in (penalty.contact_stiffness_of, penalty.contact_limit):
        assert function(structure, penalty.Options()) == function(plain, penalty.Options())


def test_a_plan_says_what_a_structure_is_stepped_by() -> None:
    structure = heavy_chain(nodes=6)
    assert moreau.operator_name(structure) == "6 + 6 modes with the tip's own"
    coupled = with_dashpot(structure, 1, 3, 20.0)
    assert "6 + 6 modes with the tip's own, coupled by damping" in moreau.operator_name(coupled)
    exact = schemes.load("event_driven")
    assert exact.operator_name is not None
    assert exact.operator_name(structure) == ""
    assert "poles of 18 states, as damping couples the modes" in exact.operator_name(coupled)


@pytest.mark.parametrize(
    ("e", "alpha"), [(0.0, 5.0), *(pytest.param(*one, marks=SLOW) for one in ((0.5, 0.0), (0.8, 5.0)))]
)
def test_the_exact_solution_of_a_load_elsewhere_on_a_moving_casing(e: float, alpha: float) -> None:
    structure = replace(heavy_chain(nodes=3).matrices(), load=np.array([0.5, 1.0, 0.2]))
    acting = {"gap": 2e-5, "mean": 30.0, "amplitude": 300.0, "frequency": 300.0, "phase": 0.3, **WAVES}
    start = {"steady": 2.0, "heating": 0.3, "temperature": 1.0, "velocity": 0.1}
    case = cases(structure, e=e, alpha=alpha, **acting, **start)
    assert against_reference(structure, case, sampling(3e-3, 1e-5)) <= 1e-9
