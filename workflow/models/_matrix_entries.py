"""Entries of a file of matrices: their check and conversion to SI, the rows of contacts, and perturbed ones.

A contact is a row of the displacements: a label or an index stands for a row with a single 1, an entry of the file for
one row or several. Directions of sliding and shares of heat are rows beside them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import scipy
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.models._contacts import Contacts, checked_contacts
from workflow.models._factors import is_definite
from workflow.models._from_matrices import ASYMMETRY, GivenMatrices
from workflow.models._matrix_files import (
    ENTRIES,
    LABELS,
    MATRICES,
    ROWS,
    SPEED2,
    STRUCTURAL,
    VECTORS,
    Entries,
    in_unicode,
)
from workflow.models._pair import UnusableMatricesError
from workflow.models._sensors import Sensor
from workflow.models._structure import COLD, Rayleigh

_WHOLE = 1e-9
"""Accepted deviation of a sum of weights from 1: rounding of many of them."""

_SINGLE = 1e-6
"""Negative part of a damping matrix, over its diagonal, up to which it is the rounding of entries of seven digits."""

_TO_SI = {
    **dict.fromkeys(("kg", "N/m", "N s/m", "N s²/(m rad²)"), 1e3),
    **dict.fromkeys(("J/K", "W/K", "W", "m/N", "m/K", "m"), 1e-3),
}
"""Factors from t, N/mm, N s/mm, mJ/K, mW/K, mW, mm/N, mm/K and mm, by the unit."""


def in_si(entries: Entries, units: str) -> dict[str, Any]:
    """Return entries in SI."""
    if units == "SI":
        return dict(entries)
    factors = {name: _TO_SI[entry.unit] for name, entry in ENTRIES.items() if entry.unit in _TO_SI}
    return {name: value * factors[name] if name in factors else value for name, value in entries.items()}


Choice = str | int | tuple[str | int, ...] | None
"""Labels, indices or names of entries; ``None`` for the file's own entry."""


class Chosen(NamedTuple):
    """A study's choice from a file, of several contacts a list of labels and indices, or an entry with their rows."""

    contact: Choice = None
    thermal_contact: Choice = None
    tangent: Choice = None


def given_by(
    entries: Entries,
    chosen: Chosen,
    damping: Rayleigh,
    angular: float = 0.0,
    warmth: Array | None = None,
    residual: str = "residual_flexibility",
) -> tuple[GivenMatrices, Contacts]:
    """Return the matrices of entries in SI, all of them sparse, and the contacts; the first is that of the matrices.

    They are those at an angular speed Ω [rad/s]: K1 + Ω² K_Ω and the constant load f + Ω² r. Temperatures of a uniform
    rise by 1 K are 1 unless ``warmth`` says others; what a study calls the ``residual`` stands in messages.

    Raises
    ------
    UnusableMatricesError
        An entry is missing or wrong.
    """
    if "mass" not in entries or "stiffness" not in entries:
        problem = f"it has no `{'stiffness' if 'mass' in entries else 'mass'}`"
        remedy = f"write `mass` and `stiffness`; it has {', '.join(entries) or 'nothing'}"
        raise UnusableMatricesError(problem, remedy)
    mass = symmetric_entry(entries, "mass")
    size = mass.shape[0]
    labels, heat = _texts("labels", entries, size), _heat(entries, size)
    contacts = _contacts(entries, chosen, labels, (size, 0 if heat is None else len(heat["heating"])))
    total = max(contacts.heat.sum(axis=1).tolist(), key=lambda total: abs(total - 1))
    if warmth is None and abs(total - 1) > _WHOLE:
        raise UnusableMatricesError(f"the shares of `thermal_contact` are {total!r} in sum", "they must be 1 in sum")
    contacts = checked_contacts(contacts, residual)
    stiffness, steady = symmetric_entry(entries, "stiffness", size), _vector("steady", entries, size)
    if SPEED2[0] in entries:
        turning = symmetric_entry(entries, SPEED2[0], size)
        stiffness = stiffness + angular**2 * turning if angular else stiffness
    steady = steady + angular**2 * _vector(SPEED2[1], entries, size) if SPEED2[1] in entries else steady
    damper = _dissipative(symmetric_entry(entries, "damping", size)) if "damping" in entries else None
    if damper is not None and damping != Rayleigh():
        raise UnusableMatricesError("it has a `damping`, and the study has one too", "keep one of them")
    if STRUCTURAL in entries and damping == Rayleigh():
        problem = "it has structural damping (K4AAX, DMPS), which has no motion in time"
        raise UnusableMatricesError(problem, "state `damping: {ratio: …}`, half of the loss factor, or leave it out")
    load = np.zeros(size) if contacts.count > 1 else None  # there is no one contact that it would act along
    given = GivenMatrices(
        damper=damper,
        load=_nonzero("load", _vector("load", entries, size)) if "load" in entries else load,
        mass=mass,
        stiffness=stiffness,
        contact=contacts.normal[0],
        thermal_contact=contacts.heat[0],
        damping=damping,
        steady=steady,
        labels=labels,
        uniform_rise=warmth,
        **(_cold(size) if heat is None else heat),
    )
    return given, contacts


