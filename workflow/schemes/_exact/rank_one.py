"""Eigenvalues and eigenvectors of a diagonal matrix with a rank-one term, each to its own relative accuracy.

In coordinates that only friction heat couples the held tip has the matrix D + α u wᵀ, D = diag(d): d are the poles of
the held structure and its thermal rates, u the response to heat at the tip, wᵀ the row of the contact force. Its
eigenvalues are the zeros of

    f(s) = 1 - α Σ u_k w_k/(s - d_k).

Newton's method finds the shift δ of each from a pole, so that every difference s - d_k keeps its digits (Golub, SIAM
Review 15 (1973) 318–334). Of a complex pair the one above the real axis is found.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import Complex
from workflow.kernels.compiled import inlined, part

_NEWTON_STEPS, _CONVERGED = 20, 1e-10
"""Relative change of a shift at which Newton's method ends: the next change would be about its square."""

_DISTINCT = 1e-6
"""Distance of two zeros, over their shifts, below which they keep fewer than ten digits: the general solver is used."""

_INDEPENDENT = 3e-2
"""Product left · right, over the sum of its terms, below which eigenvectors lose digits by its square and more: the
matrix is nearly defective, see :mod:`workflow.poles`."""


class RankOne(NamedTuple):
    """The matrix D + α u wᵀ, ``(N,)`` each; thermal rates come last."""

    thermal: int
    """Number of poles that are thermal rates."""
    d: Complex
    u: Complex
    w: Complex


class Zeros(NamedTuple):
    """Eigenvalues d + δ above the real axis or on it, ``(eigenvalue,)``."""

    pole: NDArray[np.int64]
    """Index of the pole d."""
    shift: Complex
    """δ, 1/s."""
    residue: Complex
    """α u w of each pole, 1/s, ``(N,)``."""


@inlined
def square(x: complex) -> float:
    """Return |x|²."""
    return x.real * x.real + x.imag * x.imag


@inlined
def reciprocal(x: complex) -> complex:
    """Return 1/x, without a guard against overflow."""
    return x.conjugate() * (1.0 / square(x))


@part
def find_zeros(matrix: RankOne, alpha: float, zeros: Zeros) -> int:
    """Find the zeros from their first order in α; return their number, 0 where they are not distinct."""
    for k in range(matrix.d.size):
        zeros.residue[k] = alpha * matrix.u[k] * matrix.w[k]
    count, above = _first_order(matrix, zeros), 0
    for i in range(count):
        k, shift = zeros.pole[i], zeros.shift[i]
        real = matrix.d[k].imag + shift.imag == 0.0
        shift = _newton(matrix.d, zeros.residue, k, shift, real)
        height = 0.0 if real else matrix.d[k].imag + shift.imag
        size = square(shift)
        if not (real or height * height > _DISTINCT * _DISTINCT * size) or not size < np.inf:
            return 0
        zeros.shift[i] = shift
        above += int(height > 0.0)
        for n in range(i):
            away = (matrix.d[k] - matrix.d[zeros.pole[n]]) + (shift - zeros.shift[n])
            if not square(away) > _DISTINCT * _DISTINCT * (size + square(zeros.shift[n])):
                return 0
    return count if above + count == matrix.d.size else 0


@part
def _first_order(matrix: RankOne, zeros: Zeros) -> int:
    """Fill the zeros near poles to first order in α; at thermal rates the structure responds quasi-statically."""
    d, thermal, yielding, count = matrix.d, matrix.thermal, 1.0, 0
    fast = d.size - thermal
    for k in range(fast):
        yielding += (zeros.residue[k] * reciprocal(d[k])).real
        if d[k].imag >= 0.0:
            zeros.pole[count], zeros.shift[count] = k, zeros.residue[k]
            count += 1
    for k in range(fast, d.size):
        shift = zeros.residue[k].real / yielding
        for other in range(fast, d.size):  # at most a third of the distance to another rate
            if other != k:
                most = abs(d[k].real - d[other].real) / 3.0
                shift = min(max(shift, -most), most)
        zeros.pole[count], zeros.shift[count] = k, shift
        count += 1
    return count


@part
def _newton(d: Complex, residue: Complex, own: int, shift: complex, real: bool) -> complex:
    """Return the zero of δ f(d + δ) by Newton's method, NaN where it does not converge."""
    if residue[own] == 0.0:
        return 0.0j
    for _ in range(_NEWTON_STEPS):
        f, slope = 1.0 + 0.0j, 0.0j
        for k in range(d.size):
            if k != own:
                inverse = reciprocal((d[own] - d[k]) + shift)
                term = residue[k] * inverse
                f -= term
                slope += term * inverse
        step = (shift * f - residue[own]) * reciprocal(f + shift * slope)
        shift -= complex(step.real, 0.0) if real else step
        if square(step) <= _CONVERGED * _CONVERGED * square(shift):
            return shift
    return complex(np.nan, 0.0)


@part
def fill_vectors(
    matrix: RankOne, alpha: float, own: int, shift: complex, right: Complex, left: Complex
) -> tuple[complex, bool]:
    """Fill eigenvectors with left · right = 1; return wᵀ right, and whether they keep their digits.

    Near a pole its factor 1/(s - d) is the largest: its component of the right vector is set to 1.
    """
    _, d, u, w = matrix
    f, length, terms = 1.0 + 0.0j, 1.0 + 0.0j, 1.0
    for k in range(d.size):
        if k != own:
            inverse = reciprocal((d[own] - d[k]) + shift)
            right[k], left[k] = alpha * u[k] * inverse, w[k] * inverse
            f -= w[k] * right[k]
    force, heat = w[own] * reciprocal(f), alpha * u[own] * reciprocal(f)
    for k in range(d.size):
        if k != own:
            right[k], left[k] = force * right[k], heat * left[k]
            term = left[k] * right[k]
            length += term
            terms += abs(term.real) + abs(term.imag)
    right[own], left[own] = 1.0 + 0.0j, 1.0 + 0.0j
    for k in range(d.size):
        left[k] *= reciprocal(length)
    return force, square(length) > _INDEPENDENT * _INDEPENDENT * terms * terms
