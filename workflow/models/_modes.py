"""Normal modes of a structure, with rigid and adiabatic ones decided by rank."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from workflow.kernels import Array
from workflow.kernels.algebra import singular
from workflow.models._structure import Structure


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
    has_static
        Whether the last column is the static deformation by a force on a tip without mass: its inertia is 0 and its
        value the root of its stiffness, √(N/m), so that shapesᵀ · stiffness · shapes = values² holds for it too.
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


def singular_modes(inertia: Array, deformation: Array, whole: Array | None = None) -> Modes:
    """Solve deformationᵀ deformation φ = s² inertia φ through singular values s.

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
    return Modes(values[::-1].copy(), np.ascontiguousarray(shapes[:, ::-1]))


def poles(frequency: Array, damping: Array) -> NDArray[np.complex128]:
    """Return both roots λ of λ² + c λ + ω² = 0, complex, 1/s, shape ``(mode, 2)``.

    The smaller one of two real roots is ω² by the larger one: their sum would lose its digits.
    """
    half = damping / 2
    square = half**2 - frequency**2
    root = np.sqrt(np.abs(square))
    pairs = np.empty((frequency.size, 2), dtype=np.complex128)
    pairs.real, pairs.imag = -half[:, None], root[:, None] * np.array([1.0, -1.0])
    real = square >= 0
    far = -(half + root)[real]
    pairs[real, 1] = far
    pairs[real, 0] = np.divide(frequency[real] ** 2, far, out=np.zeros_like(far), where=far != 0)
    return pairs


def mechanical_modes(structure: Structure) -> Modes:
    """Return the undamped mechanical modes: K1 φ = ω² M φ, φᵀ M φ = 1.

    Rayleigh damping is diagonal in them, c = a_M + a_K ω². Of a tip without mass the static deformation comes last.
    """
    strain = np.sqrt(structure.springs)[:, None] * structure.elongation
    if structure.has_massless_tip:
        return _condensed_modes(structure.mass, strain)
    return singular_modes(structure.mass, strain)


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
    return Modes(np.append(modes.values, np.sqrt(stiffness)), shapes, has_static=True)


def thermal_modes(structure: Structure) -> Modes:
    """Return the thermal modes: K2 χ = μ C2 χ, χᵀ C2 χ = 1; a mode decays as exp(-μ t)."""
    roots = singular_modes(structure.heat_capacity, np.sqrt(structure.conductors)[:, None] * structure.difference)
    return Modes(roots.values**2, roots.shapes)


def modal_coupling(structure: Structure, mechanical: Modes, thermal: Modes) -> Array:
    """Return G = φᵀ K12 χ, shape ``(mechanical mode, thermal mode)``.

    Rigid modes strain no spring, so no thermal force works on them: their rows are exactly zero.
    """
    forces = (structure.springs * structure.expansions(thermal.shapes).T).T
    coupling = -structure.elongations(mechanical.shapes).T @ forces
    coupling[mechanical.values == 0] = 0.0
    return coupling
