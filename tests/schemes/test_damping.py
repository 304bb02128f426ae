"""Damping that is not Rayleigh's: a ratio of every mode, a matrix that couples them, the tip free and held."""

from dataclasses import replace

import numpy as np
import pytest
from test_event_driven_random import against_reference

from scenes import cases, chain, heavy_chain, observing, sampling, with_dashpot
from workflow import schemes
from workflow.models import (
    Matrices,
    Rayleigh,
    Structure,
    analyse_contacts,
    contact_system,
    mechanical_modes,
    modal_damping,
)
from workflow.reduction import reduce_structure


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


def test_what_a_mode_loses_by_itself_holds_its_part_of_a_damping_matrix() -> None:
    structure = with_dashpot(heavy_chain(nodes=6), 1, 3, 20.0)
    modes = mechanical_modes(structure)
    diagonal = np.diag(modes.shapes.T @ structure.damping_matrix @ modes.shapes)
    np.testing.assert_allclose(modal_damping(structure, modes), diagonal, rtol=1e-12)
    assert np.all(modal_damping(replace(structure, damper=None), modes) < diagonal)


def loaded_elsewhere(structure: Structure) -> Matrices:
    """The load acts on two nodes in the middle."""
    return replace(structure.matrices(), load=np.array([0.0, 0.5, 0.0, 1.0, 0.0, 0.0]))


def test_a_scheme_that_takes_none_of_these_refuses_it() -> None:
    """As one from outside that says nothing; temperatures over a depth, too."""
    silent, structure = replace(schemes.load("moreau"), GENERAL=frozenset()), heavy_chain(nodes=6)
    assert silent.refusal(structure, None) is None
    assert "couples its modes" in silent.refusal(with_dashpot(structure, 1, 3, 20.0), None)
    assert "does not act on the tip" in silent.refusal(loaded_elsewhere(structure), None)
    deep = observing(structure, np.ones(6) / 6)
    assert silent.refusal(deep, None) == "it does not record the temperature over a depth"


def test_damping_that_feeds_a_real_pole() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=(1.0, 2.0, 1.5)).matrices()
    fed = replace(structure, damper=np.diag([-9.0, 0.0, 5.0]))
    free = contact_system(analyse_contacts(fed), np.zeros(1, dtype=bool), 0.0, 0.0)
    assert free is not None
    poles = np.linalg.eigvals(free.A)
    assert (poles.real > 0)[poles.imag == 0].any()
    rub = cases(fed, e=0.5, gap=0.2, mean=0.5, amplitude=0.4, frequency=0.1)
    assert against_reference(fed, rub, sampling(8.0, 0.1)) <= 1e-10
