"""Certified search for the first zero of the signal: the gap of a free tip, the contact force of a held one.

The signal lies within the bounds of its expansion (:mod:`workflow.schemes._exact.expansion`). Where the Bernstein
coefficients of the lower bound are not negative, it has no zero; where those of the upper bound of its derivative are
all negative and its end is below zero, it has exactly one.

A step may begin at a zero of known order m ("zeros"): 1 after an impact or where the contact force rises from zero, 2
where a tip lies on the casing without a force, 3 after a release. The search then uses the signal divided by τ^m.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import SUM_ROUNDING, bounds, expanded_blocks, growth_bound
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.tables import expansion

_LONGER, _SHORTER = 1.5, 0.6
"""Factors by which a step is lengthened while it is certified, or shortened until it is: they set how many
lengths are tried, never the result."""

_STRETCHES = (1.02, 1.25)
"""Ends of the interval tried around a zero, over its guess: beyond the error of the guess, which is that of a cubic,
and before the next zero."""

_CLOSE = 1e-9
"""Relative change at which Newton's method on the cubic ends: its zero is a guess, which is refined afterwards."""


@part
def _has_no_zero(m: Motion, zeros: int, h: float) -> bool:
    """Whether the signal certainly has no zero on (0, h], with a zero of order ``zeros`` at 0 divided out."""
    s = bounds(m, expanded_blocks(m, h) if zeros == 0 else m.blocks, h)
    a1, a2, a3, a4 = s.d1, s.d2, s.d3, -s.fourth
    if zeros == 1:
        b1, b2, b3 = a1 + a2 / 3.0, a1 + (2.0 * a2 + a3) / 3.0, a1 + a2 + a3 + a4
        return bool(a1 > 0.0 and b1 >= 0.0 and b2 >= 0.0 and b3 >= 0.0)
    if zeros == 2:
        return bool(a2 > 0.0 and a2 + a3 / 2.0 >= 0.0 and a2 + a3 + a4 >= 0.0)
    if zeros == 3:
        return bool(a3 > 0.0 and a3 + a4 >= 0.0)
    a0 = s.d0 - s.tail
    a0 -= min(0.0, m.expansion.sums[expansion.D0, m.blocks]) - SUM_ROUNDING * m.expansion.sums[expansion.SIZE, 0]
    b1 = a0 + a1 / 4.0
    b2 = a0 + a1 / 2.0 + a2 / 6.0
    b3 = a0 + 0.75 * a1 + a2 / 2.0 + a3 / 4.0
    b4 = a0 + a1 + a2 + a3 + a4
    return bool(a0 >= 0.0 and b1 >= 0.0 and b2 >= 0.0 and b3 >= 0.0 and b4 >= 0.0)


@part
def longest_without_zero(m: Motion, zeros: int, guess: float, most: float) -> float:
    """Return a step up to ``most`` on which the signal certainly has no zero; 0 if there is none."""
    h = min(guess, most)
    if _has_no_zero(m, zeros, h):
        while h < most:
            longer = min(_LONGER * h, most)
            if not _has_no_zero(m, zeros, longer):
                break
            h = longer
        return h
    for _ in range(400):  # 0.6⁴⁰⁰ = 1e-89
        h *= _SHORTER
        if _has_no_zero(m, zeros, h):
            return h
    return 0.0


@part
def cubic_zero(sums: Array, k: int, most: int, least: float) -> tuple[float, bool]:
    """Return the zero of the cubic of column ``k`` by Newton's method from τ = 0, and whether it converged.

    It converges where a step changes τ by no more than ``least``, relatively, within ``most`` steps on which the cubic
    falls.
    """
    a0, a1 = sums[expansion.D0, k], sums[expansion.D1, k]
    a2, a3 = sums[expansion.D2, k] / 2.0, sums[expansion.D3, k] / 6.0
    tau = 0.0
    for _ in range(most):
        rate = a1 + tau * (2.0 * a2 + tau * 3.0 * a3)
        if rate >= 0.0:
            break
        step = -(a0 + tau * (a1 + tau * (a2 + tau * a3))) / rate
        tau += step
        if abs(step) <= least * abs(tau):
            return tau, True
    return tau, False


@part
def zero_crossing(m: Motion, zeros: int, most: float) -> tuple[float, float]:
    """Return a guess and the end of an interval (0, end] in which the signal certainly falls through zero once.

    Both are 0 where none is certified up to about ``most``.
    """
    sums, n = m.expansion.sums, m.blocks
    if zeros == 0:
        guess, reached = cubic_zero(sums, n, 20, _CLOSE)
        if not reached or guess <= 0.0:
            guess, reached = cubic_zero(sums, expanded_blocks(m, most), 20, _CLOSE)
        if not reached:
            return 0.0, 0.0
    elif zeros == 1:
        guess = _flight_guess(sums[expansion.D1, n], sums[expansion.D2, n] / 2.0, sums[expansion.D3, n] / 6.0)
    else:
        return 0.0, 0.0
    if guess <= 0.0 or guess > 2.0 * most:
        return 0.0, 0.0
    for stretch in _STRETCHES:
        if _falls_through(m, zeros, guess * stretch):
            return guess, guess * stretch
    return 0.0, 0.0


@part
def _falls_through(m: Motion, zeros: int, h: float) -> bool:
    """Whether the signal certainly falls through zero exactly once on (0, h], with a zero at 0 divided out."""
    sums, factor = m.expansion.sums, growth_bound(m.growth * h)
    k = expanded_blocks(m, h) if zeros == 0 else m.blocks
    fourth = (sums[expansion.FOURTH, k] + sums[expansion.FOURTH_GROWTH, 0] * h) * factor
    a1, a2, a3 = sums[expansion.D1, k], sums[expansion.D2, k] / 2.0, sums[expansion.D3, k] / 6.0
    if zeros == 1:
        c1, c2 = 2.0 * a3 * h, fourth * h * h / 8.0
        falls = a2 < 0.0 and a2 + c1 / 2.0 < 0.0 and a2 + c1 + c2 < 0.0
        return bool(falls and a1 + h * (a2 + h * a3) + fourth * h**3 / 24.0 < 0.0)
    b0 = a1 + sums[expansion.TAIL_SLOPE, k] * factor
    c1, c2, c3 = 2.0 * a2 * h, 3.0 * a3 * h * h, fourth * h**3 / 6.0
    falls = b0 < 0.0 and b0 + c1 / 3.0 < 0.0 and b0 + 2.0 * c1 / 3.0 + c2 / 3.0 < 0.0 and b0 + c1 + c2 + c3 < 0.0
    end = sums[expansion.D0, k] + sums[expansion.TAIL, k] * factor + h * (a1 + h * (a2 + h * a3)) + fourth * h**4 / 24.0
    return bool(falls and end < 0.0)


@part
def _flight_guess(a1: float, a2: float, a3: float) -> float:
    """Return the positive zero of a1 + a2 τ + a3 τ² of a flight that starts at zero gap; -1 if there is none."""
    if a1 <= 0.0 or a2 >= 0.0:
        return -1.0
    square = a2 * a2 - 4.0 * a1 * a3
    if square < 0.0:
        return -1.0
    return float(-2.0 * a1 / (a2 - np.sqrt(square)))
