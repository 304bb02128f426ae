"""Structure of any kind from its matrices: a finite element model from files, with one contact or several.

Freedoms that a program holds by a huge number on the diagonal (1e36 of Abaqus, 1e20 or 1e30 of others) are left out,
with their rows and columns, and stay 0: beside such a number nothing else of the matrix is left in floating point, and
no rank can be decided.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, Literal

import numpy as np
import scipy
from numpy.typing import NDArray

from workflow.declare import File, file, label, speed
from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._factors import is_definite
from workflow.models._from_matrices import (
    GivenMatrices,
    structure_from_matrices,
    structure_from_sparse,
    with_contacts,
)
from workflow.models._matrix_entries import Choice, Chosen, given_by, in_si, labels_of, row_of, shaken
from workflow.models._matrix_files import ENTRIES, LABELS, MATRICES, PART, SPEED2, files_of, in_unicode, read_entries
from workflow.models._pair import UnusableMatricesError, turning_at
from workflow.models._sensors import Sensor
from workflow.models._structure import Matrices, Rayleigh, Structure

_HUGE = 1e17
"""Stiffness [N/m] or conductance [W/K] that no part of a machine has: 1e20 in mW/K."""

_BESIDE = 1e-12
"""Largest other entry of the row over the diagonal: what is left out changes the answers relatively by this."""


def with_held_left_out(given: GivenMatrices) -> Matrices:
    """Return the structure of the matrices without held freedoms, for cases that are given with them.

    Raises
    ------
    UnusableMatricesError
        The contact, its heat or the load act on nothing else.
    """
    moving, warming = ~_is_held(given.stiffness), ~_is_held(given.conductance)
    if moving.all() and warming.all():
        return _dense_or_sparse(given)
    into, heat_into = (scipy.sparse.eye_array(each.size, format="csc")[:, each] for each in (moving, warming))
    vectors = {name: getattr(given, name) for name in ("contact", "load", "steady")}
    left: dict[str, Any] = {name: value if value is None else into.T @ value for name, value in vectors.items()}
    left["thermal_contact"] = heat_into.T @ given.thermal_contact
    for name in ("contact", "load", "thermal_contact"):
        if left[name] is not None and not np.any(left[name]) and np.any(getattr(given, name)):
            raise UnusableMatricesError(f"`{name}` acts only on what is held by {_HUGE:g}", "choose what moves")
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
    structure = _dense_or_sparse(rest)
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


@dataclass(frozen=True)
class Parameters:
    """Matrices from a file, and the degrees of freedom in contact."""

    file: File = file(
        "file with entries mass, stiffness and others, see entries of a file of matrices",
        files=files_of,
    )
    contact: Choice = label(
        "degree of freedom that touches the casing by its label or index (from 0), or the name of a vector in the "
        "file; of several contacts a list, or the name of an entry with a row for each; the file's `contact` where "
        "left out",
        default=None,
        many=True,
    )
    thermal_contact: Choice = label(
        "temperature that takes the contact heat, or the name of a vector of shares; of several contacts as `contact`; "
        "the file's where left out",
        default=None,
        many=True,
    )
    tangent: Choice = label(
        "direction in which the casing slides, by the label or index of a degree of freedom or the name of a vector in "
        "the file, of several contacts as `contact`: with `friction.coefficient` µ the contact force acts along "
        "contact - µ tangent; the file's where left out",
        default=None,
        later=True,
        many=True,
    )
    units: Literal["SI", "mm-t-s"] = "SI"
    damping: Rayleigh = field(default_factory=Rayleigh)
    speed: float = speed()


def depends_on_speed(parameters: Parameters) -> bool:
    """Tell whether a file has an entry that counts times Ω²; of one that cannot be read assembling says why."""
    try:
        return any(name in _entries(parameters.file) for name in SPEED2)
    except UnusableMatricesError:
        return False


def _entries(of: File) -> dict[str, Any]:
    """Return the entries of a file; those of the last one that a study has read are kept for its other speeds."""
    return _kept(of) if of.contents else read_entries(Path(of.place))


@lru_cache(maxsize=1)
def _kept(of: File) -> dict[str, Any]:
    return read_entries(Path(of.place))


def assemble(parameters: Parameters) -> Matrices:
    """Return the structure of equations (1a) and (1b), its last coordinate the contact; sparse above 300 coordinates.

    Raises
    ------
    UnusableMatricesError
        The file, or the study's choice from it, does not describe a structure.
    """
    entries = in_si(_entries(parameters.file), parameters.units)
    if parameters.file.shaken != 0:
        entries = shaken(entries, parameters.file.shaken)
    chosen = Chosen(parameters.contact, parameters.thermal_contact, parameters.tangent)
    with turning_at(parameters.speed):
        given, contacts = given_by(entries, chosen, parameters.damping, 2 * np.pi * parameters.speed)
        structure = with_contacts(with_held_left_out(given), contacts)
        if parameters.speed and structure.is_sparse and not is_definite(structure.mechanical.stiffness):
            raise UnusableMatricesError("K1 + Ω² K_Ω is not positive definite", "check `stiffness_speed2`")
    return structure


def labels(parameters: Parameters, of_heat: bool) -> tuple[str, ...]:
    """Return the labels of the displacements, or temperatures, of the file."""
    return labels_of(_entries(parameters.file), of_heat)


def sensor_rows(parameters: Parameters, sensors: tuple[Sensor, ...], structure: Structure) -> list[Array]:
    """Return the rows of sensors in the coordinates of the file.

    Raises
    ------
    UnusableMatricesError
        The file has no such label, index or vector.
    """
    entries = _entries(parameters.file)
    return [row_of(entries, sensor) for sensor in sensors]


def _dense_or_sparse(given: GivenMatrices) -> Matrices:
    large = max(given.mass.shape[0], given.heat_capacity.shape[0]) > MOST_BY_JACOBI
    return structure_from_sparse(given) if large else structure_from_matrices(given)


def read_matrices(path: str | Path) -> dict[str, Any]:
    """Return the entries of any file that a study may name, matrices dense or SciPy's sparse ones, in its own units.

    Raises
    ------
    ValueError
        It cannot be used, or a file that belongs to it is missing.
    """
    files_of(Path(path))
    return read_entries(Path(path))


def write_matrices(
    path: str | Path, *, mass: Any, stiffness: Any, vectors: Mapping[str, Any] | None = None, **entries: Any
) -> Path:
    """Check the matrices of a structure and write them as NPZ, in the units that the study will state.

    M x'' + C1 x' + K1 x + K12 θ = f and C2 θ' + K2 θ = q: where heat lengthens a blade, entries of K12 are negative.

    Parameters
    ----------
    path
        Path of the file; it ends in ``.npz``.
    mass, stiffness
        M and K1, dense arrays or SciPy's sparse ones, (displacement, displacement).
    entries
        Others that the reference of studies lists with shape and unit, under "Entries of a file of matrices":
        ``damping``, ``heat_capacity``, ``conductance``, ``coupling``, ``contact``, ``load``, ``labels`` and more.
    vectors
        Others by names of your own, (displacement,) or (temperature,), which a study names as contacts or sensors.

    Raises
    ------
    UnusableMatricesError
        An entry is wrong; the message says which, and what would be right.
    """
    place = Path(path)
    given = {"mass": mass, "stiffness": stiffness, **entries}
    if place.suffix.lower() != ".npz":
        raise UnusableMatricesError(f"`{place.name}` is no NPZ file", "end its name in .npz")
    unknown = sorted(set(given) - set(ENTRIES))
    if unknown:
        remedy = f"entries are {', '.join(ENTRIES)}; vectors of your own names go into `vectors`"
        raise UnusableMatricesError(f"no entry is called {', '.join(unknown)}", remedy)
    _check(given)
    arrays: dict[str, Any] = {}
    for name, value in given.items():
        if hasattr(value, "tocsr") and name in MATRICES:
            rows = value.tocsr()
            arrays |= {f"{name}.{part}": getattr(rows, part) for part in ("data", "indices", "indptr", "shape")}
        else:  # a contact may be an index or a label
            plain = in_unicode(name, np.asarray(value.toarray() if hasattr(value, "toarray") else value))
            arrays[name] = plain.astype(str if name in LABELS else plain.dtype if plain.size == 1 else float)
    np.savez_compressed(place, **arrays, **_own_vectors(vectors or {}, given))
    return place


def _own_vectors(vectors: Mapping[str, Any], given: Mapping[str, Any]) -> dict[str, Any]:
    """Return vectors of names of their own as arrays, each with a number for each displacement or temperature."""
    sizes = {np.shape(given[name])[0] for name in ("mass", "heat_capacity") if name in given}
    arrays = {str(name): np.asarray(vector, dtype=float) for name, vector in vectors.items()}
    taken = {
        *ENTRIES,
        "file",
        "allow_pickle",
        *(str(text) for name in LABELS for text in np.ravel(given.get(name, ()))),
    }
    for name, array in arrays.items():
        if not name or name in taken or PART.fullmatch(name) or not name.isprintable():
            raise UnusableMatricesError(f"{name!r} is no name of a vector", "choose one that is no entry and no label")
        if array.ndim != 1 or array.size not in sizes or not np.isfinite(array).all():
            numbers = " or ".join(map(str, sorted(sizes)))
            raise UnusableMatricesError(f"`{name}` has the shape {array.shape}", f"write {numbers} finite numbers")
    return arrays


def _check(given: dict[str, Any]) -> None:
    """Check the entries as the model does, except contacts, which the study may name."""
    checked = given
    if "contact" not in given:
        some = {"contact": np.eye(1, (*np.shape(given["mass"]), 1)[0])}
        checked = {name: value for name, value in given.items() if name != "tangent"} | some
    if "thermal_contact" not in given and "heat_capacity" in given:
        count = len(given["contact"]) if len(np.shape(given.get("contact", 0))) == 2 else 1
        shares = np.repeat(np.eye(1, (*np.shape(given["heat_capacity"]), 1)[0]), count, axis=0)
        checked = {**checked, "thermal_contact": shares}
    given_by(checked, Chosen(), Rayleigh())
