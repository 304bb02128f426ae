"""Certified search for the first zero of a signal: gap of a free tip, force of a held one.

From a point of time on, the signal is its Taylor polynomial of degree 3 with the remainder
|s''''| τ⁴/24, and s'''' is bounded by the amplitudes of the modes, whose energy never grows (by
more than a known factor where modes grow). Where the Bernstein coefficients of the lower bound are
not negative, the signal has no zero; where those of the upper bound of its derivative are all
negative and its end is below zero, it has exactly one. Fast modes whose amplitude is small are
bounded as a group by their amplitude instead, which lets steps be much longer than their periods.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.models import Array
from workflow.schemes._event_functions import (
    DAMPING,
    EXPLICIT,
    FIRST,
    FORCE_COS,
    FORCE_SIN,
    OMEGA,
    PACE,
    PERIOD,
    RATE,
    SEEN,
    SEEN_SLOPE,
    SLOPE,
    SPECIAL,
    STIFFNESS,
    VALUE,
    row_total,
)
from workflow.schemes._event_motion import explicit_force, load_phase
from workflow.schemes._event_response import FIRSTS, PACES, SLOPES, VALUES, Response
from workflow.schemes._kernel import part

ROUNDING = 4.0 * 2.220446049250313e-16
"""Signal values below this share of the sum of their terms' magnitudes are not told from zero."""

FAST = 2.5
"""A mode with ω h above this is bounded by its amplitude: (ω h)⁴/24 exceeds 1 from 2.2 on."""


LONGER, SHORTER = 1.5, 0.6
"""Factors by which a step is lengthened while it stays clear, or shortened until it is: they set how
many certificates are tried, never the result."""

STRETCHES = (1.02, 1.25)
"""Ends of the interval tried around a zero, as shares of its guess: past the error of the guess, which
is that of a cubic, and before the next zero."""

CLOSE = 1e-9
"""Newton's steps on the cubic end at this relative change: its zero is a guess, polished afterwards."""


class Expansion(NamedTuple):
    """Taylor expansion of a signal; column K of its sums counts the slow terms and the K slowest blocks.

    :func:`expand` fills the first and the last column, :func:`accumulate` those between.
    """

    sums: Array
    """Rows: signal, three derivatives, bound of |s⁗|; and bounds of |s| and |s'| of the other blocks;
    in column 0 how fast the bound of |s⁗| may grow, and the sum of the magnitudes of all terms."""
    terms: Array
    """Per block: signal, three derivatives, bounds of |s⁗|, |s'| and |s|; scratch."""
    derivatives: Array
    """Of the signal, ``(ORDER + 1,)``; scratch."""


S0, S1, S2, S3, FOURTH, REST, REST_RATE, FIFTH, SIZE = range(9)


@part
def expand(r: Response, motion: Array, t: float, x: Expansion) -> None:
    """Expand the signal at a state."""
    b, f, sums, d = r.block, r.first, x.sums, x.terms
    w = r.load_omega
    cos, sin = load_phase(r, t)
    wave = r.signal_wave[0] * cos + r.signal_wave[1] * sin
    turn = r.signal_wave[1] * cos - r.signal_wave[0] * sin
    s0, s1, s2, s3 = r.signal + wave, w * turn, -w * w * wave, -w * w * w * turn
    amplitude = abs(r.signal_wave[0]) + abs(r.signal_wave[1])
    fourth, fifth = amplitude * w * w * w * w, 0.0
    size = abs(r.signal) + amplitude
    for j in range(r.firsts):
        mu = -f[RATE, j]
        d1 = (f[FIRST, j] + f[PACE, j] * mu) * motion[PACES, j]
        a0, a1 = f[FIRST, j] * motion[FIRSTS, j], f[PACE, j] * motion[PACES, j]
        s0 += a0 + a1
        s1 += d1
        s2 += mu * d1
        s3 += mu * mu * d1
        fourth += abs(mu * mu * mu * d1)
        size += abs(a0) + abs(a1)
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] == 0.0:
            continue
        c, w2, value, slope = b[DAMPING, k], b[STIFFNESS, k], b[VALUE, k], b[SLOPE, k]
        y, v = motion[VALUES, k], motion[SLOPES, k]
        f_cos, f_sin = b[FORCE_COS, k], b[FORCE_SIN, k]
        f0 = explicit_force(r, k, motion, cos, sin)
        f1 = w * (f_sin * cos - f_cos * sin)
        f2 = -w * w * (f_cos * cos + f_sin * sin)
        f3 = w**3 * (f_cos * sin - f_sin * cos)
        f3_bound, f4_bound = w**3 * np.hypot(f_cos, f_sin), w**4 * np.hypot(f_cos, f_sin)
        for j in range(r.firsts):
            g, mu = r.coupling[0, k, j] * motion[PACES, j], -f[RATE, j]
            f1 += g
            f2 += g * mu
            f3 += g * mu * mu
            f3_bound += abs(g) * mu * mu
            f4_bound += abs(g * mu * mu * mu)
        y2 = -c * v - w2 * y + f0
        y3 = -c * y2 - w2 * v + f1
        y4 = -c * y3 - w2 * y2 + f2
        y5 = -c * y4 - w2 * y3 + f3
        s0 += value * y + slope * v
        s1 += value * v + slope * y2
        s2 += value * y2 + slope * y3
        s3 += value * y3 + slope * y4
        fourth += abs(value) * np.sqrt(w2 * y3 * y3 + y4 * y4) + abs(slope) * np.sqrt(w2 * y4 * y4 + y5 * y5)
        fifth += abs(value) * f3_bound + abs(slope) * f4_bound
        size += abs(value * y) + abs(slope * v)
    _expand_blocks(b, motion, d)
    sums[S0, 0], sums[S1, 0], sums[S2, 0], sums[S3, 0], sums[FOURTH, 0] = s0, s1, s2, s3, fourth
    n = r.blocks
    sums[S0, n] = s0 + row_total(d, S0)
    sums[S1, n] = s1 + row_total(d, S1)
    sums[S2, n] = s2 + row_total(d, S2)
    sums[S3, n] = s3 + row_total(d, S3)
    sums[FOURTH, n] = fourth + row_total(d, FOURTH)
    sums[FIFTH, 0], sums[SIZE, 0] = fifth, size + row_total(d, REST)
    sums[REST, n], sums[REST_RATE, n] = 0.0, 0.0


