"""Several contacts, or contacts without mass: the linear system of each set of closed contacts, in real blocks.

The system is :func:`~workflow.models.contact_system`. The signals, whose fall through zero ends the set, are the gaps
d_i - x_i of open contacts and λ_i of closed ones. A set is a row of numbers (:class:`ClosedSet`), separated once for
(structure, S, α, µ), whatever the loads are.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import block_diagonal
from workflow.kernels.compiled import part
from workflow.kernels.packs import view
from workflow.models import Array, ContactBasis, contact_system
from workflow.poles import real_blocks
from workflow.schemes._exact.regimes import complete
from workflow.schemes._exact.tables import block, first, padded


class ClosedSet(NamedTuple):
    """The linear system of a set in real blocks [η, u, ξ], N_S coordinates, as views of a row of numbers."""

    blocks: int
    firsts: int
    growth: float
    """Largest rate at which a block or first-order state may grow, 1/s, not negative."""
    fastest: float
    """Bound of all poles, 1/s."""
    block: Array
    """With the rows of ``tables.block`` that do not depend on loads or contact."""
    first: Array
    """With the rows of ``tables.first``."""
    outputs: Array
    """Signal and temperature of each contact per η and η' (rows as in ``tables.block``), ``(contact, 4, column)``."""
    slow_outputs: Array
    """The same per ξ, ``(contact, 2, column)``."""
    source: Array
    """Sources [β, γ, χ] and then the signals, ``(input, N_S + m)``, padded."""
    entry: Array
    """Coordinates per X = [y, y', τ], ``(N, N_S)``: rows are X."""
    exit: Array
    """X per coordinate, ``(N_S, N)`` …"""
    place: Array
    """… and y per d of each contact, y' per d', ``(contact, mode)``."""


HEAD = 8
"""Numbers of a set's row before its tables: blocks, first-order states, N, contacts, modes, inputs, growth, fastest."""


def row_length(basis: ContactBasis) -> int:
    """Return the length of the rows of a structure's sets."""
    N, n, m = basis.size, basis.frequency.size, basis.contacts.count
    columns, wide = padded(N // 2), padded(N)
    tables = (block.ROWS + 4 * m) * columns + (first.ROWS + 2 * m) * wide
    return HEAD + tables + basis.inputs * padded(N + m) + 2 * N * N + m * n


def closed_set_of(row: Array) -> ClosedSet:
    """Return the set that is stored in a row; its tables are views."""
    blocks, firsts, N, m, n, inputs = int(row[0]), int(row[1]), int(row[2]), int(row[3]), int(row[4]), int(row[5])
    own = 2 * blocks + firsts
    columns, wide, across = 8 * ((blocks + 7) // 8), 8 * ((firsts + 7) // 8), 8 * ((own + m + 7) // 8)
    a = HEAD + block.ROWS * columns
    b = a + first.ROWS * wide
    c = b + 4 * m * columns
    d = c + 2 * m * wide
    e = d + inputs * across
    f = e + N * own
    g = f + own * N
    return ClosedSet(
        blocks,
        firsts,
        row[6],
        row[7],
        view(row, HEAD, (block.ROWS, columns)),
        view(row, a, (first.ROWS, wide)),
        view(row, b, (m, 4, columns)),
        view(row, c, (m, 2, wide)),
        view(row, d, (inputs, across)),
        view(row, e, (N, own)),
        view(row, f, (own, N)),
        view(row, g, (m, n)),
    )


closed_set_in = part(closed_set_of)
""":func:`closed_set_of` in kernels."""


def fill_set(row: Array, basis: ContactBasis, closed: NDArray[np.bool_], *conditions: float) -> bool:
    """Store the system with the contacts ``closed`` in a row, at α, µ and a duration; whether it could be separated."""
    alpha, friction, duration = conditions
    system = contact_system(basis, closed, alpha, friction)
    if system is None:
        return False
    try:
        blocks = real_blocks(system.A, duration)
    except ValueError:  # poles that coincide, entries that are not finite
        return False
    m, own, k, j = closed.size, len(system.A), blocks.damping.size, blocks.rate.size
    row[:] = 0.0
    row[:6] = k, j, basis.size, m, basis.frequency.size, basis.inputs
    a = closed_set_of(row)
    a.block[block.DAMPING, :k], a.block[block.STIFFNESS, :k], a.first[first.RATE, :j] = blocks[:3]
    modes = system.null.shape[1]
    seen = basis.heat @ blocks.outward[2 * modes :]
    for o, per in enumerate((system.signals @ blocks.outward, seen)):
        a.outputs[:, 2 * o, :k], a.outputs[:, 2 * o + 1, :k] = per[:, :k], per[:, k : 2 * k]
        a.slow_outputs[:, o, :j] = per[:, 2 * k :]
    a.source[:, :own], a.source[:, own : own + m] = (blocks.inward @ system.B).T, system.inputs.T
    into = block_diagonal(system.null, system.null, np.eye(basis.rate.size))
    a.entry[:], a.exit[:], a.place[:] = into @ blocks.inward.T, blocks.outward.T @ into.T, system.place
    row[6], row[7] = complete(a.block, a.first, k, j)
    return True
