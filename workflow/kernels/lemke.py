"""Linear complementarity problems, λ >= 0, z = M λ + q >= 0, λᵀz = 0, by Lemke's method.

An artificial variable makes z = M λ + q + 1 z0 feasible; each pivot lets the complement of what left the basis enter,
until z0 leaves. For a P-matrix M (all principal minors positive) there is one solution for any q, and it is found; a
ray, along which no variable leaves, shows that M is none. The active set of the solution before is tried first: in
most of the steps of a march it stays.

Source: R. W. Cottle, J.-S. Pang, R. E. Stone, The Linear Complementarity Problem (2009), algorithm 4.4.5.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import Array
from workflow.kernels.compiled import kernel, part

_SMALL = 1e-13
"""Pivot, over the largest of its column, up to which it is the rounding of 0."""

_MOST_PIVOTS = 20
"""Pivots per variable after which degenerate pivots are taken to cycle; some two are usual."""


class Complementarity(NamedTuple):
    """A problem with up to m variables, and memory for it."""

    matrix: Array
    """M, ``(m, m)``."""
    constant: Array
    """q, ``(m,)``."""
    solution: Array
    """λ, ``(m,)``."""
    active: NDArray[np.bool_]
    """Which λ are basic: z is 0 there, ``(m,)``. Before, those that are tried first."""
    tableau: Array
    """``(m, 2 m + 2)``; scratch."""
    basis: NDArray[np.int64]
    """Number of the basic variable of each row: z first, then λ, then z0, ``(m,)``; scratch."""


def problem(size: int) -> Complementarity:
    """Return memory for problems of up to ``size`` variables."""
    rows = np.zeros((size, size)), np.zeros(size), np.zeros(size), np.zeros(size, dtype=np.bool_)
    return Complementarity(*rows, np.zeros((size, 2 * size + 2)), np.zeros(size, dtype=np.int64))


@part
def solve_complementarity(p: Complementarity, size: int) -> bool:
    """Fill solution and active set of the first ``size`` variables; return whether there is a solution."""
    for i in range(size):
        if not np.isfinite(p.constant[i]):
            return False
    if _solves(p, size):
        return True
    return _pivots(p, size) and _basic_solution(p, size)


@kernel
def solve_one(p: Complementarity) -> bool:
    """Fill solution and active set of a problem; return whether there is a solution."""
    return solve_complementarity(p, p.constant.size)


def complementarity(matrix: Array, constant: Array) -> Array | None:
    """Return λ of a problem; ``None`` where there is none."""
    own = problem(constant.size)
    own.matrix[:], own.constant[:] = matrix, constant
    return own.solution if solve_one(own) else None


@part
def _solves(p: Complementarity, size: int) -> bool:
    """Whether the active set solves the problem: λ > 0 on it, z >= 0 elsewhere."""
    if not _basic_solution(p, size):
        return False
    for i in range(size):
        if p.active[i]:
            if p.solution[i] <= 0.0:
                return False
        else:
            z = p.constant[i]
            for j in range(size):
                z += p.matrix[i, j] * p.solution[j]
            if z < 0.0:
                return False
    return True


@part
def _basic_solution(p: Complementarity, size: int) -> bool:
    """Fill λ of the active set, M λ = -q on it, by elimination with pivots; return whether it is regular."""
    a, count = p.tableau, 0
    for i in range(size):
        p.solution[i] = 0.0
        if p.active[i]:
            p.basis[count] = i
            count += 1
    for r in range(count):
        for c in range(count):
            a[r, c] = p.matrix[p.basis[r], p.basis[c]]
        a[r, count] = -p.constant[p.basis[r]]
    if not solve_in_place(a, count):
        return False
    for r in range(count):
        p.solution[p.basis[r]] = a[r, count]
    return True


@part
def solve_in_place(a: Array, size: int) -> bool:
    """Replace column ``size`` of a by the solution of the system that its columns before it are the matrix of."""
    for k in range(size):
        largest = k
        for r in range(k + 1, size):
            if abs(a[r, k]) > abs(a[largest, k]):
                largest = r
        if a[largest, k] == 0.0:
            return False
        for c in range(k, size + 1):
            a[k, c], a[largest, c] = a[largest, c], a[k, c]
        for r in range(k + 1, size):
            share = a[r, k] / a[k, k]
            if share != 0.0:
                for c in range(k + 1, size + 1):
                    a[r, c] -= share * a[k, c]
    for k in range(size - 1, -1, -1):
        for c in range(k + 1, size):
            a[k, size] -= a[k, c] * a[c, size]
        a[k, size] /= a[k, k]
    return True


@part
def _pivots(p: Complementarity, size: int) -> bool:
    """Fill the active set by Lemke's pivots; return whether they end with a solution."""
    a, rhs, worst = p.tableau, 2 * size + 1, 0
    for i in range(size):
        for j in range(size):
            a[i, j], a[i, size + j] = 1.0 if i == j else 0.0, -p.matrix[i, j]
        a[i, 2 * size], a[i, rhs], p.basis[i] = -1.0, p.constant[i], i
        p.active[i] = False
        if p.constant[i] < p.constant[worst]:
            worst = i
    if p.constant[worst] >= 0.0:
        return True
    entering, row = 2 * size, worst
    for _ in range(_MOST_PIVOTS * size):
        leaving = p.basis[row]
        _exchange(a, size, row, entering)
        p.basis[row] = entering
        if leaving == 2 * size:
            for i in range(size):
                if p.basis[i] >= size:
                    p.active[p.basis[i] - size] = True
            return True
        entering = leaving + size if leaving < size else leaving - size
        row = _leaving_row(p, size, entering)
        if row < 0:
            return False
    return False


@part
def _exchange(a: Array, size: int, row: int, entering: int) -> None:
    """Make ``entering`` the basic variable of a row."""
    pivot = a[row, entering]
    for c in range(2 * size + 2):
        a[row, c] /= pivot
    for r in range(size):
        share = a[r, entering]
        if r != row and share != 0.0:
            for c in range(2 * size + 2):
                a[r, c] -= share * a[row, c]


@part
def _leaving_row(p: Complementarity, size: int, entering: int) -> int:
    """Return the row whose variable first falls to 0 as ``entering`` grows, z0 before others; -1 for a ray.

    Where z0 falls to 0 with another, up to rounding, the problem is solved: pivots after that one may end in a ray.
    """
    a, rhs, largest, row, least = p.tableau, 2 * size + 1, 0.0, -1, np.inf
    for r in range(size):
        largest = max(largest, abs(a[r, entering]))
    for r in range(size):
        if a[r, entering] > _SMALL * largest:
            ratio = a[r, rhs] / a[r, entering]
            if p.basis[r] == 2 * size:
                ratio -= _SMALL * abs(ratio)
            if ratio < least or (ratio == least and p.basis[r] == 2 * size):
                row, least = r, ratio
    return row
