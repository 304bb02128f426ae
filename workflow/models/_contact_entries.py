"""Several contacts, or contacts without mass, from the entries of a file: rows by labels, and their residuals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.models._contacts import Contacts
from workflow.models._from_matrices import GivenMatrices
from workflow.models._matrix_entries import Chosen, checked_matrices
from workflow.models._matrix_files import Entries
from workflow.models._pair import UnusableMatricesError
from workflow.models._structure import Rayleigh

MOST_CONTACTS = 64
"""Largest number of contacts of a structure."""

_SUMMED = 1e-9
"""Accepted deviation of a sum of shares from 1: rounding of many of them."""

_PARALLEL = 1e-10
"""Sine of the angle between rows below which they are parallel, and asymmetry of R over its largest entry."""


class ChosenContacts(NamedTuple):
    """A study's choice from a file, see :class:`~workflow.models._matrix_entries.Chosen`; of several contacts lists."""

    contact: str | int | tuple[str | int, ...] | None = None
    thermal_contact: str | int | tuple[str | int, ...] | None = None
    tangent: str | int | tuple[str | int, ...] | None = None


def given_by(entries: Entries, chosen: ChosenContacts, damping: Rayleigh) -> tuple[GivenMatrices, Contacts | None]:
    """Return the matrices of entries in SI, and their contacts where they are several or without mass.

    Raises
    ------
    UnusableMatricesError
        An entry is missing or wrong.
    """
    if not is_several(entries, chosen):
        entries, single = _of_one(entries, chosen)
        return checked_matrices(entries, single, damping), None
    rest = {name: value for name, value in entries.items() if name not in ("contact", "thermal_contact", "tangent")}
    given = checked_matrices(rest, Chosen(0, 0), damping)
    contacts = contacts_of(entries, chosen, given.labels, (given.mass.shape[0], given.heat_capacity.shape[0]))
    slides = contacts.tangent[np.any(contacts.tangent != 0, axis=1)]
    nowhere = np.zeros(given.mass.shape[0]) if contacts.count > 1 else None
    own: dict[str, Any] = {"contact": contacts.normal[0], "thermal_contact": contacts.heat[0]}
    own |= {"tangent": slides[0] if len(slides) else None, "load": nowhere if given.load is None else given.load}
    return replace(given, **own), contacts


def _of_one(entries: Entries, chosen: ChosenContacts) -> tuple[Entries, Chosen]:
    """Return entries and choice of one contact with mass, which may be a list of one."""
    single = {name: value[0] if isinstance(value, tuple) else value for name, value in chosen._asdict().items()}
    own = _names("contact_labels", entries, entries.get("contact"))
    if single["contact"] in own:
        at = own.index(single["contact"])
        rows = {name: value for name, value in entries.items() if name in single and np.ndim(value) == 2}
        entries = {**entries, **{name: value[at] for name, value in rows.items()}}
        single["contact"] = None
    return entries, Chosen(**single)


def is_several(entries: Entries, chosen: ChosenContacts) -> bool:
    """Tell whether a file and the study's choice from it mean several contacts, or contacts without mass."""
    if "residual_flexibility" in entries:
        return True
    if isinstance(chosen.contact, tuple):
        return len(chosen.contact) > 1
    name = chosen.contact if isinstance(chosen.contact, str) and chosen.contact in entries else "contact"
    if (chosen.contact is not None and name == "contact") or name not in entries or "mass" not in entries:
        return False
    rows, size = np.shape(entries[name]), np.shape(entries["mass"])[-1:]
    return len(rows) == 2 and rows[0] > 1 and rows[1:] == size  # a column is one contact


def contacts_of(entries: Entries, chosen: ChosenContacts, labels: Sequence[str], sizes: tuple[int, int]) -> Contacts:
    """Return the contacts of entries in SI, in the coordinates of the file with ``sizes`` displacements, temperatures.

    Raises
    ------
    UnusableMatricesError
        An entry is missing or wrong.
    """
    size, heats = sizes
    own = _names("contact_labels", entries, entries.get("contact"))
    normal, names, which = _rows(chosen.contact, "contact", entries, own, labels, size)
    if len(normal) > MOST_CONTACTS:
        raise UnusableMatricesError(f"it has {len(normal)} contacts", f"choose up to {MOST_CONTACTS} of them")
    tangent = np.zeros_like(normal)
    if chosen.tangent is not None or "tangent" in entries:
        tangent = _beside(chosen.tangent, "tangent", entries, labels, which, size)
        _refuse_parallel(normal, tangent, names)
    _refuse_dependent(normal, names, "residual_flexibility" in entries)
    return Contacts(
        names,
        normal,
        tangent,
        _heat_rows(entries, chosen.thermal_contact, labels, names, which, (len(normal), heats)),
        _numbers("angle", entries, which, (len(normal),)),
        **_residuals(entries, which, (len(normal), heats)),
    )


