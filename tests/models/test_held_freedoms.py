"""Freedoms held by a huge number on the diagonal: the answers are those of the structure without them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from matrix_files import matrices_of
from scenes import cases, heavy_chain
from workflow.declare import File
from workflow.models import (
    Structure,
    UnusableMatricesError,
    critical_alpha,
    frequencies,
    load,
    rates,
    tip_flexibility,
    write_matrices,
)


def assembled(path: Path, **entries: Any) -> Structure:
    model = load("matrices")
    written = write_matrices(path, **entries)
    return model.assemble(model.Parameters(File(str(entries), written.name, str(written))))


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
    assert whole.coordinates is not None
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
    assert whole.input_contact.tolist() == [0, 0, 0, 1]
    assert whole.coordinates is not None
    given = cases(heavy_chain(nodes=4), steady=np.array([[1.0, 2.0, 3.0, 4.0]]))
    assert whole.coordinates.transformed(given).steady.shape == (1, 3)
    moved = whole.coordinates.displacement_basis @ np.ones(3)
    assert moved[1] == 0.0


def test_what_is_only_stiff_is_not_held(tmp_path: Path) -> None:
    """A rigid link between two freedoms, and a modal file with far frequencies."""
    matrices = matrices_of(heavy_chain(nodes=4))
    matrices["stiffness"][1:3, 1:3] += 1e20 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    modes = {"mass": np.eye(3), "stiffness": np.diag([1e-6, 1e8, 1e14]), "contact": [1.0, 1.0, 1.0]}
    for number, entries in enumerate(({**matrices, "contact": 3}, modes)):
        structure = assembled(tmp_path / f"{number}.npz", **entries)
        assert structure.coordinates is not None
        assert structure.coordinates.held == (0, 0)


@pytest.mark.parametrize("name", ["contact", "thermal_contact", "load"])
def test_what_is_held_takes_no_contact(name: str, tmp_path: Path) -> None:
    matrices = matrices_of(heavy_chain(nodes=4))
    for matrix in ("stiffness", "conductance"):
        matrices[matrix][0, 0] = 1e36
    entries = {"contact": 3, "thermal_contact": 3} | {name: [1.0, 0, 0, 0] if name == "load" else 0}
    with pytest.raises(UnusableMatricesError, match=f"`{name}` acts on nothing but what is held"):
        assembled(tmp_path / "a.npz", **matrices, **entries)
