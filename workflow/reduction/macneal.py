"""MacNeal: modes with the tip free and the residual flexibility of the tip, whose inertia is neglected.

Mechanical: x = Σ φ_j η_j + G_r e_n f with the lowest modes of the whole structure, K1 φ = ω² M φ, and the residual
flexibility G_r = K1⁻¹ - Σ φ_j φ_jᵀ/ω_j² over the modes kept. With g = e_nᵀ G_r e_n and ρ = G_r e_n/g, which is
orthogonal to the modes in M and K1, f = (x_n - Σ φ_j,n η_j)/g retains the tip as a coordinate:

    x = Σ (φ_j - φ_j,n ρ) η_j + ρ x_n,   M = diag(1, …, 1, 0).

It is :mod:`~workflow.reduction.rubin` without the inertia of ρ, so that the tip has no mass and contact no impacts, see
:mod:`workflow.schemes.moreau`. A rigid-body motion of the structure is the first mode. Where the modes kept contain all
of the tip's flexibility (a free mass as tip, for instance) there is no residual, and the basis is that of rubin.
Thermal: as craig_bampton. α_c is exact.

Source: MacNeal, Computers & Structures 1 (1971) 581-601; Craig and Kurdila, Fundamentals of structural dynamics
(2006), 17.6.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Structure
from workflow.reduction import rubin
from workflow.reduction._reduction import DEPENDENT, Orthonormal, Vectors, massless_vectors
from workflow.reduction.rubin import thermal

__all__ = ["mechanical", "thermal"]


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest ``count`` free modes relative to ρ, and ρ without inertia."""
    pair, constraint = structure.mechanical, structure.mechanical.constraint
    is_held = pair.tip_stiffness > 0
    response = constraint if is_held else pair.solve(pair.unit_tip)  # static response to a tip force, up to a factor
    span = Orthonormal(pair.size, count + 1, pair.inertia_of)
    if count > 0:
        if not is_held:
            span.add(constraint)
        span.add_each(pair.modes(count).shapes)
    left = span.add(response) if is_held or count > 0 else None
    if left is None or np.dot(left, pair.inertia_of(response)) * left[-1] <= DEPENDENT * response[-1]:
        return rubin.mechanical(structure, count, duration)
    modes, tip = span.all()[:, :count], left / left[-1]
    interior = modes - np.outer(tip, modes[-1])
    interior[-1] = 0.0
    return massless_vectors(pair, interior, tip, pair.deformation_of(tip), modes)
