"""Sums and matrix products whose bits do not depend on the processor, nor on what else is summed beside them.

NumPy and BLAS choose the order of a sum, and whether a multiplication and an addition are rounded together, by the
processor and by the shapes of the operands. Here the order depends on the number of terms alone, and only
IEEE additions, multiplications and square roots are used.
"""

from __future__ import annotations

from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, uncounted

BLOCK = 128
"""Terms that are added by eight running sums; sums of blocks are added pairwise, so that rounding grows with
the logarithm of their number."""

_LEVELS = 64
"""Levels of pairwise sums: more than the bits of any count of blocks."""


@inlined
def row_sum(rows: Array, i: int, first: int, last: int) -> float:
    """Return the sum of ``rows[i, first:last]``, by eight running sums."""
    a = b = c = d = e = f = g = h = 0.0
    eights = first + (last - first) // 8 * 8
    for start in range(first, eights, 8):
        k = np.uintp(start)  # unsigned: an index that cannot be negative needs no test for it
        a += rows[i, k]
        b += rows[i, k + np.uintp(1)]
        c += rows[i, k + np.uintp(2)]
        d += rows[i, k + np.uintp(3)]
        e += rows[i, k + np.uintp(4)]
        f += rows[i, k + np.uintp(5)]
        g += rows[i, k + np.uintp(6)]
        h += rows[i, k + np.uintp(7)]
    subtotal = ((a + b) + (c + d)) + ((e + f) + (g + h))
    for j in range(eights, last):
        subtotal += rows[i, j]
    return subtotal


@uncounted
def _row_totals(rows: Array, partial: Array, totals: Array) -> None:
    """Put the sum of each row in ``totals``; ``partial`` holds sums of 1, 2, 4, … blocks that wait for their pair."""
    count = rows.shape[1]
    for i in range(rows.shape[0]):
        level = 0
        for first in range(0, count, BLOCK):
            here, pairs = row_sum(rows, i, first, min(first + BLOCK, count)), first // BLOCK + 1
            while pairs % 2 == 0:
                level -= 1
                here = partial[level] + here
                pairs //= 2
            partial[level] = here
            level += 1
        here = 0.0
        for k in range(level - 1, -1, -1):
            here = partial[k] + here
        totals[i] = here


@uncounted
def _multiply(a: Array, b: Array, products: Array) -> None:
    """Add ``a @ b`` to ``products``, each sum in the order of its terms."""
    for i in range(a.shape[0]):
        for k in range(a.shape[1]):
            weight = a[i, k]
            for j in range(b.shape[1]):
                products[i, j] += weight * b[k, j]


@uncounted
def _multiply_vector(a: Array, b: Array, products: Array) -> None:
    """Put ``a @ b`` in ``products``, each sum in the order of its terms; ``b`` and ``products`` have one column."""
    for i in range(a.shape[0]):
        here = 0.0
        for k in range(a.shape[1]):
            here += a[i, k] * b[k, 0]
        products[i, 0] = here


def plain(values: ArrayLike) -> Array:
    """Return values as kernels take them: float64, in C order, writable; copied only where they are not."""
    array = np.asarray(values, dtype=np.float64, order="C")
    return array if array.flags.writeable else array.copy()


@overload
def product(a: NDArray[Any], b: NDArray[Any]) -> Array: ...
@overload
def product(a: ArrayLike, b: ArrayLike) -> Any: ...
def product(a: ArrayLike, b: ArrayLike) -> Any:
    """Return ``a @ b`` of real vectors and matrices, of two vectors as a float.

    Each entry is the sum of its terms in their order: the bits of a row of ``a`` or a column of ``b`` are the same
    whatever rows or columns stand beside it.
    """
    left, right = np.asarray(a), np.asarray(b)
    rows = plain(left if left.ndim == 2 else left[None, :])
    columns = plain(right if right.ndim == 2 else right[:, None])
    if rows.shape[1] != columns.shape[0]:
        raise ValueError(f"a product of shapes {left.shape} and {right.shape}")
    products = np.zeros((rows.shape[0], columns.shape[1]))
    (_multiply_vector if columns.shape[1] == 1 else _multiply)(rows, columns, products)
    if left.ndim == 2 and right.ndim == 2:
        return products
    return products.ravel() if left.ndim + right.ndim == 3 else float(products[0, 0])


def dot(a: ArrayLike, b: ArrayLike) -> float:
    """Return the sum of the products of two real vectors, in the order of their terms."""
    return float(product(np.asarray(a), np.asarray(b)))


@overload
def total(values: ArrayLike, axis: None = None) -> float: ...
@overload
def total(values: ArrayLike, axis: int) -> Array: ...
def total(values: ArrayLike, axis: int | None = None) -> Any:
    """Return the sum of real numbers along an axis, or of all of them as a float.

    Its bits depend on the terms along the axis alone.
    """
    terms = np.asarray(values, dtype=np.float64)
    moved = terms.reshape(1, -1) if axis is None else np.moveaxis(terms, axis, -1)
    shape = moved.shape[:-1]
    rows = plain(moved).reshape(int(np.prod(shape)), moved.shape[-1])
    totals = np.zeros(rows.shape[0])
    _row_totals(rows, np.zeros(_LEVELS), totals)
    return float(totals[0]) if axis is None else totals.reshape(shape)


@overload
def norm(values: ArrayLike, axis: None = None) -> float: ...
@overload
def norm(values: ArrayLike, axis: int) -> Array: ...
def norm(values: ArrayLike, axis: int | None = None) -> Any:
    """Return the Euclidean norm of real or complex numbers along an axis, or of all of them as a float."""
    numbers = np.asarray(values)
    squares = numbers.real * numbers.real
    if np.iscomplexobj(numbers):
        squares = squares + numbers.imag * numbers.imag
    lengths = np.sqrt(total(squares) if axis is None else total(squares, axis))
    return float(lengths) if axis is None else lengths
