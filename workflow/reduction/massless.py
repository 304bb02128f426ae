"""Massless: Craig–Bampton with the inertia of the tip redistributed to the modes, so that the tip has none.

Mechanical: x = Σ φ_j η_j + ψ̃ x_n with the fixed-interface modes φ and, instead of the constraint mode ψ,

    ψ̃ = ψ - Φ Φᵀ M ψ,   that is Ψ̃ = Ψ - Φ Φᵀ (M_ib + M_ii Ψ) in the interior (i) and 1 at the tip (b).

With Φ it spans the same space, and it is orthogonal to Φ in M. The inertia of ψ̃, which falls as modes are added, is
neglected: M = diag(1, …, 1, 0). Contact has no impacts then, see :mod:`workflow.schemes.moreau`. A free tip whose
inertia no mode contains keeps its mass, as with craig_bampton. Thermal: as craig_bampton. α_c is exact: S and K2⁻¹ e_n
need the constraint modes only.

Source: Monjaraz Tec, Gross, Krack, arXiv 2111.07693.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Structure
from workflow.reduction._reduction import (
    DEPENDENT,
    Vectors,
    fixed_interface_modes,
    massless_vectors,
    mechanical_vectors,
)
from workflow.reduction.craig_bampton import thermal

__all__ = ["mechanical", "thermal"]


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest ``count`` fixed-interface modes, and ψ̃ without inertia."""
    modes = fixed_interface_modes(structure, count)
    pair, constraint = structure.mechanical, structure.mechanical.constraint
    inertia = pair.inertia_of(constraint)
    share = modes.T @ inertia
    if pair.tip_stiffness == 0 and np.dot(share, share) <= DEPENDENT**2 * np.dot(constraint, inertia):
        return mechanical_vectors(structure, modes)
    tip = constraint - modes @ share
    return massless_vectors(pair, modes, tip, pair.deformed - pair.deformation_of(modes) @ share, modes)
