"""Friction and the modes that a basis does not resolve: they do not flutter alone, or it is said.

Structures with 16 modes of 100 to 1600 rad/s, turned at random, and two contacts: none flutters with one closed.
Without the damping of what a basis does not resolve each of these bases does, at up to 15 1/s.
"""

import numpy as np
import pytest

from scenes import of_entries
from workflow.judges.cautions import flutter_of_basis
from workflow.models import Matrices, Rayleigh, Structure, analyse_contacts, poles_in_contact
from workflow.reduction import reduce_structure

FRICTION, SIZE = 0.2, 16


def turned(seed: int) -> Matrices:
    basis = np.linalg.qr(np.random.default_rng(seed).normal(size=(SIZE, SIZE)))[0]
    stiffness = basis.T @ np.diag((100.0 * np.arange(1, SIZE + 1)) ** 2) @ basis
    rows = np.eye(SIZE)
    return of_entries(
        {"mass": np.eye(SIZE), "stiffness": stiffness, "contact": rows[:2], "tangent": rows[2:4]}, Rayleigh(ratio=0.003)
    )


def growth(structure: Structure) -> float:
    """The largest growth rate with one of both contacts closed, 1/s."""
    basis = analyse_contacts(structure)
    each = (poles_in_contact(basis, np.array([k]), 0.0, FRICTION) for k in range(2))
    return max(float(poles[poles.imag > 0].real.max()) for poles in each)


@pytest.mark.parametrize(
    ("seed", "basis", "count"),
    [(3, "craig_bampton", 7), (5, "krylov", 9), (11, "rubin", 8), (11, "rubin", 9)],
)
def test_what_a_basis_does_not_resolve_does_not_flutter(seed: int, basis: str, count: int) -> None:
    structure = turned(seed)
    assert growth(structure) < 0
    reduced = reduce_structure(structure, count, 0, basis, 1.0).structure
    assert growth(reduced) < 0
    assert list(flutter_of_basis(structure, reduced, FRICTION, basis)) == []


@pytest.mark.parametrize(("seed", "basis", "count"), [(1, "krylov", 10), (2, "krylov", 5), (4, "craig_bampton", 3)])
def test_a_basis_that_still_flutters_is_told(seed: int, basis: str, count: int) -> None:
    structure = turned(seed)
    reduced = reduce_structure(structure, count, 0, basis, 1.0).structure
    lines = list(flutter_of_basis(structure, reduced, FRICTION, "this basis"))
    assert all(line.startswith("this basis: friction at contact `") for line in lines)
    assert any(f"grows at {growth(reduced):.3g} 1/s" in line for line in lines)


def test_modes_that_a_basis_resolves_keep_their_damping() -> None:
    """All 14 interior modes: the coordinates are others, the structure is the same."""
    ratio = reduce_structure(turned(1), 14, 0, "krylov", 1.0).structure.damping.ratio
    assert ratio == pytest.approx(0.003, rel=1e-9)
    assert reduce_structure(turned(1), 8, 0, "krylov", 1.0).structure.damping.ratio.max() > 0.004
