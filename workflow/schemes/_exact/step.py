"""A certified step: one on which the signal has no zero, or one that ends at its first zero."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import SUM_ROUNDING, accumulate, expand, row_sum
from workflow.schemes._exact.explicit_blocks import explicit_derivatives
from workflow.schemes._exact.layout import ORDER, TAYLOR_SPAN
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.propagation import advance
from workflow.schemes._exact.search import cubic_zero, longest_without_zero, zero_crossing
from workflow.schemes._exact.tables import block, expansion, first, state, wave
from workflow.schemes._exact.waves import wave_phase

_HALF_THE_DIGITS = 1e-9
"""Step of Newton's method, over the zero, at which it ends: its error is of the order of the square."""

_LAST_PLACE = 1e-16
"""Relative change below half a unit in the last place of 1, which has no effect."""

_NEGLIGIBLE = 1e-18
"""Terms of a Taylor polynomial, over its first one, below which they are left out: a hundredth of rounding."""


class Start(NamedTuple):
    """Start of a step."""

    zeros: int
    """Order of the zero that the signal has there, see :mod:`workflow.schemes._exact.search`."""
    speed: float
    """Rate of the signal where the impact law gives it, m/s; negative where it does not."""
    expanded: bool
    """Whether the signal is already expanded at the state."""
    guess: float
    """First length tried, s."""


@part
def certified_step(m: Motion, start: Start, t: float, left: float, tolerance: float) -> tuple[float, bool]:
    """Return the length of a step from t, at most ``left``, and whether it ends at the first zero of the signal.

    The step has no other zero; its length is NaN where none is certified. Up to ``tolerance`` past ``left`` a zero is
    taken at ``left``. The expansion is overwritten.
    """
    sums, n, zeros = m.expansion.sums, m.blocks, start.zeros
    # with a factor of a thousand, so that products with the bound of the fourth derivative do not overflow
    if not np.isfinite(1e3 * sums[expansion.SIZE, 0] * max(1.0, m.fastest) ** 4):
        return np.nan, False
    if start.speed >= 0.0:
        sums[expansion.D1, n] = start.speed
    if zeros > 0 and sums[expansion.D0 + zeros, n] <= 0.0:
        zeros = 0
    if zeros == 0:
        if sums[expansion.D0, n] <= 0.0 and sums[expansion.D1, n] < 0.0:
            return 0.0, True
        accumulate(m)
    guess, end = zero_crossing(m, zeros, left)
    if end > 0.0:
        if zeros == 1 and m.fastest * end <= TAYLOR_SPAN:
            h = _short_flight(m, t, sums[expansion.D1, n], guess)
        else:
            h = _refined_zero(m, t, guess, end)
        return (left, False) if h > left + tolerance else (min(h, left), True)
    h = longest_without_zero(m, zeros, start.guess, left)
    return (h, False) if h > 0.0 else (np.nan, False)


@part
def _refined_zero(m: Motion, t: float, guess: float, end: float) -> float:
    """Return the zero of the signal in (0, end], by bracketed Newton steps on expansions about the last iterate."""
    sums, n = m.expansion.sums, m.blocks
    tau, low, high = guess, 0.0, end
    for _ in range(30):
        advance(m, m.now, t, tau, m.between)
        expand(m, m.between, t + tau)
        if sums[expansion.D0, n] > 0.0:
            low = tau
        else:
            high = tau
        step, _ = cubic_zero(sums, n, 7, 10.0 * _LAST_PLACE)
        if sums[expansion.D1, n] >= 0.0 or not (low <= tau + step <= high):
            step = 0.5 * (low + high) - tau
            tau += step
            if high - low <= _LAST_PLACE * (t + high):
                return tau
            continue
        tau += step
        remainder = sums[expansion.FOURTH, n] * step**4 / 24.0
        if remainder <= 0.25 * SUM_ROUNDING * sums[expansion.SIZE, 0] or abs(step) <= _LAST_PLACE * (t + tau):
            return tau
    return tau


@part
def _short_flight(m: Motion, t: float, speed: float, guess: float) -> float:
    """Return the duration of a flight that starts at zero gap with ``speed``, by its Taylor polynomial.

    Solves gap(τ)/τ = 0, which keeps its digits for flights of any height.
    """
    derivatives = m.expansion.derivatives
    order = _series_order(1.1 * m.fastest * guess)
    _series(m, t, order)
    derivatives[1] = speed
    factorial = 1.0
    for n in range(1, order + 1):
        factorial *= n
        derivatives[n] /= factorial
    tau = guess
    for _ in range(20):
        value, rate = 0.0, 0.0
        for n in range(order, 0, -1):
            rate = rate * tau + value
            value = value * tau + derivatives[n]
        step = -value / rate
        tau += step
        if abs(step) <= _HALF_THE_DIGITS * tau:
            break
    return tau


@part
def _series_order(span: float) -> int:
    """Return the order of a Taylor polynomial over ``span``, pole times time."""
    order, term = 1, span
    while order < ORDER and term > _NEGLIGIBLE:
        order += 1
        term *= span / order
    return max(order, 4)


@part
def _series(m: Motion, t: float, order: int) -> None:
    """Fill the derivatives of the signal at the state of t up to ``order``; overwrite the terms of the expansion."""
    derivatives, b, d = m.expansion.derivatives, m.block, m.expansion.terms
    for n in range(order + 1):
        derivatives[n] = 0.0
    for i in range(m.waves.shape[0]):
        omega = m.waves[i, wave.OMEGA]
        cos, sin = wave_phase(m.waves, i, t)
        wave_cos, wave_sin = m.waves[i, wave.SIGNAL_COS], m.waves[i, wave.SIGNAL_SIN]
        for n in range(order + 1):
            derivatives[n] += wave_cos * cos + wave_sin * sin
            wave_cos, wave_sin = omega * wave_sin, -omega * wave_cos
    for j in range(m.firsts):
        f, mu = m.first, m.first[first.RATE, j]
        term = f[first.SIGNAL, j] * m.now[state.FIRST_SLOPE, j]
        for n in range(1, order + 1):
            derivatives[n] += term
            term *= -mu
    for n in range(order + 1):
        derivatives[n] += row_sum(d, expansion.D0, 0, d.shape[1])
        for k in range(d.shape[1]):
            s2 = -b[block.DAMPING, k] * d[expansion.D1, k] - b[block.STIFFNESS, k] * d[expansion.D0, k]
            d[expansion.D0, k] = d[expansion.D1, k]
            d[expansion.D1, k] = s2
    for i in range(m.explicits):
        k, own = int(b[block.EXPLICIT_COLUMNS, i]), m.expansion.explicit
        explicit_derivatives(m, k, m.now, t, order + 1, own)
        for n in range(order + 1):
            derivatives[n] += b[block.SIGNAL_VALUE, k] * own[n] + b[block.SIGNAL_SLOPE, k] * own[n + 1]
