"""Structure of any kind from its matrices: a finite element model from files, with one contact.

Freedoms that a program holds by a huge number on the diagonal (1e36 of Abaqus, 1e20 or 1e30 of others) are left out,
with their rows and columns, and stay 0: beside such a number nothing else of the matrix is left in floating point, and
no rank can be decided.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from workflow.declare import File, file, label
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._from_matrices import GivenMatrices, Sparse, structure_from_matrices, structure_from_sparse
from workflow.models._matrix_entries import Chosen, checked_matrices, in_si, shaken
from workflow.models._matrix_files import files_of, read_entries
from workflow.models._pair import UnusableMatricesError
from workflow.models._structure import Matrices, Rayleigh

_HUGE = 1e17
"""Stiffness [N/m] or conductance [W/K] that no part of a machine has: 1e20 in mW/K."""

_BESIDE = 1e-12
"""Largest other entry of the row over the diagonal: what is left out changes the answers relatively by this."""


def with_held_left_out(given: GivenMatrices, build: Callable[[GivenMatrices], Matrices | Sparse]) -> Matrices | Sparse:
    """Return what ``build`` makes of the matrices without held freedoms, for cases that are given with them.

    Raises
    ------
    UnusableMatricesError
        The contact, its heat or the load act on nothing else.
    """
    moving, warming = ~_is_held(given.stiffness), ~_is_held(given.conductance)
    if moving.all() and warming.all():
        return build(given)
    into, heat_into = (scipy.sparse.eye_array(each.size, format="csc")[:, each] for each in (moving, warming))
    vectors = {name: getattr(given, name) for name in ("contact", "load", "tangent", "steady")}
    left: dict[str, Any] = {name: value if value is None else into.T @ value for name, value in vectors.items()}
    left["thermal_contact"] = heat_into.T @ given.thermal_contact
    for name in ("contact", "load", "tangent", "thermal_contact"):
        if left[name] is not None and not np.any(left[name]):
            raise UnusableMatricesError(f"`{name}` acts on nothing but what is held by {_HUGE:g}", "choose what moves")
    rest = replace(
        given,
        mass=into.T @ given.mass @ into,
        stiffness=into.T @ given.stiffness @ into,
        damper=None if given.damper is None else into.T @ given.damper @ into,
        coupling=into.T @ given.coupling @ heat_into,
        heat_capacity=heat_into.T @ given.heat_capacity @ heat_into,
        conductance=heat_into.T @ given.conductance @ heat_into,
        heating=heat_into.T @ given.heating,
        labels=tuple(np.array(given.labels)[moving]) if given.labels else (),
        **left,
    )
    structure = build(rest)
    own = structure.coordinates
    assert own is not None
    coordinates = replace(
        own,
        displacement_basis=into @ own.displacement_basis,
        displacement_projection=own.displacement_projection @ into.T,
        temperature_basis=heat_into @ own.temperature_basis,
        temperature_projection=own.temperature_projection @ heat_into.T,
        steady=given.steady,
        heating=given.heating,
        expansive=into @ own.expansive,
        held=(int((~moving).sum()), int((~warming).sum())),
    )
    return replace(structure, coordinates=coordinates)


def _is_held(matrix: Any) -> NDArray[np.bool_]:
    diagonal = matrix.diagonal()
    beside = abs(matrix - scipy.sparse.diags_array(diagonal)).max(axis=0).toarray().ravel()
    return np.asarray((diagonal >= _HUGE) & (beside <= _BESIDE * diagonal))


Labels = str | int | tuple[str | int, ...] | None
"""Label, index or name of a vector; of several contacts one of each."""


@dataclass(frozen=True)
class Parameters:
    """Matrices from a file, and the degrees of freedom in contact."""

    file: File = file(
        "file with entries mass, stiffness, and optionally damping, coupling, heat_capacity, conductance, contact, "
        "thermal_contact, load, steady, heating, tangent, labels",
        files=files_of,
    )
    contact: Labels = label(
        "degree of freedom that touches the casing by its label or index (from 0), or the name of a vector in the "
        "file; of several contacts a list, or the name of an entry with a row for each; the file's `contact` where "
        "left out",
        default=None,
        many=True,
    )
    thermal_contact: Labels = label(
        "temperature that takes the contact heat, or the name of a vector of shares; of several contacts as `contact`; "
        "the file's where left out",
        default=None,
        many=True,
    )
    tangent: Labels = label(
        "direction in which the casing slides, by the label or index of a degree of freedom or the name of a vector in "
        "the file, of several contacts as `contact`: with `friction.coefficient` µ the contact force acts along "
        "contact - µ tangent; the file's where left out",
        default=None,
        later=True,
        many=True,
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
    one: dict[str, str | int | None] = {}
    for name in Chosen._fields:
        value: Labels = getattr(parameters, name)
        if isinstance(value, tuple):
            raise UnusableMatricesError(f"`{name}` is a list", "write one of them")
        one[name] = value
    chosen = Chosen(**one)
    return with_held_left_out(checked_matrices(entries, chosen, parameters.damping), _dense_or_sparse)


def _dense_or_sparse(given: GivenMatrices) -> Matrices | Sparse:
    large = max(given.mass.shape[0], given.heat_capacity.shape[0]) > MOST_BY_JACOBI
    return structure_from_sparse(given) if large else structure_from_matrices(given)
