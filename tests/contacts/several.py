"""Matrices of a file with a row for each contact, without condensation: M and C2 are regular."""

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from workflow.declare import File, file
from workflow.models import Array, Contacts, GivenMatrices, Structure, structure_from_matrices
from workflow.models.chain import Rayleigh


@dataclass(frozen=True)
class Parameters:
    """A file of NumPy with the entries of several contacts."""

    file: File = file("file")
    damping: Rayleigh = field(default_factory=Rayleigh)


def assemble(parameters: Parameters) -> Structure:
    """Return the structure with all contacts of the file."""
    with np.load(parameters.file.place) as entries:
        return of_entries(dict(entries), parameters.damping)


def of_entries(entries: dict[str, Any], damping: Rayleigh) -> Structure:
    """Return a structure of matrices and rows of contacts."""
    normal = np.atleast_2d(entries["contact"]).astype(float)
    count, size = normal.shape
    thermal = len(entries["heat_capacity"]) if "heat_capacity" in entries else 1
    capacity = entries.get("heat_capacity", np.ones((1, 1)))
    heat = np.atleast_2d(entries.get("thermal_contact", np.eye(1, thermal).repeat(count, axis=0))).astype(float)
    given = GivenMatrices(
        mass=entries["mass"],
        stiffness=entries["stiffness"],
        coupling=entries.get("coupling", np.zeros((size, thermal))),
        heat_capacity=capacity,
        conductance=entries.get("conductance", np.zeros((thermal, thermal))),
        contact=normal[0],
        thermal_contact=heat[0],
        steady=entries.get("steady", np.zeros(size)),
        heating=entries.get("heating", np.zeros(thermal)),
        damping=damping,
        load=entries.get("load"),
        damper=entries.get("damping"),
    )
    structure = structure_from_matrices(given)
    own = structure.coordinates

    def rows(name: str, default: Array) -> Array:
        return np.atleast_2d(entries.get(name, default)).astype(float) @ own.displacement_basis

    residuals = {f"residual{end}": f"residual{name}" for end, name in _RESIDUALS.items()}
    contacts = Contacts(
        labels=tuple(map(str, entries.get("contact_labels", np.arange(1, count + 1)))),
        normal=rows("contact", normal),
        tangent=rows("tangent", np.zeros((count, size))),
        heat=heat @ own.temperature_basis,
        angle=np.ravel(entries.get("angle", np.zeros(count))).astype(float),
        **{field: entries.get(name) for field, name in residuals.items()},
    )
    load = own.displacement_basis.T @ entries.get("load", np.zeros(size))
    return replace(structure, contacts=contacts, load=load)


_RESIDUALS = {"": "_flexibility", "_tangent": "_tangent", "_load": "_load"}
