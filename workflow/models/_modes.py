"""Normal modes of a structure, with rigid and adiabatic ones decided by rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from workflow.models._structure import Array, Structure


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes y = shapes · amplitudes that diagonalise an inertia and a stiffness.

    Attributes
    ----------
    values
        Mechanical: ω, rad/s, ascending, exactly 0 for rigid modes. Thermal: μ, 1/s, ascending,
        exactly 0 for adiabatic modes. Shape ``(mode,)``.
    shapes
        Columns with shapesᵀ · inertia · shapes = 1, shape ``(coordinate, mode)``.
    """

    values: Array
    shapes: Array

    @property
    def tip(self) -> Array:
        """Participation of the tip (the last coordinate) in each mode, shape ``(mode,)``."""
        return np.asarray(self.shapes[-1])


def singular_modes(inertia: Array, deformation: Array) -> Modes:
    """Solve deformationᵀ deformation φ = s² inertia φ through singular values s.

    Singular values keep low frequencies of graded chains accurate to eps·ω_max/ω where the
    eigenvalues of the squared matrix would only be so to eps·(ω_max/ω)².
    """
    size = inertia.shape[0]
    if size == 0:
        return Modes(np.zeros(0), np.zeros((0, 0)))
    root = scipy.linalg.cholesky(inertia, lower=True)
    scaled = scipy.linalg.solve_triangular(root, deformation.T, lower=True).T
    _, s, vt = scipy.linalg.svd(scaled, full_matrices=scaled.shape[0] < size)
    values = np.zeros(size)
    values[: s.size] = s
    rounding = max(scaled.shape) * np.finfo(float).eps  # numpy.linalg.matrix_rank's own rule
    values[values <= rounding * values.max(initial=0.0)] = 0.0
    shapes = scipy.linalg.solve_triangular(root, vt.T, lower=True, trans="T")
    return Modes(values[::-1].copy(), np.ascontiguousarray(shapes[:, ::-1]))


def poles(frequency: Array, damping: Array) -> NDArray[np.complex128]:
    """Return both roots λ of λ² + c λ + ω² = 0, complex, 1/s, shape ``(mode, 2)``."""
    root = np.emath.sqrt((damping / 2) ** 2 - frequency**2 + 0j)
    return np.stack([-damping / 2 + root, -damping / 2 - root], axis=-1)


def mechanical_modes(structure: Structure) -> Modes:
    """Return the undamped mechanical modes: K1 φ = ω² M φ, φᵀ M φ = 1.

    Rayleigh damping is diagonal in them, c = a_M + a_K ω².
    """
    return singular_modes(structure.mass, np.sqrt(structure.springs)[:, None] * structure.elongation)


def thermal_modes(structure: Structure) -> Modes:
    """Return the thermal modes: K2 χ = μ C2 χ, χᵀ C2 χ = 1; a mode decays as exp(-μ t)."""
    roots = singular_modes(structure.heat_capacity, np.sqrt(structure.conductors)[:, None] * structure.difference)
    return Modes(roots.values**2, roots.shapes)


def modal_coupling(structure: Structure, mechanical: Modes, thermal: Modes) -> Array:
    """Return G = φᵀ K12 χ, shape ``(mechanical mode, thermal mode)``.

    Rigid modes strain no spring, so no thermal force works on them: their rows are exactly zero.
    """
    coupling = mechanical.shapes.T @ structure.coupling_matrix @ thermal.shapes
    coupling[mechanical.values == 0] = 0.0
    return coupling
