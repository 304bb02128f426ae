"""Dense linear algebra of structures: the same bits on every processor, but for very large ones.

Up to :data:`MOST_PORTABLE` coordinates everything is our own (:mod:`workflow.kernels.singular`,
:mod:`workflow.kernels.sums`). Above, LAPACK takes a fifth of the time (800 coordinates: 0.3 s instead of
1.8 s), and its last bits depend on the processor. The size alone decides.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array, sums
from workflow.kernels import singular as portable

MOST_PORTABLE = 300
"""Coordinates up to which the bits of a structure's modes do not depend on the processor."""

_MOST_TERMS = 1000
"""Rows, columns and terms of a portable product: 300 coordinates with springs, conductors and surroundings."""


def singular(matrix: Array) -> tuple[Array, Array]:
    """Return the singular values, descending, ``(column,)``, and the right singular vectors in columns."""
    if matrix.shape[1] <= MOST_PORTABLE:
        decomposition = portable.singular(matrix)
        return decomposition.values, decomposition.vectors
    _, s, vt = np.linalg.svd(matrix, full_matrices=matrix.shape[0] < matrix.shape[1])
    values = np.zeros(matrix.shape[1])
    values[: s.size] = s
    return values, np.ascontiguousarray(vt.T)


def least_squares(matrix: Array, values: Array) -> Array:
    """Return the solution x of matrix · x = values of least residual and minimum norm."""
    if matrix.shape[1] <= MOST_PORTABLE:
        return portable.least_squares(matrix, values)
    return np.asarray(np.linalg.lstsq(matrix, values, rcond=None)[0], dtype=np.float64)


def product(a: Array, b: Array) -> Array:
    """Return the product of matrices or vectors, both of one or two dimensions."""
    if max(*a.shape, *b.shape) <= _MOST_TERMS:
        return np.asarray(sums.product(a, b))
    return np.asarray(a @ b)
