"""Factors of symmetric matrices that may be singular, by pivots of falling size: rank is decided, not assumed.

Bits do not depend on the processor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import uncounted
from workflow.kernels.sums import plain


class Factor(NamedTuple):
    """R with A[order][:, order] = Rᵀ R + a rest that has no pivot above the threshold."""

    upper: Array
    """R, upper triangular with a positive diagonal, ``(rank, size)``."""
    order: NDArray[np.int64]
    """Rows of A in the order in which they became pivots, ``(size,)``."""
    rest: float
    """Largest magnitude in the rest: beyond rounding where A is indefinite."""


@uncounted
def _eliminate(rest: Array, upper: Array, order: NDArray[np.int64], least: float) -> int:
    """Factor ``rest``, which is used up, into ``upper``; return the rank."""
    size = rest.shape[0]
    for k in range(size):
        best = k
        for i in range(k + 1, size):
            if rest[i, i] > rest[best, best]:
                best = i
        if not rest[best, best] > least:
            return k
        if best != k:
            order[k], order[best] = order[best], order[k]
            for j in range(size):
                rest[k, j], rest[best, j] = rest[best, j], rest[k, j]
            for j in range(size):
                rest[j, k], rest[j, best] = rest[j, best], rest[j, k]
                upper[j, k], upper[j, best] = upper[j, best], upper[j, k]
        pivot = np.sqrt(rest[k, k])
        upper[k, k] = pivot
        for j in range(k + 1, size):
            upper[k, j] = rest[k, j] / pivot
        for i in range(k + 1, size):
            share = upper[k, i]
            if share != 0.0:
                for j in range(k + 1, size):
                    rest[i, j] -= share * upper[k, j]
    return int(size)


def pivoted_factor(matrix: ArrayLike, least: float) -> Factor:
    """Return the factor of a symmetric matrix from pivots above ``least``, largest first.

    Source: Higham, Accuracy and stability of numerical algorithms (SIAM 2002), section 10.3: the rank found is that of
    a matrix within rounding of A.
    """
    rest = plain(matrix).copy()
    size = rest.shape[0]
    upper, order = np.zeros((size, size)), np.arange(size, dtype=np.int64)
    rank = int(_eliminate(rest, upper, order, least))
    return Factor(np.ascontiguousarray(upper[:rank]), order, float(np.abs(rest[rank:, rank:]).max(initial=0.0)))