def _refuse_parallel(normal: Array, tangent: Array, names: Sequence[str]) -> None:
    """Refuse a direction of sliding that is that of its contact."""
    for name, w, t in zip(names, normal, tangent, strict=True):
        size = np.linalg.norm(w) * np.linalg.norm(t)
        if size > 0 and size - abs(w @ t) <= _PARALLEL * size:
            remedy = "write the direction in which the casing slides, or 0"
            raise UnusableMatricesError(f"`tangent` of contact {name} is the direction of the contact", remedy)


def _names(name: str, entries: Entries, rows: Any) -> tuple[str, ...]:
    """Return the labels of the rows of the file's contacts; none where it has none."""
    if name not in entries:
        return ()
    own = tuple(str(text).strip() for text in np.asarray(entries[name]).astype(str).ravel())
    if len(own) != len(np.atleast_2d(rows)) or len(set(own)) < len(own):
        raise UnusableMatricesError(
            f"`{name}` has {len(own)} labels", "write one for each row of `contact`, all unlike"
        )
    return own


def _rows(
    chosen: Any, name: str, entries: Entries, own: tuple[str, ...], labels: Sequence[str], size: int
) -> tuple[Array, tuple[str, ...], list[int] | None]:
    """Return rows, their names, and which rows of the file's entry they are; ``None`` where they are none of it."""
    if isinstance(chosen, tuple):
        rows = [_row(item, name, entries, own, labels, size) for item in chosen]
        which = [own.index(item) for item in chosen if isinstance(item, str) and item in own]
        return np.array(rows), tuple(str(item) for item in chosen), which if len(which) == len(chosen) else None
    given = _matrix(chosen if isinstance(chosen, str) else name, entries, size)
    names = own if len(own) == len(given) else tuple(str(k + 1) for k in range(len(given)))
    return given, names, list(range(len(given)))


def _row(item: str | int, name: str, entries: Entries, own: Sequence[str], labels: Sequence[str], size: int) -> Array:
    """Return the row of a label of a contact or a displacement, or of an index."""
    if isinstance(item, str) and item in own:
        return np.asarray(_matrix(name, entries, size)[list(own).index(item)])
    at = list(labels).index(item) if isinstance(item, str) and item in labels else item
    if not isinstance(at, int) or not 0 <= at < size:
        known = ", ".join([*own, *labels][:5])
        remedy = f"write {known + ', … or ' if known else ''}an index from 0 to {size - 1}"
        raise UnusableMatricesError(f"`{name}: {item}` is neither a label nor an index", remedy)
    row = np.zeros(size)
    row[at] = 1.0
    return row


def _matrix(name: str, entries: Entries, size: int) -> Array:
    """Return an entry with ``size`` columns and a row for each contact."""
    if name not in entries:
        raise UnusableMatricesError(
            f"`{name}` is given neither in the study nor in the file", "write a row per contact"
        )
    value = entries[name]
    rows = np.atleast_2d(value.toarray() if hasattr(value, "toarray") else np.asarray(value))
    if rows.ndim != 2 or rows.shape[1] != size or rows.dtype.kind not in "fiu" or not np.isfinite(rows).all():
        remedy = f"write a row of {size} finite numbers for each contact"
        raise UnusableMatricesError(f"`{name}` has the shape {np.shape(value)}", remedy)
    return rows.astype(np.float64)


def _beside(chosen: Any, name: str, entries: Entries, labels: Sequence[str], which: Any, size: int) -> Array:
    """Return the rows that go with the contacts: those chosen, or those of the file in their order."""
    if isinstance(chosen, tuple):
        return np.array([_row(item, name, entries, (), labels, size) for item in chosen])
    rows = _matrix(chosen if isinstance(chosen, str) else name, entries, size)
    return rows if which is None else rows[_in_file(name, which, len(rows))]


def _in_file(name: str, which: Sequence[int], rows: int) -> Sequence[int]:
    """Return the rows of an entry that go with the contacts that are chosen."""
    if max(which) >= rows:
        raise UnusableMatricesError(f"`{name}` has {rows} rows", "write one for each row of `contact`")
    return which


