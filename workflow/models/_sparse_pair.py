"""A pair of sparse stiffness and inertia, the tip last: static solutions and the lowest modes, tip held and free.

One factorisation, of the stiffness K_ii with the tip held, serves all of them. With the constraint mode
ψ = [-K_ii⁻¹ K_in, 1] and the stiffness of the tip σ = K_nn + K_ni ψ_i,

    K⁻¹ f = [K_ii⁻¹ f_i, 0] + ψ (ψᵀ f)/σ,

so that solutions with the tip free need no other factorisation. The modes nearest to 0 are found by Lanczos iteration
on K⁻¹ M (shift-invert), and their residuals are checked. No array has n × n entries.

Source: Ericsson and Ruhe, Math. Comp. 35 (1980) 1251-1268; Lehoucq, Sorensen and Yang, ARPACK users' guide (SIAM 1998).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._factors import NotHeldError, Solver, elimination_order, factorised
from workflow.models._pair import (
    MOST_FULL,
    DensePair,
    Modes,
    Pair,
    Part,
    TooManyCoordinatesError,
    factored,
    scale_of,
    symmetric,
)

_RESIDUAL = 1e-8
"""Largest residual K φ - λ M φ of a mode over λ M φ, besides the rounding of K φ: the relative error of the eigenvalue
is its square."""

_ROUNDING = 100 * float(np.finfo(float).eps)
"""Rounding of K φ over |K| |φ|, for sums of about a hundred terms."""

_RIGID = 1e-13
"""Stiffness of the tip over K_nn up to which the tip moves freely: the rounding of zero. A chain of 1e5 equal springs
has 1e-5."""

_LANCZOS = 30
"""Lanczos steps for the ends of a spectrum, which converge first."""

_ITERATIONS, _BLOCK = 40, 4
"""Iterations and vectors for the largest eigenvalue: of a mesh of 36 000 nodes of bricks it is then 4 % low."""

_NEGATIVE = 1e-10
"""Magnitude of a negative eigenvalue of the matrix with unit diagonal above which it is indefinite: rounding of
assembled entries leaves 1e-13."""


MOST_REDUCED = 300
"""Largest number of modes or vectors of each kind of a sparse structure: each is an array of the structure's size."""

_CORRECTIONS = 2
"""Corrections of the constraint mode: each multiplies its error by condition number times rounding."""


