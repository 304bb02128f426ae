"""A pair of stiffness K and inertia M, the tip last: static solutions and modes, with the tip held and free.

The mechanical pair is K1 and M, the thermal one K2 and C2. Modes are K φ = λ M φ, φᵀ M φ = 1, with λ = ω² or λ = μ.
Rigid motions and uniform warming of adiabatic parts have λ = 0 exactly, as decided by rank: a given matrix is factored,
K = DᵀD, with its rank decided by pivots.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from scipy.linalg.lapack import dpstrf

from workflow.kernels import Array
from workflow.kernels.algebra import least_squares, singular
from workflow.models._cases import distinct_rows, project

_INDEFINITE = 1e3
"""Negative part of a matrix, over its rounding, above which the matrix is indefinite."""

_ROUNDED_IN_FILES = 1e-4
"""Negative part of a matrix with unit diagonal up to which numbers of five digits or more may have made it."""


BALANCED_IN_FILES = 1e-8
"""Relative thermal force that may act on a rigid body: half the digits of a file in full precision."""


class UnusableMatricesError(ValueError):
    """Matrices do not describe a structure, or one that a basis can reduce: ``problem`` and ``remedy`` for the user."""

    def __init__(self, problem: str, remedy: str):
        super().__init__(f"{problem}: {remedy}")
        self.problem, self.remedy = problem, remedy


@contextmanager
def turning_at(revolutions: float) -> Iterator[None]:
    """Have what makes matrices unusable said with the speed, rev/s, unless it is 0."""
    try:
        yield
    except UnusableMatricesError as error:
        if revolutions == 0:
            raise
        problem = f"at {revolutions:.6g} rev/s {error.problem}"
        remedy = f"turn slower, check the sign of `stiffness_speed2`, or {error.remedy}"
        raise UnusableMatricesError(problem, remedy) from None


class Part(NamedTuple):
    """A symmetric positive semi-definite matrix as deformationᵀ · deformation, ``(rank, coordinate)``."""

    deformation: Array
    order: NDArray[np.int64]

    def expansion(self, coupling: Array) -> Array:
        """Return the free expansion with K12 = -deformationᵀ · expansion, ``(rank, temperature)``.

        Raises
        ------
        UnusableMatricesError
            A temperature rise would exert a resultant force on a rigid body, which no thermal expansion does.
        """
        rank, forces = self.deformation.shape[0], -coupling[self.order]
        in_order = self.deformation[:, self.order]
        expansion = solve_triangular(in_order[:, :rank].T, forces[:rank], lower=True)
        beyond = np.abs(forces[rank:] - in_order[:, rank:].T @ expansion).max(initial=0.0)
        if beyond > BALANCED_IN_FILES * np.abs(forces).max(initial=0.0):
            raise UnusableMatricesError(
                "coupling exerts a resultant force on a part that nothing holds",
                "thermal forces of a free body must balance; check sign and order of coupling",
            )
        return np.asarray(expansion)


def is_last(row: Array) -> bool:
    """Tell whether a row is 1 at the last coordinate and 0 elsewhere."""
    return np.flatnonzero(row).tolist() == [row.size - 1] and bool(row[-1] == 1)


def congruent(matrix: Array, basis: Array) -> Array:
    """Return basisᵀ · matrix · basis, symmetric to the bit."""
    return symmetric(basis.T @ (matrix @ basis))


def symmetric(matrix: Array) -> Array:
    """Return the symmetric part of a matrix."""
    return np.asarray((matrix + matrix.T) / 2)


def factored(matrix: Array, name: str, basis: Array | None = None) -> Part:
    """Return the deformation of EᵀK E with a basis E; its rank is decided by the rounding of |E|ᵀ|K||E|.

    Raises
    ------
    UnusableMatricesError
        The matrix is indefinite.
    """
    basis = np.eye(matrix.shape[0]) if basis is None else basis
    scale = scale_of(np.abs(basis).T @ np.abs(matrix) @ np.abs(basis))
    upper, order = pivots(congruent(matrix, basis), name, scale)
    deformation = np.zeros_like(upper)
    deformation[:, order] = upper
    return Part(deformation * scale, order)


def scale_of(matrix: Array) -> Array:
    """Return √K_ii, 1 where that is 0, ``(coordinate,)``."""
    diagonal = np.diag(matrix)
    return np.sqrt(np.where(diagonal > 0, diagonal, 1.0))


def pivots(matrix: Array, name: str, scale: Array) -> tuple[Array, NDArray[np.int64]]:
    """Return the factor R of a matrix divided by scales of its coordinates ``(coordinate,)``, and the order of pivots.

    A[order][:, order] = Rᵀ R + a remainder without a pivot above the threshold, R upper triangular ``(rank, size)``.
    Source: Higham, Accuracy and stability of numerical algorithms (SIAM 2002), section 10.3: the rank found is that of
    a matrix within rounding of A.
    """
    scaled = matrix / scale / scale[:, None]
    least = 10 * matrix.shape[0] * np.finfo(float).eps  # rounding of assembled entries, after numpy's matrix_rank
    whole, order, rank, _ = dpstrf(scaled, tol=least)
    upper = np.triu(whole)[:rank]
    order = np.asarray(order, dtype=np.int64) - 1
    rest = scaled[np.ix_(order[rank:], order[rank:])] - upper[:, rank:].T @ upper[:, rank:]
    negative = float(np.abs(rest).max(initial=0.0))
    if _INDEFINITE * least < negative <= _ROUNDED_IN_FILES:
        raise UnusableMatricesError(
            f"{name} is indefinite by {negative:.0e} of its diagonal, as its numbers are rounded in the file",
            "write them with 16 digits, or hold the body that is free",
        )
    if not negative <= _INDEFINITE * least:
        raise UnusableMatricesError(
            f"{name} is not positive semi-definite", "check signs and that it was assembled in full"
        )
    return upper, order


MOST_FULL = 2000
"""Coordinates up to which a structure can be kept full: a larger matrix has over 32 MB, and modes take a minute."""

UNBALANCED = 1e-9
"""Resultant of the loads on an unconstrained part, over their sum of magnitudes, up to which it is zero: far above the
rounding of the sum, far below any intended load."""


class TooManyCoordinatesError(ValueError):
    """A structure has too many coordinates for dense matrices."""

    def __init__(self, size: int, most: int):
        super().__init__(
            f"a structure of {size} coordinates cannot be kept full (at most {MOST_FULL} can): "
            f"write `mechanical_modes` and `thermal_modes` of up to {most}, or `auto` with a `tolerance`"
        )


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes y = shapes · amplitudes that diagonalise an inertia and a stiffness."""

    values: Array
    """λ of a pair, ascending; ω [rad/s] of :func:`~workflow.models.mechanical_modes`. Shape ``(mode,)``."""
    shapes: Array
    """Columns with shapesᵀ · inertia · shapes = 1, shape ``(coordinate, mode)``."""

    @property
    def tip(self) -> Array:
        """Participation of the tip (the last coordinate) in each mode, shape ``(mode,)``."""
        return np.asarray(self.shapes[-1])

    def lowest(self, count: int | None) -> Modes:
        """Return the ``count`` lowest modes, all where ``None``."""
        return self if count is None else Modes(self.values[:count], self.shapes[:, :count])

    def with_boundary_held(self, boundary: int) -> Modes:
        """Return modes of all coordinates but the last ``boundary``, extended by 0 there."""
        held = np.zeros((boundary, self.values.size))
        return Modes(self.values, np.ascontiguousarray(np.vstack([self.shapes, held])))