def _dissipative(damper: scipy.sparse.csc_array) -> scipy.sparse.csc_array:
    """Return a damping matrix that is positive semi-definite beyond rounding; any other one drives some motion."""
    diagonal = damper.diagonal()
    acts = np.flatnonzero(abs(damper).sum(axis=0))
    own = damper[acts][:, acts] + scipy.sparse.diags_array(_SINGLE * diagonal[acts])
    if not (np.all(diagonal[acts] > 0) and (not acts.size or is_definite(scipy.sparse.csc_array(own)))):
        problem = "`damping` is not positive semi-definite: it would drive some motion"
        raise UnusableMatricesError(problem, "check its signs, as damping forces are C1 x' on the left of equation 1a")
    return damper


def _heat(entries: Entries, size: int) -> dict[str, Any] | None:
    """Return the thermal entries; ``None`` for a file without temperatures."""
    own = ("heat_capacity", "conductance", "coupling")
    if not any(name in entries for name in own):
        return None
    for name in own[:2]:
        if name not in entries:
            remedy = "write both of heat_capacity and conductance, or neither and no coupling"
            raise UnusableMatricesError(f"it has no `{name}`", remedy)
    capacity = symmetric_entry(entries, "heat_capacity")
    count = capacity.shape[0]
    coupling = _sparse("coupling", entries.get("coupling", scipy.sparse.csc_array((size, count))))
    if coupling.shape != (size, count):
        remedy = f"it must have a row per displacement and a column per temperature, {(size, count)}"
        raise UnusableMatricesError(f"`coupling` has the shape {coupling.shape}", remedy)
    return {
        "heat_capacity": capacity,
        "conductance": symmetric_entry(entries, "conductance", count),
        "coupling": coupling,
        "heating": _vector("heating", entries, count),
    }


def _cold(size: int) -> dict[str, Any]:
    """Return a single temperature that stays 0 without any effect."""
    one, none = scipy.sparse.csc_array(np.ones((1, 1))), scipy.sparse.csc_array((size, 1))
    return {"heat_capacity": COLD * one, "conductance": 0 * one, "coupling": none, "heating": np.zeros(1)}


