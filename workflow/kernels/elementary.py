"""Exponential, logarithm, sine, cosine and hypotenuse for kernels, with the same bits on every processor.

The functions of a C library depend on its version and on whether the processor has a fused
multiply-add. These use additions, subtractions, multiplications, divisions, square roots and integer
operations only, all of which IEEE 754 fixes. Errors are below 1 unit in the last place, measured against
mpmath (``tests/kernels/test_elementary.py``).

Arguments are reduced by multiples of ln 2 and of π/2 (W. J. Cody and W. Waite, Software Manual for the
Elementary Functions, 1980), those of sine and cosine beyond 1.6e6 by the bits of 2/π (M. H. Payne and
R. N. Hanek, ACM SIGNUM Newsletter 18 (1983) 19–24). Reduced arguments are kept as r + rest, two numbers
whose sum is more accurate than one. Polynomials are Taylor series, cut where the next term is below a
tenth of a rounding.

For arrays outside kernels see :mod:`workflow.kernels.elementwise`.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels.compiled import inlined, part

TO_INTEGER = 6755399441055744.0
"""1.5 · 2^52: adding and subtracting it rounds to the nearest integer."""

LOG2_E = 1.4426950408889634
LN2_HIGH, LN2_LOW = 0.6931471803691238, 1.9082149292705877e-10
"""ln 2 = high + low + 1e-26. ``LN2_HIGH`` is ln 2 cut after 32 bits, so that its product with an integer up to 2^21 has
at most 53 bits and is exact; ``LN2_LOW`` is what is left, rounded."""

TWO_OVER_PI = 0.6366197723675814
HALF_PI_1, HALF_PI_2 = 1.5707963267341256, 6.077100506303966e-11
_HALF_PI_3, _HALF_PI_4 = 2.0222662487111665e-21, 8.4784276603689e-32
"""π/2 as a sum of four parts, to 7e-49. Each of the first three is π/2, less the parts before it, cut after at most 33
bits, so that its product with an integer up to 2^20 is exact; the last is what is left, rounded."""
_HALF_PI, _HALF_PI_REST = 1.5707963267948966, 6.123233995736766e-17
"""π/2 rounded, and its rounding: the factor of a fraction of a quarter turn, to 1.5e-33."""
_LARGEST_TURN = 1.6e6
"""About 2^20 · π/2: larger arguments of sine and cosine are reduced by the bits of 2/π."""

_LARGEST_POWER, _SMALLEST_POWER = 709.79, -745.2
"""The exponential of larger arguments overflows, that of smaller ones underflows to zero."""

_SPLIT = 134217729.0
"""2^27 + 1 splits a number into two of 26 bits (T. J. Dekker, Numerische Mathematik 18 (1971) 224–242)."""

_LIMB = 24
"""Bits of one entry of the table of 2/π: products of two entries, and sums of some, fit in 64 bits."""
_LIMBS = 52
"""Entries: enough for the largest double, 2^1024, and 168 bits of the reduced argument."""
_FRACTION_LIMBS = 7
"""Entries of the reduced argument, 168 bits: 62 vanish where an argument is nearest to a multiple of π/2."""


def _inverse_tangent(denominator: int, one: int) -> int:
    """Return ``one`` times the arc tangent of 1/denominator, by its series in integers."""
    term = total = one // denominator
    divisor, sign = 1, 1
    while term:
        term //= denominator * denominator
        divisor, sign = divisor + 2, -sign
        total += sign * (term // divisor)
    return total


def _bits_of_two_over_pi() -> np.ndarray:
    """Return 2/π in pieces of 24 bits, the first one worth 2^-24, by Machin's formula for π/4."""
    guard = 64
    one = 1 << (_LIMB * _LIMBS + guard)
    quarter_pi = 4 * _inverse_tangent(5, one) - _inverse_tangent(239, one)
    bits = ((one * one) // (2 * quarter_pi)) >> guard
    pieces = [(bits >> (_LIMB * (_LIMBS - 1 - k))) & ((1 << _LIMB) - 1) for k in range(_LIMBS)]
    return np.array(pieces, dtype=np.int64)


_TABLE = _bits_of_two_over_pi()


@inlined
def _power_of_two(exponent: int) -> float:
    """Return 2^exponent of an integer between -1022 and 1023."""
    return float(np.int64((exponent + 1023) << 52).view(np.float64))


@inlined
def _scaled(x: float, exponent: int) -> float:
    """Return x · 2^exponent, rounded once, also where the power itself is no double."""
    half = exponent >> 1
    return x * _power_of_two(half) * _power_of_two(exponent - half)


@inlined
def _sum(a: float, b: float) -> tuple[float, float]:
    """Return the rounded sum and what rounding left out (Knuth's two-sum)."""
    s = a + b
    c = s - a
    return s, (a - (s - c)) + (b - c)


@inlined
def _product(a: float, b: float) -> tuple[float, float]:
    """Return the rounded product and what rounding left out (Dekker's product)."""
    p = a * b
    c = _SPLIT * a
    a_high = c - (c - a)
    a_low = a - a_high
    c = _SPLIT * b
    b_high = c - (c - b)
    b_low = b - b_high
    return p, ((a_high * b_high - p) + a_high * b_low + a_low * b_high) + a_low * b_low


@inlined
def _curved(r: float) -> float:
    """Return (e^r - 1 - r)/r² of -0.4 < r < 0.4: Σ r^k/(k + 2)! up to r^12/14!."""
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
def _less_doublings(x: float) -> tuple[int, float, float]:
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
    q, r, rest = _less_doublings(x)
    return float(_scaled(1.0 + (r + (rest + r * r * _curved(r))), q))


@part
def log(x: float) -> float:
    """Return the natural logarithm; -inf of 0 and NaN of negative numbers."""
    if not 0.0 < x < np.inf:
        if x == 0.0:
            return -np.inf
        return x if x > 0.0 else np.nan
    k = 0
    if x < 2.2250738585072014e-308:  # subnormal
        x, k = x * 18014398509481984.0, -54
    bits = np.float64(x).view(np.int64)
    # 2^k m with m between √½ and √2: adding what lies between the bits of √½ and 1 carries into the exponent
    shifted = bits + (4607182418800017408 - 4604544271217802189)
    step = (shifted >> 52) - 1023
    k += int(step)
    f = np.int64(bits - (step << 52)).view(np.float64) - 1.0
    s = f / (2.0 + f)
    z = s * s
    p = z * (2.0 / 23.0) + 2.0 / 21.0
    p = p * z + 2.0 / 19.0
    p = p * z + 2.0 / 17.0
    p = p * z + 2.0 / 15.0
    p = p * z + 2.0 / 13.0
    p = p * z + 2.0 / 11.0
    p = p * z + 2.0 / 9.0
    p = p * z + 2.0 / 7.0
    p = p * z + 2.0 / 5.0
    p = p * z + 2.0 / 3.0
    half = 0.5 * f * f
    return float(k * LN2_HIGH - ((half - (s * (half + p * z) + k * LN2_LOW)) - f))


@part
def _less_turns_of_large(x: float) -> tuple[int, float, float]:
    """Return q mod 4, r and rest of x = q π/2 + r + rest, by the bits of 2/π; x is finite and above 1e6.

    x = m 2^(24 j) with m an integer of four pieces of 24 bits. Column c of the product with 2/π is worth
    2^(-24 c); columns left of the point are multiples of 2^24, so of 4. Carries are rounded to nearest, so
    that the fraction lies between -1/2 and 1/2 and its leading pieces vanish where it is small.
    """
    bits = np.float64(x).view(np.int64)
    exponent = (bits >> 52) - 1075
    mantissa = (bits & 4503599627370495) | 4503599627370496
    j = exponent // _LIMB
    shift = exponent - _LIMB * j
    mask = (1 << _LIMB) - 1
    low, high = (mantissa & mask) << shift, (mantissa >> _LIMB) << shift
    m0 = low & mask
    high += low >> _LIMB
    m1, m2, m3 = high & mask, (high >> _LIMB) & mask, high >> (2 * _LIMB)
    carry, r, rest, column = 0, 0.0, 0.0, 0
    scale = _power_of_two(-_LIMB * (_FRACTION_LIMBS + 1))
    for c in range(_FRACTION_LIMBS + 1, -1, -1):
        k = j - 1 + c
        column = carry
        column += m0 * _TABLE[k] if k >= 0 else 0
        column += m1 * _TABLE[k + 1] if k + 1 >= 0 else 0
        column += m2 * _TABLE[k + 2] if k + 2 >= 0 else 0
        column += m3 * _TABLE[k + 3] if k + 3 >= 0 else 0
        if c > 0:
            carry = (column + (1 << (_LIMB - 1))) >> _LIMB
            r, lost = _sum(float(column - (carry << _LIMB)) * scale, r)
            rest += lost
            scale *= 16777216.0
    high_part, low_part = _product(r, _HALF_PI)
    low_part += r * _HALF_PI_REST + rest * _HALF_PI
    r = high_part + low_part
    return int(column & 3), r, (high_part - r) + low_part


@inlined
def _less_turns(x: float) -> tuple[int, float, float]:
    """Return q, r and rest of x = q π/2 + r + rest, |x| up to 1.6e6: products with q are exact but the last."""
    q = (x * TWO_OVER_PI + TO_INTEGER) - TO_INTEGER
    r, first = _sum(x - q * HALF_PI_1, -(q * HALF_PI_2))
    r, second = _sum(r, -(q * _HALF_PI_3))
    last = (first + second) - q * _HALF_PI_4
    whole = r + last
    return int(q), whole, (r - whole) + last


@part
def sine_cosine(x: float) -> tuple[float, float]:
    """Return sin x and cos x; NaN where x is not finite."""
    size = abs(x)
    if size < _LARGEST_TURN:
        q, r, rest = _less_turns(x)
    elif size < np.inf:
        q, r, rest = _less_turns_of_large(size)
        if x < 0.0:
            q, r, rest = -q, -r, -rest
    else:
        return np.nan, np.nan
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


@part
def hypot(x: float, y: float) -> float:
    """Return √(x² + y²) without overflow or underflow in between."""
    a, b = max(abs(x), abs(y)), min(abs(x), abs(y))
    if abs(x) == np.inf or abs(y) == np.inf:
        return np.inf
    if x != x or y != y:
        return np.nan
    if a == 0.0 or b == 0.0:
        return a
    back = 1.0
    if a > 1e140:
        back = _power_of_two(600)
    elif b < 1e-140:
        back = _power_of_two(-600)
    a, b = a / back, b / back
    (s, t), (u, v) = _product(a, a), _product(b, b)
    whole = s + u
    rest = ((s - whole) + u) + (t + v)
    root = np.sqrt(whole)
    square, lost = _product(root, root)
    return float(back * (root + (((whole - square) - lost) + rest) / (2.0 * root)))


@inlined
def quotient(a: complex, b: complex) -> complex:
    """Return a/b by Smith's division (Communications of the ACM 5 (1962) 435), NaN where b is 0: numba's own raises."""
    c, d = b.real, b.imag
    if abs(c) >= abs(d):
        ratio = d / c
        size = c + d * ratio
        return complex((a.real + a.imag * ratio) / size, (a.imag - a.real * ratio) / size)
    ratio = c / d
    size = c * ratio + d
    return complex((a.real * ratio + a.imag) / size, (a.imag * ratio - a.real) / size)
