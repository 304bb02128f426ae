"""The held regime with friction heat where damping couples no modes: all that depends on α, in one kernel.

Per contact force λ = 1 an eigenvector at s of X = [z, z', τ] has τ = α χ_n/(s + μ) and z = -G τ/(s² + c s + ω²). Beside
a pole its own factor is the largest: there the vector is 1, and the differences s - d of the others keep their digits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.algebra import Complex, eigenvalues
from workflow.kernels.compiled import kernel, part, rolled
from workflow.models import Array
from workflow.schemes._exact.layout import Layout, layout
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.rank_one import (
    INDEPENDENT,
    RankOne,
    Zeros,
    find_zeros,
    put_guesses,
    reciprocal,
    room,
    square,
)
from workflow.schemes._exact.regimes import Regime, linked, regime_of
from workflow.schemes._exact.spectrum import rank_one, separated


class TwoWay(NamedTuple):
    """The held regimes at all α > 0; arrays without a word are those of the modal system."""

    matrix: RankOne
    damping: Array
    coupling: Array
    reaction: Array
    reaction_slope: Array
    thermal_reaction: Array
    heat_tip: Array
    source: Array
    """z'' and τ' per input w, see :class:`~workflow.schemes._exact.regimes.Regime`, but for friction heat,
    ``(mode + thermal mode, input)``."""
    inputs: Array
    """Contact force per input, ``(input,)``."""
    entry: Array
    exit: Array


class Vectors(NamedTuple):
    """Memory of one eigenvalue: eigenvectors in X, and the factors of modes and thermal modes."""

    right: Complex
    left: Complex
    inverse: Complex
    """1/(s² + c s + ω²) of modes and 1/(s + μ) of thermal modes, 0 where the pole is the eigenvalue's own."""
    slope: Complex
    """r + s r' of modes."""
    warmth: Complex
    """α χ_n/(s + μ) of thermal modes, per λ."""


class HeldRegimes:
    """The held regimes of a batch, for one α after the other."""

    def __init__(self, held: ModalSystem):
        self._held, self._linked = held, linked(held)
        system = None if held.is_coupled else separated(self._linked, state_space(self._linked, 0.0)[0])
        self._two_way = None if system is None else _two_way(self._linked, rank_one(self._linked, system))

    def at(self, alpha: float, friction: float = 0.0) -> Layout:
        """Return the regime at α [W/N], and µ along the tangent."""
        system = self._held.sliding(friction)
        if system is not self._held:
            return layout(regime_of(linked(system), alpha))
        if alpha > 0 and self._two_way is not None:
            zeros = room(self._two_way.matrix.d.size)
            is_solved, regime = _regime_at(self._two_way, alpha, zeros, 0)
            if not is_solved and zeros.pole.size:
                values = eigenvalues(state_space(self._linked, alpha)[0])
                given = put_guesses(self._two_way.matrix, values, zeros)
                is_solved, regime = _regime_at(self._two_way, alpha, zeros, given)
            if is_solved:
                return regime
        return layout(regime_of(self._linked if alpha > 0 else self._held, alpha))


def _two_way(held: ModalSystem, matrix: RankOne) -> TwoWay:
    """Return what the kernel takes."""
    modes, names = held.frequency.size, ("damping", "coupling", "reaction", "reaction_slope", "thermal_reaction")
    arrays = *(getattr(held, name) for name in names), held.heat_tip, state_space(held, 0.0)[2][modes:]
    arrays = *arrays, signal_inputs(held), held.entry, held.exit
    return TwoWay(matrix, *(np.ascontiguousarray(a, dtype=np.float64) for a in arrays))