def _contacts(entries: Entries, chosen: Chosen, labels: Sequence[str], sizes: tuple[int, int]) -> Contacts:
    """Return the contacts in the coordinates of the file with ``sizes`` displacements and temperatures, 0 for cold."""
    size, heats = sizes
    contact, thermal_contact, sliding = (one[0] if isinstance(one, tuple) and len(one) == 1 else one for one in chosen)
    own = _labelled(entries, contact, labels, size)
    each = contact if isinstance(contact, tuple) else () if contact is None else (contact,)
    names = tuple(_as_label("contact", one, entries, labels, size, own) for one in each)
    if names and all(name in own for name in names):
        entries, contact = _rows_of(entries, names, tuple(own)), None
        own = {str(name): own[str(name)] for name in names}
    normal = _rows("contact", contact, entries, labels, size, own)
    count = len(normal)
    if contact is None or (isinstance(contact, str) and contact not in labels):
        names = tuple(own) if len(own) == count else tuple(range(1, count + 1))
    elif "residual_flexibility" in entries:
        problem = "contacts without mass are chosen by displacements, and the file has residuals by `contact_labels`"
        raise UnusableMatricesError(problem, "choose contacts by these labels")
    slides = sliding is not None or "tangent" in entries
    tangent = _beside("tangent", sliding, entries, labels, size, count) if slides else np.zeros_like(normal)
    heat = np.ones((count, 1))
    if heats:
        warm = labels_of(entries, of_heat=True)
        alone = thermal_contact is None and "thermal_contact" not in entries
        found = _own_temperatures(names, normal, warm, heats) if alone else None
        heat = _beside("thermal_contact", thermal_contact, entries, warm, heats, count) if found is None else found
    read = ROWS if "residual_flexibility" in entries else ("angle",)
    lengths = {"contact": count, "temperature": heat.shape[1]}
    values: dict[str, Any] = {
        name: _of_each(name, entries, tuple(lengths[axis] for axis in ROWS[name].axes)) for name in read
    }
    values["residual"] = values.pop("residual_flexibility", None)
    return Contacts(tuple(map(str, names)), normal, tangent, heat, **values)


def labels_of(entries: Entries, of_heat: bool) -> tuple[str, ...]:
    """Return the labels of the displacements of a file, or of its temperatures; none where it has none."""
    sizes = [np.shape(entries[name])[0] for name in ("mass", "heat_capacity") if name in entries]
    labels = _texts("labels", entries, sizes[0])
    own = _texts("thermal_labels", entries, sizes[-1]) if of_heat else labels
    return own or (labels if sizes[0] == sizes[-1] else ())


def row_of(entries: Entries, sensor: Sensor) -> Array:
    """Return the row of a sensor at a label, an index or a vector of the file, ``(coordinate,)``."""
    size = np.shape(entries["mass"])[0]
    labels, own = labels_of(entries, sensor.of_heat), _labelled(entries, None, (), size)
    if sensor.of_heat:
        if "heat_capacity" not in entries:
            raise UnusableMatricesError("the file has no temperatures", "choose a displacement")
        size, own = np.shape(entries["heat_capacity"])[0], {}
    rows = _rows("sensor", sensor.at, entries, labels, size, own)
    if len(rows) > 1:
        raise UnusableMatricesError(f"`{sensor.at}` has {len(rows)} rows", "choose a vector")
    return np.asarray(rows[0])


def _labelled(entries: Entries, chosen: Choice, labels: Sequence[str], size: int) -> dict[str, Array]:
    """Return the rows of the file's entry of contacts by their labels, none where it labels none."""
    name = chosen if isinstance(chosen, str) and "contact" not in entries else "contact"
    if "contact_labels" not in entries or name not in entries:
        return {}
    rows = _rows(name, None, entries, labels, size)
    return dict(zip(_texts("contact_labels", entries, len(rows)), rows, strict=True))


def _rows_of(entries: Entries, names: Sequence[str | int], own: Sequence[str]) -> Entries:
    """Return the entries of a file that has no contacts but those of some labels, of all its ``own``."""
    which, changed = [own.index(str(name)) for name in names], dict(entries)
    for name in {"contact", "thermal_contact", "tangent", *ROWS} & set(entries):
        value = _dense(entries[name])
        if name in ROWS and value.size % len(own) == 0:
            value = value.reshape(len(own), -1)
        elif value.ndim < 2 or (1 in value.shape and len(value) != len(own)):
            continue  # a label, an index or one vector
        if len(value) != len(own):
            raise UnusableMatricesError(f"`{name}` has {len(value)} rows", "write one for each row of `contact`")
        changed[name] = value[which][:, which] if ENTRIES[name].axes == ("contact", "contact") else value[which]
    return changed


