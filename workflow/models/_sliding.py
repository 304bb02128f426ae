"""Friction of a casing that slides without reversing: the contact force acts along n - µt, the gap is measured along n.

    M x'' + C1 x' + K1 x + K12 θ = f - λ (e_n - µ t),   x_n <= d

The compliance of the tip to such a force is that to a force along e_n times

    at an impact   nᵀM⁻¹(n - µt) / nᵀM⁻¹n = 1 - µ a,      at standstill   nᵀK1⁻¹(n - µt) / nᵀK1⁻¹n = 1 - µ s,   s = ψᵀt,

with the constraint mode ψ ∝ K1⁻¹ n. Where the first is not positive an impulse pushes the tip into the casing: there is
no impact law (Painlevé paradox). Where the second is not, a tip at rest on its casing is unstable.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.models._modes import mechanical_modes
from workflow.models._structure import Structure


class CriticalFriction(NamedTuple):
    """Friction coefficients from which on the tip's compliance to a contact force is not positive; ``inf`` for none."""

    impact: float
    """1/a: no impact law."""
    standstill: float
    """1/s: no stable rest on the casing."""


def directions(structure: Structure, friction: Array) -> Array:
    """Return e_n - µ t for each friction coefficient µ ``(case,)``, ``(case, mechanical)``."""
    vectors = np.tile(structure.mechanical.unit_tip, (friction.size, 1))
    if structure.tangent is not None:
        vectors -= friction[:, None] * structure.tangent
    return vectors


def static_share(structure: Structure) -> float:
    """Return s = ψᵀt, 1: tangential over normal displacement at standstill by a force along the normal."""
    if structure.tangent is None:
        return 0.0
    return float(structure.mechanical.constraint @ structure.tangent)


def critical_friction(structure: Structure) -> CriticalFriction:
    """Return the critical friction coefficients of a structure."""
    if structure.tangent is None:
        return CriticalFriction(np.inf, np.inf)
    modes = mechanical_modes(structure)
    inertial = modes.inertia > 0
    tip, along = modes.tip[inertial], modes.shapes.T[inertial] @ structure.tangent
    normal, aside, static = np.dot(tip, tip), np.dot(tip, along), static_share(structure)
    return CriticalFriction(normal / aside if aside > 0 else np.inf, 1 / static if static > 0 else np.inf)
