"""Singular values to their own relative accuracy, right singular vectors and minimum-norm least squares.

A matrix is made triangular by Householder reflections, in each step the largest column first and in it the row
with the largest entry, and the rows of the triangle are made orthogonal by plane rotations of two at a time
(one-sided Jacobi rotations of its transpose). Their lengths are the singular values and their directions
the right singular vectors. Rows and columns that differ by many decades in size, as those of chains of soft
and stiff springs do, cost no digits; LAPACK's bidiagonal reduction errs by rounding times the largest value in
all of them.

Sources: Demmel and Veselić, SIAM J. Matrix Anal. Appl. 13 (1992) 1204–1245; Drmač and Veselić, SIAM J. Matrix
Anal. Appl. 29 (2008) 1322–1342 (triangular form first, its rows instead of its columns); Powell and Reid, Proc.
IFIP Congress 1968, 122–126, and Cox and Higham, Numer. Algorithms 19 (1998) 95–110 (exchanged rows).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part, uncounted
from workflow.kernels.lanes import PACK
from workflow.kernels.packs import narrow, pack, spread, store
from workflow.kernels.sums import plain, product

_EPS = float(np.finfo(float).eps)

_SWEEPS = 40
"""Rotations of all pairs of rows; they converge quadratically, five to seven times suffice."""

_SKEWED = 1e100
"""cot 2φ of a rotation above which its square overflows or is nothing beside 1: tan φ is then 1/(2 cot 2φ)."""

_NOTHING = 1e-290
"""Square of a row's length, relative to the largest entry's, below which its direction is lost to underflow."""


@inlined
def _dot(rows: Array, p: int, q: int, first: int, last: int) -> Any:
    """Return the sum of the products of two rows from ``first`` to ``last``, both multiples of ``PACK``."""
    sums = spread(0.0, narrow(0))
    for k in range(first, last, PACK):
        lane = narrow(k)
        sums += pack(rows, (p, lane)) * pack(rows, (q, lane))
    last_row = rows.shape[0] - 1
    store(rows, (last_row, narrow(0)), sums)
    return (
        ((rows[last_row, 0] + rows[last_row, 1]) + (rows[last_row, 2] + rows[last_row, 3]))
        + ((rows[last_row, 4] + rows[last_row, 5]) + (rows[last_row, 6] + rows[last_row, 7]))
    )  # fmt: skip


@part
def _bring_forward(columns: Array, k: int, count: int, squares: Array, order: NDArray[np.intp], triangle: Array) -> Any:
    """Exchange columns and rows so that the k-th are the largest; tell whether anything other than 0 is left.

    The largest column is that of the largest square of its length, the largest row that of its largest entry.
    """
    length, every = columns.shape[1], columns.shape[0] - 1
    best = k
    for j in range(k + 1, count):
        if squares[j] > squares[best]:
            best = j
    if not squares[best] > 0.0:
        return False
    if best != k:
        for i in range(length):
            columns[k, i], columns[best, i] = columns[best, i], columns[k, i]
        for i in range(k):
            triangle[i, k], triangle[i, best] = triangle[i, best], triangle[i, k]
        order[k], order[best] = order[best], order[k]
        squares[best] = squares[k]
    best = k
    for i in range(k + 1, length):
        if abs(columns[k, i]) > abs(columns[k, best]):
            best = i
    if best != k:
        for j in range(k, every):
            columns[j, k], columns[j, best] = columns[j, best], columns[j, k]
    return True


@uncounted
def _triangularise(columns: Array, count: int, squares: Array, order: NDArray[np.intp], triangle: Array) -> int:
    """Make a matrix upper triangular, the largest of its first ``count`` columns first; return its number of rows.

    ``columns`` holds a column in each row and is used up, its last row is for sums; ``order`` is exchanged as the
    columns are. Column ``count + e`` goes to column ``offset + e`` of ``triangle``, where offset is
    ``count`` rounded up to whole packs.
    """
    length, every = columns.shape[1], columns.shape[0] - 1
    offset = -(-count // PACK) * PACK - count
    for j in range(count):
        squares[j] = _dot(columns, j, j, 0, length)
    for k in range(triangle.shape[0] - 1):
        if not _bring_forward(columns, k, count, squares, order, triangle):
            return k
        first = k // PACK * PACK
        size, corner = np.sqrt(_dot(columns, k, k, first, length)), columns[k, k]
        if corner > 0.0:
            size = -size
        triangle[k, k] = size
        columns[k, k] = corner - size  # what is left of the column is the mirror's normal
        scale = 1.0 / (size * (size - corner))
        for j in range(k + 1, every):
            share = -scale * _dot(columns, k, j, first, length)
            for i in range(first, length, PACK):
                lane = narrow(i)
                store(columns, (j, lane), pack(columns, (j, lane)) + share * pack(columns, (k, lane)))
            triangle[k, j + (offset if j >= count else 0)] = columns[j, k]
            columns[j, k] = 0.0
            if j < count:
                squares[j] = _dot(columns, j, j, first, length)
    return int(triangle.shape[0]) - 1


@inlined
def _rotate(rows: Array, p: int, q: int, sine: float, half: float) -> None:
    """Turn two rows in the plane they span by φ, given sin φ and tan φ/2.

    Written as what is added to each row: rounding of cos φ would change the lengths in every rotation.
    """
    for k in range(0, rows.shape[1], PACK):
        lane = narrow(k)
        one, other = pack(rows, (p, lane)), pack(rows, (q, lane))
        store(rows, (p, lane), one - sine * (other + half * one))
        store(rows, (q, lane), other + sine * (one - half * other))


@inlined
def _tangent(share: float, one: float, other: float) -> Any:
    """Return tan φ of the smaller rotation that makes two rows orthogonal, of squares ``one`` and ``other``."""
    cotangent = (other - one) / (2.0 * share)
    if abs(cotangent) > _SKEWED:
        return 0.5 / cotangent
    tangent = 1.0 / (abs(cotangent) + np.sqrt(1.0 + cotangent * cotangent))
    return -tangent if cotangent < 0.0 else tangent


@uncounted
def _orthogonalise(rows: Array, count: int, width: int, tolerance: float, squares: Array, lengths: Array) -> None:
    """Rotate the first ``count`` rows until their first ``width`` numbers are orthogonal; the last row is for sums."""
    for _ in range(_SWEEPS):
        for p in range(count):
            squares[p] = _dot(rows, p, p, 0, width)
            lengths[p] = np.sqrt(squares[p])
        rotated = False
        for p in range(count - 1):
            for q in range(p + 1, count):
                share = _dot(rows, p, q, 0, width)
                if not abs(share) > tolerance * lengths[p] * lengths[q] or min(squares[p], squares[q]) <= _NOTHING:
                    continue
                rotated = True
                tangent = _tangent(share, squares[p], squares[q])
                cosine = 1.0 / np.sqrt(1.0 + tangent * tangent)
                _rotate(rows, p, q, cosine * tangent, cosine * tangent / (1.0 + cosine))
                squares[p], squares[q] = squares[p] - tangent * share, squares[q] + tangent * share
                for i in (p, q):
                    if squares[i] < 0.5 * lengths[i] * lengths[i]:  # digits were lost
                        squares[i] = _dot(rows, i, i, 0, width)
                    lengths[i] = np.sqrt(squares[i])
        if not rotated:
            return


@uncounted
def _complete(vectors: Array, count: int, covered: Array, trial: Array) -> None:
    """Add orthonormal rows to the first ``count`` ones until the matrix is square.

    Each begins as the unit vector that the rows so far hold least of.
    """
    size = vectors.shape[1]
    for i in range(count):
        for j in range(size):
            covered[j] += vectors[i, j] * vectors[i, j]
    for row in range(count, size):
        least = 0
        for j in range(size):
            if covered[j] < covered[least]:
                least = j
            trial[j] = 0.0
        trial[least] = 1.0
        for _ in range(2):  # once more for what rounding left
            for i in range(row):
                share = 0.0
                for j in range(size):
                    share += vectors[i, j] * trial[j]
                for j in range(size):
                    trial[j] -= share * vectors[i, j]
        square = 0.0
        for j in range(size):
            square += trial[j] * trial[j]
        for j in range(size):
            vectors[row, j] = trial[j] / np.sqrt(square)
            covered[j] += vectors[row, j] * vectors[row, j]


class Singular(NamedTuple):
    """Singular values s of a matrix and its right singular vectors."""

    values: Array
    """Descending, one per column of the matrix: those beyond its rank are 0 or rounding, ``(column,)``."""
    vectors: Array
    """In columns, orthonormal, in the order of the values: a square matrix, null vectors included."""


class _Rotated(NamedTuple):
    """Rows V'ᵀ [R | y] of a triangular form [R | y] of a matrix and further columns, orthogonal in their first part."""

    lengths: Array
    """Of the orthogonal parts, ``(row,)``."""
    rows: Array
    """The orthogonal parts, ``(row, column)``."""
    further: Array
    """What became of the further columns, ``(row, further)``."""
    order: NDArray[np.intp]
    """Which column of the matrix each column is."""


