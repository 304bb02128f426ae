"""Cholesky factors, triangular and general systems of equations, inverses: sums in a fixed order.

Bits do not depend on the processor, and a column of the right-hand side gets the same whatever columns stand
beside it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, uncounted
from workflow.kernels.sums import plain


@inlined
def _subtract(rows: Array, i: int, share: float, source: Array, k: int) -> None:
    """Subtract a share of a row of ``source`` from a row of ``rows``."""
    for j in range(rows.shape[1]):
        rows[i, j] -= share * source[k, j]


@uncounted
def _factor(matrix: Array, lower: Array) -> bool:
    """Put the Cholesky factor of a matrix, of which the lower half is read, in zeros; tell whether there is one."""
    for i in range(matrix.shape[0]):
        for j in range(i + 1):
            rest = matrix[i, j]
            for k in range(j):
                rest -= lower[i, k] * lower[j, k]
            if j < i:
                lower[i, j] = rest / lower[j, j]
            elif rest > 0.0 and rest < np.inf:
                lower[i, i] = np.sqrt(rest)
            else:
                return False
    return True


@uncounted
def _solve_downward(lower: Array, right: Array) -> None:
    """Replace ``right`` by the solution of a lower triangular system."""
    for i in range(lower.shape[0]):
        for k in range(i):
            if lower[i, k] != 0.0:
                _subtract(right, i, lower[i, k], right, k)
        for j in range(right.shape[1]):
            right[i, j] /= lower[i, i]


@uncounted
def _solve_upward(lower: Array, right: Array) -> None:
    """Replace ``right`` by the solution of the system of the transpose of a lower triangular matrix."""
    for i in range(lower.shape[0] - 1, -1, -1):
        for k in range(i + 1, lower.shape[0]):
            if lower[k, i] != 0.0:
                _subtract(right, i, lower[k, i], right, k)
        for j in range(right.shape[1]):
            right[i, j] /= lower[i, i]


@uncounted
def _eliminate(matrix: Array, right: Array) -> bool:
    """Replace ``right`` by the solution; uses the matrix up. Tell whether every pivot was other than 0 and finite."""
    size = matrix.shape[0]
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if abs(matrix[i, k]) > abs(matrix[best, k]):
                best = i
        if not 0.0 < abs(matrix[best, k]) < np.inf:
            return False
        if best != k:
            for j in range(k, size):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
            for j in range(right.shape[1]):
                right[k, j], right[best, j] = right[best, j], right[k, j]
        for i in range(k + 1, size):
            share = matrix[i, k] / matrix[k, k]
            if share != 0.0:
                for j in range(k + 1, size):
                    matrix[i, j] -= share * matrix[k, j]
                _subtract(right, i, share, right, k)
    for i in range(size - 1, -1, -1):
        for k in range(i + 1, size):
            _subtract(right, i, matrix[i, k], right, k)
        for j in range(right.shape[1]):
            right[i, j] /= matrix[i, i]
    return True


def _columns(size: int, right: ArrayLike) -> tuple[Array, tuple[int, ...]]:
    """Return a copy of right-hand sides as columns, and their shape as given."""
    sides = np.asarray(right, dtype=np.float64)
    if sides.shape[:1] != (size,):
        raise ValueError(f"right-hand sides of shape {sides.shape} for {size} equations")
    return sides.reshape(size, int(np.prod(sides.shape[1:]))).copy(), sides.shape


def cholesky(matrix: ArrayLike) -> Array:
    """Return the lower triangular L with L Lᵀ = A of a symmetric positive definite A, of which the lower half is read.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is not positive definite.
    """
    a = plain(matrix)
    lower = np.zeros_like(a)
    if not _factor(a, lower):
        raise np.linalg.LinAlgError("the matrix is not positive definite")
    return lower


def solve_triangular(lower: ArrayLike, right: ArrayLike, transposed: bool = False) -> Array:
    """Return L⁻¹ b of a lower triangular L, or L⁻ᵀ b, for a vector or for each column of b."""
    factor = plain(lower)
    columns, shape = _columns(factor.shape[0], right)
    (_solve_upward if transposed else _solve_downward)(factor, columns)
    return columns.reshape(shape)


def solve(matrix: ArrayLike, right: ArrayLike) -> Array:
    """Return A⁻¹ b for a vector or for each column of b, by elimination with partial pivoting.

    Raises
    ------
    numpy.linalg.LinAlgError
        A pivot is 0 or not finite: the matrix is singular.
    """
    a = np.array(matrix, dtype=np.float64, order="C")
    columns, shape = _columns(a.shape[0], right)
    if not _eliminate(a, columns):
        raise np.linalg.LinAlgError("the matrix is singular")
    return columns.reshape(shape)


def inverse(matrix: ArrayLike) -> Array:
    """Return A⁻¹.

    Raises
    ------
    numpy.linalg.LinAlgError
        The matrix is singular.
    """
    return solve(matrix, np.eye(np.asarray(matrix).shape[0]))
