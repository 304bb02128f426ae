"""Normal modes of a structure, with rigid and adiabatic ones decided by rank."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.models._pair import Modes
from workflow.models._structure import Structure


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
    """Return the undamped mechanical modes, values ω [rad/s]: K1 φ = ω² M φ, φᵀ M φ = 1.

    Rayleigh damping is diagonal in them, c = a_M + a_K ω². Of a tip without mass the static deformation comes last, its
    value the root of its stiffness, √(N/m).
    """
    modes = structure.mechanical.modes()
    return replace(modes, values=np.sqrt(modes.values))


def thermal_modes(structure: Structure) -> Modes:
    """Return the thermal modes, values μ [1/s]: K2 χ = μ C2 χ, χᵀ C2 χ = 1; a mode decays as exp(-μ t)."""
    return structure.thermal.modes()


def modal_coupling(structure: Structure, mechanical: Modes, thermal: Modes) -> Array:
    """Return G = φᵀ K12 χ, shape ``(mechanical mode, thermal mode)``.

    Rigid modes strain no spring, so no thermal force works on them: their rows are exactly zero.
    """
    pair, shapes = structure.mechanical, mechanical.shapes
    coupling = -pair.work(shapes, pair.deformation_of(shapes), structure.expansions(thermal.shapes))
    coupling[mechanical.values == 0] = 0.0
    return coupling
