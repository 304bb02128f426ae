"""Arithmetic of complex arrays from operations on real ones, which IEEE fixes to the bit.

NumPy rounds multiplication and addition of a complex product together on processors that can, and takes the
square root and the absolute value from the C library.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workflow.kernels import Array
from workflow.kernels.sums import product, total

Complex = NDArray[np.complex128]


def complex_of(real: ArrayLike, imaginary: ArrayLike) -> Complex:
    """Return complex numbers of given parts."""
    x, y = np.broadcast_arrays(real, imaginary)
    numbers = np.empty(x.shape, dtype=np.complex128)
    numbers.real, numbers.imag = x, y
    return numbers


def times(a: ArrayLike, b: ArrayLike) -> Complex:
    """Return a · b, element by element."""
    p, q = np.asarray(a), np.asarray(b)
    return complex_of(p.real * q.real - p.imag * q.imag, p.real * q.imag + p.imag * q.real)


def over(a: ArrayLike, b: ArrayLike) -> Complex:
    """Return a / b, element by element, by the quotient of the smaller and the larger part of b.

    Source: Smith, Commun. ACM 5 (1962) 435. Infinite or NaN where b is 0.
    """
    p, q = np.asarray(a), np.asarray(b)
    level = np.abs(q.real) >= np.abs(q.imag)
    large, small = np.where(level, q.real, q.imag), np.where(level, q.imag, q.real)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = small / large
        size = large + small * ratio
        real = np.where(level, p.real + p.imag * ratio, p.real * ratio + p.imag) / size
        imaginary = np.where(level, p.imag - p.real * ratio, p.imag * ratio - p.real) / size
    return complex_of(real, imaginary)


def magnitude(a: ArrayLike) -> Array:
    """Return |a|, element by element, to two units in the last place."""
    values = np.asarray(a)
    x, y = np.abs(values.real), np.abs(values.imag)
    large, small = np.maximum(x, y), np.minimum(x, y)
    ratio = small / np.where(large > 0, large, 1.0)
    return np.asarray(large * np.sqrt(1.0 + ratio * ratio), dtype=np.float64)


def square_root(a: ArrayLike) -> Complex:
    """Return the root of a whose real part is not negative, element by element.

    Of a negative real number it is imaginary, on the side of the sign of its zero imaginary part.
    """
    values = np.asarray(a)
    x, y = values.real, np.asarray(values.imag, dtype=np.float64)
    large = np.sqrt(0.5 * (magnitude(values) + np.abs(x)))
    small = 0.5 * np.abs(y) / np.where(large > 0, large, 1.0)
    right = x >= 0
    return complex_of(np.where(right, large, small), np.copysign(np.where(right, small, large), y))


def complex_total(a: ArrayLike, axis: int) -> Complex:
    """Return the sum of complex numbers along an axis, see :func:`~workflow.kernels.sums.total`."""
    values = np.asarray(a)
    return complex_of(total(values.real, axis), total(values.imag, axis))


def complex_product(a: ArrayLike, b: ArrayLike) -> Any:
    """Return ``a @ b`` of vectors and matrices of which one may be real, see :func:`~workflow.kernels.sums.product`.

    Of two vectors it is a complex number.
    """
    p, q = np.asarray(a), np.asarray(b)
    real, imaginary = product(p.real, q.real), 0.0
    if np.iscomplexobj(p) and np.iscomplexobj(q):
        real = real - product(p.imag, q.imag)
        imaginary = product(p.real, q.imag) + product(p.imag, q.real)
    elif np.iscomplexobj(q):
        imaginary = product(p.real, q.imag)
    elif np.iscomplexobj(p):
        imaginary = product(p.imag, q.real)
    numbers = complex_of(real, imaginary)
    return numbers if numbers.ndim else complex(numbers)
