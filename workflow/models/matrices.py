"""Structure of any kind by its matrices: a finite element model from files, with one contact."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from workflow.declare import File, file, label
from workflow.models._from_matrices import structure_from_matrices
from workflow.models._matrix_entries import given_matrices, in_si
from workflow.models._matrix_files import files_of, read_entries
from workflow.models._structure import Matrices, Rayleigh


@dataclass(frozen=True)
class Parameters:
    """Matrices from a file, and where the casing is touched."""

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
    units: Literal["SI", "mm-t-s"] = "SI"
    damping: Rayleigh = field(default_factory=Rayleigh)


def assemble(parameters: Parameters) -> Matrices:
    """Return the structure of equations (1a) and (1b), its last coordinate the contact.

    Raises
    ------
    UnusableMatricesError
        The file, or what the study chooses from it, is no structure.
    """
    entries = in_si(read_entries(Path(parameters.file.place)), parameters.units)
    given = given_matrices(entries, parameters.contact, parameters.thermal_contact, parameters.damping)
    return structure_from_matrices(given)
