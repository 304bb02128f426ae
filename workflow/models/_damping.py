"""Damping C1 in modes: Rayleigh's, a ratio ζ of every mode with the tip free, or a matrix of its own.

    C1 = a_M M + a_K K1 + M Φ diag(2 ζ ω) Φᵀ M + D

with Φ the modes of the structure with its tip free, φᵀ M φ = 1; rigid ones have ω = 0. With the tip free all but D are
diagonal in modes, with the tip held only Rayleigh's two are. A reduced structure has the ratio in its own modes.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.models._modes import mechanical_modes
from workflow.models._pair import Modes
from workflow.models._structure import Structure

_COUPLED = 1e-12
"""Share of the largest modal damping below which that between two modes is rounding of a matrix that is diagonal."""


def modal_damping(structure: Structure, modes: Modes) -> Array:
    """Return φᵀ C1 φ of each mode with the tip free, 1/s, ``(mode,)``; what couples them is left out."""
    damping = structure.damping.of_modes(modes.values, modes.inertia)
    if structure.damper is None:
        return damping
    return np.asarray(damping + np.diag(modes.shapes.T @ (structure.damper @ modes.shapes)))


def coupled_damping(structure: Structure, modes: Modes) -> Array:
    """Return c of each mode with the tip free, 1/s, ``(mode,)``; φᵀ C1 φ, ``(mode, mode)``, if damping couples them."""
    damping = structure.damping.of_modes(modes.values, modes.inertia)
    if structure.damper is None:
        return damping
    own = modes.shapes.T @ (structure.damper @ modes.shapes)
    if is_diagonal(own):
        return np.asarray(damping + np.diag(own))
    return np.asarray(np.diag(damping) + (own + own.T) / 2)


def held_damping(structure: Structure, modes: Modes) -> Array:
    """Return φᵀ C1 φ of the modes with the tip held, 1/s, ``(mode, mode)``.

    Shapes have the row of the tip, which is 0.
    """
    projected = modes.shapes.T @ (structure.damping_matrix @ modes.shapes)
    return np.asarray((projected + projected.T) / 2)


def is_rayleigh(structure: Structure) -> bool:
    """Tell whether damping is diagonal in the modes of any support: a_M M + a_K K1 alone."""
    return structure.damper is None and structure.damping.ratio == 0


def couples_free_modes(structure: Structure) -> bool:
    """Tell whether damping couples the modes with the tip free."""
    if structure.damper is None:
        return False
    shapes = mechanical_modes(structure).shapes
    return not is_diagonal(shapes.T @ (structure.damper @ shapes))


def needs_matrices(structure: Structure) -> bool:
    """Tell whether a structure cannot be stepped in modes scaled by the tip."""
    return structure.load is not None or couples_free_modes(structure)


def is_diagonal(matrix: Array) -> bool:
    """Tell whether what is beside the diagonal of a damping matrix is rounding."""
    beside = np.abs(matrix - np.diag(np.diag(matrix)))
    return bool(np.all(beside <= _COUPLED * np.abs(np.diag(matrix)).max(initial=0.0)))
