"""Forced response of blocks near resonance: divided differences of exp, computed without a division.

The response of η'' + c η' + ω² η = e^(a t), from rest, is t² exp[p t, q t, a t], the divided difference of exp at the
block's poles p, q and a = iΩ of a wave, 0 of a constant; one more node 0 integrates. Divided
differences are the entries of the exponential of the bidiagonal matrix of their nodes (G. Opitz, Z. Angew. Math. Mech.
44 (1964) T52–T54): it is scaled, summed as a Taylor series and squared, its diagonal exact each time (A. McCurdy,
K. C. Ng, B. N. Parlett, Math. Comp. 43 (1984) 501–528), whether nodes are far apart, close or equal.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import part
from workflow.schemes._exact.motion import Motion, forced
from workflow.schemes._exact.tables import block, state, wave
from workflow.schemes._exact.waves import wave_phase

_NODES, _TERM = 4, 5
"""Rows of :attr:`Motion.differences` below the matrix: its diagonal, and terms of its series."""

_SPAN = 3.0
"""Largest |node| · time of the series: its terms exceed their sum by less than a digit or two."""

_NEGLIGIBLE = 1e-21
"""Size of terms of the series of e^|z| below which they are left out: a hundredth of the rounding of the corner entry,
1/24 at z = 0, and of its neighbours."""


@part
def explicit_force(m: Motion, k: int, t: float) -> float:
    """Return the force on an explicit block at t."""
    force = m.block[block.FORCE, k]
    for i in range(m.waves.shape[0]):
        cos, sin = wave_phase(m.waves, i, t)
        row = i * block.WAVE
        force = force + m.block[block.FORCE_COS + row, k] * cos + m.block[block.FORCE_SIN + row, k] * sin
    return float(force)


@part
def explicit_derivatives(m: Motion, k: int, y: Array, t: float, order: int, out: Array) -> None:
    """Fill η of an explicit block in the state ``y`` of time t, and its derivatives up to ``order``."""
    b = m.block
    out[0], out[1] = y[state.VALUE, k], y[state.SLOPE, k]
    for n in range(2, order + 1):
        out[n] = b[block.FORCE, k] if n == 2 else 0.0
    for i in range(m.waves.shape[0]):
        omega, row, (cos, sin) = m.waves[i, wave.OMEGA], i * block.WAVE, wave_phase(m.waves, i, t)
        f_cos, f_sin = b[block.FORCE_COS + row, k], b[block.FORCE_SIN + row, k]
        for n in range(2, order + 1):
            out[n] += f_cos * cos + f_sin * sin
            f_cos, f_sin = omega * f_sin, -omega * f_cos
    for n in range(2, order + 1):
        out[n] -= b[block.DAMPING, k] * out[n - 1] + b[block.STIFFNESS, k] * out[n - 2]


@part
def _exponential(z: complex) -> complex:
    """Return e^z."""
    size, (sin, cos) = elementary.exp(z.real), elementary.sine_cosine(z.imag)
    return complex(size * cos, size * sin)


@part
def _differences(m: Motion, k: int, a: complex, dt: float, size: int) -> None:
    """Fill the rows of :attr:`Motion.differences` with exp(Z dt), ``size`` rows and columns.

    Z has the nodes p, q, a, 0 on its diagonal, |p| <= |q|, and 1 beside it: entry (i, j) is the divided difference
    at the nodes i to j, times dt^(j - i). Rows below the second are filled where that takes squaring.
    """
    e, c, w2 = m.differences, m.block[block.DAMPING, k], m.block[block.STIFFNESS, k]
    half = 0.5 * c
    square = half * half - w2
    if square < 0.0:
        e[_NODES, 0], e[_NODES, 1] = complex(-half, np.sqrt(-square)), complex(-half, -np.sqrt(-square))
    else:
        q = -(half + np.copysign(np.sqrt(square), half))
        e[_NODES, 0], e[_NODES, 1] = w2 / q if q != 0.0 else 0.0, q
    e[_NODES, 2] = a
    span, h, doublings = max(np.sqrt(w2), abs(c), abs(a.real) + abs(a.imag)) * abs(dt), dt, 0
    while span > _SPAN:
        span, h, doublings = 0.5 * span, 0.5 * h, doublings + 1
    rows, n, largest = size if doublings > 0 else 2, 0, 1.0
    for i in range(rows):
        for j in range(i, size):
            e[i, j] = e[_TERM + i, j] = 1.0 if j == i else 0.0
    while n < size or largest > _NEGLIGIBLE:
        n += 1
        step = h / n
        largest *= span / n
        for i in range(rows):
            for j in range(size - 1, i, -1):
                e[_TERM + i, j] = (e[_NODES, j] * e[_TERM + i, j] + e[_TERM + i, j - 1]) * step
                e[i, j] += e[_TERM + i, j]
            e[_TERM + i, i] *= e[_NODES, i] * step
    for _ in range(doublings):
        for i in range(size):
            e[i, i] = _exponential(e[_NODES, i] * h)
        for i in range(size):
            for j in range(size - 1, i, -1):
                total = (e[i, i] + e[j, j]) * e[i, j]
                for n in range(i + 1, j):
                    total += e[i, n] * e[n, j]
                e[i, j] = total
        h *= 2.0


@part
def advance_explicit(m: Motion, k: int, y: Array, t: float, dt: float, size: int) -> tuple[float, float, float]:
    """Return η, η' and ∫η dt of an explicit block a time ``dt`` after the state ``y`` of time t.

    The initial state is applied as constant forces, so that no small change is lost beside 1. ``size`` is 3, or 4 for
    the integral, which is meaningless otherwise.
    """
    e, b, before, pace = m.differences, m.block, y[state.VALUE, k], y[state.SLOPE, k]
    c, w2 = b[block.DAMPING, k], b[block.STIFFNESS, k]
    constant, value, slope, area = b[block.FORCE, k], 0.0, 0.0, 0.0
    for i in range(m.waves.shape[0]):
        if forced(b, k, i):
            row, (cos, sin) = i * block.WAVE, wave_phase(m.waves, i, t)
            f = complex(b[block.FORCE_COS + row, k], -b[block.FORCE_SIN + row, k]) * complex(cos, sin)
            _differences(m, k, complex(0.0, m.waves[i, wave.OMEGA]), dt, size)
            value += (f * e[0, 2]).real
            slope += (f * (e[_NODES, 0] * e[0, 2] + e[1, 2])).real
            area += (f * e[0, 3]).real
    _differences(m, k, complex(0.0, 0.0), dt, size)
    once, twice = e[0, 1].real, e[0, 2].real
    area += before * once + (pace + c * before) * twice + constant * e[0, 3].real
    constant -= w2 * before
    value += pace * once + constant * twice
    slope += (constant - c * pace) * once - w2 * pace * twice
    return before + value, pace + slope, area
