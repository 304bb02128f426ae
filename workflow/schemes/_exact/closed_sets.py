"""Several contacts, or contacts without mass: the linear system of each set of closed contacts, in real blocks.

In free modes, y'' + c y' + ω² y + G τ = g - Σ λ_i (w_i - µ t_i), τ' + μ τ = q + α Σ λ_i s_i, with g = φᵀ(f̄ + F b).
With the contacts S closed:

- **with mass** they follow the casing, w_S y = d_S: y = P d_S + Z z with Z an orthonormal basis of the null space of
  w_S, P = w_Sᵀ(w_S w_Sᵀ)⁻¹, and

      λ = D⁻¹ (w_S (g - c y' - ω² y - G τ) - d_S''),   D = w_S (w_S - µ t_S)ᵀ,   z'' = Zᵀ (g - … + µ t_Sᵀ λ);

- **without mass** their forces are linear in all modes, which stay,

      λ = Q (w_S y - r_S τ + ρ_S F + σ_S - d_S),   Q = (R - µ R^t + c)_SS⁻¹.

The signals, whose fall through zero ends the set, are the gaps d_i - x_i of open contacts and λ_i of closed ones. A set
is a row of numbers (:class:`ClosedSet`), separated once for (structure, S, α, µ), whatever the loads are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workflow.kernels.compiled import part
from workflow.models import Array, Contacts, Structure, coupled_damping, mechanical_modes, modal_coupling, thermal_modes
from workflow.poles import RealBlocks, real_blocks
from workflow.schemes._exact.tables import block, first, padded

_RIGID = 1e-13
"""Frequency of a constrained structure, over the largest, up to which it is 0: the rounding of some hundred terms."""


@dataclass(frozen=True, eq=False)
class ContactBasis:
    """A structure with all contacts open, in its modes."""

    contacts: Contacts
    shapes: Array
    """φ, ``(mechanical, mode)``."""
    heat_shapes: Array
    """χ, ``(thermal, thermal mode)``."""
    to_modes: Array
    """φᵀ M."""
    to_thermal: Array
    """χᵀ C2."""
    frequency: Array
    """ω, 1/s, ``(mode,)``."""
    damping: Array
    """c, ``(mode,)``, or ``(mode, mode)`` where damping couples modes."""
    coupling: Array
    """G, ``(mode, thermal mode)``."""
    rate: Array
    """μ, 1/s."""
    normal: Array
    """w, ``(contact, mode)``."""
    tangent: Array
    """t, ``(contact, mode)``."""
    heat: Array
    """s, ``(contact, thermal mode)``."""
    load: Array
    """φᵀ b, ``(mode,)``."""

    @property
    def residual_load(self) -> Array:
        """ρ, m/N, ``(contact,)``."""
        own = self.contacts.residual_load
        return np.zeros(self.contacts.count) if own is None else own

    @property
    def residual_coupling(self) -> Array:
        """R per thermal mode, m, ``(contact, thermal mode)``."""
        own = self.contacts.residual_coupling
        return np.zeros(self.heat.shape) if own is None else own @ self.heat_shapes

    @property
    def size(self) -> int:
        """Number of states [y, y', τ]."""
        return 2 * self.frequency.size + self.rate.size

    @property
    def inputs(self) -> int:
        """Number of inputs [g, q, F, d, d', d''] of a set."""
        return self.frequency.size + self.rate.size + 1 + 3 * self.contacts.count

    @property
    def unheated(self) -> ContactBasis:
        """The same without thermal modes, where no heat acts."""
        none: dict[str, Any] = {name: getattr(self, name)[:0] for name in ("rate", "to_thermal")}
        for name in ("heat_shapes", "coupling", "heat"):
            none[name] = getattr(self, name)[:, :0]
        return replace(self, **none)

    def delassus(self, friction: float) -> Array:
        """Return w_i (w_j - µ t_j)ᵀ, 1/kg, ``(contact, contact)``."""
        return np.asarray(self.normal @ (self.normal - friction * self.tangent).T)


def analyse_contacts(structure: Structure) -> ContactBasis:
    """Return the modes of a structure with contacts, and their rows in modes."""
    contacts = structure.contacts
    assert contacts is not None
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    return ContactBasis(
        contacts=contacts,
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        to_modes=mechanical.shapes.T @ structure.mass,
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        frequency=mechanical.values,
        damping=coupled_damping(structure, mechanical),
        coupling=modal_coupling(structure, mechanical, thermal),
        rate=thermal.values,
        normal=contacts.normal @ mechanical.shapes,
        tangent=contacts.tangent @ mechanical.shapes,
        heat=contacts.heat @ thermal.shapes,
        load=mechanical.shapes.T @ structure.load_direction,
    )


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
        row[HEAD:a].reshape((block.ROWS, columns)),
        row[a:b].reshape((first.ROWS, wide)),
        row[b:c].reshape((m, 4, columns)),
        row[c:d].reshape((m, 2, wide)),
        row[d:e].reshape((inputs, across)),
        row[e:f].reshape((N, own)),
        row[f:g].reshape((own, N)),
        row[g : g + m * n].reshape((m, n)),
    )


