"""Factors of large sparse symmetric positive definite matrices: SuperLU's, or CHOLMOD's where the extra is installed.

SuperLU takes the order of least degree, which fills slender solids little: 98 280 coordinates of a blade leave 3.2e7
entries in both factors. Bulky solids it fills more and more. CHOLMOD's supernodal factor in METIS's order of nested
dissections (extra ``sparse``) is taken for them from :data:`MOST_BY_SUPERLU` coordinates on.

Source: Demmel et al., SIAM J. Matrix Anal. Appl. 20 (1999) 720-755; Chen, Davis, Hager and Rajamanickam, ACM Trans.
Math. Softw. 35 (2008) 22; Karypis and Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from functools import cache

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from workflow.kernels import Array

Answer = Callable[[Array], Array]
"""From loads ``(coordinate, …)`` to displacements or temperatures, alike."""

MOST_BY_SUPERLU = 10_000
"""Coordinates up to which SuperLU takes less than a second whatever the shape of the solid."""


FACTORISING = "cvxopt", "pymetis"
"""Packages of the extra ``sparse``: CHOLMOD is a part of cvxopt, and METIS comes with pymetis."""


class NotHeldError(ValueError):
    """A sparse stiffness that leaves the structure loose, or is not positive definite."""

    def __init__(self, why: str = "with the tip held some part of the structure is still loose"):
        super().__init__(why)


def factorised(matrix: scipy.sparse.csc_array, order: Array | None = None) -> Answer:
    """Return what solves a sparse symmetric definite matrix for loads ``(coordinate, …)``.

    Parameters
    ----------
    matrix
        Shape ``(coordinate, coordinate)``.
    order
        Of :func:`elimination_order`, where it is known.

    Raises
    ------
    NotHeldError
        The matrix is singular, or CHOLMOD finds it indefinite.
    """
    if matrix.shape[0] == 0:
        return lambda load: load
    order = elimination_order(matrix) if order is None else order
    return _by_superlu(matrix) if order is None else _by_cholmod(matrix, order)


def elimination_order(matrix: scipy.sparse.csc_array) -> Array | None:
    """Return the order in which CHOLMOD is to eliminate matrices with these entries or some of them, ``(coordinate,)``.

    ``None`` for those that SuperLU factorises, in an order of its own.
    """
    return _nested_dissection(matrix) if matrix.shape[0] > MOST_BY_SUPERLU and has_cholmod() else None


@cache
def has_cholmod() -> bool:
    """Tell whether the extra ``sparse`` is installed."""
    return all(importlib.util.find_spec(package) is not None for package in FACTORISING)


def _by_superlu(matrix: scipy.sparse.csc_array) -> Answer:
    """Return the solver by SuperLU on the order of least degree of A + Aᵀ, with pivots on the diagonal."""
    try:
        factors = scipy.sparse.linalg.splu(
            scipy.sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise NotHeldError from None
    return lambda load: np.asarray(factors.solve(load))


def _by_cholmod(matrix: scipy.sparse.csc_array, order: Array) -> Answer:
    """Return the solver by CHOLMOD on an order of elimination.

    Its BLAS, a library of its own, has one thread each time: callers cannot limit what is not loaded yet.
    """
    import cvxopt
    from cvxopt import cholmod

    lower = scipy.sparse.coo_array(scipy.sparse.tril(matrix))
    entries = (cvxopt.matrix(values) for values in (lower.data, *(row.astype(np.int64) for row in lower.coords)))
    given = cvxopt.spmatrix(*entries, matrix.shape)
    del lower
    with threadpool_limits(limits=1, user_api="blas"):
        try:
            factor = cholmod.symbolic(given, p=cvxopt.matrix(order))
            cholmod.numeric(given, factor)
        except ArithmeticError:
            raise NotHeldError from None

    def answer(load: Array) -> Array:
        solution = cvxopt.matrix(np.asarray(load, dtype=np.float64))
        with threadpool_limits(limits=1, user_api="blas"):
            cholmod.solve(factor, solution)
        return np.array(solution).reshape(load.shape)

    return answer


def _nested_dissection(matrix: scipy.sparse.csc_array) -> Array:
    """Return METIS's order of elimination of a symmetric matrix, ``(coordinate,)``."""
    import pymetis

    links = scipy.sparse.coo_array(matrix)
    row, column = links.coords
    beside = row != column
    graph = scipy.sparse.csr_array((np.ones(beside.sum(), np.int8), (row[beside], column[beside])), matrix.shape)
    order, _ = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
    return np.array(order, dtype=np.int64)