@kernel
@rolled
def _regime_at(h: TwoWay, alpha: float, zeros: Zeros, given: int) -> tuple[bool, Layout]:
    """Return whether the spectrum at α can be trusted, and the regime, in the coordinates of ``regimes._two_way``."""
    count, (modes, heats), d = find_zeros(h.matrix, alpha, zeros, given), h.coupling.shape, h.matrix.d
    size, pairs, sound = d.size, 2 * modes + heats - count, count > 0
    if not sound:
        count = pairs = 0
    firsts = size - 2 * pairs
    v = Vectors(
        np.empty(size, np.complex128),
        np.empty(size, np.complex128),
        np.empty(modes + heats, np.complex128),
        np.empty(modes, np.complex128),
        np.empty(heats, np.complex128),
    )
    wide = 8 * (size // 8 + 1)
    inward, outward, source = np.zeros((size, wide)), np.zeros((size, size)), np.zeros((h.inputs.size, wide))
    damping, stiffness, rate, signal = np.zeros(pairs), np.zeros(pairs), np.zeros(firsts), np.zeros(size)
    p, q = 0, 2 * pairs
    while p + q < 2 * pairs + count:
        i = _next(d, zeros, count)
        k = zeros.pole[i]
        shift, s = zeros.shift[i], d[k] + zeros.shift[i]
        force, good = _vectors(h, alpha, k, shift, v)
        zeros.pole[i] = -1
        sound &= good
        if s.imag > 0.0:
            ratio = s.real / s.imag
            damping[p], stiffness[p] = -2.0 * s.real, s.real * s.real + s.imag * s.imag
            signal[p], signal[pairs + p] = 2.0 * (force.real - force.imag * ratio), 2.0 * force.imag / s.imag
            for n in range(size):
                inward[n, p], inward[n, pairs + p] = v.left[n].real, (s * v.left[n]).real
                outward[p, n] = 2.0 * (v.right[n].real - v.right[n].imag * ratio)
                outward[pairs + p, n] = 2.0 * v.right[n].imag / s.imag
            p += 1
        else:
            rate[q - 2 * pairs], signal[q] = -s.real, force.real
            for n in range(size):
                inward[n, q], outward[q, n] = v.left[n].real, v.right[n].real
            q += 1
    temperature = np.zeros(size)
    for n in range(size):
        for j in range(heats):
            temperature[n] += h.heat_tip[j] * outward[n, 2 * modes + j]
    for i in range(h.inputs.size):
        _fill_source(h, alpha, inward, i, source[i])
        source[i, size] = h.inputs[i]
    coupling, resonant = np.zeros((3, firsts, pairs)), np.zeros(pairs)
    regime = Regime(
        damping, stiffness, rate, coupling, resonant, signal, temperature, source, inward, outward, h.entry, h.exit
    )
    return sound, layout(regime)


@part
def _next(d: Complex, zeros: Zeros, count: int) -> int:
    """Return the eigenvalue that is due, complex ones first, each kind by its size; those done have no pole."""
    best, kind, least = -1, False, np.inf
    for i in range(count):
        if zeros.pole[i] >= 0:
            s = d[zeros.pole[i]] + zeros.shift[i]
            above, size = s.imag > 0.0, s.real * s.real + s.imag * s.imag
            if best < 0 or (above and not kind) or (above == kind and size < least):
                best, kind, least = i, above, size
    return best


@part
def _vectors(h: TwoWay, alpha: float, own: int, shift: complex, v: Vectors) -> tuple[complex, bool]:
    """Fill eigenvectors, left · right = 1; return the contact force per right one, and whether they keep their digits.

    y = α χ_nᵀ l_τ is to the left vector what λ is to the right one.
    """
    (modes, heats), d, right, left = h.coupling.shape, h.matrix.d, v.right, v.left
    s, mode, heat = d[own] + shift, own % modes if own < 2 * modes else -1, own - 2 * modes
    f = 1.0 + 0.0j
    for j in range(heats):
        v.inverse[modes + j] = 0.0 if j == heat else reciprocal((d[own] - d[2 * modes + j]) + shift)
        v.warmth[j] = alpha * h.heat_tip[j] * v.inverse[modes + j]
        f += h.thermal_reaction[j] * v.warmth[j]
        left[2 * modes + j] = -h.thermal_reaction[j]
    for m in range(modes):
        inverse = reciprocal((d[own] - d[m]) + shift) * reciprocal((d[own] - d[modes + m]) + shift)
        v.inverse[m] = 0.0 if m == mode else inverse
        v.slope[m] = h.reaction[m] + s * h.reaction_slope[m]
        left[modes + m], push = -v.slope[m] * v.inverse[m], 0.0j
        for j in range(heats):
            left[2 * modes + j] -= h.coupling[m, j] * left[modes + m]
            push += h.coupling[m, j] * v.warmth[j]
        right[m] = push
        f += left[modes + m] * push
    driven = left[2 * modes + heat] if mode < 0 else 0.0j
    for j in range(heats):
        left[2 * modes + j] *= v.inverse[modes + j]
    if mode >= 0:
        force, y = -v.slope[mode] * reciprocal(f), -right[mode] * reciprocal(f)
    else:
        force, y = driven * reciprocal(f), alpha * h.heat_tip[heat] * reciprocal(f)
    for m in range(modes):
        own_push = 0.0 if mode >= 0 else h.coupling[m, heat]
        right[m] = 1.0 + 0.0j if m == mode else -(force * right[m] + own_push) * v.inverse[m]
        right[modes + m] = s * right[m]
        left[modes + m] = 1.0 + 0.0j if m == mode else y * left[modes + m]
        left[m] = (s + h.damping[m]) * left[modes + m] + y * h.reaction_slope[m]
    for j in range(heats):
        own_push = 0.0 if mode < 0 else h.coupling[mode, j]
        right[2 * modes + j] = 1.0 + 0.0j if j == heat else force * v.warmth[j]
        left[2 * modes + j] = 1.0 + 0.0j if j == heat else y * left[2 * modes + j] - own_push * v.inverse[modes + j]
    length, terms = 0.0j, 0.0
    for n in range(right.size):
        term = left[n] * right[n]
        length += term
        terms += abs(term.real) + abs(term.imag)
    scale = reciprocal(length)
    for n in range(left.size):
        left[n] *= scale
    return force, square(length) > INDEPENDENT * INDEPENDENT * terms * terms


@part
def _fill_source(h: TwoWay, alpha: float, inward: Array, i: int, source: Array) -> None:
    """Fill the sources of coordinates per input ``i``."""
    modes, heats = h.coupling.shape
    for n in range(modes + heats):
        per = h.source[n, i] + (alpha * h.inputs[i] * h.heat_tip[n - modes] if n >= modes else 0.0)
        if per != 0.0:
            for q in range(inward.shape[1]):
                source[q] += per * inward[modes + n, q]
