"""Weakly coupled: as craig_bampton, and temperatures carry their quasi-static deformation with them.

    x = Σ φ_j η_j + ψ x_n + Γ θ_r,   v = Σ φ_j η_j' + ψ v_n,   Γ = G - Σ φ_j φ_jᵀ M G,   G = -K1⁻¹ K12 Θ

with K1⁻¹ of the structure whose tip is held, Θ the thermal basis of craig_bampton, and Γ that part of the deformation G
which the fixed-interface modes φ do not hold. The coupled problem has such eigenvectors: a mode of the heat deforms
the structure as if at standstill, as heat is slow. Γ is orthogonal to the modes in M, K1 and C1 and to ψ in K1, and
inertia of Γ θ_r'' is left out, as weak coupling means. So the tip moves as with craig_bampton, whose constraint mode
holds the static answer of the tip already, to rounding; what is gained lies inside: displacements and spring
forces of a warm structure are right without a mode, and a warm start at rest is held (`projection_residual`). α_c
is exact.

Source: Nachtergaele, Rixen, Steenhoek, J. Comput. Appl. Math. 234 (2010) 2272-2278.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Structure
from workflow.reduction._reduction import Vectors
from workflow.reduction.craig_bampton import mechanical, thermal

__all__ = ["carried", "mechanical", "thermal"]


def carried(structure: Structure, mechanical: Vectors, thermal: Vectors) -> Array:
    """Return Γ, m/K, ``(node, thermal)``."""
    pair = structure.mechanical
    static = np.column_stack([pair.answer(force, held=True) for force in structure.thermal_forces(thermal.shapes).T])
    modes = mechanical.shapes[:, :-1]
    return static - modes @ (pair.inertia_of(modes).T @ static)