def _rotate_rows(a: Array, right: Array) -> _Rotated:
    """Make a matrix triangular and the rows of the triangle orthogonal, and turn columns ``right`` along."""
    (height, count), further = a.shape, right.shape[1]
    width = -(-count // PACK) * PACK
    columns = np.zeros((count + further + 1, max(-(-height // PACK), 1) * PACK))
    columns[:count, :height], columns[count:-1, :height] = a.T, right.T
    order, squares, lengths = np.arange(count), np.zeros(count), np.zeros(count)
    rows = np.zeros((min(height, count) + 1, width + -(-further // PACK) * PACK))
    rank = _triangularise(columns, count, squares, order, rows) if count else 0
    _orthogonalise(rows, rank, width, float(np.sqrt(count)) * _EPS, squares, lengths)
    return _Rotated(lengths[:rank], rows[:rank, :count], rows[:rank, width : width + further], order)


def _decompose(matrix: ArrayLike, right: Array) -> tuple[Array, Array, Array]:
    """Return singular values, right singular vectors as rows, and left ones' products with the columns of ``right``.

    Shapes ``(n,)``, ``(n, n)`` and ``(n, right)``.
    """
    a = plain(matrix)
    if not (np.isfinite(a).all() and np.isfinite(right).all()):
        raise np.linalg.LinAlgError("a matrix with entries that are not finite has no singular values")
    size, exponent = a.shape[1], int(np.frexp(np.abs(a).max(initial=0.0))[1])
    rotated = _rotate_rows(np.ldexp(a, -exponent), right)
    descending = np.argsort(-rotated.lengths, kind="stable")
    lengths = rotated.lengths[descending]
    rank = int(np.count_nonzero(lengths * lengths > _NOTHING))
    first, values = descending[:rank], np.zeros(size)
    vectors, shares = np.zeros((size, size)), np.zeros((size, right.shape[1]))
    values[: lengths.size], shares[:rank] = lengths, rotated.further[first]
    vectors[:rank, rotated.order] = rotated.rows[first] / lengths[:rank, None]
    _complete(vectors, rank, np.zeros(size), np.zeros(size))
    return np.ldexp(values, exponent), vectors, shares


def singular(matrix: ArrayLike) -> Singular:
    """Return singular values and right singular vectors of a real matrix of any shape.

    Where A = D₁ B D₂ with any diagonal D₁, D₂ and a well-conditioned B each value is accurate to its own size.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite.
    """
    a = plain(matrix)
    values, vectors, _ = _decompose(a, np.zeros((a.shape[0], 0)))
    return Singular(values, np.ascontiguousarray(vectors.T))


def least_squares(matrix: ArrayLike, right: ArrayLike) -> Array:
    """Return the x of minimum norm that minimises |A x - b|, for each column of b.

    Singular values below max(shape) · 2.2e-16 of the largest count as 0, as in ``numpy.linalg.lstsq``.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite.
    """
    a, b = plain(matrix), np.asarray(right, dtype=np.float64)
    values, vectors, shares = _decompose(a, b.reshape(a.shape[0], int(np.prod(b.shape[1:]))))
    significant = values > max(a.shape) * _EPS * values.max(initial=0.0)
    solution = product(vectors[significant].T, shares[significant] / values[significant, None])
    return np.asarray(solution.reshape(a.shape[1], *b.shape[1:]))
