"""Entries of a file that describe many degrees of freedom: checked and kept as sparse matrices."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._matrix_files import refuse

ASYMMETRY = 1e-10
"""Share of the largest entry of a row and column by which a matrix may miss symmetry: that of assembly in another
order, or of files with eleven digits. The mean of both halves is used."""


def is_large(value: Any) -> bool:
    """Tell whether a matrix has more rows or columns than dense portable arrays are made of."""
    return len(np.shape(value)) == 2 and max(np.shape(value)) > MOST_BY_JACOBI


def sparse_matrix(name: str, value: Any) -> scipy.sparse.csc_array:
    """Return a matrix of finite numbers by its columns."""
    kind = value.dtype.kind if hasattr(value, "dtype") else np.asarray(value).dtype.kind
    if kind not in "fiub":
        raise refuse(f"`{name}` holds no real numbers", "write real numbers")
    matrix = scipy.sparse.csc_array(
        value if scipy.sparse.issparse(value) else np.asarray(value, dtype=np.float64), dtype=np.float64
    )
    matrix.sum_duplicates()
    if not np.isfinite(matrix.data).all():
        raise refuse(f"`{name}` has an entry that is not finite", "write finite numbers")
    return matrix


def sparse_square(name: str, value: Any, size: int | None = None) -> scipy.sparse.csc_array:
    """Return a symmetric matrix, its two halves averaged."""
    matrix = sparse_matrix(name, value)
    if matrix.shape[0] != matrix.shape[1]:
        raise refuse(f"`{name}` has the shape {matrix.shape}", "it must be square")
    if size is not None and matrix.shape[0] != size:
        raise refuse(f"`{name}` has {matrix.shape[0]} rows", f"it must have {size}, as the matrices beside it")
    across = scipy.sparse.csc_array(matrix.T)
    magnitudes = abs(matrix)
    largest = np.maximum(magnitudes.max(axis=0).toarray().ravel(), magnitudes.max(axis=1).toarray().ravel())
    apart = abs(matrix - across).tocoo()
    wrong = np.flatnonzero(apart.data > ASYMMETRY * np.maximum(largest[apart.row], largest[apart.col]))
    if wrong.size:
        row, column = int(apart.row[wrong[0]]), int(apart.col[wrong[0]])
        raise refuse(
            f"`{name}` is not symmetric: {matrix[row, column]:g} at ({row}, {column}), {matrix[column, row]:g} across",
            "write both halves alike",
        )
    return scipy.sparse.csc_array((matrix + across) / 2)
