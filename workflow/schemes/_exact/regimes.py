"""The two regimes between contact events, tip free and tip held at the gap, in uncoupled real blocks.

    blocks        η' = u + β(t),   u' = -c u - ω² η + γ(t)
    first order   ξ' = -μ ξ + χ(t)

so that a motion of any length costs one exponential per block. Where neither damping nor friction couples the modes,
first-order states are thermal modes, ξ = τ, and blocks are mechanical modes less their response to these,

    η = z - R τ,   u = z' + R μ τ,   R = -G/(μ² - μ c + ω²).

Friction heat adds to the held tip α times a rank-one term. In z - R τ, each mode split by its two poles, its matrix is
D + α u wᵀ, D = diag(d): d are the poles of the held structure and its thermal rates, u the response to heat at the tip,
wᵀ the row of the contact force. Its eigenvalues are the zeros of

    f(s) = 1 - α Σ u_k w_k/(s - d_k).

Newton's method finds the shift δ of each from a pole, so that every difference s - d_k keeps its digits (Golub, SIAM
Review 15 (1973) 318–334). Of a complex pair the one above the real axis is found. :mod:`workflow.poles` separates other
couplings: a damping matrix, friction along a tangent, a mode near a thermal rate, a matrix that is nearly defective.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import inlined, kernel, part
from workflow.poles import RealBlocks, real_blocks
from workflow.schemes._exact.layout import FASTEST, GROWTH, IS_MODAL, WARMS, Regime, in_row, unpacked
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.tables import block, first, seen

NEAR_RATE = 1e-3
"""Size of μ² - μ c + ω², over the sum of its terms, below which R has fewer than thirteen digits."""

CRITICAL = 1e-2
"""Relative distance of the two poles of a mode, or of a pole and a thermal rate, below which the general solver is
used, as digits are lost by its square."""


_OBSERVABLE = 1e-13
"""Reaction of a mode at the tip, over the largest, above which it is kept: the rounding of shapes is some 1e-15, and
the modes below change λ by no more than this, relatively."""

_NEWTON_STEPS, _CONVERGED = 20, 1e-10
"""Relative change of a shift at which Newton's method ends: the next change would be about its square."""

_DISTINCT = 1e-6
"""Distance of two zeros, over their shifts, below which they keep fewer than ten digits: the general solver is used."""

_INDEPENDENT = 3e-2
"""Product left · right, over the sum of its terms, below which eigenvectors lose digits by its square and more: the
matrix is nearly defective."""


class _Modes(Protocol):
    """Modes that only thermal ones link."""

    @property
    def frequency(self) -> Array: ...
    @property
    def damping(self) -> Array: ...
    @property
    def coupling(self) -> Array: ...
    @property
    def rate(self) -> Array: ...


def thermal_response(system: _Modes, near: float) -> Array | None:
    """Return R, ``(mode, thermal mode)``; ``None`` where a thermal rate is near the pole of a mode that heat loads."""
    mu, c, omega2, driven = system.rate, system.damping[:, None], system.frequency[:, None] ** 2, system.coupling != 0
    polynomial, size = mu**2 - mu * c + omega2, mu**2 + mu * c + omega2
    if np.any(driven & (np.abs(polynomial) <= near * size)):
        return None
    return -np.divide(system.coupling, polynomial, out=np.zeros_like(polynomial), where=driven)


class Regimes(NamedTuple):
    """Regimes of a batch."""

    rows: Array
    """As :func:`~workflow.schemes._exact.layout.unpacked` reads them, ``(regime, number)``."""
    separable: NDArray[np.bool_]
    """Whether their poles can be separated, ``(regime,)``; the row of others is meaningless."""


