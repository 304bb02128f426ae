"""A stiffness and an inertia by dense matrices: answers and modes by singular values of what is deformed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy.linalg import solve_triangular

from workflow.kernels import Array
from workflow.kernels.algebra import least_squares, singular
from workflow.models._cases import project
from workflow.models._pair import MOST_FULL, UNBALANCED, Modes


@dataclass(frozen=True, eq=False)
class DensePair:
    """K = deformationᵀ diag(weights) deformation and M; what is asked of them see :class:`Pair`.

    Attributes
    ----------
    inertia
        M or C2, ``(coordinate, coordinate)``.
    weights
        Springs [N/m] or conductors [W/K], ``(spring,)``.
    deformation
        D, elongation or temperature difference of each per coordinate, ``(spring, coordinate)``.
    """

    inertia: Array
    weights: Array
    deformation: Array
    most_modes = MOST_FULL

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.inertia.shape[0])

    @property
    def dense(self) -> DensePair:
        """Itself."""
        return self

    @property
    def stiffness(self) -> Array:
        """K, ``(coordinate, coordinate)``."""
        return np.asarray(self.deformation.T @ (self.weights[:, None] * self.deformation))

    def inertia_of(self, u: Array) -> Array:
        """Return M u."""
        return self.inertia @ u

    def deformation_of(self, u: Array) -> Array:
        """Return D u."""
        return self.deformation @ u

    def forces(self, deformation: Array) -> Array:
        """Return Dᵀ diag(weights) d."""
        return np.asarray(self.deformation.T @ (self.weights * deformation.T).T)

    def work(self, u: Array, deformation: Array, expansion: Any) -> Array:
        """Return dᵀ diag(weights) e, which is exactly 0 where u deforms nothing."""
        return np.asarray((self.weights * deformation.T) @ expansion)

    def energies(self, u: Array) -> Array:
        """Return k_i d_i²."""
        return np.asarray(self.weights * self.deformation_of(u) ** 2)

    @property
    def weighted(self) -> Array:
        """√weights · D, whose singular values decide ranks, ``(spring, coordinate)``."""
        return np.asarray(np.sqrt(self.weights)[:, None] * self.deformation)

    @cached_property
    def constraint(self) -> Array:
        """ψ: the vector of least deformation energy, of minimum norm, with the tip at 1."""
        weighted = self.weighted
        return np.append(least_squares(weighted[:, :-1], -weighted[:, -1]), 1.0)

    @cached_property
    def deformed(self) -> Array:
        """D ψ, 0 below the rounding that decides the rank."""
        deformed, weighted = self.deformation @ self.constraint, self.weighted
        rounding = 10 * max(weighted.shape) * np.finfo(float).eps  # ten times matrix_rank's: ψ is rounded too
        least = rounding * np.linalg.norm(weighted) * np.linalg.norm(self.constraint)
        moved = np.linalg.norm(np.sqrt(self.weights) * deformed) > least
        return deformed if moved else np.zeros_like(deformed)

    @property
    def tip_stiffness(self) -> float:
        """σ = ψᵀ K ψ."""
        return float(np.sum(self.weights * self.deformed**2))

    @cached_property
    def _modes(self) -> Modes:
        massless = self.size > 0 and not np.any(self.inertia[-1])
        return (_condensed_modes if massless else singular_modes)(self.inertia, self.weighted)

    @cached_property
    def _held(self) -> Modes:
        return singular_modes(self.inertia[:-1, :-1], self.weighted[:, :-1]).with_tip_held()

    def modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip free."""
        modes = self._modes
        return modes if count is None else Modes(modes.values[:count], modes.shapes[:, :count])

    def held_modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip held."""
        return Modes(self._held.values[:count], self._held.shapes[:, :count])

    def answer_held(self, load: Array) -> Array:
        """Return K⁻¹ f with the tip held."""
        return np.asarray(_by_modes(self._held, load[None])[0])

    def answers_held_shifted(self) -> Callable[[Array, float], Array]:
        """Return what gives (K + s M)⁻¹ f with the tip held."""
        modes = self._held
        return lambda load, shift: modes.shapes @ ((modes.shapes.T @ load) / (modes.values + shift))

    def static_answers(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case; modes with λ = 0 take no part."""
        return _by_modes(self._modes, loads)

    def moves(self, load: Array, held: bool = False) -> bool:
        """Tell whether a load drives a mode with λ = 0."""
        modes = self._held if held else self._modes
        rigid = modes.shapes[:, modes.values == 0]
        return bool(np.any(np.abs(rigid.T @ load) > UNBALANCED * np.abs(rigid).max(axis=0) * np.abs(load).sum()))

    def spectrum(self) -> Array:
        """Return λ of all modes."""
        return np.where(self._modes.inertia > 0, self._modes.values, np.inf)

    def largest(self) -> float:
        """Return the largest λ."""
        return float(self._modes.values[-1])


def _by_modes(modes: Modes, loads: Array) -> Array:
    """Return the sum of the modal answers to loads ``(case, coordinate)``."""
    elastic = modes.values > 0
    shapes = np.ascontiguousarray(modes.shapes[:, elastic])
    return project(shapes, project(shapes.T, loads) / modes.values[elastic])


def singular_modes(inertia: Array, deformation: Array, whole: Array | None = None) -> Modes:
    """Solve deformationᵀ deformation φ = s² inertia φ through singular values s; λ = s².

    Singular values keep low frequencies of graded chains accurate to eps·ω_max/ω where the
    eigenvalues of the squared matrix would only be so to eps·(ω_max/ω)². ``whole`` is the deformation of which this one
    is what condensing has left: ranks are decided by the rounding of the larger one.
    """
    size = inertia.shape[0]
    if size == 0:
        return Modes(np.zeros(0), np.zeros((0, 0)))
    root = np.linalg.cholesky(inertia)
    scaled = solve_triangular(root, deformation.T, lower=True).T
    values, vectors = singular(scaled)
    rounding = max(scaled.shape) * np.finfo(float).eps  # numpy.linalg.matrix_rank's own rule
    before = 0.0  # or ten times the size of what was condensed: its entries are rounded sums
    if whole is not None:
        before = 10 * float(np.linalg.norm(solve_triangular(root, whole.T, lower=True)))
    values[values <= rounding * values.max(initial=before)] = 0.0
    shapes = solve_triangular(root, vectors, lower=True, trans="T")
    return Modes(values[::-1] ** 2, np.ascontiguousarray(shapes[:, ::-1]))


def _condensed_modes(mass: Array, strain: Array) -> Modes:
    """Return the modes of a structure whose tip has no mass, then the static deformation by a force on the tip.

    In the modes the tip follows the others at rest, x_n = -K_nn⁻¹ K_ni x_i; that deformation is a unit displacement of
    the tip alone, of stiffness K_nn. All are orthogonal in M, K1 and C1.
    """
    others, tip = strain[:, :-1], strain[:, -1]
    stiffness, follows = np.dot(tip, tip), np.zeros(others.shape[1])
    condensed = others
    for _ in range(2):  # once more, so that rounding of the first pass goes too
        share = (condensed.T @ tip) / stiffness
        condensed, follows = condensed - tip[:, None] * share, follows - share
    modes = singular_modes(mass[:-1, :-1], condensed, others)
    shapes = np.zeros((strain.shape[1], strain.shape[1]))
    shapes[:-1, :-1], shapes[-1, :-1], shapes[-1, -1] = modes.shapes, follows @ modes.shapes, 1.0
    return Modes(np.append(modes.values, stiffness), shapes, has_static=True)
