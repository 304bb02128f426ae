"""Rubin: modes with the tip free and the residual flexibility of the tip, whose inertia is kept.

Mechanical: x = Σ φ_j η_j + G_r e_n f with the lowest modes of the whole structure, K1 φ = ω² M φ, and the residual
flexibility G_r = K1⁻¹ - Σ φ_j φ_jᵀ/ω_j² over the modes kept. K1⁻¹ e_n is along the constraint mode ψ, so that
{φ_1 … φ_m, G_r e_n} spans the same space as ψ and the modes relative to it, φ_j - φ_j,n ψ, which retain the tip as a
coordinate; several contacts have a ψ each. Mass and stiffness are projected on all of them (Rubin's method; MacNeal's
neglects the inertia of G_r e_n). Where the structure can move as a rigid body ψ is that motion, and the flexibility of
the elastic modes, Σ φ_j φ_j,n/ω_j² over all of them, is the first vector. Thermal: as craig_bampton. α_c is exact.

Source: Rubin, AIAA Journal 13 (1975) 995-1006; Craig and Kurdila, Fundamentals of structural dynamics (2006), 17.6.
"""

from __future__ import annotations

import numpy as np

from workflow.models import Structure
from workflow.reduction._reduction import Vectors, mechanical_vectors, relative
from workflow.reduction.craig_bampton import thermal

__all__ = ["CONTACTS", "mechanical", "thermal"]

CONTACTS = frozenset({"several"})


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest free modes relative to the constraint modes, and these."""
    pair, held = structure.mechanical, structure.mechanical.boundary
    modes = pair.modes(count + held)  # some may be constraint modes
    loose = [unit for unit in np.eye(held, pair.size, pair.size - held) if pair.moves(unit)]
    shapes = np.column_stack([*(pair.solve(unit) for unit in loose), modes.shapes])
    return mechanical_vectors(structure, relative(shapes, pair.constraint, pair.inertia_of, count))