@dataclass(frozen=True, eq=False)
class SparsePair(Pair):
    """K and M as matrices ``(coordinate, coordinate)``."""

    stiffness: scipy.sparse.csc_array
    inertia: scipy.sparse.csc_array
    """``stiffness``, ``inertia``: K1 and M [N/m, kg], or K2 and C2 [W/K, J/K]. Coordinates other than the tip may have
    no inertia: they are condensed statically in every vector that is found here."""
    boundary: int = 1
    most_modes = MOST_REDUCED

    @cached_property
    def dense(self) -> DensePair:
        deformation = self._springs.deformation
        return DensePair(self.inertia.toarray(), np.ones(len(deformation)), deformation, self.boundary)

    @cached_property
    def _springs(self) -> Part:
        if self.size > MOST_FULL:
            raise TooManyCoordinatesError(self.size, MOST_REDUCED)
        return factored(self.stiffness.toarray(), "stiffness")

    def expansion_of_springs(self, expansion: Any) -> Array:
        return self._springs.expansion(-expansion.toarray())

    @property
    def deformation(self) -> scipy.sparse.csc_array:
        """K itself, as there are no springs."""
        return self.stiffness

    @property
    def weights(self) -> Array:  # type: ignore[override]
        """1 each."""
        return np.ones(self.size)

    def forces(self, deformation: Array) -> Array:
        return deformation

    def work(self, u: Array, deformation: Array, expansion: Any) -> Array:
        return np.asarray(u.T @ expansion)

    def energies(self, u: Array) -> Array:
        return np.asarray(u * (self.stiffness @ u))

    @cached_property
    def _interior(self) -> Solver:
        return factorised(self.stiffness[self._inside], self._order)

    @property
    def _inside(self) -> tuple[slice, slice]:
        return np.s_[: -self.boundary, : -self.boundary]

    @cached_property
    def _order(self) -> Array | None:
        return elimination_order((abs(self.stiffness) + abs(self.inertia))[self._inside])

    @cached_property
    def constraint(self) -> Array:  # type: ignore[override]
        """ψ after iterative refinement with residuals in extended precision.

        On a finite element blade processors agree on S to 2e-12 and on α_c to 2e-11, without refinement to 7e-10.
        """
        held = self.boundary
        below = self.stiffness[:-held, -held:].toarray()
        shapes = np.vstack([np.column_stack([-self._interior(column) for column in below.T]), np.eye(held)])
        longer = self.stiffness.astype(np.longdouble)  # the longest floats of the processor
        for shape in [*shapes.T] * _CORRECTIONS:
            shape[:-held] -= self._interior((longer @ shape)[:-held].astype(np.float64))
        return shapes

    @property
    def tip_stiffness(self) -> float:
        return float(self._boundary_stiffness[-1, -1])

    @cached_property
    def _boundary_stiffness(self) -> Array:
        """σ = ψᵀKψ, ``(boundary, boundary)``; 0 where the boundary moves freely."""
        stiffness = symmetric(self.stiffness[-self.boundary :] @ self.constraint)
        root = scale_of(self.stiffness[-self.boundary :, -self.boundary :].toarray())
        is_held = np.linalg.eigvalsh(stiffness / root / root[:, None])[0] > _RIGID
        return stiffness if is_held else np.zeros_like(stiffness)

    @property
    def deformed(self) -> Array:  # type: ignore[override]
        """K ψ = σ at the boundary."""
        forces = np.zeros(self.constraint.shape)
        forces[-self.boundary :] = self._boundary_stiffness
        return forces

    def solve(self, load: Array, held: bool = False) -> Array:
        """Return K⁻¹ f, ``(coordinate,)``; where the tip moves freely, with inertia relief and the tip at 0."""
        if held:
            return np.append(self._interior(load[: -self.boundary]), np.zeros(self.boundary))
        shapes, acting = self.constraint, self.constraint.T @ load
        if self.tip_stiffness > 0:
            return self.solve(load, held=True) + shapes @ np.linalg.solve(self._boundary_stiffness, acting)
        inertia = self.inertia_of(shapes)
        return self.solve(load - inertia @ np.linalg.solve(shapes.T @ inertia, acting), held=True)

    def rigid_motions(self, held: bool) -> Array:
        """Return the rigid motion of a tip that moves freely; the pair has no other one."""
        return self.constraint[:, : self.boundary * (self.tip_stiffness == 0 and not held)]

    def shifted_solver(self) -> Callable[[Array, float], Array]:
        @lru_cache(maxsize=1)
        def factors(shift: float) -> Solver:
            return factorised((self.stiffness + shift * self.inertia)[self._inside], self._order)

        held = self.boundary
        return lambda load, shift: np.append(factors(shift)(load[:-held]), np.zeros(held))

    def modes(self, count: int | None = None, held: bool = False) -> Modes:
        """Return the lowest modes; where the tip moves freely the lowest λ is exactly 0."""
        if count is None:
            return self.dense.modes(held=held)
        if held:
            inside = self.stiffness[self._inside], self.inertia[self._inside]
            return Modes(*_lowest(*inside, self._interior, count, 0.0)).with_boundary_held(self.boundary)
        if self.tip_stiffness > 0 or self.size == 1:
            return Modes(*_lowest(self.stiffness, self.inertia, self.solve, count, 0.0))
        shift = float(self.modes(1, held=True).values[0])
        moved = factorised(self.stiffness + shift * self.inertia)
        values, shapes = _lowest(self.stiffness, self.inertia, moved, count, -shift)
        values[:1] = 0.0
        return Modes(values, shapes)

    def spectrum(self) -> Array:
        lowest = float(self.modes(1).values[0])
        return np.array([lowest, max(self._highest(), lowest)])

    def largest(self) -> float:
        """Estimate the largest eigenvalue with the inertia lumped on its diagonal: its size, for shifts."""
        lumped = np.asarray(abs(self.inertia).sum(axis=0))
        root = scipy.sparse.diags_array(np.where(lumped > 0, 1 / np.sqrt(np.where(lumped > 0, lumped, 1.0)), 0.0))
        most = _spectrum_ends(scipy.sparse.csc_array(root @ self.stiffness @ root))[1]
        return max(most, float(self.modes(1).values[0]))

    def _highest(self) -> float:
        """Estimate the largest eigenvalue of the pair from inside, some percent too low."""
        carried = np.flatnonzero(self.inertia.diagonal() > 0)
        stiffness, inertia = (matrix[carried][:, carried] for matrix in (self.stiffness, self.inertia))
        scale = scipy.sparse.diags_array(1 / inertia.diagonal())
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that it has not converged
            start = np.random.default_rng(0).standard_normal((carried.size, min(_BLOCK, carried.size)))
            found = scipy.sparse.linalg.lobpcg(stiffness, start, inertia, scale, maxiter=_ITERATIONS, largest=True)
        return float(np.max(found[0]))

    def refuse_unusable(self, kind: str) -> None:
        """Raise where the tip has no inertia or a matrix is indefinite; ``kind`` names the coordinates."""
        if not np.all(self.inertia.diagonal()[-self.boundary :] > 0):
            raise NotHeldError(f"the contact acts on what has no inertia, among {kind}")
        for name, matrix in (("inertia", self.inertia), ("stiffness", self.stiffness)):
            diagonal = matrix.diagonal()
            root = scipy.sparse.diags_array(1 / np.sqrt(np.where(diagonal > 0, diagonal, 1.0)))
            if diagonal.min() < 0 or _spectrum_ends(scipy.sparse.csc_array(root @ matrix @ root))[0] < -_NEGATIVE:
                raise NotHeldError(f"the {name} is indefinite, among {kind}")


