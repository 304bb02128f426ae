"""Factors K = DᵀD of symmetric positive semi-definite matrices, their ranks decided by pivots."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpstrf

from workflow.kernels import Array

_INDEFINITE = 1e3
"""Negative part of a matrix, over its rounding, above which the matrix is indefinite."""

_ROUNDED_IN_FILES = 1e-4
"""Negative part of a matrix with unit diagonal up to which numbers of five digits or more may have made it."""


class UnusableMatricesError(ValueError):
    """Matrices do not describe a structure, or one that a basis can reduce: ``problem`` and ``remedy`` for the user."""

    def __init__(self, problem: str, remedy: str):
        super().__init__(f"{problem}: {remedy}")
        self.problem, self.remedy = problem, remedy


class Factor(NamedTuple):
    """R with A[order][:, order] = Rᵀ R + a remainder without a pivot above the threshold."""

    upper: Array
    """R, upper triangular with a positive diagonal, ``(rank, size)``."""
    order: NDArray[np.int64]
    """Rows of A in the order of pivoting, ``(size,)``."""


class Part(NamedTuple):
    """A symmetric positive semi-definite matrix as deformationᵀ · deformation, ``(rank, coordinate)``."""

    deformation: Array
    order: NDArray[np.int64]


def congruent(matrix: Array, basis: Array) -> Array:
    """Return basisᵀ · matrix · basis, symmetric to the bit."""
    return symmetric(basis.T @ (matrix @ basis))


def symmetric(matrix: Array) -> Array:
    """Return the symmetric part of a matrix."""
    return np.asarray((matrix + matrix.T) / 2)


def factored(matrix: Array, name: str, basis: Array | None = None) -> Part:
    """Return the deformation of EᵀK E with a basis E; its rank is decided by the rounding of |E|ᵀ|K||E|.

    Raises
    ------
    UnusableMatricesError
        The matrix is indefinite.
    """
    basis = np.eye(matrix.shape[0]) if basis is None else basis
    scale = scale_of(np.abs(basis).T @ np.abs(matrix) @ np.abs(basis))
    factor = pivots(congruent(matrix, basis), name, scale)
    deformation = np.zeros_like(factor.upper)
    deformation[:, factor.order] = factor.upper
    return Part(deformation * scale, factor.order)


def scale_of(matrix: Array) -> Array:
    """Return √K_ii, 1 where that is 0, ``(coordinate,)``."""
    diagonal = np.diag(matrix)
    return np.sqrt(np.where(diagonal > 0, diagonal, 1.0))


def pivots(matrix: Array, name: str, scale: Array) -> Factor:
    """Return the factor of a matrix divided by scales of its coordinates ``(coordinate,)``, with complete pivoting.

    Source: Higham, Accuracy and stability of numerical algorithms (SIAM 2002), section 10.3: the rank found is that of
    a matrix within rounding of A.
    """
    scaled = matrix / scale / scale[:, None]
    least = 10 * matrix.shape[0] * np.finfo(float).eps  # rounding of assembled entries, after numpy's matrix_rank
    whole, order, rank, _ = dpstrf(scaled, tol=least)
    upper = np.triu(whole)[:rank]
    order = np.asarray(order, dtype=np.int64) - 1
    rest = scaled[np.ix_(order[rank:], order[rank:])] - upper[:, rank:].T @ upper[:, rank:]
    negative = float(np.abs(rest).max(initial=0.0))
    if _INDEFINITE * least < negative <= _ROUNDED_IN_FILES:
        raise UnusableMatricesError(
            f"{name} is indefinite by {negative:.0e} of its diagonal, which rounding of the numbers in its file does",
            "write them with 16 digits, or hold the body that is free",
        )
    if not negative <= _INDEFINITE * least:
        raise UnusableMatricesError(
            f"{name} is not positive semi-definite", "check signs and that it was assembled in full"
        )
    return Factor(upper, order)
