"""A stiffness K and an inertia M of one kind, the tip last: static answers and modes, with the tip held and free.

Mechanical K is K1 and M its mass, thermal K is K2 and M = C2. Modes are K φ = λ M φ, φᵀ M φ = 1, with λ = ω² or λ = μ.
Rigid motions and even warming of adiabatic parts have λ = 0 exactly: ranks decide it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from scipy.linalg import solve_triangular

from workflow.kernels import Array
from workflow.kernels.algebra import least_squares, singular
from workflow.models._cases import project


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes y = shapes · amplitudes that diagonalise an inertia and a stiffness.

    Attributes
    ----------
    values
        λ of a pair, ascending; ω [rad/s] of :func:`~workflow.models.mechanical_modes`. Shape ``(mode,)``.
    shapes
        Columns with shapesᵀ · inertia · shapes = 1, shape ``(coordinate, mode)``.
    has_static
        Whether the last column is the static deformation by a force on a tip without mass: its inertia is 0 and its
        λ its stiffness, N/m, so that shapesᵀ · stiffness · shapes = λ holds for it too.
    """

    values: Array
    shapes: Array
    has_static: bool = False

    @property
    def tip(self) -> Array:
        """Participation of the tip (the last coordinate) in each mode, shape ``(mode,)``."""
        return np.asarray(self.shapes[-1])

    @property
    def inertia(self) -> Array:
        """shapesᵀ · inertia · shapes: 1, and 0 of a static deformation, shape ``(mode,)``."""
        inertia = np.ones(self.values.size)
        inertia[self.values.size - self.has_static :] = 0.0
        return inertia


class Pair(Protocol):
    """What is asked of a stiffness and an inertia, whatever they are kept as."""

    @property
    def size(self) -> int:
        """Number of coordinates."""
        ...

    @property
    def constraint(self) -> Array:
        """ψ, 1 at the tip, without load elsewhere, ``(coordinate,)``; parts not linked to the tip stay at 0."""
        ...

    @property
    def deformed(self) -> Array:
        """What ψ deforms, exactly 0 where it deforms nothing: see :meth:`Structure.elongations`, ``differences``."""
        ...

    def modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip free, all if not said."""
        ...

    def held_modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip held, all if not said; their tip is 0."""
        ...

    def answer_held(self, load: Array) -> Array:
        """Return K⁻¹ f with the tip held, ``(coordinate,)``; loads on a part that nothing holds are left out."""
        ...

    def answers_held_shifted(self) -> Callable[[Array, float], Array]:
        """Return what gives (K + s M)⁻¹ f, ``(coordinate,)``, with the tip held by f and s > 0."""
        ...

    def static_answers(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case, ``(case, coordinate)``.

        On a part that nothing holds loads are balanced by its inertia first, f - M r with r its rigid motion, so that a
        deformation is left that the loads alone do not determine up to a rigid motion (inertia relief).
        """
        ...

    def spectrum(self) -> Array:
        """Return λ of all modes, ascending, infinite of a static deformation; of large pairs the lowest and highest."""
        ...

    def largest(self) -> float:
        """Return the largest λ; of sparse matrices about that."""
        ...


@dataclass(frozen=True, eq=False)
class DensePair:
    """K = deformationᵀ diag(weights) deformation and M.

    Attributes
    ----------
    inertia
        M or C2, ``(coordinate, coordinate)``.
    weights
        Springs [N/m] or conductors [W/K], ``(spring,)``.
    deformation
        Elongation or temperature difference of each per coordinate, ``(spring, coordinate)``.
    """

    inertia: Array
    weights: Array
    deformation: Array

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.inertia.shape[0])

    @property
    def _weighted(self) -> Array:
        return np.asarray(np.sqrt(self.weights)[:, None] * self.deformation)

    @cached_property
    def _constraint(self) -> tuple[Array, Array]:
        """The vector of least deformation energy, of minimum norm, with the tip at 1, and its deformation."""
        weighted = self._weighted
        shape = np.append(least_squares(weighted[:, :-1], -weighted[:, -1]), 1.0)
        deformed = self.deformation @ shape
        rounding = max(weighted.shape) * np.finfo(float).eps  # numpy.linalg.matrix_rank's own rule
        if np.linalg.norm(np.sqrt(self.weights) * deformed) <= rounding * np.linalg.norm(weighted):
            deformed = np.zeros_like(deformed)
        return shape, deformed

    @property
    def constraint(self) -> Array:
        """ψ, see :class:`Pair`."""
        return self._constraint[0]

    @property
    def deformed(self) -> Array:
        """What ψ deforms, ``(spring,)``."""
        return self._constraint[1]

    @cached_property
    def _modes(self) -> Modes:
        massless = self.size > 0 and not np.any(self.inertia[-1])
        return (_condensed_modes if massless else singular_modes)(self.inertia, self._weighted)

    @cached_property
    def _held(self) -> Modes:
        return singular_modes(self.inertia[:-1, :-1], self._weighted[:, :-1])

    def modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip free."""
        modes = self._modes
        return modes if count is None else Modes(modes.values[:count], modes.shapes[:, :count])

    def held_modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip held."""
        shapes = self._held.shapes[:, :count]
        return Modes(self._held.values[:count], np.vstack([shapes, np.zeros(shapes.shape[1])]))

    def answer_held(self, load: Array) -> Array:
        """Return K⁻¹ f with the tip held."""
        modes = self.held_modes()
        driven = modes.shapes.T @ load
        return np.asarray(
            modes.shapes @ np.divide(driven, modes.values, out=np.zeros_like(driven), where=modes.values > 0)
        )

    def answers_held_shifted(self) -> Callable[[Array, float], Array]:
        """Return what gives (K + s M)⁻¹ f with the tip held."""
        modes = self.held_modes()
        return lambda load, shift: modes.shapes @ ((modes.shapes.T @ load) / (modes.values + shift))

    def static_answers(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case; modes with λ = 0 take no part."""
        modes = self._modes
        elastic = modes.values > 0
        shapes = np.ascontiguousarray(modes.shapes[:, elastic])
        return project(shapes, project(shapes.T, loads) / modes.values[elastic])

    def spectrum(self) -> Array:
        """Return λ of all modes."""
        return np.where(self._modes.inertia > 0, self._modes.values, np.inf)

    def largest(self) -> float:
        """Return the largest λ."""
        return float(self._modes.values[-1])


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