@part
def accumulate(r: Response, x: Expansion) -> None:
    """Fill the sums between those of the slow terms and those of all blocks."""
    b, sums, d = r.block, x.sums, x.terms
    for k in range(d.shape[1]):
        d[REST_RATE, k] = np.sqrt(b[STIFFNESS, k] * d[S0, k] * d[S0, k] + d[S1, k] * d[S1, k])
    for k in range(r.blocks - 1):
        sums[S0, k + 1] = sums[S0, k] + d[S0, k]
        sums[S1, k + 1] = sums[S1, k] + d[S1, k]
        sums[S2, k + 1] = sums[S2, k] + d[S2, k]
        sums[S3, k + 1] = sums[S3, k] + d[S3, k]
        sums[FOURTH, k + 1] = sums[FOURTH, k] + d[FOURTH, k]
    for k in range(r.blocks - 1, -1, -1):
        sums[REST, k] = sums[REST, k + 1] + d[REST_RATE, k] * b[PERIOD, k]
        sums[REST_RATE, k] = sums[REST_RATE, k + 1] + d[REST_RATE, k]


@part
def _expand_blocks(b: Array, y: Array, d: Array) -> None:
    """Fill the terms of all blocks that move freely.

    The energy √(ω² s² + s'²) of a mode never grows, and is at most ω |s| + |s'|: within √2 of it, without a root.
    """
    for k in range(d.shape[1]):
        curvature = -b[DAMPING, k] * y[SLOPES, k] - b[STIFFNESS, k] * y[VALUES, k]
        d[S0, k] = b[SEEN, k] * y[VALUES, k] + b[SEEN_SLOPE, k] * y[SLOPES, k]
        d[S1, k] = b[SEEN, k] * y[SLOPES, k] + b[SEEN_SLOPE, k] * curvature
    for k in range(d.shape[1]):
        c, w2 = b[DAMPING, k], b[STIFFNESS, k]
        s0, s1 = d[S0, k], d[S1, k]
        s2 = -c * s1 - w2 * s0
        s3 = -c * s2 - w2 * s1
        s4 = -c * s3 - w2 * s2
        d[S2, k] = s2
        d[S3, k] = s3
        d[FOURTH, k] = b[OMEGA, k] * abs(s3) + abs(s4)
        d[REST, k] = abs(s0) + b[PERIOD, k] * abs(s1)


@part
def _summed(r: Response, h: float) -> int:
    """Return how many blocks to expand over a step h; the others are bounded as a group."""
    k = r.blocks
    while k > 0 and r.block[OMEGA, k - 1] * h > FAST:
        k -= 1
    return k


@part
def _growth(x: float) -> float:
    """Return a bound of e^x: at most what modes grow over a step."""
    if x <= 0.0:
        return 1.0
    return 1.0 / (1.0 - x) if x < 0.25 else np.exp(x)