closed_set_in = part(closed_set_of)
""":func:`closed_set_of` in kernels."""


class _System(NamedTuple):
    """X_S' = A X_S + B w, signals = rows X_S + inputs w, X_S = [z, z', τ] with y = Z z + Pᵀ d."""

    A: Array
    B: Array
    signals: Array
    inputs: Array
    null: Array
    """Z, ``(mode, constrained mode)``."""
    place: Array
    """P, ``(contact, mode)``; 0 for open contacts."""


def fill_set(row: Array, basis: ContactBasis, closed: NDArray[np.bool_], alpha: float, friction: float) -> bool:
    """Store the system with the contacts ``closed`` (bool, ``(contact,)``) in a row; whether it could be separated."""
    massless = basis.contacts.is_massless
    system = (_without_mass if massless else _with_mass)(basis, np.flatnonzero(closed), alpha, friction)
    if system is None:
        return False
    try:
        blocks = _separated(system.A, system.null.shape[1])
    except ValueError:  # poles that coincide, entries that are not finite
        return False
    N, n, m, own, k, j = (
        basis.size,
        basis.frequency.size,
        closed.size,
        len(system.A),
        blocks.damping.size,
        blocks.rate.size,
    )
    row[:] = 0.0
    row[:6] = k, j, N, m, n, basis.inputs
    a = closed_set_of(row)
    a.block[block.DAMPING, :k], a.block[block.STIFFNESS, :k], a.first[first.RATE, :j] = blocks[:3]
    modes = system.null.shape[1]
    seen = basis.heat @ blocks.outward[2 * modes :]
    for o, per in enumerate((system.signals @ blocks.outward, seen)):
        a.outputs[:, 2 * o, :k], a.outputs[:, 2 * o + 1, :k] = per[:, :k], per[:, k : 2 * k]
        a.slow_outputs[:, o, :j] = per[:, 2 * k :]
    a.source[:, :own], a.source[:, own : own + m] = (blocks.inward @ system.B).T, system.inputs.T
    into = scipy.linalg.block_diag(system.null, system.null, np.eye(basis.rate.size))
    a.entry[:], a.exit[:], a.place[:] = into @ blocks.inward.T, blocks.outward.T @ into.T, system.place
    _complete(a.block, k)
    row[6] = max(0.0, -blocks.damping.min(initial=0.0), -blocks.rate.min(initial=0.0))
    row[7] = np.concatenate([a.block[block.OMEGA, :k], np.abs(blocks.damping), np.abs(blocks.rate)]).max(initial=0.0)
    return True


def _complete(b: Array, count: int) -> None:
    """Fill what follows in the table of blocks from c and ω² of ``count`` blocks; others pad it at rest."""
    b[block.STIFFNESS, count:] = max(1.0, b[block.STIFFNESS, count - 1]) if count else 1.0
    b[block.OMEGA], b[block.HALF_DAMPING] = np.sqrt(b[block.STIFFNESS]), 0.5 * b[block.DAMPING]
    b[block.INVERSE_OMEGA] = np.divide(1.0, b[block.OMEGA], out=np.zeros(b.shape[1]), where=b[block.OMEGA] > 0)
    square = b[block.STIFFNESS] - b[block.HALF_DAMPING] ** 2
    b[block.NU] = 1.0
    b[block.NU, :count] = np.where(square[:count] > 0, np.sqrt(np.abs(square[:count])), 1.0)


def _separated(A: Array, modes: int) -> RealBlocks:
    """Return the blocks of [z, z', τ]; where nothing couples the modes, they are the blocks."""
    z, u = A[modes : 2 * modes, :modes], A[modes : 2 * modes, modes : 2 * modes]
    rest = A[2 * modes :, 2 * modes :]
    beside = np.any(A[: 2 * modes, 2 * modes :]) or np.any(A[2 * modes :, : 2 * modes])
    if not beside and all(np.array_equal(own, np.diag(np.diag(own))) for own in (z, u, rest)):
        return RealBlocks(-np.diag(u), -np.diag(z), -np.diag(rest), np.eye(len(A)), np.eye(len(A)))
    return real_blocks(A)


def _constrained(basis: ContactBasis, rows: Array) -> tuple[Array, Array]:
    """Return Z, the modes of the structure with ``rows`` held, and their ω², ascending.

    They are singular values of diag(ω) Z: eigenvalues of Zᵀ diag(ω²) Z would lose the digits of low modes.
    """
    if not len(rows):
        return np.eye(basis.frequency.size), basis.frequency**2
    null = scipy.linalg.null_space(rows)
    _, values, vectors = scipy.linalg.svd(basis.frequency[:, None] * null, full_matrices=False)
    held = np.where(values > _RIGID * values.max(initial=0.0), values, 0.0)
    return null @ vectors[::-1].T, held[::-1] ** 2


