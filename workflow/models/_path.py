"""Systems on a line: grounds at the nodes, joints between neighbours, in as many operations as nodes.

Both stiffness and conductance of a chain are of this kind, (A u)_i = g_i u_i + j_i (u_i - u_{i-1})
- j_{i+1} (u_{i+1} - u_i) with the root u_0 = 0. Elimination from the tip to the root adds
positive numbers only,

    pivot_i = j_i + o_i,   o_i = g_i + j_{i+1} o_{i+1} / pivot_{i+1},

o_i being what node i and all beyond it are tied to the surroundings with: no digit is lost and a
part that nothing holds is found by a pivot that is exactly zero.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.models._pair import Modes

_UNBALANCED = 1e-9
"""Load on a part that nothing holds, as a share of all loads, above which it moves for ever: far
above the rounding of its sum, far below a load that somebody meant."""


_LIFT = 1e-6
"""Share of the largest λ by which values are lifted: λ is then known to 1e-19 of the largest, while
the slowest of 100 000 nodes lies at 1e-10 of it."""


@dataclass(frozen=True, eq=False)
class Path:
    """Grounds g_i at the nodes 1 … n and joints j_i from node i-1 to node i, both ``(n,)``, >= 0."""

    ground: Array
    joint: Array

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.joint.size

    def without_tip(self) -> Path:
        """Return the path with its last node held still."""
        ground = self.ground[:-1].copy()
        if ground.size:
            ground[-1] += self.joint[-1]
        return Path(ground, self.joint[:-1])

    def pivots(self) -> Array:
        """Return the pivots of the elimination from the tip to the root, ``(n,)``."""
        ground, joint = self.ground.tolist(), self.joint.tolist()
        pivots = [0.0] * self.size
        beyond = 0.0
        for i in range(self.size - 1, -1, -1):
            own = ground[i] + beyond
            pivots[i] = joint[i] + own
            beyond = joint[i] * own / pivots[i] if pivots[i] > 0 else 0.0
        return np.array(pivots)

    def unit_tip(self) -> tuple[Array, Array]:
        """Return u with u_n = 1 and (A u)_i = 0 at all other nodes, and u_i - u_{i-1}; both ``(n,)``.

        A part that nothing links to the tip stays at 0. With r_i = g_i + j_i in series with r_{i-1} (elimination
        from the root) u_{i-1} = u_i j_i/(j_i + r_{i-1}): positive numbers only, so that differences across stiff
        joints keep their digits, and are exactly zero where nothing but the tip holds the nodes before.
        """
        ground, joint = self.ground.tolist(), self.joint.tolist()
        ratios, strained = [0.0] * self.size, [1.0] * self.size  # u_{i-1}/u_i and (u_i - u_{i-1})/u_i
        below = ground[0] + joint[0]
        for i in range(1, self.size):
            total = joint[i] + below
            ratios[i], strained[i] = (joint[i] / total, below / total) if joint[i] > 0 else (0.0, 1.0)
            below = ground[i] + joint[i] * strained[i]
        values, differences = [1.0] * self.size, list(strained)
        for i in range(self.size - 1, -1, -1):
            differences[i] = strained[i] * values[i]
            if i:
                values[i - 1] = ratios[i] * values[i]
        return np.array(values), np.array(differences)

    def solve(self, load: Array) -> Array | None:
        """Return u with A u = load, of mean 0 in a part that nothing holds; ``None`` if that is driven."""
        joint, pivot, carried = self.joint.tolist(), self.pivots().tolist(), load.tolist()
        for i in range(self.size - 1, 0, -1):
            if pivot[i] > 0:
                carried[i - 1] += joint[i] / pivot[i] * carried[i]
        tolerated = _UNBALANCED * np.sum(np.abs(load))
        u = np.zeros(self.size)
        before, loose = 0.0, []
        for i in range(self.size):
            if pivot[i] > 0:
                before = (carried[i] + joint[i] * before) / pivot[i]
            elif abs(carried[i]) <= tolerated:
                before = 0.0
                loose.append(i)
            else:
                return None
            u[i] = before
        ends = np.append(np.flatnonzero(self.joint == 0), self.size)
        for first, stop in pairwise(ends):
            if first in loose:
                u[first:stop] -= np.sum(u[first:stop]) / (stop - first)
        return u

    def _alternating(self, inertia: Array) -> Array:
        """Return the off-diagonal of [[0, Bᵀ], [B, 0]] with rows and columns of B alternating.

        B is bidiagonal with BᵀB = inertia^-½ A inertia^-½.
        """
        pivot = self.pivots()
        root = np.sqrt(pivot)
        lower = np.zeros(self.size)
        np.divide(-self.joint, root, out=lower, where=pivot > 0)
        alternating = np.zeros(2 * self.size - 1)
        alternating[::2], alternating[1::2] = root / np.sqrt(inertia), lower[1:] / np.sqrt(inertia[:-1])
        return alternating

    def value(self, inertia: Array, which: int) -> float:
        """Return λ of the mode ``which`` (from 0, ascending) of A φ = λ inertia φ, as :meth:`modes` does."""
        chosen = (self.size + which, self.size + which)
        ends = np.zeros(2 * self.size), self._alternating(inertia)
        roots = _tridiagonal(*ends, eigvals_only=True, select="i", select_range=chosen)
        return max(float(roots[0]), 0.0) ** 2

    def modes(self, inertia: Array, first: int, last: int) -> Modes:
        """Return the modes ``first`` to ``last`` (from 0, ascending) of A φ = λ inertia φ.

        They are eigenvectors of [[0, Bᵀ], [B, 0]], which is tridiagonal where rows and columns of B
        alternate: singular values of B to eps times the largest of them, as in
        :func:`~workflow.models._pair.singular_modes`. Where some part is held by nothing, all λ are
        lifted for the while: the eigenvectors of a double 0 would mix rows and columns.
        """
        lift = 0.0 if np.all(self.pivots() > 0) else _LIFT * float(((self.ground + self.joint) / inertia).max() or 1.0)
        lifted = Path(self.ground + lift * inertia, self.joint)
        chosen = (self.size + first, self.size + last)
        ends = np.zeros(2 * self.size), lifted._alternating(inertia)
        values, vectors = _tridiagonal(*ends, select="i", select_range=chosen)
        shapes = np.sqrt(2) * vectors[1::2] / np.sqrt(inertia)[:, None]
        return Modes(np.maximum(values**2 - lift, 0.0), shapes)


def _tridiagonal(diagonal: Array, beside: Array, **options: Any) -> Any:
    """Return eigenvalues, and eigenvectors where they are asked for, of a symmetric tridiagonal matrix."""
    from scipy.linalg import eigh_tridiagonal  # imported here: reading a study needs none of it

    return eigh_tridiagonal(diagonal, beside, **options)