@part
def _clear(r: Response, x: Expansion, zeros: int, h: float) -> bool:
    """Whether the signal certainly has no zero on (0, h], known zeros at 0 divided out."""
    factor = _growth(r.growth * h)
    k = _summed(r, h) if zeros == 0 else r.blocks
    a1, a2, a3 = x.sums[S1, k] * h, x.sums[S2, k] * h * h / 2.0, x.sums[S3, k] * h * h * h / 6.0
    a4 = -(x.sums[FOURTH, k] + x.sums[FIFTH, 0] * h) * factor * h**4 / 24.0
    if zeros == 1:
        b1, b2, b3 = a1 + a2 / 3.0, a1 + (2.0 * a2 + a3) / 3.0, a1 + a2 + a3 + a4
        return bool(a1 > 0.0 and b1 >= 0.0 and b2 >= 0.0 and b3 >= 0.0)
    if zeros == 2:
        return bool(a2 > 0.0 and a2 + a3 / 2.0 >= 0.0 and a2 + a3 + a4 >= 0.0)
    if zeros == 3:
        return bool(a3 > 0.0 and a3 + a4 >= 0.0)
    a0 = x.sums[S0, k] - x.sums[REST, k] * factor
    floor = min(0.0, x.sums[S0, r.blocks]) - ROUNDING * x.sums[SIZE, 0]
    a0 -= floor
    b1 = a0 + a1 / 4.0
    b2 = a0 + a1 / 2.0 + a2 / 6.0
    b3 = a0 + 0.75 * a1 + a2 / 2.0 + a3 / 4.0
    b4 = a0 + a1 + a2 + a3 + a4
    return bool(a0 >= 0.0 and b1 >= 0.0 and b2 >= 0.0 and b3 >= 0.0 and b4 >= 0.0)


@part
def longest_clear(r: Response, x: Expansion, zeros: int, guess: float, most: float) -> float:
    """Return a step up to ``most`` on which the signal certainly has no zero; 0 if there is none."""
    h = min(guess, most)
    if _clear(r, x, zeros, h):
        while h < most:
            longer = min(LONGER * h, most)
            if not _clear(r, x, zeros, longer):
                break
            h = longer
        return h
    for _ in range(400):  # 0.6⁴⁰⁰ = 1e-89: nothing is left of any step
        h *= SHORTER
        if _clear(r, x, zeros, h):
            return h
    return 0.0


@part
def _cubic_zero(a0: float, a1: float, a2: float, a3: float) -> float:
    """Return the zero of a0 + a1 τ + a2 τ² + a3 τ³ that Newton finds from τ = 0; -1 if none."""
    if a1 >= 0.0:
        return -1.0
    tau = 0.0
    for _ in range(20):
        value = a0 + tau * (a1 + tau * (a2 + tau * a3))
        rate = a1 + tau * (2.0 * a2 + tau * 3.0 * a3)
        if rate >= 0.0:
            return -1.0
        step = -value / rate
        tau += step
        if abs(step) <= CLOSE * tau:
            return tau
    return -1.0


@part
def falls_through(r: Response, x: Expansion, zeros: int, most: float) -> tuple[float, float]:
    """Return a guess and the end of an interval in which the signal certainly falls through zero once.

    Both are 0 where none is certain before about ``most``.
    """
    n = r.blocks
    if zeros == 0:
        guess = _cubic_zero(x.sums[S0, n], x.sums[S1, n], x.sums[S2, n] / 2.0, x.sums[S3, n] / 6.0)
        if guess <= 0.0:
            k = _summed(r, most)
            guess = _cubic_zero(x.sums[S0, k], x.sums[S1, k], x.sums[S2, k] / 2.0, x.sums[S3, k] / 6.0)
    elif zeros == 1:
        guess = _flight_guess(x.sums[S1, n], x.sums[S2, n] / 2.0, x.sums[S3, n] / 6.0)
    else:
        return 0.0, 0.0
    if guess <= 0.0 or guess > 2.0 * most:
        return 0.0, 0.0
    for stretch in STRETCHES:
        h = guess * stretch
        factor = _growth(r.growth * h)
        k = _summed(r, h) if zeros == 0 else n
        m = (x.sums[FOURTH, k] + x.sums[FIFTH, 0] * h) * factor
        a1, a2, a3 = x.sums[S1, k], x.sums[S2, k] / 2.0, x.sums[S3, k] / 6.0
        if zeros == 0:
            b0 = a1 + x.sums[REST_RATE, k] * factor
            c1, c2, c3 = 2.0 * a2 * h, 3.0 * a3 * h * h, m * h**3 / 6.0
            falls = (
                b0 < 0.0 and b0 + c1 / 3.0 < 0.0 and b0 + 2.0 * c1 / 3.0 + c2 / 3.0 < 0.0 and b0 + c1 + c2 + c3 < 0.0
            )
            end = x.sums[S0, k] + x.sums[REST, k] * factor + h * (a1 + h * (a2 + h * a3)) + m * h**4 / 24.0
        else:
            c1, c2 = 2.0 * a3 * h, m * h * h / 8.0
            falls = a2 < 0.0 and a2 + c1 / 2.0 < 0.0 and a2 + c1 + c2 < 0.0
            end = a1 + h * (a2 + h * a3) + m * h**3 / 24.0
        if falls and end < 0.0:
            return guess, h
    return 0.0, 0.0


@part
def _flight_guess(a1: float, a2: float, a3: float) -> float:
    """Return the positive zero of a1 + a2 τ + a3 τ² of a flight that starts at zero; -1 if none."""
    if a1 <= 0.0 or a2 >= 0.0:
        return -1.0
    square = a2 * a2 - 4.0 * a1 * a3
    if square < 0.0:
        return -1.0
    return float(-2.0 * a1 / (a2 - np.sqrt(square)))
