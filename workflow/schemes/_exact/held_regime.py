"""The held regimes of a batch at all α; with friction heat and uncoupled modes one kernel computes them.

With the response R of the modes to thermal modes subtracted, z - R τ, and each mode split by its two poles, the matrix
of the held tip without friction heat is diagonal, and the heat a rank-one term
(:mod:`workflow.schemes._exact.rank_one`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import kernel, part
from workflow.schemes._exact.layout import tabulate
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.rank_one import RankOne, Zeros, fill_vectors, find_zeros, reciprocal, square
from workflow.schemes._exact.regimes import Regimes, fill_row, observable, thermal_response

_CRITICAL = 1e-2
"""Relative distance of the two poles of a mode, or of a pole and a thermal rate, below which the general solver is
used, as digits are lost by its square."""


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
    """The held regimes of a structure; ``length`` is that of their rows."""

    def __init__(self, held: ModalSystem, length: int):
        self._held, self._observable, self._length = held, observable(held), length
        self._heated = None if held.is_coupled else _heated(self._observable)

    def at(self, alpha: Array, friction: Array, heated: NDArray[np.bool_]) -> Regimes:
        """Return the regimes at some α [W/N] and µ along the tangent, without thermal modes where no heat acts."""
        rows, found = np.empty((alpha.size, self._length)), np.zeros(alpha.size, dtype=np.bool_)
        slides = (friction != 0) & (self._held.tangent is not None)
        if self._heated is not None:
            _fill_rows(self._heated, np.where(slides, 0.0, alpha), rows, found)
        for k in np.flatnonzero(~found):
            found[k] = fill_row(rows[k], self._system(slides[k] * friction[k], alpha[k] > 0, heated[k]), alpha[k])
        return Regimes(rows, found)

    def _system(self, friction: float, heats: bool, heated: bool) -> ModalSystem:
        """Return the system of the held tip, of observable modes where friction or its heat links them."""
        if friction != 0:
            return observable((self._held if heated else self._held.unheated).sliding(friction))
        return self._observable if heats else self._held if heated else self._held.unheated


def _heated(held: ModalSystem) -> Heated | None:
    """Return the arguments of the kernel; ``None`` where poles or rates are near each other, or a pole is 0."""
    c, mu, omega2, r, lag = held.damping, held.rate, held.frequency**2, held.reaction, held.reaction_slope
    split = 2 * np.sqrt((c / 2) ** 2 - omega2 + 0j)
    response, near = thermal_response(held, _CRITICAL), np.abs(split) <= _CRITICAL * (held.frequency + c)
    if response is None or np.any(near) or np.any(held.frequency == 0):
        return None
    upper, lower = -c / 2 + split / 2, -c / 2 - split / 2
    overdamped = (split.imag == 0) & (c > 0)
    upper[overdamped] = omega2[overdamped] / lower[overdamped]  # no cancellation
    place, speed = -response @ held.heat_tip, response @ (mu * held.heat_tip)  # of z - R τ per heat
    u = [(speed - lower * place) / split, (upper * place - speed) / split, held.heat_tip]
    w = [-r - lag * upper, -r - lag * lower, -held.thermal_reaction - r @ response + lag @ (response * mu)]
    matrix = (np.concatenate(each).astype(np.complex128) for each in ([upper, lower, -mu], u, w))
    tips = response, held.heat_tip, held.observed
    arrays = *tips, state_space(held, 0.0)[2][c.size :], signal_inputs(held), held.entry, held.exit
    return Heated(RankOne(mu.size, *matrix), *(np.ascontiguousarray(a, dtype=np.float64) for a in arrays))


@kernel
def _fill_rows(h: Heated, alpha: Array, rows: Array, found: NDArray[np.bool_]) -> None:
    """Store the regimes at those α > 0 at which the spectrum is accurate, and which these are."""
    for i in range(alpha.size):
        if alpha[i] > 0.0:
            found[i] = _fill_row(h, alpha[i], rows[i])


@kernel
def _fill_row(h: Heated, alpha: float, row: Array) -> bool:
    """Store the regime at α, whose blocks are complex pairs of eigenvalues; return whether the spectrum is accurate.

    A pair s = σ ± iν with right and left eigenvectors x and ξ = l X has the real coordinates η = Re ξ
    and u = Re(s ξ), so that η' = u, u' = 2σ u - |s|² η and X = 2 Re(x ξ).
    """
    (modes, heats), d = h.response.shape, h.matrix.d
    size = d.size
    right, left = np.empty(size, np.complex128), np.empty(size, np.complex128)
    zeros = Zeros(np.zeros(size, np.int64), np.zeros(size, np.complex128), np.zeros(size, np.complex128))
    count = find_zeros(h.matrix, alpha, zeros)
    sound, pairs = count > 0, size - count if count > 0 else 0
    firsts, wide = size - 2 * pairs, 8 * (size // 8 + 1)
    inward, outward, source = np.zeros((size, wide)), np.zeros((size, size)), np.zeros((h.inputs.size, wide))
    damping, stiffness, rate, signal = np.zeros(pairs), np.zeros(pairs), np.zeros(firsts), np.zeros(size)
    p, q = 0, 2 * pairs
    while p + q < 2 * pairs + count:
        i = _next(d, zeros, count)
        k = zeros.pole[i]
        s = d[k] + zeros.shift[i]
        force, good = fill_vectors(h.matrix, alpha, k, zeros.shift[i], right, left)
        _to_modes(h, s, right, left)
        zeros.pole[i] = -1
        sound &= good
        if s.imag > 0.0:
            ratio = s.real / s.imag
            damping[p], stiffness[p] = -2.0 * s.real, square(s)
            signal[p], signal[pairs + p] = 2.0 * (force.real - force.imag * ratio), 2.0 * force.imag / s.imag
            for n in range(size):
                inward[n, p], inward[n, pairs + p] = left[n].real, (s * left[n]).real
                outward[p, n] = 2.0 * (right[n].real - right[n].imag * ratio)
                outward[pairs + p, n] = 2.0 * right[n].imag / s.imag
            p += 1
        else:
            rate[q - 2 * pairs], signal[q] = -s.real, force.real
            for n in range(size):
                inward[n, q], outward[q, n] = left[n].real, right[n].real
            q += 1
    temperature = np.zeros(size)
    for n in range(size):
        for j in range(heats):
            temperature[n] += h.observed[j] * outward[n, 2 * modes + j]
    for i in range(h.inputs.size):
        for n in range(modes + heats):
            per = h.source[n, i] + (alpha * h.inputs[i] * h.heat_tip[n - modes] if n >= modes else 0.0)
            if per != 0.0:
                for k in range(wide):
                    source[i, k] += per * inward[modes + n, k]
        source[i, size] = h.inputs[i]
    tabulate(row, damping, stiffness, rate, signal, temperature, source, inward, outward, h.entry, h.exit)
    return bool(sound)


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
def _to_modes(h: Heated, s: complex, right: Complex, left: Complex) -> None:
    """Transform eigenvectors at s from the poles of modes, with R τ subtracted, to X = [z, z', τ]."""
    (modes, heats), d = h.response.shape, h.matrix.d
    for m in range(modes):
        n, upper, lower = modes + m, d[m], d[modes + m]
        per = reciprocal(upper - lower)
        right[m] += right[n]
        left[m], left[n] = (upper * left[n] - lower * left[m]) * per, (left[m] - left[n]) * per
        for j in range(heats):
            k, along = 2 * modes + j, h.response[m, j]
            right[m] += along * right[k]
            left[k] -= along * (left[m] + d[k].real * left[n])
        right[n] = s * right[m]
