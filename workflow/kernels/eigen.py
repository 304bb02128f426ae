"""Eigenvalues and eigenvectors of a general real matrix, in sums of a fixed order.

They err by rounding times the norm of the balanced matrix and the condition of the eigenvalue, as LAPACK's do.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part, uncounted
from workflow.kernels.complex_numbers import Complex, complex_of
from workflow.kernels.elementary import quotient
from workflow.kernels.hessenberg import Hessenberg, hessenberg
from workflow.kernels.schur import schur
from workflow.kernels.solving import inverse
from workflow.kernels.sums import norm, plain, product

_EPS = float(np.finfo(float).eps)


class Eigen(NamedTuple):
    """Eigenvalues and eigenvectors of a matrix A."""

    values: Complex
    """One with a positive imaginary part is followed by its conjugate, to the bit; ``(n,)``."""
    right: Complex
    """Columns x of length 1 with A x = s x, ``(n, n)``; of conjugate values conjugate, of real values real."""
    left: Complex
    """Rows l with l A = s l and l x = 1, orthogonal to all other columns of ``right``: its inverse."""


def _schur_form(matrix: ArrayLike, whole: bool) -> Hessenberg:
    """Return the Schur form of a matrix, with its basis where the whole is asked for.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite, or the iteration did not converge.
    """
    form = hessenberg(plain(matrix), whole)
    if not schur(form.matrix, form.basis, form.first, form.last, whole, np.zeros(8)):
        raise np.linalg.LinAlgError("the eigenvalues did not converge")
    return form


def _values(form: Array) -> Complex:
    """Return the eigenvalues of a Schur form."""
    size = form.shape[0]
    imaginary = np.zeros(size)
    upper = np.flatnonzero(np.diagonal(form, -1)) if size else np.zeros(0, dtype=np.intp)
    imaginary[upper] = np.sqrt(np.abs(form[upper, upper + 1])) * np.sqrt(np.abs(form[upper + 1, upper]))
    imaginary[upper + 1] = -imaginary[upper]
    return complex_of(np.diagonal(form), imaginary)


def eigenvalues(matrix: ArrayLike) -> Complex:
    """Return the eigenvalues of a real square matrix; conjugate pairs are so to the bit, positive imaginary part first.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite, or the iteration did not converge.
    """
    return _values(_schur_form(matrix, False).matrix)


@inlined
def _pole(form: Array, k: int) -> Any:
    """Return the imaginary part of the eigenvalues of the block of rows k - 1 and k."""
    return np.sqrt(abs(form[k - 1, k])) * np.sqrt(abs(form[k, k - 1]))


@part
def _begin(form: Array, k: int, x: Array) -> float:
    """Put what the eigenvector of the block that ends in row k has there in ``x``; return its imaginary part."""
    for j in range(form.shape[0]):
        x[0, j] = x[1, j] = 0.0
    x[0, k] = 1.0
    if k == 0 or form[k, k - 1] == 0.0:
        return 0.0
    above, below = form[k - 1, k], form[k, k - 1]
    pole = _pole(form, k)
    if abs(above) >= abs(below):
        x[0, k - 1], x[0, k], x[1, k] = 1.0, 0.0, pole / above
    else:
        x[0, k - 1], x[0, k], x[1, k] = -pole / below, 0.0, 1.0
    return float(pole)


@inlined
def _rest(form: Array, row: int, first: int, last: int, side: int, x: Array) -> float:
    """Return the negative of what the known entries ``first`` to ``last`` of real or imaginary part add to a row."""
    rest = 0.0
    for j in range(first, last + 1):
        rest -= form[row, j] * x[side, j]
    return rest


@inlined
def _put(entry: complex, i: int, x: Array) -> None:
    """Put an entry of an eigenvector in its row of real and imaginary parts."""
    x[0, i], x[1, i] = entry.real, entry.imag


@part
def _extend(form: Array, i: int, last: int, value: tuple[float, float], smallest: float, x: Array) -> int:
    """Find the entries of an eigenvector in the block that ends in row i; return the row above the block."""
    away, pole = form[i, i] - value[0], value[1]
    p, q = _rest(form, i, i + 1, last, 0, x), _rest(form, i, i + 1, last, 1, x)
    if i == 0 or form[i, i - 1] == 0.0:
        if abs(away) + pole < smallest:
            away = smallest
        _put(quotient(complex(p, q), complex(away, -pole)), i, x)
        return i - 1
    top_p, top_q = _rest(form, i - 1, i + 1, last, 0, x), _rest(form, i - 1, i + 1, last, 1, x)
    above, below, other = form[i - 1, i], form[i, i - 1], _pole(form, i)
    # the determinant (away - i pole)² + other² as a product of differences, which lose nothing
    shifted = smallest if abs(away) + abs(other - pole) < smallest else away
    u, v = shifted * shifted + (other - pole) * (other + pole), -2.0 * shifted * pole
    upper = complex(top_p * away + top_q * pole - above * p, top_q * away - top_p * pole - above * q)
    lower = complex(p * away + q * pole - below * top_p, q * away - p * pole - below * top_q)
    _put(quotient(upper, complex(u, v)), i - 1, x)
    _put(quotient(lower, complex(u, v)), i, x)
    return i - 2


@uncounted
def _vectors(form: Array, x: Array, smallest: float, vectors: Array) -> None:
    """Put the eigenvectors of a Schur form in the rows of ``vectors``: real part and then imaginary part of a pair.

    ``smallest`` stands for a difference of eigenvalues that is 0. ``x`` is room for a vector, ``(2, n)``.
    """
    k = form.shape[0] - 1
    while k >= 0:
        value = form[k, k], _begin(form, k, x)
        first = k - 1 if value[1] != 0.0 else k
        i = first - 1
        while i >= 0:
            above = _extend(form, i, k, value, smallest, x)
            largest = max(abs(x[0, i]), abs(x[1, i]))
            if above == i - 2:
                largest = max(largest, max(abs(x[0, i - 1]), abs(x[1, i - 1])))
            if largest * _EPS * largest > 1.0:  # as EISPACK: before a vector overflows
                for j in range(above + 1, k + 1):
                    x[0, j] /= largest
                    x[1, j] /= largest
            i = above
        for j in range(form.shape[0]):
            vectors[first, j] = x[0, j]
            if first < k:
                vectors[k, j] = x[1, j]
        k = first - 1


def _lengths(parts: Array, pair: NDArray[np.intp]) -> Array:
    """Return the lengths of columns, of real and imaginary part together where ``pair`` names the first of the two."""
    lengths = norm(parts, 0)
    lengths[pair] = lengths[pair + 1] = np.sqrt(lengths[pair] * lengths[pair] + lengths[pair + 1] * lengths[pair + 1])
    return lengths


def eigenvectors(matrix: ArrayLike) -> Eigen:
    """Return eigenvalues and right and left eigenvectors of a real square matrix.

    Raises
    ------
    numpy.linalg.LinAlgError
        Entries are not finite, the iteration did not converge, or the eigenvectors are dependent.
    """
    form = _schur_form(matrix, True)
    values, size = _values(form.matrix), form.order.size
    rows, largest = np.zeros((size, size)), float(np.abs(form.matrix).max(initial=0.0))
    smallest = max(_EPS * largest, float(np.finfo(float).tiny))
    _vectors(form.matrix, np.zeros((2, size)), smallest, rows)
    pair = np.flatnonzero(values.imag > 0)
    scaled = product(form.basis.T, rows.T)
    scaled /= _lengths(scaled, pair)
    parts, dual = form.original(scaled, inverse(scaled))
    lengths = _lengths(parts, pair)
    parts, dual = parts / lengths, dual * lengths[:, None]
    right, left = parts.astype(np.complex128), dual.astype(np.complex128)
    right[:, pair] = complex_of(parts[:, pair], parts[:, pair + 1])
    left[pair] = complex_of(0.5 * dual[pair], -0.5 * dual[pair + 1])
    right[:, pair + 1], left[pair + 1] = right[:, pair].conj(), left[pair].conj()
    return Eigen(values, right, left)
