"""A certified step: one on which a signal has no zero, or one that ends at its first zero, polished."""

from __future__ import annotations

import numpy as np

from workflow.models import Array
from workflow.schemes._event_functions import (
    DAMPING,
    EXPLICIT,
    FIRST,
    FORCE_COS,
    FORCE_SIN,
    PACE,
    RATE,
    SLOPE,
    SPECIAL,
    STIFFNESS,
    VALUE,
    row_total,
)
from workflow.schemes._event_motion import advance, explicit_force, load_phase
from workflow.schemes._event_response import ORDER, PACES, SLOPES, TAYLOR_SPAN, VALUES, Response
from workflow.schemes._event_search import (
    FOURTH,
    ROUNDING,
    S0,
    S1,
    S2,
    S3,
    SIZE,
    Expansion,
    accumulate,
    expand,
    falls_through,
    longest_clear,
)
from workflow.schemes._kernel import part

HALF_THE_DIGITS = 1e-9
"""A step of Newton's below this share of the zero is the last: its error is of the order of the square."""

LAST_PLACE = 1e-16
"""Below half a unit in the last place of 1: a relative change this small changes nothing."""

NEGLIGIBLE = 1e-18
"""Terms of a Taylor polynomial below this share of its first are left out, a hundredth of rounding."""


@part
def polish(r: Response, motion: Array, t: float, guess: float, end: float, scratch: Array, x: Expansion) -> float:
    """Return the zero of the signal in (0, end], by expansions about ever better points."""
    tau = guess
    n = r.blocks
    low, high = 0.0, end
    for _ in range(30):
        advance(r, motion, t, tau, scratch)
        expand(r, scratch, t + tau, x)
        s0, s1, s2, s3 = x.sums[S0, n], x.sums[S1, n], x.sums[S2, n] / 2.0, x.sums[S3, n] / 6.0
        if s0 > 0.0:
            low = tau
        else:
            high = tau
        step = -s0 / s1 if s1 < 0.0 else 2.0 * end
        for _ in range(6):
            rate = s1 + step * (2.0 * s2 + step * 3.0 * s3)
            if rate >= 0.0:
                break
            change = (s0 + step * (s1 + step * (s2 + step * s3))) / rate
            step -= change
            if abs(change) <= 10.0 * LAST_PLACE * abs(step):
                break
        if not (low <= tau + step <= high):
            step = 0.5 * (low + high) - tau
            tau += step
            if high - low <= LAST_PLACE * (t + high):
                return tau
            continue
        tau += step
        if x.sums[FOURTH, n] * step**4 / 24.0 <= 0.25 * ROUNDING * x.sums[SIZE, 0] or abs(step) <= LAST_PLACE * (
            t + tau
        ):
            return tau
    return tau


@part
def short_flight(r: Response, motion: Array, t: float, speed: float, guess: float, x: Expansion) -> float:
    """Return the duration of a flight that starts at zero gap with ``speed``, by its Taylor polynomial.

    Solves gap(τ)/τ = 0, which keeps its digits however low the flight is.
    """
    order, slow_order = series_order(1.1 * r.fastest * guess), series_order(1.1 * r.fastest_first * guess)
    derivatives = x.derivatives
    series(r, motion, t, order, slow_order, x)
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
        if abs(step) <= HALF_THE_DIGITS * tau:
            break
    return tau


@part
def series_order(span: float) -> int:
    """Return the order of a Taylor polynomial over ``span``, pole times time."""
    order, term = 1, span
    while order < ORDER and term > NEGLIGIBLE:
        order += 1
        term *= span / order
    return max(order, 4)


@part
def series(r: Response, motion: Array, t: float, order: int, slow_order: int, x: Expansion) -> None:
    """Fill the derivatives of the signal up to ``order`` from a state; ``x`` is its expansion and is used up.

    First-order states are summed up to ``slow_order``.
    """
    w, derivatives = r.load_omega, x.derivatives
    cos, sin = load_phase(r, t)
    wave_cos, wave_sin = r.signal_wave
    for n in range(order + 1):
        derivatives[n] = wave_cos * cos + wave_sin * sin
        wave_cos, wave_sin = w * wave_sin, -w * wave_cos
    if r.firsts > 0:
        f = r.first
        for j in range(r.firsts):
            term = (f[FIRST, j] - f[PACE, j] * f[RATE, j]) * motion[PACES, j]
            for n in range(1, slow_order + 1):
                derivatives[n] += term
                term *= -f[RATE, j]
    b, d = r.block, x.terms
    for n in range(order + 1):
        derivatives[n] += row_total(d, S0)
        for k in range(d.shape[1]):
            next_ = -b[DAMPING, k] * d[S1, k] - b[STIFFNESS, k] * d[S0, k]
            d[S0, k] = d[S1, k]
            d[S1, k] = next_
    for i in range(r.specials):
        k = int(b[SPECIAL, i])
        if b[EXPLICIT, k] == 0.0:
            continue
        c, w2, value, slope = b[DAMPING, k], b[STIFFNESS, k], b[VALUE, k], b[SLOPE, k]
        y, v = motion[VALUES, k], motion[SLOPES, k]
        f_cos, f_sin = b[FORCE_COS, k], b[FORCE_SIN, k]
        force = explicit_force(r, k, motion, cos, sin)
        for n in range(order + 1):
            derivatives[n] += value * y + slope * v
            y, v = v, force - c * v - w2 * y
            f_cos, f_sin = w * f_sin, -w * f_cos
            force = f_cos * cos + f_sin * sin
            for j in range(r.firsts):
                force += r.coupling[0, k, j] * motion[PACES, j] * (-r.first[RATE, j]) ** n


@part
def certified_step(
    r: Response,
    x: Expansion,
    motion: Array,
    t: float,
    T: float,
    zeros: int,
    known_speed: float,
    guess: float,
    tolerance: float,
    scratch: Array,
) -> tuple[float, bool]:
    """Return a step on which the signal certainly has no zero, or one that ends at its first zero.

    ``x`` is the expansion at t and may be used up.

    ``known_speed`` is the rate with which it starts from zero where that is known (negative: not).
    """
    n = r.blocks
    left = T - t
    if not np.isfinite(x.sums[SIZE, 0]):
        return np.nan, False
    if known_speed >= 0.0:
        x.sums[S1, n] = known_speed
    leading = x.sums[S1, n] if zeros == 1 else x.sums[S2, n] if zeros == 2 else x.sums[S3, n]
    if zeros > 0 and leading <= 0.0:
        zeros = 0
    if zeros == 0 and x.sums[S0, n] <= 0.0 and x.sums[S1, n] < 0.0:
        return 0.0, True
    if zeros == 0:
        accumulate(r, x)
    around, end = falls_through(r, x, zeros, left)
    if end > 0.0:
        if zeros == 1 and r.fastest * end <= TAYLOR_SPAN:
            h = short_flight(r, motion, t, x.sums[S1, n], around, x)
        else:
            h = polish(r, motion, t, around, end, scratch, x)
        return (left, False) if h > left + tolerance else (min(h, left), True)
    h = longest_clear(r, x, zeros, guess, left)
    return (h, False) if h > 0.0 else (np.nan, False)