def fill_row(row: Array, system: ModalSystem, alpha: float, duration: float) -> bool:
    """Store the regime of a structure with its tip free, or held at α [W/N]; return whether its poles can be separated.

    At α > 0 or with friction along t ``system`` is one of :func:`observable` modes. Three poles that coincide cannot be
    separated; ``duration`` is that of the cases, s.
    """
    is_apart = alpha == 0 and system.friction_force is None and not system.is_coupled
    response = thermal_response(system, NEAR_RATE) if is_apart else None
    A, signal, source = state_space(system, alpha)
    try:
        blocks = real_blocks(A, duration) if response is None else _in_modes(system, response)
    except ValueError:  # poles that coincide, entries that are not finite
        return False
    n, j, size = blocks.damping.size, blocks.rate.size, len(A)
    inputs = signal_inputs(system)
    row[:] = 0.0
    row[:5] = n, j, inputs.size, len(system.entry) - 1, system.frequency.size
    regime = unpacked(row)
    b, f, outward = regime.block, regime.first, blocks.outward
    b[block.DAMPING, :n], b[block.STIFFNESS, :n], f[first.RATE, :j] = blocks.damping, blocks.stiffness, blocks.rate
    outputs = signal @ outward, system.observed @ outward[2 * system.frequency.size :]
    for o, per in enumerate(outputs):
        row_of = block.ROWS + 2 * o
        b[row_of + seen.SIGNAL_VALUE, :n], b[row_of + seen.SIGNAL_SLOPE, :n] = per[:n], per[n : 2 * n]
        f[first.ROWS + o, :j] = per[2 * n :]
    regime.source[:, :size], regime.source[:, size] = (blocks.inward @ source).T, inputs
    regime.inward[:, :size], regime.outward[:] = blocks.inward.T, outward.T
    regime.entry[:], regime.exit[:] = system.entry, system.exit
    _complete(row)
    return True


def _in_modes(system: ModalSystem, response: Array) -> RealBlocks:
    """Return the blocks that are the modes of the system less their response R to thermal modes."""
    modes = system.frequency.size
    inward = np.eye(2 * modes + system.rate.size)
    inward[:modes, 2 * modes :], inward[modes : 2 * modes, 2 * modes :] = -response, response * system.rate
    return RealBlocks(system.damping, system.frequency**2, system.rate, inward, 2 * np.eye(len(inward)) - inward)


@kernel
def _complete(row: Array) -> None:
    """Fill what follows in a row from c and ω² of blocks, μ of first-order states, outputs and transforms."""
    regime = in_row(row)
    b, warms = regime.block, False
    row[GROWTH], row[FASTEST] = complete(b, regime.first, regime.blocks, regime.firsts)
    for k in range(regime.blocks):
        warms |= b[block.ROWS + seen.TEMPERATURE_VALUE, k] != 0.0 or b[block.ROWS + seen.TEMPERATURE_SLOPE, k] != 0.0
    row[WARMS], row[IS_MODAL] = warms, _is_identity(regime.inward)


@kernel
def complete(b: Array, f: Array, blocks: int, firsts: int) -> tuple[float, float]:
    """Fill what follows in tables from c and ω², others pad them at rest; return growth and fastest of a regime."""
    growth, fastest = 0.0, 0.0
    filled = max(1.0, b[block.STIFFNESS, blocks - 1]) if blocks > 0 else 1.0
    for k in range(b.shape[1]):
        if k >= blocks:
            b[block.STIFFNESS, k] = filled
        b[block.OMEGA, k], b[block.NU, k] = np.sqrt(b[block.STIFFNESS, k]), 1.0
        if b[block.OMEGA, k] > 0.0:
            b[block.INVERSE_OMEGA, k] = 1.0 / b[block.OMEGA, k]
    for k in range(blocks):
        c = b[block.DAMPING, k]
        b[block.HALF_DAMPING, k] = 0.5 * c
        if b[block.STIFFNESS, k] > 0.25 * c * c:
            b[block.NU, k] = np.sqrt(b[block.STIFFNESS, k] - 0.25 * c * c)
        growth, fastest = max(growth, -c), max(fastest, b[block.OMEGA, k], abs(c))
    for j in range(firsts):
        growth, fastest = max(growth, -f[first.RATE, j]), max(fastest, abs(f[first.RATE, j]))
    return growth, fastest


