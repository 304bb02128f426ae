"""Entries of a file of matrices: one table, their check and conversion to SI, perturbed ones, and their writer."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._from_matrices import ASYMMETRY, COLD, GivenMatrices
from workflow.models._matrix_files import LABELS, MATRICES, VECTORS, Entries
from workflow.models._pair import UnusableMatricesError
from workflow.models._structure import Rayleigh

_WHOLE = 1e-9
"""Accepted deviation of a sum of weights from 1: rounding of many of them."""

_TO_SI = {
    "mass": 1e3,
    "stiffness": 1e3,
    "damping": 1e3,
    "coupling": 1.0,
    "heat_capacity": 1e-3,
    "conductance": 1e-3,
    "heating": 1e-3,
    "residual_flexibility": 1e-3,
    "residual_tangent": 1e-3,
    "residual_coupling": 1e-3,
    "residual_load": 1e-3,
}
"""Factors from t, N/mm, N s/mm, N/K, mJ/K, mW/K, mW, mm/N and mm/K."""


def in_si(entries: Entries, units: str) -> dict[str, Any]:
    """Return entries in SI."""
    if units == "SI":
        return dict(entries)
    return {name: value * _TO_SI[name] if name in _TO_SI else value for name, value in entries.items()}


class Chosen(NamedTuple):
    """A study's choice from a file: labels, indices or names of vectors; ``None`` for the file's own entry."""

    contact: str | int | None = None
    thermal_contact: str | int | None = None
    tangent: str | int | None = None


def checked_matrices(entries: Entries, chosen: Chosen, damping: Rayleigh) -> GivenMatrices:
    """Return the matrices of entries in SI, all of them sparse.

    Raises
    ------
    UnusableMatricesError
        An entry is missing or wrong.
    """
    if "mass" not in entries or "stiffness" not in entries:
        problem = f"it has no `{'stiffness' if 'mass' in entries else 'mass'}`"
        remedy = f"write `mass` and `stiffness`; it has {', '.join(entries) or 'nothing'}"
        raise UnusableMatricesError(problem, remedy)
    mass = _symmetric(entries, "mass")
    size = mass.shape[0]
    labels = _texts("labels", entries, size)
    normal = _direction(chosen.contact, "contact", entries, labels, size)
    damper = _symmetric(entries, "damping", size) if "damping" in entries else None
    if damper is not None and damping != Rayleigh():
        raise UnusableMatricesError("it has a `damping`, and the study has one too", "keep one of them")
    return GivenMatrices(
        damper=damper,
        load=_nonzero("load", _vector("load", entries, size)) if "load" in entries else None,
        mass=mass,
        stiffness=_symmetric(entries, "stiffness", size),
        contact=normal,
        tangent=_tangent(entries, labels, chosen.tangent, normal),
        damping=damping,
        steady=_vector("steady", entries, size),
        labels=labels,
        **_heat(entries, labels, chosen.thermal_contact, normal),
    )


def _heat(entries: Entries, labels: Sequence[str], chosen: str | int | None, contact: Array) -> dict[str, Any]:
    """Return the thermal entries; for a file without temperatures a single one that stays 0 without any effect."""
    size, own = contact.size, ("heat_capacity", "conductance", "coupling")
    if not any(name in entries for name in own):
        one, none = scipy.sparse.csc_array(np.ones((1, 1))), scipy.sparse.csc_array((size, 1))
        cold = {"heat_capacity": COLD * one, "conductance": 0 * one, "coupling": none}
        return {**cold, "thermal_contact": np.ones(1), "heating": np.zeros(1)}
    for name in own[:2]:
        if name not in entries:
            remedy = "write both of heat_capacity and conductance, or neither and no coupling"
            raise UnusableMatricesError(f"it has no `{name}`", remedy)
    capacity = _symmetric(entries, "heat_capacity")
    count = capacity.shape[0]
    coupling = _sparse("coupling", entries.get("coupling", scipy.sparse.csc_array((size, count))))
    if coupling.shape != (size, count):
        remedy = f"it must have a row per displacement and a column per temperature, {(size, count)}"
        raise UnusableMatricesError(f"`coupling` has the shape {coupling.shape}", remedy)
    return {
        "heat_capacity": capacity,
        "conductance": _symmetric(entries, "conductance", count),
        "coupling": coupling,
        "thermal_contact": _thermal_contact(entries, labels, chosen, contact, count),
        "heating": _vector("heating", entries, count),
    }


def _thermal_contact(
    entries: Entries, labels: Sequence[str], chosen: str | int | None, contact: Array, count: int
) -> Array:
    """Return the weights of the contact heat; by default those of a contact at one node, with as many temperatures."""
    own = _texts("thermal_labels", entries, count) or (labels if len(labels) == count else ())
    if chosen is None and "thermal_contact" not in entries and count == contact.size and np.count_nonzero(contact) == 1:
        return np.asarray(contact != 0, dtype=np.float64)
    shares = _direction(chosen, "thermal_contact", entries, own, count)
    if abs(shares.sum() - 1) > _WHOLE:
        raise UnusableMatricesError(
            f"the shares of `thermal_contact` are {float(shares.sum())!r} in sum", "they must be 1 in sum"
        )
    return shares


def _tangent(entries: Entries, labels: Sequence[str], chosen: str | int | None, normal: Array) -> Array | None:
    """Return the sliding direction, which must not be that of the contact; ``None`` where none is given."""
    if chosen is None and "tangent" not in entries:
        return None
    tangent = _direction(chosen, "tangent", entries, labels, normal.size)
    along = abs(tangent @ normal) / (np.linalg.norm(tangent) * np.linalg.norm(normal))
    if along > 1 - ASYMMETRY:
        problem, remedy = "`tangent` is the direction of the contact", "write the direction in which the casing slides"
        raise UnusableMatricesError(problem, remedy)
    return tangent


def _direction(chosen: str | int | None, name: str, entries: Entries, labels: Sequence[str], size: int) -> Array:
    """Return the vector, ``(size,)``, of a label, an index (from 0) or the name of a vector.

    ``chosen`` is the study's; for ``None`` it is the entry ``name`` of the file, which may be any of these.
    """
    if chosen is None:
        if name not in entries:
            remedy = "write a label, an index or a vector"
            raise UnusableMatricesError(f"`{name}` is given neither in the study nor in the file", remedy)
        value = entries[name].toarray() if hasattr(entries[name], "toarray") else np.asarray(entries[name])
        if value.size == 0:
            raise UnusableMatricesError(f"`{name}` is empty", "write a label, an index or a vector, or leave it out")
        if value.size > 1 or (size == 1 and value.dtype.kind == "f"):
            return _nonzero(name, _vector(name, entries, size))
        is_index = value.dtype.kind in "iu" or (value.dtype.kind == "f" and float(value.item()).is_integer())
        chosen = int(value.item()) if is_index else str(value.item())
    if isinstance(chosen, str):
        if chosen not in labels:
            vectors = [entry for entry in entries if entry not in (*MATRICES, *LABELS)]
            if chosen in vectors:
                return _nonzero(chosen, _vector(chosen, entries, size))
            own = [entry for entry in vectors if entry == name or entry not in VECTORS]
            near = get_close_matches(chosen, labels, 5) or labels[:5]
            some = ", ".join(f"`{text}`" for text in (*own, *near)) + ", …" * (len(labels) > len(near))
            remedy = f"write {some + ' or ' if some else ''}an index from 0 to {size - 1}"
            raise UnusableMatricesError(f"`{name}: {chosen}` is neither a label nor a vector of the file", remedy)
        chosen = list(labels).index(chosen)
    if not 0 <= chosen < size:
        raise UnusableMatricesError(f"`{name}: {chosen}` is no index", f"write one from 0 to {size - 1}")
    unit = np.zeros(size)
    unit[chosen] = 1.0
    return unit


def _numbers(name: str, value: Any) -> Array:
    """Return a value as finite real numbers."""
    array = np.asarray(value)
    if array.dtype.kind not in "fiub":
        raise UnusableMatricesError(f"`{name}` holds no real numbers", "write real numbers")
    if not np.isfinite(array).all():
        raise UnusableMatricesError(f"`{name}` has an entry that is not finite", "write finite numbers")
    return array.astype(np.float64)


def _sparse(name: str, value: Any) -> scipy.sparse.csc_array:
    """Return a matrix of finite numbers in compressed columns."""
    matrix = scipy.sparse.csc_array(value if scipy.sparse.issparse(value) else _numbers(name, value))
    matrix.sum_duplicates()
    matrix.data = _numbers(name, matrix.data)
    return matrix


def _symmetric(entries: Entries, name: str, size: int | None = None) -> scipy.sparse.csc_array:
    """Return a symmetric matrix with ``size`` rows, the mean of its two halves."""
    shape = np.shape(entries[name])
    if len(shape) != 2 or shape[0] != shape[1] or not shape[0] or shape[0] != (size or shape[0]):
        remedy = f"it must have {size} rows and columns" if size else "it must be square"
        raise UnusableMatricesError(f"`{name}` has the shape {shape}", remedy)
    matrix = _sparse(name, entries[name])
    across, magnitudes = matrix.T.tocsc(), abs(matrix)
    largest = np.maximum(magnitudes.max(axis=0).toarray().ravel(), magnitudes.max(axis=1).toarray().ravel())
    apart = abs(matrix - across).tocoo()
    wrong = np.flatnonzero(apart.data > ASYMMETRY * np.maximum(largest[apart.row], largest[apart.col]))
    if wrong.size:
        row, column = int(apart.row[wrong[0]]), int(apart.col[wrong[0]])
        both = f"{float(matrix[row, column])!r} at ({row}, {column}), {float(matrix[column, row])!r} across"
        remedy = "write both halves alike: (K + K.T)/2 if rounding is all that they differ by"
        raise UnusableMatricesError(f"`{name}` is not symmetric: {both}", remedy)
    return scipy.sparse.csc_array((matrix + across) / 2)


def _vector(name: str, entries: Entries, size: int) -> Array:
    """Return a vector with an entry per degree of freedom, zeros where the file has none."""
    value = entries.get(name, np.zeros(size))
    array = _numbers(name, value.toarray() if hasattr(value, "toarray") else value)
    if array.size != size or array.ndim > 2 or (array.ndim == 2 and 1 not in array.shape):
        remedy = f"it must have {size} entries, as the matrices have rows"
        raise UnusableMatricesError(f"`{name}` has the shape {array.shape}", remedy)
    return array.ravel()


def _nonzero(name: str, values: Array) -> Array:
    if not np.any(values):
        raise UnusableMatricesError(f"`{name}` is zero everywhere", "write what it acts on")
    return values


def _texts(name: str, entries: Entries, size: int) -> tuple[str, ...]:
    """Return labels, one per degree of freedom, all different; none where the file has none."""
    if name not in entries:
        return ()
    labels = tuple(str(text).strip() for text in np.asarray(entries[name]).astype(str).ravel())
    if len(labels) != size:
        raise UnusableMatricesError(f"`{name}` has {len(labels)} labels", f"write {size}, as the matrices have rows")
    if len(set(labels)) < size:
        twice = next(label for label in labels if labels.count(label) > 1)
        raise UnusableMatricesError(f"`{name}` has {twice[:40]!r} twice", "name each degree of freedom once")
    return labels


ROUNDED = float(np.finfo(float).eps)
"""Relative perturbation of a single entry."""


def shaken(entries: Entries, share: float) -> dict[str, Any]:
    """Return the entries of a file with matrices and vectors perturbed by a share of either sign, and its labels."""
    changed = dict(entries)
    for k, name in enumerate(MATRICES):
        if name in changed:
            own = share if k % 2 == 0 else -share
            changed[name] = _changed(changed[name], 1 + own, float(np.copysign(ROUNDED, own)))
    for name in VECTORS:
        if np.size(changed.get(name, 0)) > 1 and np.asarray(changed[name]).dtype.kind == "f":  # one is an index
            changed[name] = changed[name] * (
                1 + share * _signs(np.size(changed[name])).reshape(np.shape(changed[name]))
            )
    return changed


def _changed(matrix: Any, factor: float, rounded: float) -> Any:
    rows, columns = (_signs(length) for length in np.shape(matrix))
    if not scipy.sparse.issparse(matrix):
        return matrix * (factor + rounded * np.multiply.outer(rows, columns))
    return matrix * factor + scipy.sparse.diags_array(rows * rounded) @ matrix @ scipy.sparse.diags_array(columns)


def _signs(size: int) -> Any:
    return np.random.default_rng(size).choice([-1.0, 1.0], size)