def _beside(name: str, chosen: Choice, entries: Entries, labels: Sequence[str], size: int, count: int) -> Array:
    """Return the rows of sliding or of heat that go with so many contacts."""
    rows = _rows(name, chosen, entries, labels, size)
    if len(rows) != count:
        remedy = f"write one for each of {count}, and choose them by `contact_labels` where a file has more"
        raise UnusableMatricesError(f"`{name}` has {len(rows)} rows for {count} contacts", remedy)
    return rows


def _of_each(name: str, entries: Entries, shape: tuple[int, ...]) -> Array:
    """Return an entry with a number, or a row, for each contact; 0 where the file has none."""
    values = _numbers(name, entries.get(name, np.zeros(shape)))
    values = values.ravel() if len(shape) == 1 else np.atleast_2d(values)
    if values.shape != shape:
        remedy = f"write finite numbers of {shape}, a row for each contact, and choose these by `contact_labels`"
        raise UnusableMatricesError(f"`{name}` has the shape {values.shape}", remedy)
    return values


def _own_temperatures(names: Sequence[str | int], normal: Array, labels: Sequence[str], count: int) -> Array | None:
    """Return shares of the heat of contacts that each have a temperature, ``(contact, count)``; ``None`` for others.

    It is that of the contact's label, that of its one displacement where there are as many, or the only one.
    """
    shares = np.zeros((len(normal), count))
    for row, name, normal_row in zip(shares, names, normal, strict=True):
        at = np.flatnonzero(normal_row)
        if isinstance(name, str) and name in labels:
            row[list(labels).index(name)] = 1.0
        elif at.size == 1 and count == normal_row.size:
            row[at] = 1.0
        elif count == 1:
            row[0] = 1.0
        else:
            return None
    return shares


def _rows(
    name: str,
    chosen: Choice,
    entries: Entries,
    labels: Sequence[str],
    size: int,
    own: Mapping[str, Array] = MappingProxyType({}),
) -> Array:
    """Return the rows, ``(row, size)``, of a label, an index (from 0) or the name of an entry, or of a list of these.

    ``chosen`` is the study's; for ``None`` it is the entry ``name`` of the file, which may be any of these. ``own`` are
    rows with labels of their own.
    """
    if isinstance(chosen, tuple):
        each = [_rows(name, one, entries, labels, size, own) for one in chosen]
        for one, rows in zip(chosen, each, strict=True):
            if len(rows) > 1:
                raise UnusableMatricesError(f"`{name}: {one}` has {len(rows)} rows", "name it alone, not in a list")
        return np.vstack(each)
    if chosen is None:
        if name not in entries:
            remedy = "write a label, an index or a vector"
            raise UnusableMatricesError(f"`{name}` is given neither in the study nor in the file", remedy)
        value = _dense(entries[name])
        if value.size == 0:
            raise UnusableMatricesError(f"`{name}` is empty", "write a label, an index or a vector, or leave it out")
        if value.size > 1 or (size == 1 and value.dtype.kind == "f"):
            return _entry_rows(name, entries, size)
        is_index = value.dtype.kind in "iu" or (value.dtype.kind == "f" and float(value.item()).is_integer())
        chosen = int(value.item()) if is_index else str(value.item())
    chosen = _as_label(name, chosen, entries, labels, size, own)
    if isinstance(chosen, str):
        if chosen in own:
            return own[chosen][None]
        if chosen not in labels:
            vectors = [entry for entry in entries if entry not in (*MATRICES, *LABELS)]
            if chosen in vectors:
                return _entry_rows(chosen, entries, size)
            vectors = [entry for entry in vectors if entry == name or entry not in (*VECTORS, *ROWS)]
            near = get_close_matches(chosen, [*own, *labels], 5) or [*own, *labels][:5]
            more = ", …" * (len(own) + len(labels) > len(near))
            some = ", ".join(f"`{text}`" for text in (*vectors, *near)) + more
            remedy = f"write {some + ' or ' if some else ''}an index from 0 to {size - 1}"
            is_index = chosen.lstrip("-").isdecimal()
            problem = f"`{name}: {chosen}` is {'no index' if is_index else 'neither a label nor a vector of the file'}"
            raise UnusableMatricesError(problem, remedy)
        chosen = list(labels).index(chosen)
    unit = np.zeros((1, size))
    unit[0, chosen] = 1.0
    return unit


