"""Craig–Bampton: fixed-interface modes and constraint modes; for heat, modes relative to the constraint modes.

Mechanical: x = Σ φ_j η_j + ψ x_n with the lowest modes of the structure with its tip held, K1 φ = ω² M φ, φ_n = 0,
and the constraint mode ψ, (K1 ψ)_i = 0 at all nodes but the tip, ψ_n = 1. Thermal: θ = Σ (χ_j - χ_j,n ψ) τ_j + ψ θ_n
with the slowest modes of the whole structure, K2 χ = μ C2 χ, and the thermal constraint mode ψ. α_c is exact: S and
K2⁻¹ e_n need the constraint modes only. Several contacts are held together, and have a constraint mode each.

Source: Craig and Bampton, AIAA Journal 6 (1968) 1313-1319; Thorin, Guérin, Legrand (extended abstract).
"""

from __future__ import annotations

from workflow.models import Structure
from workflow.reduction._reduction import (
    Vectors,
    fixed_interface_modes,
    mechanical_vectors,
    relative_thermal_modes,
    thermal_vectors,
)

CONTACTS = frozenset({"several"})


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest ``count`` fixed-interface modes and the constraint modes."""
    return mechanical_vectors(structure, fixed_interface_modes(structure, count))


def thermal(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the slowest ``count`` modes relative to the constraint modes, and these."""
    return thermal_vectors(structure, relative_thermal_modes(structure, count))
