"""Coordinates in which the contacts of a structure are the last ones, as bases hold them.

With independent rows W of the contacts, y = (x without as many x_j, W x) and x = E y: one row after another replaces
the displacement where the rest of it, less its shares of the rows before, is largest. Rows that depend on those before,
of opposite stops or of contacts that share a temperature, replace none: a basis holds each row once.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._contacts import Contacts
from workflow.models._pair import DensePair, Pair, congruent, is_last
from workflow.models._sparse_pair import SparsePair, sparse_congruent
from workflow.models._structure import Structure

_DEPENDENT = 1e-6
"""Rest of a row over its largest entry up to which it depends on others: E has entries of the inverse of it."""


class RowsLast(NamedTuple):
    """E from coordinates with rows last to others, its inverse, and the number of rows."""

    basis: Any
    projection: Any
    boundary: int


class ContactsLast(NamedTuple):
    """A structure in coordinates with its contacts last."""

    structure: Structure
    displacements: RowsLast
    temperatures: RowsLast


def rows_last(rows: Array) -> RowsLast:
    """Return the coordinates in which independent ones of the rows, ``(row, coordinate)``, are the last."""
    size, last = rows.shape[1], 0
    basis = projection = None
    for row in rows:
        own = row if basis is None else basis.T @ row
        inside = np.abs(own[: size - last])
        if last and inside.max(initial=0.0) <= _DEPENDENT * np.abs(row).max():
            continue
        one, back = _row_last(own, int(np.argmax(inside)))
        basis, projection = (one, back) if basis is None else (basis @ one, back @ projection)
        last += 1
    return RowsLast(basis, projection, last)


def _row_last(row: Array, replaced: int) -> tuple[scipy.sparse.csr_array, scipy.sparse.csr_array]:
    """Return E, from coordinates with a row last in the place of the one ``replaced`` to others, and its inverse."""
    size = row.size
    others, each = np.delete(np.arange(size), replaced), scipy.sparse.eye_array(size, format="csr")
    projection = scipy.sparse.vstack([each[others], scipy.sparse.csr_array(row[None])], format="csr")
    shares = scipy.sparse.csr_array(np.append(-row[others], 1.0)[None] / row[replaced])
    beside = scipy.sparse.hstack([each[:, others], scipy.sparse.csr_array((size, 1))])
    return scipy.sparse.csr_array(beside + each[:, [replaced]] @ shares), projection


def independent_rows(contacts: Contacts) -> tuple[int, int]:
    """Return how many displacements and temperatures a basis of the contacts holds."""
    held = contacts.normal[: 1 if contacts.is_massless else None]
    return rows_last(held).boundary, rows_last(contacts.heat).boundary


@lru_cache(maxsize=2)
def contacts_last(structure: Structure) -> ContactsLast | None:
    """Return a structure with contacts in coordinates with their rows last, kept with its factors for other counts.

    ``None`` where one contact is the last coordinate already. Rows of contacts without mass hold nothing; of them the
    first stays the tip.
    """
    contacts = structure.contacts
    if contacts.count == 1 and all(is_last(row) for row in (contacts.normal[0], contacts.heat[0])):
        return None
    x, theta = rows_last(contacts.normal[: 1 if contacts.is_massless else None]), rows_last(contacts.heat)
    mechanical, thermal = _in(structure.mechanical, x), _in(structure.thermal, theta)
    expansion, damper = structure.expansion @ theta.basis, structure.damper
    if damper is not None:
        damper = sparse_congruent(damper, x.basis) if structure.is_sparse else congruent(damper, x.basis)
    moved = replace(  # type: ignore[call-arg]
        structure,
        mechanical=mechanical,
        thermal=thermal,
        expansion=x.basis.T @ expansion if structure.is_sparse else expansion,
        uniform_rise=theta.projection @ structure.uniform_rise,
        damper=damper,
        load=x.basis.T @ structure.load_direction,
        coordinates=None,
        contacts=contacts.transformed(x.basis, theta.basis),
    )
    return ContactsLast(moved, x, theta)


def sparse_pair(stiffness: Any, inertia: Any, rows: RowsLast) -> SparsePair:
    """Return the pair of given matrices in coordinates with rows last."""
    return SparsePair(sparse_congruent(stiffness, rows.basis), sparse_congruent(inertia, rows.basis), rows.boundary)


def _in(pair: Pair, rows: RowsLast) -> Pair:
    """Return a pair in coordinates with rows last."""
    if isinstance(pair, SparsePair):
        return sparse_pair(pair.stiffness, pair.inertia, rows)
    dense, basis = pair.dense, rows.basis
    return DensePair(congruent(dense.inertia, basis), dense.weights, dense.deformation @ basis, rows.boundary)
