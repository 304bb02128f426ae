"""What factors of a large sparse matrix take, estimated from how far its body is from end to end, before they are made.

A search in breadth that begins at the tip meets the coordinates level by level, w of them in each; W = Σ w²/Σ w is the
level that a coordinate is in on average. Least degree leaves about 0.4 W entries in a row of a factor, nested
dissection 10 √W: numbers and times per entry are those of cubes, blocks and blades of 8 000 to 105 000 coordinates on
one core of a server processor of 2024, within a factor of two.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import numpy as np
import scipy

from workflow.models._factors import MOST_BY_SUPERLU, has_cholmod

_MANY_BYTES = 1e9
"""Of both factors, from which on a caller is warned."""


class LargeFactorsWarning(UserWarning):
    """Factors of a structure take much memory and time, or would take less with the extra ``sparse``."""


class Fill(NamedTuple):
    """What it takes to factorise a matrix once, memory in bytes."""

    size: float
    seconds: float

    def __str__(self) -> str:
        """Return it in words."""
        size, seconds = (float(f"{value:.1g}") for value in (self.size / 1e9, self.seconds))
        return f"{size:g} GB and {seconds:g} s of one core"


def expected_fill(matrix: scipy.sparse.csc_array, by_cholmod: bool) -> Fill:
    """Return what factors of a symmetric matrix take, by SuperLU or by CHOLMOD."""
    level = _mean_level(matrix)
    rows = float(matrix.shape[0])
    if by_cholmod:
        return Fill(100 * rows * np.sqrt(level), 2e-5 * rows + 1e-8 * rows * level)
    return Fill(8.4 * rows * level, 8e-11 * rows * level**2)


def warn_of_fill(matrix: scipy.sparse.csc_array, kind: str) -> None:
    """Warn of factors of many displacements or temperatures that take more than a gigabyte."""
    if matrix.shape[0] <= MOST_BY_SUPERLU:
        return
    here = expected_fill(matrix, has_cholmod())
    if here.size < _MANY_BYTES:
        return
    less = f"; the extra `sparse` takes about {expected_fill(matrix, True)}" if not has_cholmod() else ""
    warnings.warn(
        f"a body of {matrix.shape[0]} {kind} this bulky takes about {here} each time it is factorised, krylov seven "
        f"times for temperatures{less}",
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
