"""Entries of a file of matrices, checked and brought to SI: shapes, symmetry, numbers, labels, the contact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._from_matrices import COLD, GivenMatrices
from workflow.models._matrix_files import LABELS, MATRICES, Entries, refuse
from workflow.models._structure import Rayleigh

ASYMMETRY = 1e-10
"""Share of the largest entry of a row and column by which a matrix may miss symmetry: that of assembly in another
order, or of files with eleven digits. The mean of both halves is used."""

_WHOLE = 1e-9
"""By which shares may miss 1 in sum: rounding of many of them."""

_TO_SI = {
    "mass": 1e3,
    "stiffness": 1e3,
    "damping": 1e3,
    "coupling": 1.0,
    "heat_capacity": 1e-3,
    "conductance": 1e-3,
    "heating": 1e-3,
}
"""From t, N/mm, N s/mm, N/K, mJ/K, mW/K and mW."""


def dense(name: str, value: Any) -> Array:
    """Return a matrix or vector as a dense array of finite numbers."""
    if hasattr(value, "toarray"):
        value = value.toarray()
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise refuse(f"`{name}` holds no real numbers", "write real numbers")
    array = array.astype(np.float64)
    if not np.isfinite(array).all():
        raise refuse(f"`{name}` has an entry that is not finite", "write finite numbers")
    return array


def is_large(value: Any) -> bool:
    """Tell whether a matrix has more rows or columns than dense portable arrays are made of."""
    return len(np.shape(value)) == 2 and max(np.shape(value)) > MOST_BY_JACOBI


def square(name: str, value: Any, size: int | None = None) -> Any:
    """Return a symmetric matrix, its two halves averaged; of many rows as a sparse one."""
    shape = np.shape(value)
    if len(shape) != 2 or shape[0] != shape[1] or not shape[0]:
        raise refuse(f"`{name}` has the shape {shape}", "it must be square")
    if size is not None and shape[0] != size:
        raise refuse(f"`{name}` has {shape[0]} rows", f"it must have {size}, as the matrices beside it")
    matrix = sparse_matrix(name, value)
    across, magnitudes = matrix.T.tocsc(), abs(matrix)
    largest = np.maximum(magnitudes.max(axis=0).toarray().ravel(), magnitudes.max(axis=1).toarray().ravel())
    apart = abs(matrix - across).tocoo()
    wrong = np.flatnonzero(apart.data > ASYMMETRY * np.maximum(largest[apart.row], largest[apart.col]))
    if wrong.size:
        row, column = int(apart.row[wrong[0]]), int(apart.col[wrong[0]])
        raise refuse(
            f"`{name}` is not symmetric: {matrix[row, column]:g} at ({row}, {column}), {matrix[column, row]:g} across",
            "write both halves alike",
        )
    mean = scipy.sparse.csc_array((matrix + across) / 2)
    return mean if is_large(value) else mean.toarray()


def sparse_matrix(name: str, value: Any) -> scipy.sparse.csc_array:
    """Return a matrix of finite numbers by its columns."""
    matrix = scipy.sparse.csc_array(value if scipy.sparse.issparse(value) else dense(name, value))
    matrix.sum_duplicates()
    matrix.data = dense(name, matrix.data)
    return matrix


def vector(name: str, value: Any, size: int) -> Array:
    """Return a vector with an entry per degree of freedom."""
    array = dense(name, value)
    if array.size != size or array.ndim > 2 or (array.ndim == 2 and 1 not in array.shape):
        raise refuse(f"`{name}` has the shape {array.shape}", f"it must have {size} entries, as the matrices have rows")
    return array.ravel()


def texts(name: str, value: Any, size: int) -> tuple[str, ...]:
    """Return labels, one per degree of freedom, all different."""
    labels = tuple(str(text).strip() for text in np.asarray(value).astype(str).ravel())
    if len(labels) != size:
        raise refuse(f"`{name}` has {len(labels)} labels", f"write {size}, as the matrices have rows")
    if len(set(labels)) < size:
        twice = next(label for label in labels if labels.count(label) > 1)
        raise refuse(f"`{name}` has {twice[:40]!r} twice", "name each degree of freedom once")
    return labels


def direction(chosen: str | int | None, name: str, entries: Entries, labels: Sequence[str], size: int) -> Array:
    """Return the vector that a label, an index (from 0) or the name of a vector stands for.

    Parameters
    ----------
    chosen
        As the study has it; ``None`` stands for the entry ``name`` of the file, which may be an index or a label too.
    name
        Entry to read: ``contact``, ``thermal_contact`` or ``tangent``.
    entries, labels
        Of the file.
    size
        Number of degrees of freedom.
    """
    if chosen is None:
        if name not in entries:
            raise refuse(
                f"`{name}` is given neither in the study nor in the file", "write a label, an index or a vector"
            )
        value = np.asarray(entries[name]) if not hasattr(entries[name], "toarray") else entries[name].toarray()
        if value.size > 1 or (size == 1 and value.dtype.kind == "f"):
            return _nonzero(name, vector(name, value, size))
        chosen = int(value.ravel()[0]) if value.dtype.kind in "iu" else str(value.ravel()[0])
    if isinstance(chosen, str):
        if chosen in labels:
            chosen = list(labels).index(chosen)
        elif chosen in entries and chosen not in (*MATRICES, *LABELS):
            return _nonzero(chosen, vector(chosen, entries[chosen], size))
        else:
            raise refuse(
                f"`{name}: {chosen}` is neither a label nor a vector of the file", _remedy(entries, labels, size)
            )
    if not 0 <= chosen < size:
        raise refuse(f"`{name}: {chosen}` is no index", f"write one from 0 to {size - 1}")
    unit = np.zeros(size)
    unit[chosen] = 1.0
    return unit


def _remedy(entries: Entries, labels: Sequence[str], size: int) -> str:
    vectors = [name for name in entries if name not in (*MATRICES, *LABELS)]
    some = [f"`{text}`" for text in (*vectors, *labels[:5])]
    named = f"{', '.join(some)}{', …' if len(labels) > 5 else ''} or " if some else ""
    return f"write {named}an index from 0 to {size - 1}"


def _nonzero(name: str, values: Array) -> Array:
    if not np.any(values):
        raise refuse(f"`{name}` is zero everywhere", "write what it acts on")
    return values


def in_si(entries: Entries, units: str) -> dict[str, Any]:
    """Return entries in SI."""
    if units == "SI":
        return dict(entries)
    return {name: value * _TO_SI[name] if name in _TO_SI else value for name, value in entries.items()}


class Chosen(NamedTuple):
    """What a study chooses from a file: labels, indices or names of vectors; ``None`` for the file's own entry."""

    contact: str | int | None = None
    thermal_contact: str | int | None = None
    tangent: str | int | None = None


