"""Certified search for the largest tip temperature within a step.

The temperature is expanded like the signal (see :mod:`workflow.schemes._exact.expansion`): a Taylor
polynomial of degree 3 with a bound of its remainder, fast modes bounded as a group. An interval needs no
further search where the bounds prove one of these:

- the temperature stays below the largest one so far;
- it is monotone or convex: its largest value is at an end of the interval, and the ends are evaluated;
- it is concave: the largest value is at an end or where the rate is zero, which is then solved for.

Otherwise the interval is bisected.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import (
    SUM_ROUNDING,
    accumulate,
    bounds,
    expand_output,
    expanded_blocks,
    growth_bound,
)
from workflow.schemes._exact.motion import TEMPERATURE, Motion
from workflow.schemes._exact.propagation import advance, observe
from workflow.schemes._exact.tables import expansion, first, state

_SURE = 1e-12
"""Excess over the largest temperature, relative to it, up to which a later maximum is not searched for: a hundredth of
the promised accuracy, 1e-10."""

_SHORTEST = 1e-15
"""Length of an interval, over the time, below which it is not bisected: a few roundings of the time itself."""


@part
def peak_temperature(m: Motion, t: float, left: float, right: float, largest: float) -> float:
    """Return the larger of ``largest`` and the largest tip temperature, K, between the times ``left`` and ``right``.

    Both lie in a step from ``m.now`` at t. ``largest`` is at least the temperature at both ends.
    """
    if m.cooling and _is_monotone(m, right - t):
        return largest
    return _searched(m, t, left, right, largest)


@part
def _is_monotone(m: Motion, span: float) -> bool:
    """Whether the temperature, a sum of decaying terms, is certainly monotone over a step.

    Its rate is a sum of terms r exp(-μ τ), each between r and r max(0, 1 - μ τ).
    """
    f, low, high = m.first, 0.0, 0.0
    for j in range(m.firsts):
        rate = f[first.TEMPERATURE, j] * m.now[state.FIRST_SLOPE, j]
        later = rate * max(0.0, 1.0 - f[first.RATE, j] * span)
        low += min(rate, later)
        high += max(rate, later)
    return high <= 0.0 or low >= 0.0


@part
def _searched(m: Motion, t: float, left: float, right: float, largest: float) -> float:
    """Return the larger of ``largest`` and the largest temperature, interval by interval from left to right."""
    at = left
    while at < right:
        advance(m, m.now, t, at - t, m.between)
        expand_output(m, TEMPERATURE, m.between, at)
        if not m.cooling:
            accumulate(m)
        largest = max(largest, m.expansion.sums[expansion.D0, m.blocks])
        if not np.isfinite(m.expansion.sums[expansion.FOURTH, m.blocks]):
            return largest
        span = right - at
        while span > _SHORTEST * right:
            if _peaks_at_an_end(m, span, largest):
                break
            bend = _bend(m, span)
            if bend != 0:
                largest = _concave_peak(m, t, at, span, largest) if bend < 0 else largest
                break
            span *= 0.5
        at = right if span >= right - at else at + max(span, _SHORTEST * right)
    return largest


@part
def _peaks_at_an_end(m: Motion, h: float, largest: float) -> bool:
    """Whether certainly no temperature on (0, h) exceeds both ends and ``largest``: it is monotone or stays below."""
    s = bounds(m, m.blocks if m.cooling else expanded_blocks(m, h), h)
    d1, d2, d3 = s.d1, s.d2, s.d3
    c0, c1 = d1, d1 + 2.0 * d2 / 3.0
    c2, c3 = d1 + 4.0 * d2 / 3.0 + d3, d1 + 2.0 * d2 + 3.0 * d3
    if min(min(c0, c1), min(c2, c3 - 4.0 * s.fourth)) >= s.tail_slope:
        return True
    if max(max(c0, c1), max(c2, c3 + 4.0 * s.fourth)) <= -s.tail_slope:
        return True
    level = largest + _SURE * abs(largest) + SUM_ROUNDING * m.expansion.sums[expansion.SIZE, 0]
    b2 = d1 / 2.0 + d2 / 6.0
    b3 = 0.75 * d1 + d2 / 2.0 + d3 / 4.0
    b4 = d1 + d2 + d3 + s.fourth
    return bool(s.d0 + s.tail + max(max(0.0, d1 / 4.0), max(b2, max(b3, b4))) <= level)


@part
def _bend(m: Motion, h: float) -> int:
    """Return the sign of the second derivative of the temperature on (0, h), 0 where it is not certain."""
    sums, n = m.expansion.sums, m.blocks
    fourth = (sums[expansion.FOURTH, n] + sums[expansion.FOURTH_GROWTH, 0] * h) * growth_bound(m.growth * h)
    second, third = sums[expansion.D2, n], sums[expansion.D3, n]
    b0, b1, b2 = second, second + third * h / 2.0, second + third * h
    remainder = fourth * h * h / 2.0
    if b0 < 0.0 and b1 < 0.0 and b2 + remainder < 0.0:
        return -1
    return 1 if b0 > 0.0 and b1 > 0.0 and b2 - remainder > 0.0 else 0


@part
def _concave_peak(m: Motion, t: float, at: float, h: float, largest: float) -> float:
    """Return the largest temperature on (at, at + h), where it is concave.

    Newton's method on the rate, bracketed by points where it is positive and negative: the rate times the distance to
    the bracket's other end bounds the remaining gain.
    """
    sums, n = m.expansion.sums, m.blocks
    rate, bend, third = sums[expansion.D1, n], sums[expansion.D2, n], sums[expansion.D3, n]
    if rate <= 0.0:
        return largest
    low, high, tau = 0.0, h, 0.0
    for _ in range(100):
        slope = bend + third * tau
        tau = tau - rate / slope if slope < 0.0 else high
        if not (low < tau < high):
            tau = 0.5 * (low + high)
        advance(m, m.now, t, at + tau - t, m.between)
        outputs = observe(m, m.between, at + tau)
        largest, rate = max(largest, outputs.temperature), outputs.warming
        if rate > 0.0:
            low = tau
            gain = rate * (high - tau)
        else:
            high = tau
            gain = -rate * (tau - low)
        if gain <= _SURE * abs(largest) or high - low <= _SHORTEST * (at + h):
            break
    return largest
