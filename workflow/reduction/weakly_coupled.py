"""Weakly coupled: craig_bampton with the quasi-static deformation by temperatures added.

    x = Σ φ_j η_j + ψ x_n + Γ θ_r,   v = Σ φ_j η_j' + ψ v_n,   Γ = G - Σ φ_j φ_jᵀ M G,   G = -K1⁻¹ K12 Θ

with K1⁻¹ of the structure with its tip held, Θ the thermal basis of craig_bampton, and Γ the part of the deformation G
outside the span of the fixed-interface modes φ. The coupled problem has such eigenvectors: a slow thermal mode deforms
the structure quasi-statically. Γ is orthogonal to the modes in M, K1 and C1 and to ψ in K1, and the inertia of Γ θ_r''
is neglected, which is weak coupling. So the tip moves as with craig_bampton to rounding, as the constraint mode
contains its static response already; the gain is in the interior: displacements and spring forces of a warm structure
are exact without any mode, and so is a warm start at rest (`projection_residual`). α_c is exact.

Source: Nachtergaele, Rixen, Steenhoek, J. Comput. Appl. Math. 234 (2010) 2272-2278.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Structure
from workflow.reduction._reduction import Vectors
from workflow.reduction.craig_bampton import mechanical, thermal

__all__ = ["CONTACTS", "carried", "mechanical", "thermal"]

CONTACTS = frozenset({"several"})


def carried(structure: Structure, mechanical: Vectors, thermal: Vectors) -> Array:
    """Return Γ, m/K, ``(node, thermal)``."""
    pair = structure.mechanical
    static = np.column_stack([pair.solve(force, held=True) for force in structure.thermal_forces(thermal.shapes).T])
    modes = mechanical.shapes[:, : -pair.boundary]
    return static - modes @ (pair.inertia_of(modes).T @ static)
