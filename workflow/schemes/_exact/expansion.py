"""Taylor expansion of an output of a motion, with bounds that hold for all later times.

A time τ later an output s is its Taylor polynomial of degree 3 with a remainder of at most |s''''| τ⁴/24. The fourth
derivative is bounded by the amplitudes of the modes: the amplitude √(ω² s² + s'²) of a free mode does not grow, by more
than a known factor where modes are unstable. Fast modes are bounded as a group by their amplitudes, so that steps may
be much longer than their periods.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import inlined, part
from workflow.kernels.packs import magnitude, narrow, pack, store
from workflow.schemes._exact.motion import OUTPUTS, SIGNAL, Motion, wave_phase
from workflow.schemes._exact.propagation import explicit_derivatives
from workflow.schemes._exact.tables import block, expansion, first, seen, seen_wave, state, wave

SUM_ROUNDING = 4.0 * 2.220446049250313e-16
"""Size of an output, relative to the sum of the magnitudes of its terms, up to which it is rounding: four units in the
last place."""

_FAST = 2.5
"""Value of ω h above which a mode is bounded by its amplitude: (ω h)⁴/24 exceeds 1 from 2.2 on."""


@inlined
def row_sum(rows: Array, i: int, first: int, last: int) -> float:
    """Return the sum of ``rows[i, first:last]``, by eight partial sums."""
    a = b = c = d = e = f = g = h = 0.0
    eights = first + (last - first) // 8 * 8
    for start in range(first, eights, 8):
        k = np.uintp(start)  # unsigned: no wrap-around test of a negative index
        a += rows[i, k]
        b += rows[i, k + np.uintp(1)]
        c += rows[i, k + np.uintp(2)]
        d += rows[i, k + np.uintp(3)]
        e += rows[i, k + np.uintp(4)]
        f += rows[i, k + np.uintp(5)]
        g += rows[i, k + np.uintp(6)]
        h += rows[i, k + np.uintp(7)]
    subtotal = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for j in range(eights, last):
        subtotal += rows[i, j]
    return subtotal


@part
def row_size(m: Motion, row: int) -> float:
    """Return the sum of the magnitudes of the terms of a derivative in an expansion."""
    total = abs(m.expansion.sums[row, 0])
    for k in range(m.expansion.terms.shape[1]):
        total += abs(m.expansion.terms[row, k])
    return float(total)


@part
def expand(m: Motion, y: Array, t: float) -> None:
    """Expand the signal at a state."""
    expand_output(m, SIGNAL, y, t)


@part
def expand_output(m: Motion, output: int, y: Array, t: float) -> None:
    """Expand an output, ``SIGNAL`` or ``TEMPERATURE``, at the state ``y`` of time ``t``."""
    sums, d, n = m.expansion.sums, m.expansion.terms, m.blocks
    _expand_slow_terms(m, output, y, t, sums)
    _expand_blocks(m.block, y, m.rows + seen.SIGNAL_VALUE + 2 * output, d)
    for i in range(m.explicits):
        _expand_explicit(m, output, int(m.block[block.EXPLICIT_COLUMNS, i]), y, t, sums)
    for row in range(expansion.FOURTH + 1):
        sums[row, n] = sums[row, 0] + row_sum(d, row, 0, d.shape[1])
    sums[expansion.SIZE, 0] += row_sum(d, expansion.TAIL, 0, d.shape[1])
    sums[expansion.TAIL, n], sums[expansion.TAIL_SLOPE, n] = 0.0, 0.0


@part
def _expand_slow_terms(m: Motion, output: int, y: Array, t: float, sums: Array) -> None:
    """Fill column 0 of the sums with the output of loads, casing and first-order states."""
    f = m.first
    s0, s1, s2, s3 = m.outputs[OUTPUTS * m.contact + output], 0.0, 0.0, 0.0
    fourth, size = 0.0, abs(s0)
    column = np.uintp(m.columns + seen_wave.SIGNAL_COS + 2 * output)  # unsigned: no test of a negative index
    for i in range(m.waves.shape[0]):
        w = m.waves[i, wave.OMEGA]
        cos, sin = wave_phase(m.waves, i, t)
        a, b = m.waves[i, column], m.waves[i, column + np.uintp(1)]
        signal, turn, amplitude = a * cos + b * sin, b * cos - a * sin, abs(a) + abs(b)
        s0 += signal
        s1 += w * turn
        s2 += -w * w * signal
        s3 += -w * w * w * turn
        fourth += amplitude * w * w * w * w
        size += amplitude
    for j in range(m.firsts):
        value, mu = f[m.slow + output, j], -f[first.RATE, j]
        a0, d1 = value * y[state.FIRST, j], value * y[state.FIRST_SLOPE, j]
        s0 += a0
        s1 += d1
        s2 += mu * d1
        s3 += mu * mu * d1
        fourth += abs(mu * mu * mu * d1)
        size += abs(a0)
    sums[expansion.D0, 0], sums[expansion.D1, 0], sums[expansion.D2, 0], sums[expansion.D3, 0] = s0, s1, s2, s3
    sums[expansion.FOURTH, 0], sums[expansion.FOURTH_GROWTH, 0], sums[expansion.SIZE, 0] = fourth, 0.0, size


@part
def _expand_explicit(m: Motion, output: int, k: int, y: Array, t: float, sums: Array) -> None:
    """Add an explicit block to column 0 of the sums instead of its terms, which are those of free motion.

    Its s'''' is bounded by the amplitude of its third derivative, which only the third derivative of its force excites.
    """
    b, d, f3_bound, f4_bound = m.block, m.expansion.explicit, 0.0, 0.0
    explicit_derivatives(m, k, y, t, 5, d)
    for i in range(m.waves.shape[0]):
        w, row = m.waves[i, wave.OMEGA], i * block.WAVE
        cos, sin = b[block.FORCE_COS + row, k], b[block.FORCE_SIN + row, k]
        amplitude = w**3 * np.sqrt(cos * cos + sin * sin)
        f3_bound += amplitude
        f4_bound += w * amplitude
    w2 = b[block.STIFFNESS, k]
    row = m.rows + 2 * output
    value, slope = b[row + seen.SIGNAL_VALUE, k], b[row + seen.SIGNAL_SLOPE, k]
    fourth = abs(value) * np.sqrt(w2 * d[3] ** 2 + d[4] ** 2) + abs(slope) * np.sqrt(w2 * d[4] ** 2 + d[5] ** 2)
    for n in range(4):
        sums[expansion.D0 + n, 0] += value * d[n] + slope * d[n + 1]
    sums[expansion.FOURTH, 0] += fourth
    sums[expansion.FOURTH_GROWTH, 0] += abs(value) * f3_bound + abs(slope) * f4_bound
    sums[expansion.SIZE, 0] += abs(value * d[0]) + abs(slope * d[1])
    for r in range(expansion.TAIL + 1):
        m.expansion.terms[r, k] = 0.0


@part
def _expand_blocks(b: Array, y: Array, row: int, d: Array) -> None:
    """Fill the terms of all blocks as if they were free; ``row`` holds the output per η, the next one that per η'.

    The amplitude √(ω² s² + s'²) is bounded by ω |s| + |s'|: at most √2 times it, without a root.
    """
    for k in range(0, d.shape[1], 8):
        lane = narrow(k)
        c, w2 = pack(b, (block.DAMPING, lane)), pack(b, (block.STIFFNESS, lane))
        value, slope = pack(y, (state.VALUE, lane)), pack(y, (state.SLOPE, lane))
        per_value, per_slope = pack(b, (row, lane)), pack(b, (row + 1, lane))
        s0 = per_value * value + per_slope * slope
        s1 = per_value * slope + per_slope * (-c * slope - w2 * value)
        s2 = -c * s1 - w2 * s0
        s3 = -c * s2 - w2 * s1
        s4 = -c * s3 - w2 * s2
        store(d, (expansion.D0, lane), s0)
        store(d, (expansion.D1, lane), s1)
        store(d, (expansion.D2, lane), s2)
        store(d, (expansion.D3, lane), s3)
        store(d, (expansion.FOURTH, lane), pack(b, (block.OMEGA, lane)) * magnitude(s3) + magnitude(s4))
        store(d, (expansion.TAIL, lane), magnitude(s0) + pack(b, (block.INVERSE_OMEGA, lane)) * magnitude(s1))


@part
def accumulate(m: Motion) -> None:
    """Fill the columns of the sums between the first and the last."""
    b, sums, d = m.block, m.expansion.sums, m.expansion.terms
    for k in range(d.shape[1]):
        s0, s1 = d[expansion.D0, k], d[expansion.D1, k]
        d[expansion.TAIL_SLOPE, k] = np.sqrt(b[block.STIFFNESS, k] * s0 * s0 + s1 * s1)
    for k in range(m.blocks - 1):
        for row in range(expansion.FOURTH + 1):
            sums[row, k + 1] = sums[row, k] + d[row, k]
    for k in range(m.blocks - 1, -1, -1):
        slope = d[expansion.TAIL_SLOPE, k]
        sums[expansion.TAIL, k] = sums[expansion.TAIL, k + 1] + slope * b[block.INVERSE_OMEGA, k]
        sums[expansion.TAIL_SLOPE, k] = sums[expansion.TAIL_SLOPE, k + 1] + slope


@part
def expanded_blocks(m: Motion, h: float) -> int:
    """Return how many of the slowest blocks to expand over a step h; the others are bounded as a group."""
    k = m.blocks
    while k > 0 and m.block[block.OMEGA, k - 1] * h > _FAST:
        k -= 1
    return k


@part
def growth_bound(x: float) -> float:
    """Return an upper bound of e^x, 1 where x <= 0: the growth of modes over a step."""
    if x <= 0.0:
        return 1.0
    return 1.0 / (1.0 - x) if x < 0.25 else elementary.exp(x)


class Bounds(NamedTuple):
    """An expansion over (0, h], by the sums of one column."""

    d0: float
    d1: float
    d2: float
    d3: float
    """s, s' h, s'' h²/2 and s''' h³/6."""
    fourth: float
    """Bound of the remainder, max |s''''| h⁴/24."""
    tail: float
    """Bound of |s| of the blocks that are not expanded."""
    tail_slope: float
    """Bound of |s'| h of these blocks."""


@part
def bounds(m: Motion, k: int, h: float) -> Bounds:
    """Return the bounds over a step ``h`` with the ``k`` slowest blocks expanded."""
    sums, factor = m.expansion.sums, growth_bound(m.growth * h)
    return Bounds(
        sums[expansion.D0, k],
        sums[expansion.D1, k] * h,
        sums[expansion.D2, k] * h * h / 2.0,
        sums[expansion.D3, k] * h * h * h / 6.0,
        (sums[expansion.FOURTH, k] + sums[expansion.FOURTH_GROWTH, 0] * h) * factor * h**4 / 24.0,
        sums[expansion.TAIL, k] * factor,
        sums[expansion.TAIL_SLOPE, k] * factor * h,
    )
