"""Damping that is not Rayleigh's: a ratio of every mode in every scheme, a matrix of its own by fixed steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from test_event_driven_random import against_reference, scene

from scenes import cases, heavy_chain, relative, sampling, step, with_dashpot
from workflow import schemes
from workflow.models import Matrices, Rayleigh, Structure, mechanical_modes, modal_damping
from workflow.reduction import reduce_structure
from workflow.schemes import moreau, penalty


def test_every_mode_has_the_ratio_and_rigid_ones_none() -> None:
    structure = heavy_chain(nodes=6, stiffness=(0.0, *[2e7] * 5), damping=Rayleigh(ratio=0.03))
    modes = mechanical_modes(structure)
    by_ratio = np.diag(2 * 0.03 * modes.values)
    modal = modes.shapes.T @ structure.damping_matrix @ modes.shapes
    assert np.abs(modal - by_ratio).max() <= 1e-12 * by_ratio.max()
    assert modal[0, 0] == pytest.approx(0.0, abs=1e-12 * by_ratio.max())
    reduced = reduce_structure(heavy_chain(nodes=6, damping=Rayleigh(ratio=0.03)), 2, 2).structure
    modes = mechanical_modes(reduced)
    modal = modes.shapes.T @ reduced.damping_matrix @ modes.shapes
    assert np.abs(modal - np.diag(0.06 * modes.values)).max() <= 1e-12 * modal.max()


@pytest.mark.parametrize(
    ("seed", "ratio"),
    [(38, 1.7), *(pytest.param(*one, marks=pytest.mark.slow) for one in ((1, 0.05), (4, 0.3), (10, 1.7), (6, 1.0)))],
)
def test_a_ratio_is_exact_against_the_independent_solution(seed: int, ratio: float) -> None:
    """With the tip held its modes are coupled by damping, with and without friction heat."""
    structure, case = scene(np.random.default_rng(seed))
    structure = replace(structure, damping=Rayleigh(ratio=ratio))  # type: ignore[type-var]
    assert against_reference(structure, case) <= 1e-8


LOAD = {"alpha": 5.0, "gap": 5e-5, "amplitude": 900.0, "frequency": 200.0}


def test_what_a_mode_loses_by_itself_holds_its_part_of_a_damping_matrix() -> None:
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
    modes = mechanical_modes(structure)
    diagonal = np.diag(modes.shapes.T @ structure.damping_matrix @ modes.shapes)
    np.testing.assert_allclose(modal_damping(structure, modes), diagonal, rtol=1e-12)
    assert np.all(modal_damping(replace(structure, damper=None), modes) < diagonal)


def loaded_elsewhere(structure: Structure) -> Matrices:
    """The load acts on two nodes in the middle."""
    return replace(structure.matrices(), load=np.array([0.0, 0.5, 0.0, 1.0, 0.0, 0.0]))


def test_a_scheme_that_takes_neither_refuses_it() -> None:
    """As one from outside that says nothing."""
    silent, structure = replace(schemes.load("moreau"), GENERAL=frozenset()), heavy_chain(nodes=6)
    assert "couples its modes" in silent.refusal(with_dashpot(structure, 1, 3, 20.0), None)
    assert "does not act on the tip" in silent.refusal(loaded_elsewhere(structure), None)


def test_all_modes_keep_a_damping_matrix_and_a_load_elsewhere() -> None:
    structure = loaded_elsewhere(with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0))
    reduced, over = reduce_structure(structure, 5, 5).structure, sampling(0.005, 5e-5)
    one, other = (step(s, cases(s, **LOAD), 1e-5, over) for s in (structure, reduced))
    assert one.metrics["impacts"][0] > 0
    assert relative(other.histories["displacement"], one.histories["displacement"]) < 1e-9


def test_what_a_contact_spring_asks_of_a_structure_needs_no_modal_damping() -> None:
    """Its default stiffness and the steps up to which it holds: of M and K1 alone."""
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
    plain = replace(structure, damper=None)
    for function in (penalty.contact_stiffness_of, penalty.contact_limit):
        assert function(structure, penalty.Options()) == function(plain, penalty.Options())


def test_a_plan_says_what_a_structure_is_stepped_by() -> None:
    structure = heavy_chain(nodes=6)
    assert moreau.operator_name(structure) == "6 + 6 modes with the tip's own"
    by_matrix = replace(structure.matrices(), damping=Rayleigh(), damper=structure.damping_matrix)
    assert moreau.operator_name(by_matrix) == moreau.operator_name(structure)
    coupled = with_dashpot(structure, 1, 3, 20.0)
    assert "6 + 6 modes with the tip's own, coupled by damping" in moreau.operator_name(coupled)
    exact = schemes.load("event_driven")
    assert exact.operator_name is not None
    assert exact.operator_name(structure) == ""
    assert "poles of 18 states, as damping couples the modes" in exact.operator_name(coupled)