def _heat_rows(
    entries: Entries, chosen: Any, labels: Sequence[str], names: Sequence[str], which: Any, shape: tuple[int, int]
) -> Array:
    """Return the shares of the heat of each contact; those of its own label where the file has none."""
    own = _names_of_temperatures(entries, labels, shape[1])
    if chosen is None and "thermal_contact" not in entries:
        if shape[1] == 1:
            return np.ones(shape)
        return np.array([_row(name, "thermal_contact", entries, (), own, shape[1]) for name in names])
    heat = _beside(chosen, "thermal_contact", entries, own, which, shape[1])
    if heat.shape != shape or np.any(np.abs(heat.sum(axis=1) - 1) > _SUMMED):
        raise UnusableMatricesError("the shares of `thermal_contact` are not 1 in sum", "write a row for each contact")
    return heat


def _names_of_temperatures(entries: Entries, labels: Sequence[str], count: int) -> tuple[str, ...]:
    """Return the labels of temperatures: their own, or those of as many displacements."""
    if "thermal_labels" in entries:
        return tuple(str(text).strip() for text in np.asarray(entries["thermal_labels"]).astype(str).ravel())
    return tuple(labels) if len(labels) == count else ()


def _numbers(name: str, entries: Entries, which: Any, shape: tuple[int, ...]) -> Array:
    """Return the numbers of the contacts in an entry, 0 where the file has none."""
    if name not in entries:
        return np.zeros(shape)
    values = np.asarray(entries[name], dtype=np.float64)
    if which is not None:
        values = values[_in_file(name, which, len(values))]
    if values.shape != shape or not np.isfinite(values).all():
        raise UnusableMatricesError(f"`{name}` has the shape {values.shape}", f"write finite numbers of {shape}")
    return values


def _residuals(entries: Entries, which: Any, shape: tuple[int, int]) -> dict[str, Any]:
    """Return the residual flexibility of contacts without mass, and what belongs to it; nothing for those with mass."""
    if "residual_flexibility" not in entries:
        return {}
    if which is None:
        problem = "contacts without mass are chosen by displacements"
        raise UnusableMatricesError(problem, "choose them by `contact_labels`: the file has residuals of these")
    flexibility, tangential = (
        _among(entries.get(name, np.zeros_like(entries["residual_flexibility"])), name, which)
        for name in ("residual_flexibility", "residual_tangent")
    )
    apart = np.abs(flexibility - flexibility.T).max()
    symmetric = (flexibility + flexibility.T) / 2
    if apart > _PARALLEL * np.abs(flexibility).max() or np.linalg.eigvalsh(symmetric).min() <= 0:
        remedy = "write w ΔF wᵀ, the static flexibility less that of the modes that are given"
        raise UnusableMatricesError("`residual_flexibility` is not symmetric and positive definite", remedy)
    return {
        "residual": symmetric,
        "residual_tangent": tangential,
        "residual_coupling": _numbers("residual_coupling", entries, which, shape),
        "residual_load": _numbers("residual_load", entries, which, shape[:1]),
    }


def _among(value: Any, name: str, which: Sequence[int]) -> Array:
    """Return the part of a matrix with a row and a column for each contact that belongs to those chosen."""
    values = np.asarray(value)
    if values.ndim != 2 or values.shape[0] != values.shape[1] or not np.isfinite(values).all():
        remedy = "write finite numbers, a row and a column for each row of `contact`"
        raise UnusableMatricesError(f"`{name}` has the shape {values.shape}", remedy)
    return values[np.ix_(_in_file(name, which, len(values)), which)].astype(np.float64)


def _refuse_dependent(normal: Array, names: Sequence[str], massless: bool) -> None:
    """Refuse contacts with mass whose rows depend on each other; opposite stops of one displacement may."""
    if massless:
        return
    unit = normal / np.linalg.norm(normal, axis=1)[:, None]
    cosines = unit @ unit.T
    first = np.array([not np.any(cosines[k, :k] < _PARALLEL - 1) for k in range(len(unit))])
    singular = np.linalg.svd(unit[first], compute_uv=False)
    if first.sum() > normal.shape[1] or singular.min() <= _PARALLEL * singular.max():
        left = np.linalg.svd(unit[first])[0][:, -1]
        those = ", ".join(
            name for name, share in zip(np.array(names)[first], left, strict=True) if abs(share) > _PARALLEL
        )
        remedy = "leave one out, or write `residual_flexibility`, with which contacts have no mass"
        raise UnusableMatricesError(f"contacts {those} depend on each other", remedy)
