"""Factors of large sparse symmetric positive definite matrices: SuperLU's, or CHOLMOD's where the extra is installed.

SuperLU uses the minimum-degree ordering, whose fill-in is small in slender solids: 98 280 coordinates of a blade leave
3.2e7 entries in both factors. In bulky solids it grows fast: CHOLMOD's supernodal factor in METIS's nested-dissection
ordering (extra ``sparse``) is used from :data:`MOST_BY_SUPERLU` coordinates on.

Memory and time of the factors are estimated beforehand. A breadth-first search from the tip meets the coordinates level
by level, w of them in each; W = Σ w²/Σ w is the mean size of the level of a coordinate. Minimum degree leaves about
0.4 W entries in a row of a factor, nested dissection 10 √W: numbers and times per entry are those of cubes, blocks and
blades of 8 000 to 105 000 coordinates on one core of a server processor of 2024, within a factor of two.

Source: Demmel et al., SIAM J. Matrix Anal. Appl. 20 (1999) 720-755; Chen, Davis, Hager and Rajamanickam, ACM Trans.
Math. Softw. 35 (2008) 22; Karypis and Kumar, SIAM J. Sci. Comput. 20 (1998) 359-392.
"""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from workflow.kernels import Array

Solver = Callable[[Array], Array]
"""Solves for displacements or temperatures, ``(coordinate, …)``, under loads of the same shape."""

MOST_BY_SUPERLU = 10_000
"""Coordinates up to which SuperLU takes less than a second for any shape of the solid."""


_MANY_BYTES = 1e9
"""Size of both factors from which on a warning is given, bytes."""

FACTORISING = "cvxopt", "pymetis"
"""Packages of the extra ``sparse``: CHOLMOD is a part of cvxopt, and METIS comes with pymetis."""


class NotHeldError(ValueError):
    """A sparse stiffness leaves the structure unconstrained, or is not positive definite."""

    def __init__(self, why: str = "with the tip held some part of the structure is still loose"):
        super().__init__(why)


def factorised(matrix: scipy.sparse.csc_array, order: Array | None = None) -> Solver:
    """Factorise a sparse symmetric definite matrix; return its solver for loads ``(coordinate, …)``.

    Parameters
    ----------
    matrix
        Shape ``(coordinate, coordinate)``.
    order
        Result of :func:`elimination_order`, where it is known.

    Raises
    ------
    NotHeldError
        The matrix is singular, or CHOLMOD finds it indefinite.
    """
    if matrix.shape[0] == 0:
        return lambda load: load
    order = elimination_order(matrix) if order is None else order
    if order is not None:
        return _by_cholmod(matrix, order)
    factors = _superlu(matrix)
    return lambda load: np.asarray(factors.solve(load))


def elimination_order(matrix: scipy.sparse.csc_array) -> Array | None:
    """Return the elimination order for CHOLMOD of matrices with these nonzeros or fewer, ``(coordinate,)``.

    It is ``None`` for those that SuperLU factorises, in an order of its own.
    """
    return _nested_dissection(matrix) if matrix.shape[0] > MOST_BY_SUPERLU and has_cholmod() else None


@cache
def has_cholmod() -> bool:
    """Tell whether the extra ``sparse`` is installed."""
    return all(importlib.util.find_spec(package) is not None for package in FACTORISING)


def is_definite(matrix: scipy.sparse.csc_array, least: float = 0.0) -> bool:
    """Tell whether the pivots of a sparse symmetric matrix are larger than the least, by SuperLU, else than 0."""
    order = elimination_order(matrix)
    try:
        if order is None:
            return bool(np.all(_superlu(matrix).U.diagonal() > least))
        _by_cholmod(matrix, order)
    except NotHeldError:
        return False
    return True


def _superlu(matrix: scipy.sparse.csc_array) -> Any:
    """Return the factors of SuperLU with the minimum-degree ordering of A + Aᵀ and pivots on the diagonal."""
    try:
        return scipy.sparse.linalg.splu(
            scipy.sparse.csc_array(matrix),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError:
        raise NotHeldError from None


def _by_cholmod(matrix: scipy.sparse.csc_array, order: Array) -> Solver:
    """Return the solver by CHOLMOD with an elimination order.

    Its own BLAS library is limited to one thread here, as callers cannot limit it before it is loaded.
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

    def solve(load: Array) -> Array:
        solution = cvxopt.matrix(np.asarray(load, dtype=np.float64))
        with threadpool_limits(limits=1, user_api="blas"):
            cholmod.solve(factor, solution)
        return np.array(solution).reshape(load.shape)

    return solve


def _nested_dissection(matrix: scipy.sparse.csc_array) -> Array:
    """Return METIS's elimination order of a symmetric matrix, ``(coordinate,)``."""
    import pymetis

    links = scipy.sparse.coo_array(matrix)
    row, column = links.coords
    beside = row != column
    graph = scipy.sparse.csr_array((np.ones(beside.sum(), np.int8), (row[beside], column[beside])), matrix.shape)
    order, _ = pymetis.nested_dissection(pymetis.CSRAdjacency(graph.indptr, graph.indices))
    return np.array(order, dtype=np.int64)


class LargeFactorsWarning(UserWarning):
    """Factors of a structure take much memory and time, or would take less with the extra ``sparse``."""


class Fill(NamedTuple):
    """Memory [bytes] and time of one factorisation."""

    size: float
    seconds: float

    def __str__(self) -> str:
        """Return both in words."""
        size, seconds = (float(f"{value:.1g}") for value in (self.size / 1e9, self.seconds))
        return f"{size:g} GB and {seconds:g} s of one core"


def expected_fill(matrix: scipy.sparse.csc_array, by_cholmod: bool) -> Fill:
    """Return the estimated memory and time of a factorisation by SuperLU or by CHOLMOD."""
    level = _mean_level(matrix)
    rows = float(matrix.shape[0])
    if by_cholmod:
        return Fill(100 * rows * np.sqrt(level), 2e-5 * rows + 1e-8 * rows * level)
    return Fill(8.4 * rows * level, 8e-11 * rows * level**2)


def warn_of_fill(matrix: scipy.sparse.csc_array, kind: str) -> None:
    """Warn of factors of displacements or temperatures (``kind``) that take more than a gigabyte."""
    if matrix.shape[0] <= MOST_BY_SUPERLU:
        return
    here = expected_fill(matrix, has_cholmod())
    if here.size < _MANY_BYTES:
        return
    less = f", with the extra `sparse` about {expected_fill(matrix, True)}" if not has_cholmod() else ""
    warnings.warn(
        f"each factorisation of a compact body of {matrix.shape[0]} {kind} takes about {here}{less}; krylov makes "
        "seven for temperatures",
        LargeFactorsWarning,
        stacklevel=2,
    )


def _mean_level(matrix: scipy.sparse.csc_array) -> float:
    """Return W of a search that begins at the last coordinate."""
    order, before = scipy.sparse.csgraph.breadth_first_order(matrix, matrix.shape[0] - 1, directed=False)
    depth = np.zeros(matrix.shape[0], dtype=np.int64)
    for coordinate in order[1:].tolist():
        depth[coordinate] = depth[before[coordinate]] + 1
    width = np.bincount(depth[order]).astype(np.float64)
    return float((width**2).sum() / width.sum())
