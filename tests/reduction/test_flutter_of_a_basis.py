"""Friction and the modes that a basis does not resolve: they do not flutter alone, or it is said.

Structures with 16 modes of 100 to 1600 rad/s, turned at random, and two contacts: none flutters with one closed.
With friction on what a basis does not resolve each of these bases does, at up to 15 1/s.
"""

from pathlib import Path

import numpy as np
import pytest

from scenes import of_entries
from workflow.judges import cautions
from workflow.judges.cautions import flutter_of_basis
from workflow.models import ContactBasis, Matrices, Rayleigh, Structure, analyse_contacts, poles_in_contact
from workflow.models._pair import MOST_FULL, DensePair
from workflow.models.matrices import write_matrices
from workflow.plan import plan_study
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
    return max(float(poles.rate[poles.frequency > 0].max()) for poles in each)


def told(full: Structure, reduced: Structure, basis: str) -> list[str]:
    return list(flutter_of_basis(reduced, FRICTION, basis, lambda: full, "the full structure"))


@pytest.mark.parametrize(
    ("seed", "basis", "count"),
    [
        (1, "krylov", 10),
        (2, "krylov", 5),
        (3, "craig_bampton", 7),
        (4, "craig_bampton", 3),
        (5, "krylov", 9),
        (11, "rubin", 8),
        (11, "rubin", 9),
    ],
)
def test_what_a_basis_does_not_resolve_does_not_flutter(seed: int, basis: str, count: int) -> None:
    structure = turned(seed)
    assert growth(structure) < 0
    reduced = reduce_structure(structure, count, 0, basis, 1.0).structure
    assert growth(reduced) < 0
    assert told(structure, reduced, basis) == []


@pytest.mark.parametrize(("seed", "basis", "count"), [(1, "krylov", 11), (22, "rubin", 5), (25, "krylov", 1)])
def test_a_basis_that_still_flutters_is_told(seed: int, basis: str, count: int) -> None:
    structure = turned(seed)
    reduced = reduce_structure(structure, count, 0, basis, 1.0).structure
    lines = told(structure, reduced, "this basis")
    assert all(line.startswith("this basis: friction at contact `") for line in lines)
    assert any(f"grows at {growth(reduced):.3g} 1/s" in line for line in lines)
    assert told(reduced, reduced, "this basis") == []


def test_a_pole_of_the_structure_is_one_of_the_basis(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two poles of a bending solid with 50 vectors are within 10 % of one of its own; the second is the basis's."""
    structure = turned(1)
    reduced = reduce_structure(structure, 8, 0, "krylov", 1.0).structure
    poles = {SIZE: [(5570, 158.4e3)], reduced.mechanical_size: [(5490, 158.5e3), (3040, 175.2e3)]}

    def growing(basis: ContactBasis, contact: int, friction: float) -> np.ndarray:
        return np.array(
            [rate + 2j * np.pi * hertz for rate, hertz in poles[basis.frequency.size]][: 9 * (contact == 0)]
        )

    monkeypatch.setattr(cautions, "_growing", growing)
    (line,) = told(structure, reduced, "this basis")
    assert "1.752e+05 Hz that grows at 3.04e+03 1/s" in line


def test_friction_drives_all_that_a_basis_resolves() -> None:
    """All 14 interior modes: the coordinates are others, the structure is the same."""
    for count, is_same in ((14, True), (8, False)):
        reduction = reduce_structure(turned(1), count, 0, "krylov", 1.0)
        whole = turned(1).contacts.tangent @ reduction.displacement_basis
        assert np.allclose(reduction.structure.contacts.tangent, whole, atol=1e-9) == is_same


@pytest.mark.parametrize(("most", "other"), [(MOST_FULL, 13), (12, 9)])
def test_a_basis_of_a_large_structure_is_compared_with_another_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, most: int, other: int
) -> None:
    """A tenth more of the vectors, or less where so many are most; 11 krylov vectors flutter at 113.7 Hz."""
    monkeypatch.setattr("workflow.models._structure.MOST_FULL", SIZE - 1)
    monkeypatch.setattr(DensePair, "most_modes", most)
    structure = turned(1)
    entries = {"mass": np.eye(SIZE), "stiffness": structure.stiffness_matrix}
    rows = {"contact": structure.contacts.normal, "tangent": structure.contacts.tangent}
    file = write_matrices(tmp_path / "turned.npz", **entries, **rows)
    scene = {
        "matrices": {"file": str(file), "damping": {"ratio": 0.003}},
        "casing": {"gap": 1e-3},
        "friction": {"coefficient": FRICTION, "sliding_speed": 1.0, "heat_share": 0.0},
        "duration": 1.0,
    }
    axes = {"scheme": "event_driven", "reduction": "krylov", "mechanical_modes": 11}
    (line,) = [
        line for line in plan_study({"study": "turned", "scene": scene, "axes": axes}).warnings if "drives" in line
    ]
    assert "drives an oscillation of 113.7 Hz" in line
    assert f"and that a basis of {other} vectors does not have" in line
