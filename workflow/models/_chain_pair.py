"""A stiffness and an inertia of lumps on a line: passes along it, and dense matrices where all modes are asked for.

(K u)_i = g_i u_i + j_i (u_i - u_{i-1}) - j_{i+1} (u_{i+1} - u_i) with the root u_0 = 0. Elimination from the tip to the
root adds positive numbers only,

    pivot_i = j_i + o_i,   o_i = g_i + j_{i+1} o_{i+1} / pivot_{i+1},

o_i being what node i and all beyond it are tied to the surroundings with: no digit is lost and a part that nothing
holds is found by a pivot that is exactly zero.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeGuard

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._cases import distinct_rows
from workflow.models._dense_pair import DensePair
from workflow.models._pair import MOST_FULL, UNBALANCED, Modes, TooManyCoordinatesError

MOST_ONE_BY_ONE = 100
"""Modes of a long chain that are computed one by one: each costs a pass or two along it, and room for its shape."""

_LIFT = 1e-6
"""Share of the largest λ by which values are lifted: λ is then known to 1e-19 of the largest, while
the slowest of 100 000 nodes lies at 1e-10 of it."""


@dataclass(frozen=True, eq=False)
class ChainPair:
    """Joints between neighbours, lumps and grounds of a chain, ``(node,)`` each; see :class:`~workflow.models.Pair`.

    Attributes
    ----------
    joint
        k_i [N/m] or κ_i [W/K], the first one to the root.
    lumps
        m_i [kg] or c_i [J/K].
    ground
        Conductances b_i to the surroundings, W/K; 0 for stiffness.
    """

    joint: Array
    lumps: Array
    ground: Array
    most_modes = MOST_ONE_BY_ONE

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.joint.size

    @property
    def stiffness(self) -> Array:
        """K, ``(node, node)``."""
        return self.dense.stiffness

    @cached_property
    def weights(self) -> Array:
        """Joints, then grounds where there are any."""
        return np.concatenate([self.joint, self.ground]) if self.ground.any() else self.joint

    @cached_property
    def dense(self) -> DensePair:
        """The same by matrices."""
        if self.size > MOST_FULL:
            raise TooManyCoordinatesError(self.size, MOST_ONE_BY_ONE)
        each = np.eye(self.size)
        return DensePair(each * self.lumps, self.weights, self.deformation_of(each))

    def inertia_of(self, u: Array) -> Array:
        """Return m_i u_i."""
        return np.asarray((self.lumps * u.T).T)

    def deformation_of(self, u: Array) -> Array:
        """Return u_i - u_{i-1} of the joints, then u_i of the grounds where there are any."""
        joints = np.diff(u, axis=0, prepend=0.0)
        return np.concatenate([joints, u]) if self.ground.any() else joints

    def forces(self, deformation: Array) -> Array:
        """Return N_i - N_{i+1} for forces N_i in the joints, and what flows to the grounds."""
        flows = (self.weights * deformation.T).T
        forces = flows[: self.size].copy()
        forces[:-1] -= flows[1 : self.size]
        return forces + flows[self.size :] if self.ground.any() else forces

    def work(self, u: Array, deformation: Array, expansion: Any) -> Array:
        """Return dᵀ diag(weights) e, which is exactly 0 where u deforms nothing."""
        return np.asarray((self.weights * deformation.T) @ expansion)

    def energies(self, u: Array) -> Array:
        """Return k_i d_i²."""
        return np.asarray(self.weights * self.deformation_of(u) ** 2)

    @cached_property
    def _unit_tip(self) -> tuple[Array, Array, float]:
        """Return ψ, its differences, ``(node,)`` each, and σ.

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
        return np.array(values), np.array(differences), below

    @property
    def constraint(self) -> Array:
        """ψ, ``(node,)``."""
        return self._unit_tip[0]

    @property
    def deformed(self) -> Array:
        """What ψ deforms: joints, then grounds."""
        shape, differences, _ = self._unit_tip
        return np.concatenate([differences, shape]) if self.ground.any() else differences

    @property
    def tip_stiffness(self) -> float:
        """σ: what the tip is tied to the root and the surroundings with."""
        return self._unit_tip[2]

    @cached_property
    def _held(self) -> ChainPair:
        """The nodes before the tip, which is held."""
        ground = self.ground[:-1].copy()
        if ground.size:
            ground[-1] += self.joint[-1]
        return ChainPair(self.joint[:-1], self.lumps[:-1], ground)

    @cached_property
    def _pivots(self) -> Array:
        """Pivots of the elimination from the tip to the root, ``(node,)``."""
        ground, joint = self.ground.tolist(), self.joint.tolist()
        pivots = [0.0] * self.size
        beyond = 0.0
        for i in range(self.size - 1, -1, -1):
            own = ground[i] + beyond
            pivots[i] = joint[i] + own
            beyond = joint[i] * own / pivots[i] if pivots[i] > 0 else 0.0
        return np.array(pivots)

    @cached_property
    def _loose(self) -> list[slice]:
        """The parts that nothing holds."""
        parts = [slice(*ends) for ends in pairwise([*np.flatnonzero(self.joint == 0).tolist(), self.size])]
        return [part for part in parts if not np.any(self.ground[part])]

    def _answer(self, load: Array) -> Array:
        """Return K⁻¹ f, ``(node,)``; a loose part's centre of mass stays at rest at 0."""
        balanced = load.copy()
        for part in self._loose:
            lumps = self.lumps[part]
            balanced[part] -= np.cumsum(load[part])[-1] / np.cumsum(lumps)[-1] * lumps
        joint, pivot, carried = self.joint.tolist(), self._pivots.tolist(), balanced.tolist()
        for i in range(self.size - 1, 0, -1):
            if pivot[i] > 0:
                carried[i - 1] += joint[i] / pivot[i] * carried[i]
        u, before = np.zeros(self.size), 0.0
        for i in range(self.size):
            before = (carried[i] + joint[i] * before) / pivot[i] if pivot[i] > 0 else 0.0
            u[i] = before
        for part in self._loose:
            u[part] -= np.dot(self.lumps[part], u[part]) / np.sum(self.lumps[part])
        return u

    def answer_held(self, load: Array) -> Array:
        """Return K⁻¹ f with the tip held."""
        return np.append(self._held._answer(load[:-1]), 0.0)

    def answers_held_shifted(self) -> Callable[[Array, float], Array]:
        """Return what gives (K + s M)⁻¹ f with the tip held."""
        held = self._held

        def answer(load: Array, shift: float) -> Array:
            shifted = ChainPair(held.joint, held.lumps, held.ground + shift * held.lumps)
            return np.append(shifted._answer(load[:-1]), 0.0)

        return answer

    def static_answers(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case, each distinct load solved once."""
        first, which = distinct_rows(loads)
        return np.reshape([self._answer(load) for load in loads[first]], (-1, self.size))[which]

    def moves(self, load: Array, held: bool = False) -> bool:
        """Tell whether the loads on a loose part do not balance."""
        pair, least = self._held if held else self, UNBALANCED * np.abs(load).sum()
        return any(bool(abs(load[: pair.size][part].sum()) > least) for part in pair._loose)

    @property
    def _alternating(self) -> Array:
        """The off-diagonal of [[0, Bᵀ], [B, 0]] with rows and columns of B alternating.

        B is bidiagonal with BᵀB = M^-½ K M^-½.
        """
        root = np.sqrt(self._pivots)
        lower = np.zeros(self.size)
        np.divide(-self.joint, root, out=lower, where=root > 0)
        alternating = np.zeros(2 * self.size - 1)
        alternating[::2], alternating[1::2] = root / np.sqrt(self.lumps), lower[1:] / np.sqrt(self.lumps[:-1])
        return alternating

    def _tridiagonal(self, first: int, last: int, **options: Any) -> Any:
        """Return singular values of B ``first`` to ``last``, ascending, and vectors where they are asked for."""
        from scipy.linalg import eigh_tridiagonal  # imported here: reading a study needs none of it

        chosen = (self.size + first, self.size + last)
        return eigh_tridiagonal(np.zeros(2 * self.size), self._alternating, select="i", select_range=chosen, **options)

    def _value(self, which: int) -> float:
        """Return λ of the mode ``which`` (from 0, ascending)."""
        return max(float(self._tridiagonal(which, which, eigvals_only=True)[0]), 0.0) ** 2

    def lowest(self, count: int) -> Modes:
        """Return the lowest modes.

        They are eigenvectors of [[0, Bᵀ], [B, 0]], which is tridiagonal where rows and columns of B
        alternate: singular values of B to eps times the largest of them, as in
        :func:`~workflow.models._dense_pair.singular_modes`. Where some part is held by nothing, all λ are
        lifted for the while: the eigenvectors of a double 0 would mix rows and columns.
        """
        if count == 0:
            return Modes(np.zeros(0), np.zeros((self.size, 0)))
        lift = _LIFT * float(((self.ground + self.joint) / self.lumps).max() or 1.0) if self._loose else 0.0
        lifted = ChainPair(self.joint, self.lumps, self.ground + lift * self.lumps)
        values, vectors = lifted._tridiagonal(0, count - 1)
        shapes = np.sqrt(2) * vectors[1::2] / np.sqrt(self.lumps)[:, None]
        return Modes(np.maximum(values**2 - lift, 0.0), shapes)

    def _is_few(self, count: int | None) -> TypeGuard[int]:
        return count is not None and count <= MOST_ONE_BY_ONE + 1 and self.size > MOST_BY_JACOBI

    def modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip free."""
        return self.lowest(count) if self._is_few(count) else self.dense.modes(count)

    def held_modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip held."""
        return self._held.lowest(count).with_tip_held() if self._is_few(count) else self.dense.held_modes(count)

    def spectrum(self) -> Array:
        """Return λ of all modes, of a chain without matrices the lowest and the highest."""
        if self.size <= MOST_FULL:
            return self.dense.spectrum()
        return np.array([0.0 if self._loose else self._value(0), self.largest()])

    def largest(self) -> float:
        """Return the largest λ."""
        return self.dense.largest() if self.size <= MOST_BY_JACOBI else self._value(self.size - 1)
