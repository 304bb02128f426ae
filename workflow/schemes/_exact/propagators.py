"""Propagators of all blocks and first-order states of a regime at once, in loops that the compiler vectorises.

A block η'' + c η' + ω² η = 0 has

    η(dt) = C η + S η',   η'(dt) = -ω² S η + (C - c S) η',
    C = e^(-c dt/2) (cos ν dt + c/2 · sin(ν dt)/ν),   S = e^(-c dt/2) sin(ν dt)/ν,   ν² = ω² - c²/4,

entire functions of ν²: rigid, critical and overdamped blocks have the same form with cosh and sinh.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels import Array, elementary
from workflow.kernels.compiled import inlined, part
from workflow.kernels.elementary import HALF_PI_1, HALF_PI_2, LN2_HIGH, LN2_LOW, LOG2_E, TO_INTEGER, TWO_OVER_PI
from workflow.kernels.packs import narrow, pack, store
from workflow.schemes._exact.tables import block, first

_EXPONENT = 4503599627370496.0 + 1023.0
"""2^52 + 1023: added to an integer q it leaves q + 1023 in the lowest bits of the double."""
_HALF_PI_REST = 2.0222662487959506e-21
"""π/2 less ``HALF_PI_1`` and ``HALF_PI_2``, rounded."""
_LARGEST_ANGLE = 1e6
"""Angles beyond this are reduced by :mod:`workflow.kernels.elementary`; below it the products with these are exact."""
_SERIES = 0.3
"""Largest |μ dt| at which φ2 is summed by its series in all columns."""


@inlined
def _phi2(x: Any) -> Any:
    """Return φ2(x) = Σ x^k/(k+2)! to k = 11 of a pack, for |x| up to 0.35: 0.35^12/14! < 1e-16."""
    p = 1.6059043836821613e-10 * x + 2.08767569878681e-09
    p = p * x + 2.505210838544172e-08
    p = p * x + 2.755731922398589e-07
    p = p * x + 2.7557319223985893e-06
    p = p * x + 2.48015873015873e-05
    p = p * x + 0.0001984126984126984
    p = p * x + 0.001388888888888889
    p = p * x + 0.008333333333333333
    p = p * x + 0.041666666666666664
    p = p * x + 0.16666666666666666
    return p * x + 0.5


@part
def block_propagators(b: Array, dt: float) -> None:
    """Fill the rows C and S of a table of blocks over a time ``dt`` [s], as if all of them oscillated.

    Errors are a few units in the last place of 1.
    """
    largest = 0.0
    for k in range(b.shape[1]):
        if b[block.NU, k] > largest:
            largest = b[block.NU, k]
    if largest * abs(dt) > _LARGEST_ANGLE:
        _large_propagators(b, dt)
        return
    _sines(b, dt)
    _exponentials(b, dt)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        shrink = pack(b, (block.WORK, lane)) * pack(b, (block.POWER, lane))
        s = shrink * pack(b, (block.S, lane)) / pack(b, (block.NU, lane))
        store(b, (block.C, lane), shrink * pack(b, (block.C, lane)) + pack(b, (block.HALF_DAMPING, lane)) * s)
        store(b, (block.S, lane), s)


@part
def _large_propagators(b: Array, dt: float) -> None:
    """Fill the rows C and S where an angle ν dt is large."""
    for k in range(b.shape[1]):
        shrink = elementary.exp(-b[block.HALF_DAMPING, k] * dt)
        sin, cos = elementary.sine_cosine(b[block.NU, k] * dt)
        b[block.S, k] = shrink * sin / b[block.NU, k]
        b[block.C, k] = shrink * cos + b[block.HALF_DAMPING, k] * b[block.S, k]


@part
def _sines(b: Array, dt: float) -> None:
    """Fill the rows S with sin(ν dt) and C with cos(ν dt): reduction by multiples of π/2, then Taylor to r^16."""
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        a = pack(b, (block.NU, lane)) * dt
        q = (a * TWO_OVER_PI + TO_INTEGER) - TO_INTEGER
        r = ((a - q * HALF_PI_1) - q * HALF_PI_2) - q * _HALF_PI_REST
        z = r * r
        s = -7.647163731819816e-13 * z + 1.6059043836821613e-10
        s = s * z - 2.505210838544172e-08
        s = s * z + 2.7557319223985893e-06
        s = s * z - 0.0001984126984126984
        s = s * z + 0.008333333333333333
        s = s * z - 0.16666666666666666
        s = r + r * z * s
        c = 4.779477332387385e-14 * z - 1.1470745597729725e-11
        c = c * z + 2.08767569878681e-09
        c = c * z - 2.755731922398589e-07
        c = c * z + 2.48015873015873e-05
        c = c * z - 0.001388888888888889
        c = c * z + 0.041666666666666664
        c = 1.0 - (0.5 * z - z * z * c)
        odd = q - 2.0 * ((0.5 * q - 0.25 + TO_INTEGER) - TO_INTEGER)
        p, m = 0.5 * (q - odd), 0.5 * (q + odd)
        sign_s = 1.0 - 2.0 * (p - 2.0 * ((0.5 * p - 0.25 + TO_INTEGER) - TO_INTEGER))
        sign_c = 1.0 - 2.0 * (m - 2.0 * ((0.5 * m - 0.25 + TO_INTEGER) - TO_INTEGER))
        store(b, (block.S, lane), sign_s * (s * (1.0 - odd) + c * odd))
        store(b, (block.C, lane), sign_c * (c * (1.0 - odd) + s * odd))


@part
def _exponentials(b: Array, dt: float) -> None:
    """Fill the rows WORK and POWER with e^r and 2^q of e^(-c dt/2) = 2^q e^r, clamped at e^±700."""
    for k in range(b.shape[1]):
        y = min(max(-b[block.HALF_DAMPING, k] * dt, -700.0), 700.0)
        q = (y * LOG2_E + TO_INTEGER) - TO_INTEGER
        r = (y - q * LN2_HIGH) - q * LN2_LOW
        b[block.WORK, k] = r
        bits = np.float64(q + _EXPONENT).view(np.int64) << 52
        b[block.POWER, k] = np.int64(bits).view(np.float64)
    for k in range(0, b.shape[1], 8):
        lane = narrow(k)
        remainder = pack(b, (block.WORK, lane))
        store(b, (block.WORK, lane), 1.0 + (remainder + remainder * remainder * _phi2(remainder)))


@part
def aperiodic_propagator(c: float, w2: float, dt: float) -> tuple[float, float]:
    """Return C and S of one block that does not oscillate, ω² <= c²/4, of either sign of c."""
    half = 0.5 * c
    square = max(0.0, half * half - w2)
    x = square * dt * dt
    if x < 0.05:  # to x⁵/11!: below rounding
        cosh = 1.0 + x / 2.0 * (1.0 + x / 12.0 * (1.0 + x / 30.0 * (1.0 + x / 56.0 * (1.0 + x / 90.0))))
        sinh = 1.0 + x / 6.0 * (1.0 + x / 20.0 * (1.0 + x / 42.0 * (1.0 + x / 72.0 * (1.0 + x / 110.0))))
        decay = elementary.exp(-half * dt)
        S = dt * decay * sinh
        return decay * cosh + half * S, S
    root = np.sqrt(square)
    if half >= 0.0:
        slow, fast = -w2 / (half + root), -(half + root)
    else:
        slow, fast = -half + root, w2 / (root - half)
    e_slow, e_fast = elementary.exp(slow * dt), elementary.exp(fast * dt)
    S = (e_slow - e_fast) / (2.0 * root)
    return 0.5 * (e_slow + e_fast) + half * S, S


@part
def first_propagator(x: float) -> tuple[float, float, float]:
    """Return e^x, φ1 = (e^x - 1)/x and φ2 = (φ1 - 1)/x."""
    if -0.5 < x < 0.5:
        total, term = 0.5, 0.5  # Σ x^k/(k+2)!
        for k in range(3, 18):
            term *= x / k
            total += term
            if abs(term) < 1e-18:
                break
        phi1 = 1.0 + x * total
        return 1.0 + x * phi1, phi1, total
    e = elementary.exp(x)
    phi1 = (e - 1.0) / x
    return e, phi1, (phi1 - 1.0) / x


@part
def first_propagators(f: Array, dt: float) -> None:
    """Fill the rows DECAY, PHI1 and PHI2 of a table of first-order states: e^x, φ1, φ2 of x = -rate dt."""
    largest = 0.0
    for j in range(f.shape[1]):
        if abs(f[first.RATE, j]) > largest:
            largest = abs(f[first.RATE, j])
    if largest * abs(dt) > _SERIES:
        for j in range(f.shape[1]):
            f[first.DECAY, j], f[first.PHI1, j], f[first.PHI2, j] = first_propagator(-f[first.RATE, j] * dt)
        return
    for j in range(0, f.shape[1], 8):
        lane = narrow(j)
        x = -pack(f, (first.RATE, lane)) * dt
        phi2 = _phi2(x)
        phi1 = 1.0 + x * phi2
        store(f, (first.PHI2, lane), phi2)
        store(f, (first.PHI1, lane), phi1)
        store(f, (first.DECAY, lane), 1.0 + x * phi1)