def _as_label(
    name: str, chosen: str | int, entries: Entries, labels: Sequence[str], size: int, own: Mapping[str, Array]
) -> str | int:
    """Return a choice as a text, but an integer that is an index and no label, nor the name of a vector.

    Raises
    ------
    UnusableMatricesError
        It is a label, and the index of another place.
    """
    text = str(chosen)
    if isinstance(chosen, int) and 0 <= chosen < size:
        if text not in {*own, *labels, *entries}:
            return chosen
        if np.flatnonzero(_rows(name, text, entries, labels, size, own)).tolist() != [chosen]:
            problem = f"`{name}: {text}` is the label of one place and the index of another"
            other = f', `"{labels[chosen]}"` for the index' if labels else ""
            raise UnusableMatricesError(problem, f'write `"{text}"` in quotes for the label{other}')
    return text


def _entry_rows(name: str, entries: Entries, size: int) -> Array:
    """Return a vector as one row, or the rows of a matrix with ``size`` columns."""
    shape = np.shape(entries[name])
    if len(shape) == 2 and shape[0] > 1 and shape[1] == size:
        return _numbers(name, entries[name])
    return _nonzero(name, _vector(name, entries, size))[None]


def _dense(value: Any) -> NDArray[Any]:
    return np.asarray(value.toarray() if hasattr(value, "toarray") else value)


def _numbers(name: str, value: Any) -> Array:
    """Return a value as finite real numbers."""
    array = _dense(value)
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


def symmetric_entry(entries: Entries, name: str, size: int | None = None) -> scipy.sparse.csc_array:
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
    array = _numbers(name, value)
    if array.size != size or array.ndim > 2 or (array.ndim == 2 and 1 not in array.shape):
        remedy = f"it must have {size} entries, as the matrices have rows"
        raise UnusableMatricesError(f"`{name}` has the shape {array.shape}", remedy)
    return array.ravel()


def _nonzero(name: str, values: Array) -> Array:
    if not np.any(values):
        raise UnusableMatricesError(f"`{name}` is zero everywhere", "write what it acts on")
    return values


def _texts(name: str, entries: Entries, size: int) -> tuple[str, ...]:
    """Return labels, one per degree of freedom or contact, all different; none where the file has none."""
    if name not in entries:
        return ()
    labels = tuple(str(text).strip() for text in in_unicode(name, np.asarray(entries[name])).astype(str).ravel())
    each, rows = "degree of freedom", "the matrices have"
    if name == "contact_labels":
        each, rows = "contact", "`contact` has"
    if len(labels) != size:
        raise UnusableMatricesError(f"`{name}` has {len(labels)} labels", f"write {size}, as {rows} rows")
    for label in labels:
        if not label.isprintable():
            raise UnusableMatricesError(f"`{name}` has {label[:40]!r}", "write labels of printable characters")
    if len(set(labels)) < size:
        twice = next(label for label in labels if labels.count(label) > 1)
        raise UnusableMatricesError(f"`{name}` has {twice[:40]!r} twice", f"name each {each} once")
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
