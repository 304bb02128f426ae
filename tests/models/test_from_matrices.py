"""Structures from matrices: those of the chain in any coordinates, or of what is left where a freedom is held."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from given_matrices import given, turned
from matrix_files import matrices_of
from scenes import cases, heavy_chain, of_file, tip_flexibility
from workflow.models import (
    GivenMatrices,
    Structure,
    UnusableMatricesError,
    critical_alpha,
    frequencies,
    mechanical_modes,
    rates,
    structure_from_matrices,
    thermal_modes,
    write_matrices,
)


def with_massless(matrices: GivenMatrices) -> GivenMatrices:
    """Without the mass of nodes 2 and 5, and the heat capacity of node 3."""
    mass, capacity = matrices.mass.copy(), matrices.heat_capacity.copy()
    mass[[2, 5]], capacity[3] = 0.0, 0.0
    return replace(matrices, mass=mass, heat_capacity=capacity)


def test_degrees_of_freedom_without_mass_or_heat_capacity_follow() -> None:
    """Against masses and a capacity of 1e-9 of the others: every frequency but the two, every rate but the one."""
    structure = heavy_chain(nodes=8)
    rebuilt = structure_from_matrices(with_massless(given(structure)))
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
        for each, which in ((given_ones, "c"), (turned_ones, r"\d")):
            if follows:
                structure_from_matrices(each)
                continue
            with pytest.raises(UnusableMatricesError, match=f"on displacement {which}, which has no mass: give it"):
                structure_from_matrices(each)
    with pytest.raises(UnusableMatricesError, match="which has no mass"):
        structure_from_matrices(replace(matrices, damper=-1e-5 * matrices.stiffness))


def assembled(path: Path, **entries: Any) -> Structure:
    return of_file(write_matrices(path, **entries))


@pytest.mark.parametrize(("nodes", "held"), [(4, (0,)), (7, (0, 3)), (320, (0, 1, 9))])
@pytest.mark.parametrize("huge", [1e20, 1e30, 1e36])
def test_answers_are_those_of_the_structure_without_what_is_held(
    nodes: int, held: tuple[int, ...], huge: float, tmp_path: Path
) -> None:
    """Springs of neighbours are left beside the huge number, as Abaqus leaves them; heat flows there alike."""
    matrices = matrices_of(heavy_chain(nodes=nodes))
    kept = np.delete(np.arange(nodes), held)
    left = {name: matrix[np.ix_(kept, kept)] for name, matrix in matrices.items()}
    for name in ("stiffness", "conductance"):
        matrices[name] = matrices[name].copy()
        matrices[name][held, held] = huge
    whole = assembled(tmp_path / "a.npz", **matrices, contact=nodes - 1)
    right = assembled(tmp_path / "b.npz", **left, contact=kept.size - 1)
    assert whole.coordinates.held == (len(held), len(held))
    assert whole.coordinates.condensed == (0, 0)
    for of in (tip_flexibility, critical_alpha):
        assert of(whole) == pytest.approx(of(right), rel=1e-10)
    for of in (frequencies, rates):
        assert of(whole)[0] == pytest.approx(of(right)[0], rel=1e-10)


def test_cases_are_given_with_what_is_held_and_it_stays(tmp_path: Path) -> None:
    matrices = matrices_of(heavy_chain(nodes=4))
    matrices["stiffness"][1, 1] = 1e36
    whole = assembled(tmp_path / "a.npz", **matrices, contact="d", labels=list("abcd"))
    assert whole.input_sizes == (4, 4)
    assert whole.input_contacts.tolist() == [[0, 0, 0, 1]]
    moving = np.array([[1.0, 0.0, 2.0, -3.0]])
    start = {"displacement": moving, "velocity": 5 * moving, "temperature": moving + 4}
    given = cases(heavy_chain(nodes=4), **start, steady=moving - 7, heating=moving - 1)
    own, x = whole.coordinates.transformed(given), whole.coordinates.displacement_basis
    assert own.steady.shape == (1, 3)
    for basis, name in zip((x, x, whole.coordinates.temperature_basis), start, strict=True):
        assert basis @ getattr(own, name)[0] == pytest.approx(start[name][0], rel=1e-14), name
    assert own.steady[0] @ own.velocity[0] == pytest.approx(given.steady[0] @ given.velocity[0], rel=1e-14)
    assert own.heating[0] @ own.temperature[0] == pytest.approx(given.heating[0] @ given.temperature[0], rel=1e-14)


def test_what_is_only_stiff_is_not_held(tmp_path: Path) -> None:
    """A rigid link between two freedoms, and a modal file with far frequencies."""
    matrices = matrices_of(heavy_chain(nodes=4))
    matrices["stiffness"][1:3, 1:3] += 1e20 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    modes = {"mass": np.eye(3), "stiffness": np.diag([1e-6, 1e8, 1e14]), "contact": [1.0, 1.0, 1.0]}
    for number, entries in enumerate(({**matrices, "contact": 3}, modes)):
        structure = assembled(tmp_path / f"{number}.npz", **entries)
        assert structure.coordinates.held == (0, 0)


@pytest.mark.parametrize("name", ["contact", "thermal_contact", "load"])
def test_what_is_held_takes_no_contact(name: str, tmp_path: Path) -> None:
    matrices = matrices_of(heavy_chain(nodes=4))
    for matrix in ("stiffness", "conductance"):
        matrices[matrix][0, 0] = 1e36
    entries = {"contact": 3, "thermal_contact": 3} | {name: [1.0, 0, 0, 0] if name == "load" else 0}
    with pytest.raises(UnusableMatricesError, match=f"`{name}` acts only on what is held"):
        assembled(tmp_path / "a.npz", **matrices, **entries)