def checked_matrices(entries: Entries, chosen: Chosen, damping: Rayleigh) -> GivenMatrices:
    """Return the matrices of checked entries in SI.

    Raises
    ------
    UnusableMatricesError
        An entry is missing or wrong.
    """
    for name in ("mass", "stiffness"):
        if name not in entries:
            raise refuse(
                f"it has no `{name}`", f"write `mass` and `stiffness`; it has {', '.join(entries) or 'nothing'}"
            )
    mass = square("mass", entries["mass"])
    size = mass.shape[0]
    stiffness = square("stiffness", entries["stiffness"], size)
    labels = texts("labels", entries["labels"], size) if "labels" in entries else ()
    normal = direction(chosen.contact, "contact", entries, labels, size)
    heat = _heat(entries, labels, chosen.thermal_contact, normal)
    damper = square("damping", entries["damping"], size) if "damping" in entries else None
    if damper is not None and damping != Rayleigh():
        raise refuse("it has a `damping`, and the study has one too", "keep one of them")
    return GivenMatrices(
        damper=damper,
        load=_nonzero("load", vector("load", entries["load"], size)) if "load" in entries else None,
        mass=mass,
        stiffness=stiffness,
        contact=normal,
        tangent=_tangent(entries, labels, chosen.tangent, normal),
        damping=damping,
        steady=vector("steady", entries["steady"], size) if "steady" in entries else np.zeros(size),
        labels=labels,
        **heat,
    )


def _tangent(entries: Entries, labels: Sequence[str], chosen: str | int | None, normal: Array) -> Array | None:
    """Return the direction of friction, which must not be that of the contact; ``None`` where nobody gives one."""
    if chosen is None and "tangent" not in entries:
        return None
    tangent = direction(chosen, "tangent", entries, labels, normal.size)
    along = abs(tangent @ normal) / (np.linalg.norm(tangent) * np.linalg.norm(normal))
    if along > 1 - ASYMMETRY:
        raise refuse("`tangent` is the direction of the contact", "write the direction in which the casing slides")
    return tangent


def has_heat(entries: Entries) -> bool:
    """Tell whether a file describes temperatures."""
    return any(name in entries for name in ("heat_capacity", "conductance", "coupling"))


def _heat(
    entries: Entries, labels: Sequence[str], thermal_contact: str | int | None, contact: Array
) -> dict[str, Array]:
    """Return what is about temperatures; of a file without them a single one that stays 0 and moves nothing."""
    size = contact.size
    if not has_heat(entries):
        one = np.ones((1, 1))
        none = {"coupling": np.zeros((size, 1)), "conductance": 0 * one, "heating": np.zeros(1)}
        return {"heat_capacity": COLD * one, "thermal_contact": np.ones(1), **none}
    for name in ("heat_capacity", "conductance"):
        if name not in entries:
            raise refuse(
                f"it has no `{name}`", "write both of heat_capacity and conductance, or neither and no coupling"
            )
    capacity = square("heat_capacity", entries["heat_capacity"])
    count = capacity.shape[0]
    coupling: Any = (
        scipy.sparse.csc_array((size, count)) if max(size, count) > MOST_BY_JACOBI else np.zeros((size, count))
    )
    if "coupling" in entries:
        written = entries["coupling"]
        coupling = sparse_matrix("coupling", written) if is_large(written) else dense("coupling", written)
        if coupling.shape != (size, count):
            remedy = f"it must have a row per displacement and a column per temperature, {(size, count)}"
            raise refuse(f"`coupling` has the shape {coupling.shape}", remedy)
    return {
        "heat_capacity": capacity,
        "conductance": square("conductance", entries["conductance"], count),
        "coupling": coupling,
        "thermal_contact": _thermal_contact(entries, labels, thermal_contact, contact, count),
        "heating": vector("heating", entries["heating"], count) if "heating" in entries else np.zeros(count),
    }


def _thermal_contact(
    entries: Entries, labels: Sequence[str], chosen: str | int | None, contact: Array, count: int
) -> Array:
    """Return the shares of the contact heat; where nobody says, those of a contact at one of as many temperatures."""
    own = texts("thermal_labels", entries["thermal_labels"], count) if "thermal_labels" in entries else ()
    if chosen is None and "thermal_contact" not in entries and count == contact.size and np.count_nonzero(contact) == 1:
        return np.asarray(contact != 0, dtype=np.float64)
    shares = direction(chosen, "thermal_contact", entries, own or (labels if len(labels) == count else ()), count)
    if abs(shares.sum() - 1) > _WHOLE:
        raise refuse(f"the shares of `thermal_contact` are {shares.sum():g} in sum", "they must be 1 in sum")
    return shares
