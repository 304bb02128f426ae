"""A stiffness and an inertia of lumps on a line: passes along it, and dense matrices where all modes are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._cases import distinct_rows
from workflow.models._pair import DensePair, Modes
from workflow.models._path import Path

MOST_NODES_WITH_MATRICES = 2000
"""Above, a chain has no matrices: one of them would hold 32 MB and more, its modes take a minute."""

MOST_ONE_BY_ONE = 100
"""Modes of a long chain that are computed one by one: each costs a pass or two along it, and room for its shape."""


class TooManyNodesError(ValueError):
    """A chain is too long for what would be built of n x n matrices."""

    def __init__(self, nodes: int):
        super().__init__(
            f"a chain of {nodes} nodes cannot be kept full (at most {MOST_NODES_WITH_MATRICES} can): "
            "write counts of modes, or `auto` with a `tolerance`"
        )


@dataclass(frozen=True, eq=False)
class ChainPair:
    """Joints between neighbours, grounds and lumps of a chain, ``(node,)`` each.

    Attributes
    ----------
    joint
        k_i [N/m] or κ_i [W/K], the first one to the root.
    inertia
        m_i [kg] or c_i [J/K].
    ground
        Conductances b_i to the surroundings, W/K; ``None`` where there are none.
    """

    joint: Array
    inertia: Array
    ground: Array | None = None

    @property
    def size(self) -> int:
        """Number of nodes."""
        return self.joint.size

    @property
    def path(self) -> Path:
        """K along the chain."""
        return Path(np.zeros(self.size) if self.ground is None else self.ground, self.joint)

    @cached_property
    def dense(self) -> DensePair:
        """The same by matrices.

        Raises
        ------
        TooManyNodesError
            They would be too large.
        """
        if self.size > MOST_NODES_WITH_MATRICES:
            raise TooManyNodesError(self.size)
        each = np.eye(self.size)
        weights, deformation = self.joint, each - np.eye(self.size, k=-1)
        if self.ground is not None:
            weights, deformation = np.concatenate([weights, self.ground]), np.concatenate([deformation, each])
        return DensePair(each * self.inertia, weights, deformation)

    @cached_property
    def _constraint(self) -> tuple[Array, Array]:
        shape, differences = self.path.unit_tip()
        return shape, differences if self.ground is None else np.concatenate([differences, shape])

    @property
    def constraint(self) -> Array:
        """ψ, see :class:`~workflow.models._pair.Pair`."""
        return self._constraint[0]

    @property
    def deformed(self) -> Array:
        """What ψ deforms: joints, then grounds."""
        return self._constraint[1]

    def _lowest(self, path: Path, count: int | None) -> Modes | None:
        """Return modes one by one, ``None`` where there are too many for that or the chain is short."""
        if count is None or count > MOST_ONE_BY_ONE + 1 or self.size <= MOST_BY_JACOBI:
            return None
        inertia = self.inertia[: path.size]
        if count == 0:
            return Modes(np.zeros(0), np.zeros((inertia.size, 0)))
        modes = path.modes(inertia, 0, count - 1)
        return Modes(modes.values**2, modes.shapes)

    def modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip free."""
        return self._lowest(self.path, count) or self.dense.modes(count)

    def held_modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip held."""
        modes = self._lowest(self.path.without_tip(), count)
        if modes is None:
            return self.dense.held_modes(count)
        return Modes(modes.values, np.vstack([modes.shapes, np.zeros(modes.values.size)]))

    def answer_held(self, load: Array) -> Array:
        """Return K⁻¹ f with the tip held, 0 where nothing holds what is driven."""
        return _solved(self.path.without_tip(), load)

    def answers_held_shifted(self) -> Callable[[Array, float], Array]:
        """Return what gives (K + s M)⁻¹ f with the tip held."""
        interior, inertia = self.path.without_tip(), self.inertia[:-1]
        return lambda load, shift: _solved(Path(interior.ground + shift * inertia, interior.joint), load)

    def static_answers(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case, each distinct load solved once."""
        path, (first, which) = self.path, distinct_rows(loads)
        answers = np.zeros_like(loads[first])
        for row, load in enumerate(loads[first]):
            if np.any(load):
                answer = path.solve(self._balanced(path, load))
                assert answer is not None, "a balanced load moves no part for ever"
                answers[row] = answer
        return np.asarray(answers[which])

    def _balanced(self, path: Path, load: Array) -> Array:
        """Return a load without what moves loose parts as a whole, f_i - m_i Σ f / Σ m."""
        balanced = load.copy()
        for first, stop in pairwise([*np.flatnonzero(path.joint == 0).tolist(), path.size]):
            if not np.any(path.ground[first:stop]):
                share = np.cumsum(load[first:stop])[-1] / np.cumsum(self.inertia[first:stop])[-1]
                balanced[first:stop] -= share * self.inertia[first:stop]
        return balanced

    def spectrum(self) -> Array:
        """Return λ of all modes, of a chain without matrices the lowest and the highest."""
        if self.size <= MOST_NODES_WITH_MATRICES:
            return self.dense.spectrum()
        is_held = np.all(self.path.pivots() > 0)
        return np.array([self.path.value(self.inertia, 0) if is_held else 0.0, self.largest()])

    def largest(self) -> float:
        """Return the largest λ."""
        if self.size <= MOST_BY_JACOBI:
            return self.dense.largest()
        return self.path.value(self.inertia, self.size - 1)


def _solved(interior: Path, load: Array) -> Array:
    """Return the answer of the nodes before the tip, 0 at the tip, and 0 everywhere if nothing holds what is driven."""
    answer = interior.solve(load[:-1])
    return np.zeros(load.size) if answer is None else np.append(answer, 0.0)
