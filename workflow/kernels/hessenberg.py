"""A real matrix balanced, then reduced by orthogonal transformations to one without entries below its subdiagonal.

Sources: Parlett and Reinsch, Numer. Math. 13 (1969) 293–304; James, Langou and Lowery, arXiv:1401.5766 (Euclidean
norms); Golub and Van Loan, Matrix Computations, section 7.4.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part, uncounted

_GAIN = 0.95
"""A row and a column are scaled where that reduces the sum of their norms to this share or less."""


@dataclass(frozen=True, eq=False)
class Hessenberg:
    """H = Qᵀ D⁻¹ Pᵀ A P D Q: what is left of a matrix A, and the way back."""

    matrix: Array
    """H, upper triangular but for its subdiagonal, and for that only from row ``first`` to row ``last`` (exclusive)."""
    basis: Array
    """Qᵀ: the vectors of the basis in rows."""
    scale: Array
    """The diagonal of D, powers of two."""
    order: NDArray[np.intp]
    """P: which coordinate of A each row belongs to."""
    first: int
    last: int

    def original(self, right: Array, left: Array) -> tuple[Array, Array]:
        """Return columns ``right`` and rows ``left`` of the scaled and ordered matrix in the coordinates of A."""
        columns, rows = np.zeros_like(right), np.zeros_like(left)
        columns[self.order], rows[:, self.order] = self.scale[:, None] * right, left / self.scale
        return columns, rows


def _triangular_ends(matrix: Array) -> tuple[NDArray[np.intp], int, int]:
    """Return an order of coordinates in which those that are eigenvalues by themselves stand first and last.

    A row without entries beside its diagonal goes last, a column without such goes first, as long as
    there are any among what is left between ``first`` and ``last``.
    """
    linked = matrix != 0
    np.fill_diagonal(linked, False)
    left = np.ones(matrix.shape[0], dtype=np.bool_)
    ends: list[list[int]] = [[], []]
    for end, entries in ((1, linked), (0, linked.T)):
        count = np.count_nonzero(entries & left, axis=1)
        while True:
            alone = np.flatnonzero(left & (count == 0))
            if alone.size == 0:
                break
            ends[end].append(int(alone[-1]))
            left[alone[-1]] = False
            count -= entries[:, alone[-1]]
    middle = [int(i) for i in np.flatnonzero(left)]
    order = np.array([*ends[0], *middle, *reversed(ends[1])], dtype=np.intp)
    return order, len(ends[0]), len(ends[0]) + len(middle)


@uncounted
def _balance(matrix: Array, scale: Array, first: int, last: int) -> None:
    """Scale coordinates by powers of two until rows and columns from ``first`` to ``last`` have norms of one size."""
    changed = True
    while changed:
        changed = False
        for i in range(first, last):
            column, row = 0.0, 0.0
            for j in range(first, last):
                column += matrix[j, i] * matrix[j, i]
                row += matrix[i, j] * matrix[i, j]
            column, row = np.sqrt(column), np.sqrt(row)
            before, factor = column + row, 1.0
            if not (0.0 < column < np.inf and 0.0 < row < np.inf):
                continue
            while column < 0.5 * row:
                column, row, factor = 2.0 * column, 0.5 * row, 2.0 * factor
            while column >= 2.0 * row:
                column, row, factor = 0.5 * column, 2.0 * row, 0.5 * factor
            if column + row < _GAIN * before:
                changed = True
                scale[i] *= factor
                for j in range(matrix.shape[0]):
                    matrix[i, j] /= factor
                for j in range(matrix.shape[0]):
                    matrix[j, i] *= factor


@part
def _mirror(matrix: Array, k: int, last: int, mirror: Array) -> tuple[float, float]:
    """Put the normal of the mirror that clears column k below row k + 1 in ``mirror``.

    Returns what the mirror leaves in row k + 1, and 2 over the square of the normal; 0 where there is nothing to clear.
    """
    largest = 0.0
    for i in range(k + 2, last):
        largest = max(largest, abs(matrix[i, k]))
    if largest == 0.0:
        return 0.0, 0.0
    largest = max(largest, abs(matrix[k + 1, k]))
    square = 0.0
    for i in range(k + 1, last):
        mirror[i] = matrix[i, k] / largest
        square += mirror[i] * mirror[i]
    length = np.sqrt(square)
    if mirror[k + 1] > 0.0:
        length = -length
    weight = 1.0 / (length * (length - mirror[k + 1]))
    mirror[k + 1] -= length
    return length * largest, weight


@inlined
def _reflect(rows: Array, begin: int, end: int, mirror: Array, weight: float, share: Array, first: int) -> None:
    """Reflect rows ``begin`` to ``end`` (exclusive) from column ``first`` on; ``share`` is room for a row."""
    for j in range(first, rows.shape[1]):
        share[j] = 0.0
    for i in range(begin, end):
        for j in range(first, rows.shape[1]):
            share[j] += mirror[i] * rows[i, j]
    for i in range(begin, end):
        by = weight * mirror[i]
        for j in range(first, rows.shape[1]):
            rows[i, j] -= by * share[j]


@uncounted
def _reduce(matrix: Array, basis: Array, mirror: Array, share: Array, first: int, last: int) -> None:
    """Reflect rows and columns until nothing is left below the subdiagonal; turn the rows of ``basis`` along."""
    for k in range(first, last - 2):
        left, weight = _mirror(matrix, k, last, mirror)
        if weight == 0.0:
            continue
        _reflect(matrix, k + 1, last, mirror, weight, share, k)
        for i in range(last):
            by = 0.0
            for j in range(k + 1, last):
                by += matrix[i, j] * mirror[j]
            by *= weight
            for j in range(k + 1, last):
                matrix[i, j] -= by * mirror[j]
        matrix[k + 1, k] = left
        for i in range(k + 2, last):
            matrix[i, k] = 0.0
        _reflect(basis, k + 1, last, mirror, weight, share, 0)


def hessenberg(matrix: Array, with_basis: bool) -> Hessenberg:
    """Return a matrix balanced and reduced; its basis only where it is asked for.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite.
    """
    if not np.isfinite(matrix).all():
        raise np.linalg.LinAlgError("a matrix with entries that are not finite has no eigenvalues")
    order, first, last = _triangular_ends(matrix)
    size = order.size
    reduced, scale = np.ascontiguousarray(matrix[np.ix_(order, order)]), np.ones(size)
    _balance(reduced, scale, first, last)
    basis = np.eye(size) if with_basis else np.zeros((size, 0))
    _reduce(reduced, basis, np.zeros(size), np.zeros(size), first, last)
    return Hessenberg(reduced, basis, scale, order, first, last)
