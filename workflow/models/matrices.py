"""Structure of any kind from its matrices: a finite element model from files, with one contact."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from workflow.declare import File, file, label
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._from_matrices import GivenMatrices, structure_from_matrices
from workflow.models._held_freedoms import with_held_left_out
from workflow.models._matrix_entries import Chosen, checked_matrices, in_si
from workflow.models._matrix_files import files_of, read_entries
from workflow.models._shaken_entries import shaken
from workflow.models._sparse import Sparse
from workflow.models._sparse_from_matrices import structure_from_sparse
from workflow.models._structure import Matrices, Rayleigh


@dataclass(frozen=True)
class Parameters:
    """Matrices from a file, and the degree of freedom in contact."""

    file: File = file(
        "file with entries mass, stiffness, and optionally damping, coupling, heat_capacity, conductance, contact, "
        "thermal_contact, load, steady, heating, tangent, labels",
        files=files_of,
    )
    contact: str | int | None = label(
        "degree of freedom that touches the casing by its label or index (from 0), or the name of a vector in the "
        "file; the file's `contact` where left out",
        default=None,
    )
    thermal_contact: str | int | None = label(
        "temperature that takes the contact heat, or the name of a vector of shares; the file's where left out",
        default=None,
    )
    tangent: str | int | None = label(
        "direction in which the casing slides, by the label or index of a degree of freedom or the name of a vector in "
        "the file: with `friction.coefficient` µ the contact force acts along contact - µ tangent; the file's where "
        "left out",
        default=None,
        later=True,
    )
    units: Literal["SI", "mm-t-s"] = "SI"
    damping: Rayleigh = field(default_factory=Rayleigh)


def assemble(parameters: Parameters) -> Matrices | Sparse:
    """Return the structure of equations (1a) and (1b), its last coordinate the contact; sparse above 300 coordinates.

    Raises
    ------
    UnusableMatricesError
        The file, or the study's choice from it, does not describe a structure.
    """
    entries = in_si(read_entries(Path(parameters.file.place)), parameters.units)
    if parameters.file.shaken != 0:
        entries = shaken(entries, parameters.file.shaken)
    chosen = Chosen(parameters.contact, parameters.thermal_contact, parameters.tangent)
    return with_held_left_out(checked_matrices(entries, chosen, parameters.damping), _dense_or_sparse)


def _dense_or_sparse(given: GivenMatrices) -> Matrices | Sparse:
    large = max(given.mass.shape[0], given.heat_capacity.shape[0]) > MOST_BY_JACOBI
    return structure_from_sparse(given) if large else structure_from_matrices(given)