def sparse_congruent(matrix: Any, basis: Any) -> scipy.sparse.csc_array:
    """Return basisᵀ · matrix · basis, symmetric to the bit."""
    transformed = scipy.sparse.csc_array(basis.T @ scipy.sparse.csc_array(matrix) @ basis)
    transformed = scipy.sparse.csc_array((transformed + transformed.T) / 2)
    transformed.sort_indices()
    return transformed


def _start(size: int) -> Array:
    """Return the start vector of all iterations: the same on every run, without symmetry."""
    return np.random.default_rng(0).standard_normal(size)


def _lowest(
    stiffness: scipy.sparse.csc_array, inertia: scipy.sparse.csc_array, solve: Solver, count: int, shift: float
) -> tuple[Array, Array]:
    """Return the ``count`` eigenvalues next above a shift, ascending, and eigenvectors normalised by the inertia.

    Raises
    ------
    NotHeldError
        An eigenvalue is negative, or one was not found to its accuracy.
    """
    size = inertia.shape[0]
    if count == 0:
        return np.zeros(0), np.zeros((size, 0))
    if 3 * count > size:  # too many for Lanczos iteration
        values, shapes = scipy.linalg.eigh(stiffness.toarray(), inertia.toarray(), subset_by_index=(0, count - 1))
        return np.where(np.abs(values) > _ROUNDING * np.abs(values).max(), values, 0.0), shapes
    opinv: Any = scipy.sparse.linalg.LinearOperator(
        (size, size), matvec=lambda load: solve(np.ravel(load)), dtype=np.float64
    )
    try:
        values, shapes = scipy.sparse.linalg.eigsh(stiffness, count, inertia, sigma=shift, OPinv=opinv, v0=_start(size))
    except scipy.sparse.linalg.ArpackError as error:
        raise NotHeldError(f"{count} modes of {size} coordinates were not found: {error}") from None
    order = np.argsort(values, kind="stable")
    values, shapes = values[order], shapes[:, order]
    _check(stiffness, inertia, values, shapes, shift)
    return values, shapes


def _check(
    stiffness: scipy.sparse.csc_array, inertia: scipy.sparse.csc_array, values: Array, shapes: Array, shift: float
) -> None:
    """Raise where signs or residuals of modes are wrong."""
    if not np.all(values > 10 * min(shift, 0.0) * _RESIDUAL):
        raise NotHeldError(f"its eigenvalue {values.min():.3g} is negative: stiffness is indefinite")
    carried = inertia @ shapes * values
    missing = np.linalg.norm(stiffness @ shapes - carried, axis=0)
    rounding = _ROUNDING * np.linalg.norm(abs(stiffness) @ np.abs(shapes), axis=0)
    allowed = _RESIDUAL * np.linalg.norm(carried, axis=0) + rounding
    if not np.all(missing <= allowed):
        worst = int(np.argmax(missing - allowed))
        raise NotHeldError(f"mode {worst + 1} has a residual of {missing[worst]:.3g}, more than {allowed[worst]:.3g}")


def _spectrum_ends(matrix: scipy.sparse.csc_array) -> tuple[float, float]:
    """Estimate the ends of the spectrum from inside by some steps of Lanczos iteration."""
    vector = _start(matrix.shape[0])
    vector /= np.linalg.norm(vector)
    before, beside = np.zeros_like(vector), 0.0
    diagonal, off = [], []
    for _ in range(min(_LANCZOS, matrix.shape[0])):
        new = matrix @ vector - beside * before
        diagonal.append(float(new @ vector))
        new -= diagonal[-1] * vector
        before, beside = vector, float(np.linalg.norm(new))
        if beside <= _ROUNDING * max(map(abs, diagonal)):
            break
        off.append(beside)
        vector = new / beside
    beside_each = np.array(off[: len(diagonal) - 1])
    ritz_values = np.linalg.eigvalsh(np.diag(diagonal) + np.diag(beside_each, 1) + np.diag(beside_each, -1))
    return float(ritz_values[0]), float(ritz_values[-1])
