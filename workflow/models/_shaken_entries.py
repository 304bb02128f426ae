"""Perturbed matrices, to estimate which digits of a result another processor can reproduce.

A matrix is perturbed as a whole by a relative ``share``, and in each entry by a rounding,

    a_ij ← a_ij (1 ± share ± ε s_i s_j),   s_i = 1 or -1 at random, the same on every run,

so that it stays symmetric. The first shifts all frequencies alike. The second changes low frequencies and static
solutions as the backward error of a factorisation does, relatively by ε times the condition number.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from workflow.models._matrix_files import MATRICES, VECTORS, Entries

ROUNDED = float(np.finfo(float).eps)
"""Relative perturbation of a single entry."""


def shaken(entries: Entries, share: float) -> dict[str, Any]:
    """Return the entries of a file with matrices and vectors perturbed by a share of either sign, and its labels."""
    changed = dict(entries)
    for k, name in enumerate(MATRICES):
        if name in changed:
            own = share if k % 2 == 0 else -share
            changed[name] = _changed(changed[name], 1 + own, float(np.copysign(ROUNDED, own)))
    for name in VECTORS:
        if np.size(changed.get(name, 0)) > 1 and np.asarray(changed[name]).dtype.kind == "f":  # one is an index
            changed[name] = changed[name] * (
                1 + share * _signs(np.size(changed[name])).reshape(np.shape(changed[name]))
            )
    return changed


def _changed(matrix: Any, factor: float, rounded: float) -> Any:
    rows, columns = (_signs(length) for length in np.shape(matrix))
    if not scipy.sparse.issparse(matrix):
        return matrix * (factor + rounded * np.multiply.outer(rows, columns))
    return matrix * factor + scipy.sparse.diags_array(rows * rounded) @ matrix @ scipy.sparse.diags_array(columns)


def _signs(size: int) -> Any:
    return np.random.default_rng(size).choice([-1.0, 1.0], size)
