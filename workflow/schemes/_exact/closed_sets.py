"""The linear system of each set S of closed contacts in real blocks [η, u, ξ], as a row of numbers.

The system is :func:`~workflow.models.contact_system`, in modes [z, z', τ] with S held, y = Z z + Pᵀ d. The signals,
whose fall through zero ends the set, are the gaps d_i - x_i of open contacts and λ_i of closed ones. It is separated
once for (structure, S, α, µ), whatever the loads are, in one of three ways:

    apart      no heat of contact feeds back: blocks are modes less their response to thermal modes
    rank one   one closed contact heats: :mod:`workflow.schemes._exact.rank_one`
    general    :func:`workflow.poles.real_blocks`
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import kernel, part
from workflow.kernels.packs import view
from workflow.models import ContactBasis, contact_system
from workflow.poles import RealBlocks, real_blocks
from workflow.schemes._exact.rank_one import (
    CRITICAL,
    NEAR_RATE,
    Modes,
    RankOne,
    Zeros,
    complete,
    fill_blocks,
    find_zeros,
    rank_one,
    thermal_response,
)
from workflow.schemes._exact.tables import block, first, padded

HEAD = 11
"""Numbers of a set's row before its tables: blocks, first-order states, N, contacts, modes with all open, inputs, modes
of the set, whether these are those with all open, whether coordinates are linked, growth, fastest."""

_LINKED, _GROWTH, _FASTEST = 8, 9, 10


class ClosedSet(NamedTuple):
    """The linear system of a set, as views of a row of numbers; N coordinates, m contacts, n modes with all open."""

    blocks: int
    firsts: int
    is_open: bool
    """Whether its modes are those with all contacts open: Z = 1."""
    is_linked: bool
    """Whether [η, u, ξ] follow from [z, z', τ] by a full matrix; else they are these less the response to τ."""
    growth: float
    """Largest rate at which a block or first-order state may grow, 1/s, not negative."""
    fastest: float
    """Bound of all poles, 1/s."""
    null: Array
    """Z, ``(mode, mode of the set)``, …"""
    place: Array
    """… and P, y per d of each contact, ``(contact, mode)``; 0 for open ones."""
    block: Array
    """With the rows of ``tables.block`` that do not depend on loads or contact."""
    first: Array
    """With the rows of ``tables.first``."""
    outputs: Array
    """Signal and temperature of each contact per η and η' (rows as in ``tables.seen``), ``(contact, 4, column)``."""
    slow_outputs: Array
    """The same per ξ, ``(contact, 2, column)``."""
    source: Array
    """Sources [β, γ, χ] and then the signals, ``(input, N + m)``, padded."""
    inward: Array
    """Coordinates per [z, z', τ]: rows are these, ``(N, N)`` …"""
    outward: Array
    """… and back: rows are coordinates."""
    jump: Array
    """Change of coordinates by an impulse of 1 N s at each contact without its heat, and by that at α = 1, ``(contact,
    2, N)``."""


def row_length(basis: ContactBasis) -> int:
    """Return the length of the rows of a structure's sets."""
    N, n, m = basis.size, basis.frequency.size, basis.contacts.count
    columns, wide = padded(N // 2), padded(N)
    tables = (block.ROWS + 4 * m) * columns + (first.ROWS + 2 * m) * wide
    return HEAD + n * n + m * n + tables + basis.inputs * padded(N + m) + 2 * N * N + 2 * m * N


def closed_set_of(row: Array) -> ClosedSet:
    """Return the set that is stored in a row; its tables are views."""
    blocks, firsts, m, n, inputs, modes = int(row[0]), int(row[1]), int(row[3]), int(row[4]), int(row[5]), int(row[6])
    N = 2 * blocks + firsts
    columns, wide, across = 8 * ((blocks + 7) // 8), 8 * ((firsts + 7) // 8), 8 * ((N + m + 7) // 8)
    a = HEAD + n * modes
    b = a + m * n
    d = b + block.ROWS * columns
    e = d + first.ROWS * wide
    f = e + 4 * m * columns
    g = f + 2 * m * wide
    h = g + inputs * across
    return ClosedSet(
        blocks,
        firsts,
        row[7] != 0.0,
        row[_LINKED] != 0.0,
        row[_GROWTH],
        row[_FASTEST],
        view(row, HEAD, (n, modes)),
        view(row, a, (m, n)),
        view(row, b, (block.ROWS, columns)),
        view(row, d, (first.ROWS, wide)),
        view(row, e, (m, 4, columns)),
        view(row, f, (m, 2, wide)),
        view(row, g, (inputs, across)),
        view(row, h, (N, N)),
        view(row, h + N * N, (N, N)),
        view(row, h + 2 * N * N, (m, 2, N)),
    )


closed_set_in = part(closed_set_of)
""":func:`closed_set_of` in kernels."""


class Heated(NamedTuple):
    """A set with one closed contact that heats, for kernels: its rows at all α > 0."""

    matrix: RankOne
    response: Array
    """R, ``(mode, thermal mode)``."""
    contact: int
    heat: Array
    observed: Array
    """s of each contact, and the temperature that is recorded there, ``(contact, thermal mode)``."""
    signals: Array
    """Signals per [z, z', τ], ``(contact, N)`` …"""
    inputs: Array
    """… and per input."""
    source: Array
    """z'' and τ' per input without heat of contact, ``(mode + thermal mode, input)``."""
    struck: Array
    """z' per impulse of each contact, ``(contact, mode)``."""
    statics: Array
    """Beginning of its rows."""


class SetAnyAlpha:
    """A set of closed contacts of a structure at one µ, for cases of a duration [s]: its rows at any α."""

    def __init__(
        self, basis: ContactBasis, closed: NDArray[np.int8], friction: float, duration: float, hardening: float = 0.0
    ):
        self._basis, self._closed, self._duration = basis, closed != 0, duration
        self._system = system = contact_system(basis, closed, 0.0, friction, hardening)
        self._modes: Modes | None = None
        self._heated: Heated | None = None
        if system is None:
            return
        n, k, heats = basis.frequency.size, system.null.shape[1], basis.rate.size
        stiffness, damping = -system.A[k : 2 * k, :k], -system.A[k : 2 * k, k : 2 * k]
        is_open = np.array_equal(system.null, np.eye(n))
        head = [k, heats, 2 * k + heats, closed.size, n, basis.inputs, k, is_open, True, 0, 0]
        self._statics = np.concatenate([head, system.null.ravel(), system.place.ravel()])
        self._struck = -(basis.normal - friction * basis.tangent) @ system.null
        if all(np.array_equal(each, np.diag(np.diag(each))) for each in (stiffness, damping)):
            frequency = np.sqrt(np.maximum(0.0, np.diag(stiffness)))
            self._modes = Modes(frequency, np.diag(damping), -system.A[k : 2 * k, 2 * k :], basis.rate)
            if self._closed.sum() == 1 and heats and not basis.contacts.is_compliant:
                self._heated = self._rank_one(self._modes, int(np.flatnonzero(closed)[0]))

    def _rank_one(self, modes: Modes, contact: int) -> Heated | None:
        """Return the arguments of the kernel; ``None`` where poles or rates are near each other, or a pole is 0."""
        system, heat, response = self._system, self._basis.heat, thermal_response(modes, CRITICAL)
        assert system is not None
        matrix = None if response is None else rank_one(modes, response, -system.signals[contact], heat[contact])
        if response is None or matrix is None:
            return None
        given = system.B[modes.frequency.size :], self._struck, self._statics
        arrays = heat, self._basis.recorded, system.signals, system.inputs, *given
        own = (np.ascontiguousarray(each, dtype=np.float64) for each in arrays)
        return Heated(matrix, np.ascontiguousarray(response), contact, *own)

    @property
    def is_rank_one(self) -> bool:
        """Whether one call makes its rows at many α > 0."""
        return self._heated is not None

    def fill(self, rows: Array, alpha: Array) -> NDArray[np.bool_]:
        """Store the set at some α in rows; return at which of them its poles can be separated."""
        found, system = np.zeros(alpha.size, dtype=np.bool_), self._system
        if self._heated is not None:
            size = self._heated.matrix.d.size
            zeros = Zeros(np.zeros(size, np.int64), *np.zeros((4, size), np.complex128))
            fill_heated(self._heated, alpha, zeros, rows, found)
        for k in np.flatnonzero(~found) if system is not None else ():
            feeds = alpha[k] > 0 and self._basis.rate.size > 0 and bool(self._closed.any())
            found[k] = (not feeds and self._fill_apart(rows[k])) or self._fill_linked(rows[k], float(alpha[k]))
        return found

    def _fill_apart(self, row: Array) -> bool:
        """Store the set where no heat feeds back; whether its modes are linked by thermal ones alone."""
        response = None if self._modes is None else thermal_response(self._modes, NEAR_RATE)
        if response is None or self._modes is None:
            return False
        self._store(row, _apart(self._modes, response), 0.0, is_linked=False)
        return True

    def _fill_linked(self, row: Array, alpha: float) -> bool:
        """Store any set; whether its poles can be separated."""
        try:
            blocks = real_blocks(self._matrix(alpha), self._duration)
        except ValueError:  # poles that coincide, entries that are not finite
            return False
        self._store(row, blocks, alpha, is_linked=True)
        return True

    def _matrix(self, alpha: float) -> Array:
        """Return A at α."""
        assert self._system is not None
        A = self._system.A.copy()
        fed = self._basis.heat[self._closed].T @ self._system.signals[self._closed]
        A[2 * self._system.null.shape[1] :] += alpha * fed
        return A

    def _store(self, row: Array, blocks: RealBlocks, alpha: float, *, is_linked: bool) -> None:
        """Fill a row."""
        system, basis = self._system, self._basis
        assert system is not None
        N, modes, m = len(system.A), system.null.shape[1], self._closed.size
        k, j = blocks.damping.size, blocks.rate.size
        row[:] = 0.0
        row[: self._statics.size] = self._statics
        row[0], row[1], row[_LINKED] = k, j, is_linked
        s = closed_set_of(row)
        s.block[block.DAMPING, :k], s.block[block.STIFFNESS, :k], s.first[first.RATE, :j] = blocks[:3]
        seen = system.signals @ blocks.outward, basis.recorded @ blocks.outward[2 * modes :]
        for o, per in enumerate(seen):
            s.outputs[:, 2 * o, :k], s.outputs[:, 2 * o + 1, :k] = per[:, :k], per[:, k : 2 * k]
            s.slow_outputs[:, o, :j] = per[:, 2 * k :]
        B = system.B.copy()
        B[2 * modes :] += alpha * basis.heat[self._closed].T @ system.inputs[self._closed]
        s.source[:, :N], s.source[:, N : N + m] = (blocks.inward @ B).T, system.inputs.T
        s.inward[:], s.outward[:] = blocks.inward.T, blocks.outward.T
        s.jump[:, 0] = self._struck @ s.inward[modes : 2 * modes]
        s.jump[:, 1] = basis.heat @ s.inward[2 * modes :]
        row[_GROWTH], row[_FASTEST] = complete(s.block, s.first, k, j)


def _apart(modes: Modes, response: Array) -> RealBlocks:
    """Return the blocks that are modes less their response R to thermal modes."""
    k, mu = modes.frequency.size, modes.rate
    inward = np.eye(2 * k + mu.size)
    inward[:k, 2 * k :], inward[k : 2 * k, 2 * k :] = -response, response * mu
    return RealBlocks(modes.damping, modes.frequency**2, mu, inward, 2 * np.eye(len(inward)) - inward)


@kernel
def fill_heated(h: Heated, alpha: Array, zeros: Zeros, rows: Array, found: NDArray[np.bool_]) -> None:
    """Store a set with one closed contact at those α > 0 at which its spectrum is accurate, and which these are."""
    for i in range(alpha.size):
        count, row = find_zeros(h.matrix, alpha[i], zeros) if alpha[i] > 0.0 else 0, rows[i]
        if count > 0:
            for k in range(row.size):
                row[k] = h.statics[k] if k < h.statics.size else 0.0
            row[0], row[1] = h.matrix.d.size - count, 2 * count - h.matrix.d.size
            s = closed_set_in(row)
            tables, signals = (
                (s.block, s.first, s.inward, s.outward),
                (s.outputs[h.contact], s.slow_outputs[h.contact, 0]),
            )
            found[i] = fill_blocks(h.matrix, h.response, alpha[i], count, zeros, tables, signals)
            _fill_outputs(h, s)
            _fill_sources(h, alpha[i], s)
            _fill_jumps(h, s)
            row[_GROWTH], row[_FASTEST] = complete(s.block, s.first, s.blocks, s.firsts)


@part
def _fill_outputs(h: Heated, at: ClosedSet) -> None:
    """Fill the temperatures of all contacts, and the gaps of those that are open, which see displacements alone."""
    k, heats, modes = at.blocks, h.heat.shape[1], h.response.shape[0]
    for c in range(h.heat.shape[0]):
        for r in range(2 * k + at.firsts):
            gap, temperature = 0.0, 0.0
            for n in range(modes):
                gap += h.signals[c, n] * at.outward[r, n]
            for n in range(heats):
                temperature += h.observed[c, n] * at.outward[r, 2 * modes + n]
            if r < 2 * k:
                o, column = (0, r) if r < k else (1, r - k)
                at.outputs[c, 2 + o, column] = temperature
                if c != h.contact:
                    at.outputs[c, o, column] = gap
            else:
                at.slow_outputs[c, 1, r - 2 * k] = temperature
                if c != h.contact:
                    at.slow_outputs[c, 0, r - 2 * k] = gap


@part
def _fill_sources(h: Heated, alpha: float, at: ClosedSet) -> None:
    """Fill the sources of coordinates and the signals per input."""
    source, inward, (modes, heats), N = at.source, at.inward, h.response.shape, at.outward.shape[0]
    for i in range(source.shape[0]):
        force = alpha * h.inputs[h.contact, i]
        for n in range(modes + heats):
            per = h.source[n, i] + (force * h.heat[h.contact, n - modes] if n >= modes else 0.0)
            if per != 0.0:
                for r in range(N):
                    source[i, r] += per * inward[modes + n, r]
        for c in range(h.heat.shape[0]):
            source[i, N + c] = h.inputs[c, i]


@part
def _fill_jumps(h: Heated, at: ClosedSet) -> None:
    """Fill the change of coordinates by an impulse at each contact, and by its heat."""
    modes, heats = h.response.shape
    for c in range(h.heat.shape[0]):
        for n in range(modes):
            for r in range(at.outward.shape[0]):
                at.jump[c, 0, r] += h.struck[c, n] * at.inward[modes + n, r]
        for n in range(heats):
            for r in range(at.outward.shape[0]):
                at.jump[c, 1, r] += h.heat[c, n] * at.inward[2 * modes + n, r]
