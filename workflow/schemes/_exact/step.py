"""A certified step: one on which the signal has no zero, or one that ends at its first zero.

The signal, the gap of a free tip or the contact force of a held one, lies within the bounds of its expansion
(:mod:`workflow.schemes._exact.expansion`). Where the Bernstein coefficients of the lower bound are not negative, it has
no zero; where those of the upper bound of its derivative are all negative and its end is below zero, it has one.

A step may begin at a zero of known order m ("zeros"): 1 after an impact or where the contact force rises from zero, 2
where a tip lies on the casing without a force, 3 after a release. The search then uses the signal divided by τ^m.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import (
    SUM_ROUNDING,
    accumulate,
    bounds,
    expand,
    expanded_blocks,
    row_sum,
)
from workflow.schemes._exact.motion import ORDER, SIGNAL, Motion, wave_phase
from workflow.schemes._exact.propagation import advance, explicit_derivatives
from workflow.schemes._exact.tables import block, expansion, first, seen, seen_wave, state, wave

TAYLOR_SPAN = 0.6
"""Largest |pole| · time at which a flight is a Taylor polynomial: the remainder is below 0.6^18/18! = 2e-20."""

_LONGER, _SHORTER = 1.5, 0.6
"""Factors by which a step is lengthened while it is certified, or shortened until it is: they set how many
lengths are tried, never the result."""

_STRETCHES = (1.02, 1.25)
"""Ends of the interval tried around a zero, over its guess: beyond the error of the guess, which is that of a cubic,
and before the next zero."""

_CLOSE = 1e-9
"""Relative change at which Newton's method on the cubic ends: its zero is a guess, which is refined afterwards."""

_HALF_THE_DIGITS = 1e-9
"""Step of Newton's method, over the zero, at which it ends: its error is of the order of the square."""

_LAST_PLACE = 1e-16
"""Relative change below half a unit in the last place of 1, which has no effect."""

_NEGLIGIBLE = 1e-18
"""Terms of a Taylor polynomial, over its first one, below which they are left out: a hundredth of rounding."""


@part
def certified_step(
    m: Motion, zeros: int, speed: float, guessed: float, t: float, left: float, tolerance: float
) -> tuple[float, bool]:
    """Return the length of a step from t, at most ``left``, and whether it ends at the first zero of the signal.

    The step has no other zero; its length is NaN where none is certified. The signal is expanded at the state, where it
    has a zero of order ``zeros``, 0 for none, and the rate ``speed`` if the impact law gives it, else -1. The length
    ``guessed`` is tried first. Up to ``tolerance`` past ``left`` a zero is taken at ``left``. The expansion is
    overwritten.
    """
    sums, n = m.expansion.sums, m.blocks
    # with a factor of a thousand, so that products with the bound of the fourth derivative do not overflow
    if not np.isfinite(1e3 * sums[expansion.SIZE, 0] * max(1.0, m.fastest) ** 4):
        return np.nan, False
    if speed >= 0.0:
        sums[expansion.D1, n] = speed
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
    h = longest_without_zero(m, zeros, guessed, left)
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
        wave_cos, wave_sin = m.waves[i, m.columns + seen_wave.SIGNAL_COS], m.waves[i, m.columns + seen_wave.SIGNAL_SIN]
        for n in range(order + 1):
            derivatives[n] += wave_cos * cos + wave_sin * sin
            wave_cos, wave_sin = omega * wave_sin, -omega * wave_cos
    for j in range(m.firsts):
        f, mu = m.first, m.first[first.RATE, j]
        term = f[m.slow + SIGNAL, j] * m.now[state.FIRST_SLOPE, j]
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
            derivatives[n] += b[m.rows + seen.SIGNAL_VALUE, k] * own[n] + b[m.rows + seen.SIGNAL_SLOPE, k] * own[n + 1]


@part
def has_no_zero(m: Motion, zeros: int, h: float) -> bool:
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
    if has_no_zero(m, zeros, h):
        while h < most:
            longer = min(_LONGER * h, most)
            if not has_no_zero(m, zeros, longer):
                break
            h = longer
        return h
    for _ in range(400):  # 0.6⁴⁰⁰ = 1e-89
        h *= _SHORTER
        if has_no_zero(m, zeros, h):
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
    s = bounds(m, expanded_blocks(m, h) if zeros == 0 else m.blocks, h)
    a1, a2, a3, a4 = s.d1, s.d2, s.d3, s.fourth
    if zeros == 1:
        falls = a2 < 0.0 and a2 + a3 < 0.0 and a2 + 2.0 * a3 + 3.0 * a4 < 0.0
        return bool(falls and a1 + a2 + a3 + a4 < 0.0)
    b0 = a1 + s.tail_slope
    falls = b0 < 0.0 and b0 + 2.0 * a2 / 3.0 < 0.0 and b0 + 4.0 * a2 / 3.0 + a3 < 0.0
    falls = falls and b0 + 2.0 * a2 + 3.0 * a3 + 4.0 * a4 < 0.0
    return bool(falls and s.d0 + s.tail + a1 + a2 + a3 + a4 < 0.0)


@part
def _flight_guess(a1: float, a2: float, a3: float) -> float:
    """Return the positive zero of a1 + a2 τ + a3 τ² of a flight that starts at zero gap; -1 if there is none."""
    if a1 <= 0.0 or a2 >= 0.0:
        return -1.0
    square = a2 * a2 - 4.0 * a1 * a3
    if square < 0.0:
        return -1.0
    return float(-2.0 * a1 / (a2 - np.sqrt(square)))
