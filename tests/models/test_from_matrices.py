"""Structures from matrices: the same as the chain they were taken from, in any coordinates."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from given_matrices import given, turned
from scenes import heavy_chain
from workflow.models import (
    GivenMatrices,
    UnusableMatricesError,
    critical_alpha,
    mechanical_modes,
    structure_from_matrices,
    thermal_modes,
)


def test_matrices_of_a_chain_give_the_chain() -> None:
    structure = heavy_chain()
    rebuilt = structure_from_matrices(given(structure))
    for name in ("stiffness_matrix", "coupling_matrix", "conductance_matrix", "mass", "heat_capacity"):
        of_chain = getattr(structure, name)
        assert np.abs(getattr(rebuilt, name) - of_chain).max() <= 1e-14 * np.abs(of_chain).max(), name
    assert rebuilt.content == pytest.approx(structure.content, rel=1e-15)
    assert np.abs(rebuilt.loss_row - structure.loss_row).max() <= 1e-13 * structure.conductance_matrix.max()


def with_massless(matrices: GivenMatrices) -> GivenMatrices:
    """Without the mass of nodes 2 and 5, and the heat capacity of node 3."""
    mass, capacity = matrices.mass.copy(), matrices.heat_capacity.copy()
    mass[[2, 5]], capacity[3] = 0.0, 0.0
    return replace(matrices, mass=mass, heat_capacity=capacity)


def test_degrees_of_freedom_without_mass_or_heat_capacity_follow() -> None:
    """Against masses and a capacity of 1e-9 of the others: every frequency but the two, every rate but the one."""
    structure = heavy_chain(nodes=8)
    rebuilt = structure_from_matrices(with_massless(given(structure)))
    assert rebuilt.coordinates is not None
    assert rebuilt.coordinates.condensed == (2, 1)
    masses = np.where(np.isin(np.arange(8), (2, 5)), 2.5e-12, 2.5e-3)
    light = heavy_chain(nodes=8, mass=tuple(masses), heat_capacity=(*[1.315] * 3, 1.315e-9, *[1.315] * 4))
    assert mechanical_modes(rebuilt).values == pytest.approx(mechanical_modes(light).values[:6], rel=1e-8)
    assert thermal_modes(rebuilt).values == pytest.approx(thermal_modes(light).values[:7], rel=1e-8)
    assert critical_alpha(rebuilt) == pytest.approx(critical_alpha(structure), rel=1e-12)


def test_dampers_on_what_has_no_mass_are_multiples_of_its_springs() -> None:
    """Also in coordinates in which no row of M is zero; what is damped elsewhere is nobody's business."""
    matrices = with_massless(given(heavy_chain(nodes=8)))
    elsewhere, on_one = np.diag([0.0, 4, 0, 0, 1, 0, 0, 2]), np.diag([0.0, 0, 3, 0, 0, 0, 0, 0])
    names = tuple("abcdefgh")
    mixed = np.triu(np.random.default_rng(5).integers(-2, 3, (8, 8)), 1) + np.eye(8)
    for share, beside, follows in ((1e-5, elsewhere, True), (0.0, elsewhere, True), (1e-5, on_one, False)):
        given_ones = replace(matrices, damper=share * matrices.stiffness + beside, labels=names)
        turned_ones = replace(turned(matrices, mixed.T, mixed), damper=mixed @ given_ones.damper @ mixed.T)
        if follows:
            structure_from_matrices(given_ones)
            structure_from_matrices(turned_ones)
            continue
        with pytest.raises(UnusableMatricesError, match="`damping` acts on displacement c, which has no mass: give it"):
            structure_from_matrices(given_ones)
        with pytest.raises(
            UnusableMatricesError, match=r"`damping` acts on displacement \d, which has no mass: give it"
        ):
            structure_from_matrices(turned_ones)
    with pytest.raises(UnusableMatricesError, match="which has no mass"):
        structure_from_matrices(replace(matrices, damper=-1e-5 * matrices.stiffness))