def _without_rounding(matrix: Array) -> Array:
    """Return a matrix that is diagonal but for rounding as a diagonal one: Rayleigh's damping of constrained modes."""
    diagonal = np.diag(np.diag(matrix))
    is_rounding = np.abs(matrix - diagonal).max(initial=0.0) <= _RIGID * np.abs(diagonal).max(initial=0.0)
    return diagonal if is_rounding else matrix


def _with_mass(basis: ContactBasis, S: Any, alpha: float, friction: float) -> _System | None:
    W, T = basis.normal[S], basis.tangent[S]
    n, heats, m = basis.frequency.size, basis.rate.size, basis.contacts.count
    null, squares = _constrained(basis, W)
    modes = null.shape[1]
    try:
        inverse_delassus = np.linalg.inv(W @ (W - friction * T).T)
        lift = W.T @ np.linalg.inv(W @ W.T)  # P
    except np.linalg.LinAlgError:
        return None
    C = basis.damping if basis.damping.ndim == 2 else np.diag(basis.damping)
    K = basis.frequency**2
    z, u, tau = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, 2 * modes + heats)
    size = 2 * modes + heats
    moved = np.zeros((n, size))  # g-free acceleration per [z, z', τ]
    moved[:, z], moved[:, u], moved[:, tau] = -K[:, None] * null, -C @ null, -basis.coupling
    given = np.zeros((n, basis.inputs))  # … per input
    F = n + heats
    d, rate, bend = (F + 1 + k * m + S for k in range(3))
    given[:, :n], given[:, F] = np.eye(n), basis.load
    given[:, d], given[:, rate] = -K[:, None] * lift, -C @ lift
    force, force_inputs = inverse_delassus @ W @ moved, inverse_delassus @ W @ given
    force_inputs[:, bend] -= inverse_delassus
    A, B = np.zeros((size, size)), np.zeros((size, basis.inputs))
    A[z, u] = np.eye(modes)
    slides = friction * (null.T @ T.T)
    A[u] = null.T @ moved
    A[u, z], A[u, u] = -np.diag(squares), _without_rounding(A[u, u])
    A[u] += slides @ force
    B[u] = null.T @ given + slides @ force_inputs
    A[tau, tau] = -np.diag(basis.rate)
    B[tau, n : n + heats] = np.eye(heats)
    A[tau] += alpha * basis.heat[S].T @ force
    B[tau] += alpha * basis.heat[S].T @ force_inputs
    signals, inputs = np.zeros((m, size)), np.zeros((m, basis.inputs))
    signals[S], inputs[S] = force, force_inputs
    others = np.setdiff1d(np.arange(m), S)
    signals[others, z] = -basis.normal[others] @ null
    inputs[others, F + 1 + others] = 1.0
    inputs[np.ix_(others, d)] = -basis.normal[others] @ lift
    place = np.zeros((m, n))
    place[S] = lift.T
    return _System(A, B, signals, inputs, null, place)


def _without_mass(basis: ContactBasis, S: Any, alpha: float, friction: float) -> _System | None:
    n, heats, m = basis.frequency.size, basis.rate.size, basis.contacts.count
    flexibility = basis.contacts.flexibility(friction)
    try:
        stiffness = np.linalg.inv(flexibility[np.ix_(S, S)])  # Q
    except np.linalg.LinAlgError:
        return None
    size, F = basis.size, n + heats
    z, u, tau = slice(0, n), slice(n, 2 * n), slice(2 * n, size)
    place, place_inputs = np.zeros((m, size)), np.zeros((m, basis.inputs))  # x_i without forces
    place[:, z], place[:, tau] = basis.normal, -basis.residual_coupling
    place_inputs[:, F] = basis.residual_load
    depth_inputs = place_inputs.copy()
    depth_inputs[:, F + 1 : F + 1 + m] -= np.eye(m)
    force, force_inputs = stiffness @ place[S], stiffness @ depth_inputs[S]
    push = -(basis.normal[S] - friction * basis.tangent[S]).T
    A, B = np.zeros((size, size)), np.zeros((size, basis.inputs))
    A[z, u] = np.eye(n)
    A[u, z] = -np.diag(basis.frequency**2)
    A[u, u] = -basis.damping if basis.damping.ndim == 2 else -np.diag(basis.damping)
    A[u, tau] = -basis.coupling
    A[tau, tau] = -np.diag(basis.rate)
    B[u, :n], B[u, F], B[tau, n : n + heats] = np.eye(n), basis.load, np.eye(heats)
    A[u] += push @ force
    B[u] += push @ force_inputs
    A[tau] += alpha * basis.heat[S].T @ force
    B[tau] += alpha * basis.heat[S].T @ force_inputs
    signals, inputs = -place, -depth_inputs
    signals += flexibility[:, S] @ force
    inputs += flexibility[:, S] @ force_inputs
    signals[S], inputs[S] = force, force_inputs
    return _System(A, B, signals, inputs, np.eye(n), np.zeros((m, n)))