@part
def _is_identity(matrix: Array) -> bool:
    """Whether a matrix is the identity."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            if matrix[i, j] != (1.0 if i == j else 0.0):
                return False
    return True


def observable(held: ModalSystem, sensors: Array) -> ModalSystem:
    """Remove the modes that are unobservable in the contact force of the held tip, unless damping couples them.

    Their shapes are free modes as well, with the tip at rest: only ``sensors``, rows of displacements, may show them.
    Among them are the rigid motions of parts that are not linked to the tip, whose double eigenvalue 0 is defective.
    """
    keep, shown = _reacts(held), np.abs(sensors @ held.shapes).max(axis=0, initial=0.0)
    keep |= shown > _OBSERVABLE * shown.max(initial=0.0)
    if held.is_coupled:
        beside = np.abs(held.damping - np.diag(np.diag(held.damping)))
        keep |= np.any(beside > _OBSERVABLE * np.abs(held.damping).max(initial=0.0), axis=1)
    return replace(
        held,
        frequency=held.frequency[keep],
        damping=held.damping[np.ix_(keep, keep)] if held.is_coupled else held.damping[keep],
        coupling=held.coupling[keep],
        reaction=held.reaction[keep],
        reaction_slope=held.reaction_slope[keep],
        gap_source=held.gap_source[keep],
        shapes=held.shapes[:, keep],
        entry=held.entry[:, keep],
        exit=held.exit[np.append(keep, True)],
        friction_force=None if held.friction_force is None else held.friction_force[keep],
    )


def _reacts(held: ModalSystem) -> NDArray[np.bool_]:
    """Return which modes of the held tip move its contact force, ``(mode,)``."""
    return np.asarray(np.abs(held.reaction) > _OBSERVABLE * np.abs(held.reaction).max(initial=0.0))


class RankOne(NamedTuple):
    """The matrix D + α u wᵀ of the held tip, ``(N,)`` each; thermal rates come last."""

    thermal: int
    """Number of poles that are thermal rates."""
    d: Complex
    u: Complex
    w: Complex


class Zeros(NamedTuple):
    """Memory for eigenvalues d + δ above the real axis or on it, ``(eigenvalue,)``."""

    pole: NDArray[np.int64]
    """Index of the pole d."""
    shift: Complex
    """δ, 1/s."""
    residue: Complex
    """α u w of each pole, 1/s, ``(N,)``."""
    right: Complex
    left: Complex
    """Eigenvectors of one eigenvalue, ``(N,)``; scratch."""


class Heated(NamedTuple):
    """The held regimes at all α > 0."""

    matrix: RankOne
    response: Array
    """R, ``(mode, thermal mode)``."""
    heat_tip: Array
    observed: Array
    source: Array
    """z'' and τ' per input w, see :class:`~workflow.schemes._exact.layout.Regime`, without friction heat,
    ``(mode + thermal mode, input)``."""
    inputs: Array
    """Contact force per input, ``(input,)``."""
    entry: Array
    exit: Array


class HeldRegimes:
    """The held regimes of a structure; ``length`` is that of their rows, ``sensors`` show displacements."""

    def __init__(self, held: ModalSystem, length: int, sensors: Array):
        self._held, self._observable, self._length = held, observable(held, sensors), length
        self._sensors, all_react = sensors, bool(_reacts(self._observable).all())
        self._heated = _heated(self._observable) if all_react and not held.is_coupled else None

    def at(self, alpha: Array, friction: Array, heated: NDArray[np.bool_], duration: float) -> Regimes:
        """Return the regimes at some α [W/N] and µ for a duration [s], without thermal modes where no heat acts."""
        rows, found = np.zeros((alpha.size, self._length)), np.zeros(alpha.size, dtype=np.bool_)
        slides = (friction != 0) & (self._held.tangent is not None)
        if self._heated is not None:
            size = self._heated.matrix.d.size
            zeros = Zeros(np.zeros(size, np.int64), *np.zeros((4, size), np.complex128))
            _fill_rows(self._heated, np.where(slides, 0.0, alpha), zeros, rows, found)
        for k in np.flatnonzero(~found):
            system = self._system(slides[k] * friction[k], alpha[k] > 0, heated[k])
            found[k] = fill_row(rows[k], system, alpha[k], duration)
        return Regimes(rows, found)

    def _system(self, friction: float, heats: bool, heated: bool) -> ModalSystem:
        """Return the system of the held tip, of observable modes where friction or its heat links them."""
        if friction != 0:
            return observable((self._held if heated else self._held.unheated).sliding(friction), self._sensors)
        return self._observable if heats else self._held if heated else self._held.unheated


def _heated(held: ModalSystem) -> Heated | None:
    """Return the arguments of the kernel; ``None`` where poles or rates are near each other, or a pole is 0."""
    response = thermal_response(held, CRITICAL)
    force = np.concatenate([held.reaction, held.reaction_slope, held.thermal_reaction])
    matrix = None if response is None else rank_one(held, response, force, held.heat_tip)
    if response is None or matrix is None:
        return None
    tips = response, held.heat_tip, held.observed
    arrays = *tips, state_space(held, 0.0)[2][held.frequency.size :], signal_inputs(held), held.entry, held.exit
    return Heated(matrix, *(np.ascontiguousarray(a, dtype=np.float64) for a in arrays))


def rank_one(modes: _Modes, response: Array, force: Array, heat: Array) -> RankOne | None:
    """Return D, u and w of a contact that sees the heat ``heat`` and loses ``force`` per [z, z', τ].

    ``None`` where poles of a mode are near each other, or one is 0.
    """
    c, mu, omega2 = modes.damping, modes.rate, modes.frequency**2
    r, lag, thermal = np.split(force, [c.size, 2 * c.size])
    split = 2 * np.sqrt((c / 2) ** 2 - omega2 + 0j)
    if np.any(np.abs(split) <= CRITICAL * (modes.frequency + c)) or np.any(modes.frequency == 0):
        return None
    upper, lower = -c / 2 + split / 2, -c / 2 - split / 2
    overdamped = (split.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    place, speed = -response @ heat, response @ (mu * heat)  # of z - R τ per heat
    u = [(speed - lower * place) / split, (upper * place - speed) / split, heat]
    w = [-r - lag * upper, -r - lag * lower, -thermal - r @ response + lag @ (response * mu)]
    return RankOne(mu.size, *(np.concatenate(each).astype(np.complex128) for each in ([upper, lower, -mu], u, w)))


@kernel
def _fill_rows(h: Heated, alpha: Array, zeros: Zeros, rows: Array, found: NDArray[np.bool_]) -> None:
    """Store the regimes at those α > 0 at which the spectrum is accurate in rows of zeros, and which these are."""
    for i in range(alpha.size):
        if alpha[i] > 0.0:
            count = find_zeros(h.matrix, alpha[i], zeros)
            if count > 0:
                found[i] = _fill_row(h, alpha[i], count, zeros, rows[i])
                _complete(rows[i])


@part
def _fill_row(h: Heated, alpha: float, count: int, zeros: Zeros, row: Array) -> bool:
    """Store the regime at α; return whether the spectrum is accurate."""
    pairs = h.matrix.d.size - count
    row[0], row[1], row[2], row[3], row[4] = pairs, count - pairs, h.inputs.size, h.entry.shape[0] - 1, h.entry.shape[1]
    regime = in_row(row)
    b, f, outward = regime.block, regime.first, regime.outward
    signals = b[block.ROWS + seen.SIGNAL_VALUE :], f[first.ROWS]
    sound = fill_blocks(h.matrix, h.response, alpha, count, zeros, (b, f, regime.inward, outward), signals)
    for p in range(pairs):
        b[block.ROWS + seen.TEMPERATURE_VALUE, p] = _observed(h, outward[p])
        b[block.ROWS + seen.TEMPERATURE_SLOPE, p] = _observed(h, outward[pairs + p])
    for j in range(count - pairs):
        f[first.ROWS + 1, j] = _observed(h, outward[2 * pairs + j])
    _fill_shared(h, alpha, regime)
    return sound


@part
def fill_blocks(
    matrix: RankOne,
    response: Array,
    alpha: float,
    count: int,
    zeros: Zeros,
    tables: tuple[Array, Array, Array, Array],
    signals: tuple[Array, Array],
) -> bool:
    """Fill blocks, which are pairs of eigenvalues, and first-order states; return whether the spectrum is accurate.

    A pair s = σ ± iν with right and left eigenvectors x and ξ = l X has the real coordinates η = Re ξ
    and u = Re(s ξ), so that η' = u, u' = 2σ u - |s|² η and X = 2 Re(x ξ). ``signals`` are the contact force per η and
    η', two rows, and per ξ.
    """
    (b, f, inward, outward), (signal, slow), size = tables, signals, matrix.d.size
    pairs, p, j, sound = size - count, 0, 0, True
    while p + j < count:
        i = _next(matrix.d, zeros, count)
        s = matrix.d[zeros.pole[i]] + zeros.shift[i]
        force, good = _fill_vectors(matrix, alpha, zeros, i)
        _to_modes(response, matrix.d, s, zeros.right, zeros.left)
        zeros.pole[i] = -1
        sound = sound and good
        if s.imag > 0.0:
            ratio, u = s.real / s.imag, pairs + p
            b[block.DAMPING, p], b[block.STIFFNESS, p] = -2.0 * s.real, square(s)
            signal[0, p] = 2.0 * (force.real - force.imag * ratio)
            signal[1, p] = 2.0 * force.imag / s.imag
            for n in range(size):
                right, left = zeros.right[n], zeros.left[n]
                inward[n, p], inward[n, u] = left.real, (s * left).real
                outward[p, n], outward[u, n] = 2.0 * (right.real - right.imag * ratio), 2.0 * right.imag / s.imag
            p += 1
        else:
            own = 2 * pairs + j
            f[first.RATE, j], slow[j] = -s.real, force.real
            for n in range(size):
                inward[n, own], outward[own, n] = zeros.left[n].real, zeros.right[n].real
            j += 1
    return sound


@part
def _observed(h: Heated, coordinate: Array) -> float:
    """Return the tip temperature per coordinate, from its row of X."""
    temperature, modes = 0.0, h.response.shape[0]
    for j in range(h.observed.size):
        temperature += h.observed[j] * coordinate[2 * modes + j]
    return temperature


@part
def _fill_shared(h: Heated, alpha: float, regime: Regime) -> None:
    """Fill the sources of coordinates and the transforms of modes."""
    modes, heats = h.response.shape
    source, inward, size = regime.source, regime.inward, regime.outward.shape[0]
    for i in range(h.inputs.size):
        for n in range(modes + heats):
            per = h.source[n, i] + (alpha * h.inputs[i] * h.heat_tip[n - modes] if n >= modes else 0.0)
            if per != 0.0:
                for k in range(source.shape[1]):
                    source[i, k] += per * inward[modes + n, k]
        source[i, size] = h.inputs[i]
    for m in range(modes):
        for n in range(h.entry.shape[0]):
            regime.entry[n, m] = h.entry[n, m]
    for m in range(modes + 1):
        for n in range(h.exit.shape[1]):
            regime.exit[m, n] = h.exit[m, n]


@part
def _next(d: Complex, zeros: Zeros, count: int) -> int:
    """Return the next eigenvalue, complex ones first, each kind in the order of its size; those done have pole -1."""
    best, kind, least = -1, False, np.inf
    for i in range(count):
        if zeros.pole[i] >= 0:
            s = d[zeros.pole[i]] + zeros.shift[i]
            above, size = s.imag > 0.0, square(s)
            if best < 0 or (above and not kind) or (above == kind and size < least):
                best, kind, least = i, above, size
    return best


@part
def _to_modes(response: Array, d: Complex, s: complex, right: Complex, left: Complex) -> None:
    """Transform eigenvectors at s from the poles of modes, with R τ subtracted, to X = [z, z', τ]."""
    modes, heats = response.shape
    for m in range(modes):
        n, upper, lower = modes + m, d[m], d[modes + m]
        per = reciprocal(upper - lower)
        right[m] += right[n]
        left[m], left[n] = (upper * left[n] - lower * left[m]) * per, (left[m] - left[n]) * per
        for j in range(heats):
            k, along = 2 * modes + j, response[m, j]
            right[m] += along * right[k]
            left[k] -= along * (left[m] + d[k].real * left[n])
        right[n] = s * right[m]


@inlined
def square(x: complex) -> float:
    """Return |x|²."""
    return x.real * x.real + x.imag * x.imag


@inlined
def reciprocal(x: complex) -> complex:
    """Return 1/x, without a guard against overflow."""
    return x.conjugate() * (1.0 / square(x))


@part
def find_zeros(matrix: RankOne, alpha: float, zeros: Zeros) -> int:
    """Find the zeros from their first order in α; return their number, 0 where they are not distinct."""
    for k in range(matrix.d.size):
        zeros.residue[k] = alpha * matrix.u[k] * matrix.w[k]
    count, above = _first_order(matrix, zeros), 0
    for i in range(count):
        k, shift = zeros.pole[i], zeros.shift[i]
        real = matrix.d[k].imag + shift.imag == 0.0
        shift = _newton(matrix.d, zeros.residue, k, shift, real)
        height = 0.0 if real else matrix.d[k].imag + shift.imag
        size = square(shift)
        if not (real or height * height > _DISTINCT * _DISTINCT * size) or not size < np.inf:
            return 0
        zeros.shift[i] = shift
        above += int(height > 0.0)
        for n in range(i):
            away = (matrix.d[k] - matrix.d[zeros.pole[n]]) + (shift - zeros.shift[n])
            if not square(away) > _DISTINCT * _DISTINCT * (size + square(zeros.shift[n])):
                return 0
    return count if above + count == matrix.d.size else 0


@part
def _first_order(matrix: RankOne, zeros: Zeros) -> int:
    """Fill the zeros near poles to first order in α; at thermal rates the structure responds quasi-statically."""
    d, thermal, yielding, count = matrix.d, matrix.thermal, 1.0, 0
    fast = d.size - thermal
    for k in range(fast):
        yielding += (zeros.residue[k] * reciprocal(d[k])).real
        if d[k].imag >= 0.0:
            zeros.pole[count], zeros.shift[count] = k, zeros.residue[k]
            count += 1
    for k in range(fast, d.size):
        shift = zeros.residue[k].real / yielding
        for other in range(fast, d.size):  # at most a third of the distance to another rate
            if other != k:
                most = abs(d[k].real - d[other].real) / 3.0
                shift = min(max(shift, -most), most)
        zeros.pole[count], zeros.shift[count] = k, shift
        count += 1
    return count


@part
def _newton(d: Complex, residue: Complex, own: int, shift: complex, real: bool) -> complex:
    """Return the zero of δ f(d + δ) by Newton's method, NaN where it does not converge."""
    if residue[own] == 0.0:
        return 0.0j
    for _ in range(_NEWTON_STEPS):
        f, slope = 1.0 + 0.0j, 0.0j
        for k in range(d.size):
            if k != own:
                inverse = reciprocal((d[own] - d[k]) + shift)
                term = residue[k] * inverse
                f -= term
                slope += term * inverse
        step = (shift * f - residue[own]) * reciprocal(f + shift * slope)
        shift -= complex(step.real, 0.0) if real else step
        if square(step) <= _CONVERGED * _CONVERGED * square(shift):
            return shift
    return complex(np.nan, 0.0)


@part
def _fill_vectors(matrix: RankOne, alpha: float, zeros: Zeros, i: int) -> tuple[complex, bool]:
    """Fill the eigenvectors of zero ``i``, left · right = 1; return wᵀ right, and whether they keep their digits.

    Near a pole its factor 1/(s - d) is the largest: its component of the right vector is set to 1.
    """
    _, d, u, w = matrix
    own, shift, right, left = zeros.pole[i], zeros.shift[i], zeros.right, zeros.left
    f, length, terms = 1.0 + 0.0j, 1.0 + 0.0j, 1.0
    for k in range(d.size):
        if k != own:
            inverse = reciprocal((d[own] - d[k]) + shift)
            right[k], left[k] = alpha * u[k] * inverse, w[k] * inverse
            f -= w[k] * right[k]
    force, heat = w[own] * reciprocal(f), alpha * u[own] * reciprocal(f)
    for k in range(d.size):
        if k != own:
            right[k], left[k] = force * right[k], heat * left[k]
            term = left[k] * right[k]
            length += term
            terms += abs(term.real) + abs(term.imag)
    right[own], left[own] = 1.0 + 0.0j, 1.0 + 0.0j
    for k in range(d.size):
        left[k] *= reciprocal(length)
    return force, square(length) > _INDEPENDENT * _INDEPENDENT * terms * terms
