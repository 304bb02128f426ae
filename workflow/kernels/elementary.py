"""Exponential, sine and cosine for kernels, with the same bits on every processor.

The functions of a C library depend on its version and on whether the processor has a fused
multiply-add. These use only additions, subtractions, multiplications, divisions, square roots and integer
operations, all of them defined by IEEE 754. Errors are below 1 unit in the last place, measured against
mpmath (``tests/kernels/test_elementary.py``).

Arguments are reduced by multiples of ln 2 and of π/2 (W. J. Cody and W. Waite, Software Manual for the
Elementary Functions, 1980). Reduced arguments are r + rest, two numbers whose sum is more accurate than
one. Polynomials are Taylor series, truncated where the next term is below a tenth of a rounding.

For sine and cosine of arrays outside kernels see :mod:`workflow.kernels.elementwise`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels.compiled import inlined, part

TO_INTEGER = 6755399441055744.0
"""1.5 · 2^52: adding and subtracting it rounds to the nearest integer."""

LOG2_E = 1.4426950408889634
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10
"""ln 2 = high + low + 1e-26. ``LN2_HIGH`` is ln 2 truncated after 32 bits, so that its product with an integer up to
2^21 has at most 53 bits and is exact; ``LN2_LOW`` is the rounded remainder."""

TWO_OVER_PI = 0.6366197723675814
HALF_PI_1, HALF_PI_2 = 1.5707963267341256, 6.077100506303966e-11
_HALF_PI_3, _HALF_PI_4 = 2.0222662487111665e-21, 8.4784276603689e-32
"""π/2 as a sum of four parts, to 7e-49. Each of the first three is π/2 less the parts before it, truncated after at
most 33 bits, so that its product with an integer up to 2^20 is exact; the last is the rounded remainder."""
_LARGEST_TURN = 1.6e6
"""About 2^20 · π/2: larger arguments of sine and cosine are reduced twice, the first time by 2^20 quarter turns."""
_MANY_TURNS = 1048576.0

_LARGEST_POWER, _SMALLEST_POWER = 709.79, -745.2
"""Arguments above which the exponential overflows, and below which it underflows to zero."""


@inlined
def _power_of_two(exponent: int) -> float:
    """Return 2^exponent of an integer between -1022 and 1023."""
    return float(np.int64((exponent + 1023) << 52).view(np.float64))


@inlined
def _scaled(x: float, exponent: int) -> float:
    """Return x · 2^exponent, rounded once, also where the power itself is outside the range of doubles."""
    half = exponent >> 1
    return x * _power_of_two(half) * _power_of_two(exponent - half)


@inlined
def _sum(a: float, b: float) -> tuple[float, float]:
    """Return the rounded sum and its rounding error (Knuth's two-sum)."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@inlined
def phi2(r: Any) -> Any:
    """Return φ2 = (e^r - 1 - r)/r² of a number or pack for -0.4 < r < 0.4: Σ r^k/(k + 2)! up to r^12/14!."""
    p = 1.1470745597729725e-11 * r + 1.6059043836821613e-10
    p = p * r + 2.08767569878681e-09
    p = p * r + 2.505210838544172e-08
    p = p * r + 2.755731922398589e-07
    p = p * r + 2.7557319223985893e-06
    p = p * r + 2.48015873015873e-05
    p = p * r + 0.0001984126984126984
    p = p * r + 0.001388888888888889
    p = p * r + 0.008333333333333333
    p = p * r + 0.041666666666666664
    p = p * r + 0.16666666666666666
    return p * r + 0.5


@inlined
def _reduced_by_ln2(x: float) -> tuple[int, float, float]:
    """Return q, r and rest of x = q ln 2 + r + rest, where q is the nearest integer."""
    q = (x * LOG2_E + TO_INTEGER) - TO_INTEGER
    high, low = x - q * LN2_HIGH, q * LN2_LOW
    r = high - low
    return int(q), r, (high - r) - low


@part
def exp(x: float) -> float:
    """Return e^x."""
    if x != x or x > _LARGEST_POWER:
        return x + np.inf
    if x < _SMALLEST_POWER:
        return 0.0
    q, r, rest = _reduced_by_ln2(x)
    return float(_scaled(1.0 + (r + (rest + r * r * phi2(r))), q))


@inlined
def _reduced_by_turns(x: float, turns: float) -> tuple[int, float, float]:
    """Return q, r and rest of x = q · turns · π/2 + r + rest with |q| up to 2^20 and turns a power of two.

    Products with q are exact except the last one.
    """
    q = (x * (TWO_OVER_PI / turns) + TO_INTEGER) - TO_INTEGER
    r, first = _sum(x - q * (HALF_PI_1 * turns), -(q * (HALF_PI_2 * turns)))
    r, second = _sum(r, -(q * (_HALF_PI_3 * turns)))
    last = (first + second) - q * (_HALF_PI_4 * turns)
    whole = r + last
    return int(q), whole, (r - whole) + last


@part
def sine_cosine(x: float) -> tuple[float, float]:
    """Return sin x and cos x; NaN where x is not finite or |x| > 1.6e12, where it has no three digits of a turn."""
    begun, behind = x, 0.0
    if not abs(x) < _LARGEST_TURN:
        if not abs(x) < _LARGEST_TURN * _MANY_TURNS:
            return np.nan, np.nan
        _, begun, behind = _reduced_by_turns(x, _MANY_TURNS)
    q, r, rest = _reduced_by_turns(begun, 1.0)
    r, rest = _sum(r, rest + behind)
    z = r * r
    p = 2.8114572543455206e-15 * z - 7.647163731819816e-13  # r^17/17!, r^15/15!, …
    p = p * z + 1.6059043836821613e-10
    p = p * z - 2.505210838544172e-08
    p = p * z + 2.7557319223985893e-06
    p = p * z - 0.0001984126984126984
    p = p * z + 0.008333333333333333
    p = p * z - 0.16666666666666666
    s = r + (r * z * p + rest * (1.0 - 0.5 * z)) if r != 0.0 else x
    p = 4.779477332387385e-14 * z - 1.1470745597729725e-11  # r^16/16!, r^14/14!, …
    p = p * z + 2.08767569878681e-09
    p = p * z - 2.755731922398589e-07
    p = p * z + 2.48015873015873e-05
    p = p * z - 0.001388888888888889
    p = p * z + 0.041666666666666664
    half = 0.5 * z
    one = 1.0 - half
    c = one + (((1.0 - one) - half) + (z * z * p - r * rest))
    if q & 1:
        s, c = c, -s
    return (-s, -c) if q & 2 else (s, c)