class Pair(ABC):
    """Interface of a pair of stiffness and inertia, for any storage.

    Displacements u deform springs or conductors by d = D u, and K u = forces(d): K = Dᵀ diag(weights) D. Where there
    are no springs, d are the forces K u themselves. What is ``held`` is the boundary, the coordinates of the contacts:
    one contact is the last coordinate, several are made the last ones for a reduction.
    """

    stiffness: Any
    inertia: Any
    deformation: Any
    """``stiffness``, ``inertia``, ``deformation``: K and M ``(coordinate, coordinate)``, and D ``(spring,
    coordinate)``, dense or sparse; a chain has no matrices."""
    weights: Array
    """Springs [N/m] or conductors [W/K], ``(spring,)``."""
    most_modes: int
    """Largest number of modes or vectors of a structure that cannot be kept full."""
    boundary: int = 1
    """Number of last coordinates that are held."""
    constraint: Array
    """Constraint modes ψ, 1 at one coordinate of the boundary each, without load inside, ``(coordinate, boundary)``; 0
    in parts not linked to it."""
    deformed: Array
    """D ψ, ``(spring, boundary)``, exactly 0 where ψ deforms nothing."""

    @property
    def size(self) -> int:
        """Number of coordinates."""
        return int(self.inertia.shape[0])

    @property
    @abstractmethod
    def dense(self) -> DensePair:
        """The same pair with dense matrices.

        Raises
        ------
        TooManyCoordinatesError
            They would be too large.
        """

    def expansion_of_springs(self, expansion: Any) -> Any:
        """Return a free expansion of this pair, K12 = -forces(expansion), for the springs of ``dense``."""
        return expansion

    def inertia_of(self, u: Array) -> Array:
        """Return M u, ``(coordinate, …)``: inertia forces [N] of accelerations, or heat contents [J]."""
        return np.asarray(self.inertia @ u)

    def deformation_of(self, u: Array) -> Array:
        """Return d = D u, ``(spring, …)``: elongations [m], or temperature differences [K]."""
        return np.asarray(self.deformation @ u)

    def forces(self, deformation: Array) -> Array:
        """Return Dᵀ diag(weights) d, ``(coordinate, …)``."""
        return np.asarray(self.deformation.T @ (self.weights * deformation.T).T)

    def work(self, u: Array, deformation: Array, expansion: Any) -> Array:
        """Return uᵀ forces(e) for free expansions e, ``(spring, …)``, dense or sparse; ``deformation`` is D u.

        It is exactly 0 where u deforms nothing.
        """
        return np.asarray((self.weights * deformation.T) @ expansion)

    def energies(self, u: Array) -> Array:
        """Return terms whose sum is uᵀ K u, for one u ``(coordinate,)``."""
        return np.asarray(self.weights * self.deformation_of(u) ** 2)

    @property
    def tip_stiffness(self) -> float:
        """σ = ψᵀ K ψ = 1/(e_nᵀ K⁻¹ e_n) of one coordinate; exactly 0 where it moves freely."""
        return float(np.sum(self.weights * self.deformed[:, 0] ** 2))

    @abstractmethod
    def modes(self, count: int | None = None, held: bool = False) -> Modes:
        """Return the ``count`` lowest modes, all by default, with the boundary free, or ``held`` at 0."""

    @abstractmethod
    def solve(self, load: Array, held: bool = False) -> Array:
        """Return K⁻¹ f with the boundary free or ``held``, ``(coordinate,)``.

        Loads on an unconstrained part are balanced by its inertia first, f - M r with r its rigid motion, and the
        deformation is determined without a rigid motion (inertia relief).
        """

    def answer(self, row: Array) -> tuple[Array, Array]:
        """Return u = K⁻¹ w of a row w ``(coordinate,)``, and D u; of a tip that is held by ψ, which keeps digits."""
        if self.boundary == 1 and is_last(row) and self.tip_stiffness > 0:
            return self.constraint[:, 0] / self.tip_stiffness, self.deformed[:, 0] / self.tip_stiffness
        u = self.solve(row)
        return u, self.deformation_of(u)

    def static_solutions(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case, ``(case, coordinate)``, solved once for each distinct load."""
        first, which = distinct_rows(loads)
        return np.reshape([self.solve(load) for load in loads[first]], (-1, self.size))[which]

    @abstractmethod
    def shifted_solver(self) -> Callable[[Array, float], Array]:
        """Return a solver of (K + s M) u = f with the boundary held, of f ``(coordinate,)`` and s > 0."""

    @abstractmethod
    def rigid_motions(self, held: bool) -> Array:
        """Return the rigid motions, ``(coordinate, motion)``, with the boundary free or ``held``."""

    def moves(self, load: Array, held: bool = False) -> bool:
        """Tell whether a load ``(coordinate,)`` has a resultant on a rigid motion, the boundary free or ``held``."""
        rigid = self.rigid_motions(held)
        return bool(np.any(np.abs(rigid.T @ load) > UNBALANCED * np.abs(rigid).max(axis=0) * np.abs(load).sum()))

    @abstractmethod
    def spectrum(self) -> Array:
        """Return λ of all modes, ascending; of large pairs lowest and highest."""

    def largest(self) -> float:
        """Return the largest λ; for sparse matrices an estimate."""
        return float(self.spectrum()[-1])


@dataclass(frozen=True, eq=False)
class DensePair(Pair):
    """A pair with dense matrices: static solutions and modes by singular values of √weights · D."""

    inertia: Array
    weights: Array
    deformation: Array
    boundary: int = 1
    most_modes = MOST_FULL

    @property
    def dense(self) -> DensePair:
        """Itself."""
        return self

    @property
    def stiffness(self) -> Array:
        """K, ``(coordinate, coordinate)``."""
        return np.asarray(self.deformation.T @ (self.weights[:, None] * self.deformation))

    @property
    def weighted(self) -> Array:
        """√weights · D, whose singular values decide ranks, ``(spring, coordinate)``."""
        return np.asarray(np.sqrt(self.weights)[:, None] * self.deformation)

    @cached_property
    def constraint(self) -> Array:  # type: ignore[override]
        """ψ: the vectors of least deformation energy with one coordinate at 1, of minimum norm."""
        weighted, held = self.weighted, self.boundary
        return np.vstack([least_squares(weighted[:, :-held], -weighted[:, -held:]), np.eye(held)])

    @cached_property
    def deformed(self) -> Array:  # type: ignore[override]
        """D ψ, 0 where it is below the rounding that decides ranks."""
        deformed, weighted = self.deformation @ self.constraint, self.weighted
        rounding = 10 * max(weighted.shape) * np.finfo(float).eps  # ten times matrix_rank's: ψ is rounded too
        least = rounding * np.linalg.norm(weighted) * np.linalg.norm(self.constraint, axis=0)
        moved = np.linalg.norm(np.sqrt(self.weights) * deformed.T, axis=-1) > least
        return np.where(moved, deformed, 0.0)

    @cached_property
    def _free(self) -> Modes:
        return _singular_modes(self.inertia, self.weighted)

    @cached_property
    def _held(self) -> Modes:
        inside = np.s_[: -self.boundary]
        return _singular_modes(self.inertia[inside, inside], self.weighted[:, inside]).with_boundary_held(self.boundary)

    def modes(self, count: int | None = None, held: bool = False) -> Modes:
        return (self._held if held else self._free).lowest(count)

    def solve(self, load: Array, held: bool = False) -> Array:
        return np.asarray(_by_modes(self.modes(held=held), load[None])[0])

    def static_solutions(self, loads: Array) -> Array:
        return _by_modes(self._free, loads)

    def shifted_solver(self) -> Callable[[Array, float], Array]:
        modes = self._held
        return lambda load, shift: np.asarray(modes.shapes @ ((modes.shapes.T @ load) / (modes.values + shift)))

    def rigid_motions(self, held: bool) -> Array:
        modes = self.modes(held=held)
        return modes.shapes[:, modes.values == 0]

    def spectrum(self) -> Array:
        return self._free.values


def _by_modes(modes: Modes, loads: Array) -> Array:
    """Return the static response to loads ``(case, coordinate)`` summed over modes, without those of λ = 0."""
    elastic = modes.values > 0
    shapes = np.ascontiguousarray(modes.shapes[:, elastic])
    return project(shapes, project(shapes.T, loads) / modes.values[elastic])


def _singular_modes(inertia: Array, deformation: Array) -> Modes:
    """Solve deformationᵀ deformation φ = s² inertia φ through singular values s; λ = s².

    Singular values keep low frequencies of graded chains accurate to eps·ω_max/ω, eigenvalues of the squared matrix
    only to eps·(ω_max/ω)².
    """
    size = inertia.shape[0]
    if size == 0:
        return Modes(np.zeros(0), np.zeros((0, 0)))
    root = np.linalg.cholesky(inertia)
    scaled = solve_triangular(root, deformation.T, lower=True).T
    values, vectors = singular(scaled)
    rounding = max(scaled.shape) * np.finfo(float).eps  # numpy.linalg.matrix_rank's own rule
    values[values <= rounding * values.max(initial=0.0)] = 0.0
    shapes = solve_triangular(root, vectors, lower=True, trans="T")
    return Modes(values[::-1] ** 2, np.ascontiguousarray(shapes[:, ::-1]))
