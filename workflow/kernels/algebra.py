"""Linear algebra by LAPACK that stays accurate for matrices whose entries differ by many decades."""

from __future__ import annotations

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import lapack

from workflow.kernels import Array

Complex = NDArray[np.complex128]

MOST_BY_JACOBI = 300
"""Columns up to which singular values come from Jacobi's method: for 800 it takes 1.9 s, the usual one 0.3 s."""

_EPS = float(np.finfo(float).eps)

_SCALED_ROWS = 2
"""JOBA of dgejsv: values keep their digits where rows and columns are scaled by any factors."""


def connected_parts(links: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
    """Return the indices of parts that no link joins, of symmetric links; SciPy's search takes 0.3 ms to begin."""
    left, parts = np.ones(len(links), dtype=np.bool_), []
    while left.any():
        part = links[left.argmax()]
        while np.count_nonzero(wider := links[part].any(axis=0)) > np.count_nonzero(part):
            part = wider
        parts.append(np.flatnonzero(part))
        left &= ~part
    return parts


def singular(matrix: ArrayLike, graded: bool = True) -> tuple[Array, Array]:
    """Return the singular values of a real matrix, descending, ``(column,)``, and right singular vectors in columns.

    Where A = D₁ B D₂ with any diagonal D₁, D₂ and a well-conditioned B each value has a small relative error if
    ``graded``, up to :data:`MOST_BY_JACOBI` columns: springs of a chain may differ by many decades. Columns that no
    row links have vectors of their own, also where their values are equal.
    Source: Drmač and Veselić, New fast and accurate Jacobi SVD algorithm I (SIAM J. Matrix Anal. Appl. 29, 2008).

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite, or the iteration did not converge.
    """
    a = _finite(matrix)
    if a.shape[1] == 0 or a.all(axis=1).any():
        return _singular_of_part(a, graded)
    parts = connected_parts(((a != 0).T.astype(np.float64) @ (a != 0) > 0) | np.eye(a.shape[1], dtype=np.bool_))
    each = [_singular_of_part(a[:, part], graded) for part in parts]
    values = np.concatenate([own for own, _ in each])
    order = np.argsort(-values, kind="stable")
    vectors = block_diagonal(*(own for _, own in each))[np.argsort(np.concatenate(parts))]
    return values[order], np.ascontiguousarray(vectors[:, order])


def _singular_of_part(a: Array, graded: bool) -> tuple[Array, Array]:
    """Return the singular values of a matrix, and right singular vectors."""
    size, values = a.shape[1], np.zeros(a.shape[1])
    if size < 2:
        return np.linalg.norm(a, axis=0), np.eye(size)
    if size > MOST_BY_JACOBI or not graded:
        _, s, vt = np.linalg.svd(a, full_matrices=a.shape[0] < size)
        values[: s.size] = s
        return values, np.ascontiguousarray(vt.T)
    rows = np.zeros((max(a.shape), size))  # dgejsv takes no fewer rows than columns
    rows[: a.shape[0]] = a
    values, _, vectors, work, _, failed = lapack.dgejsv(rows, joba=_SCALED_ROWS, jobu=3, jobv=0)
    if failed:
        raise np.linalg.LinAlgError("singular values were not found")
    return values * (work[0] / work[1]), np.ascontiguousarray(vectors)


def least_squares(matrix: ArrayLike, right: ArrayLike) -> Array:
    """Return the x of minimum norm that minimises |A x - b|, for each column of b.

    A part of the triangular factor below max(shape) · 2.2e-16 counts as 0. The largest rows come first, so that rows
    of any scale keep their digits.
    Source: Cox and Higham, Stability of Householder QR factorization for weighted least squares problems (1998).
    """
    a = np.asarray(matrix, dtype=np.float64)
    order = np.argsort(-np.abs(a).max(axis=1, initial=0.0))
    solution = scipy.linalg.lstsq(a[order], np.asarray(right)[order], cond=max(a.shape) * _EPS, lapack_driver="gelsy")
    return np.asarray(solution[0])


def eigenvalues(matrix: ArrayLike) -> Complex:
    """Return the eigenvalues of a real square matrix; pairs are conjugate to the bit, positive imaginary part first.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite, or the iteration did not converge.
    """
    return np.asarray(scipy.linalg.eigvals(_finite(matrix)))


def _finite(matrix: ArrayLike) -> Array:
    """Return a matrix after a check that its entries are finite, as LAPACK requires."""
    a = np.asarray(matrix, dtype=np.float64)
    if not np.isfinite(a).all():
        raise np.linalg.LinAlgError("a matrix with entries that are not finite cannot be decomposed")
    return a


def block_diagonal(*matrices: Array) -> Array:
    """Return the matrix with these on its diagonal; SciPy's ``block_diag`` fails while a thread imports dask.array."""
    whole = np.zeros([sum(sides) for sides in zip(*(matrix.shape for matrix in matrices), strict=True)])
    row, column = 0, 0
    for matrix in matrices:
        below, right = row + matrix.shape[0], column + matrix.shape[1]
        whole[row:below, column:right] = matrix
        row, column = below, right
    return whole
