"""Normal modes of a structure, with rigid and adiabatic ones decided by rank, and modal damping.

    C1 = a_M M + a_K K1 + M Φ diag(2 ζ ω) Φᵀ M + D

with Φ the modes of the structure with its tip free, φᵀ M φ = 1; rigid ones have ω = 0. In modes with the tip free all
terms but D are diagonal, with the tip held only Rayleigh's two. A reduced structure has the ratio in its own modes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.models._pair import Modes
from workflow.models._structure import Structure

_COUPLED = 1e-12
"""Damping between two modes, over the largest modal damping, up to which it is the rounding of a diagonal matrix."""


def poles(frequency: Array, damping: Array) -> NDArray[np.complex128]:
    """Return both roots λ of λ² + c λ + ω² = 0, complex, 1/s, shape ``(mode, 2)``.

    The smaller one of two real roots is ω² over the larger one, which loses no digits.
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

    Rayleigh damping is diagonal in them, c = a_M + a_K ω².
    """
    modes = structure.mechanical.modes()
    return replace(modes, values=np.sqrt(modes.values))


def thermal_modes(structure: Structure) -> Modes:
    """Return the thermal modes, values μ [1/s]: K2 χ = μ C2 χ, χᵀ C2 χ = 1; a mode decays as exp(-μ t)."""
    return structure.thermal.modes()


def frequencies(structure: Structure) -> Array:
    """Return ω of the modes, rad/s, ascending; for a chain without matrices the lowest and the highest only.

    For sparse matrices they are the lowest and about the highest.
    """
    return np.sqrt(structure.mechanical.spectrum())


def rates(structure: Structure) -> Array:
    """Return μ of the thermal modes, 1/s, ascending; for long chains and sparse matrices as in :func:`frequencies`."""
    return structure.thermal.spectrum()


def modal_coupling(structure: Structure, mechanical: Modes, thermal: Modes) -> Array:
    """Return G = φᵀ K12 χ, shape ``(mechanical mode, thermal mode)``.

    Rigid modes strain no spring, so no thermal force works on them: their rows are exactly zero.
    """
    pair, shapes = structure.mechanical, mechanical.shapes
    coupling = -pair.work(shapes, pair.deformation_of(shapes), structure.expansions(thermal.shapes))
    coupling[mechanical.values == 0] = 0.0
    return coupling


def modal_damping(structure: Structure, modes: Modes) -> Array:
    """Return the diagonal of φᵀ C1 φ of the modes with the tip free, 1/s, ``(mode,)``."""
    damping = coupled_damping(structure, modes)
    return damping if damping.ndim == 1 else np.diag(damping)


def coupled_damping(structure: Structure, modes: Modes) -> Array:
    """Return c of each mode with the tip free, 1/s, ``(mode,)``; φᵀ C1 φ, ``(mode, mode)``, if damping couples them."""
    damping = structure.damping.of_modes(modes.values)
    if structure.damper is None:
        return damping
    own = modes.shapes.T @ (structure.damper @ modes.shapes)
    each = np.diag(own)
    if np.all(np.abs(own - np.diag(each)) <= _COUPLED * np.abs(each).max(initial=0.0)):
        return np.asarray(damping + each)
    return np.asarray(np.diag(damping) + (own + own.T) / 2)


def couples_free_modes(structure: Structure) -> bool:
    """Tell whether damping couples the modes with the tip free."""
    return structure.damper is not None and coupled_damping(structure, mechanical_modes(structure)).ndim == 2


def needs_matrices(structure: Structure) -> bool:
    """Tell whether a structure cannot be stepped in uncoupled modes scaled by the tip."""
    return structure.load is not None or couples_free_modes(structure)
