"""Thermal runaway of a tip in permanent contact: critical coupling and growth rate."""

from __future__ import annotations

from typing import TypeGuard

import numpy as np

from workflow.models import _long_chain
from workflow.models._chain import Chain
from workflow.models._modes import mechanical_modes, thermal_modes
from workflow.models._structure import Array, Structure

_PARTICIPATES = 1e-9
"""A null mode takes part at the tip above this share of the largest tip participation: well above
the rounding of its shape (about 1e-14), well below any mode of a structure that is linked."""


def _is_long(structure: Structure) -> TypeGuard[Chain]:
    return isinstance(structure, Chain) and not structure.has_matrices


def _tip_shares(tip: Array, null: Array) -> bool:
    return bool(np.any(np.abs(tip[null]) > _PARTICIPATES * np.abs(tip).max()))


def tip_flexibility(structure: Structure) -> float:
    """Return S = e_nᵀ K1⁻¹ e_n, the static compliance of the tip, m/N; ``inf`` for a free root."""
    if _is_long(structure):
        return _long_chain.tip_flexibility(structure)
    modes = mechanical_modes(structure)
    rigid = modes.values == 0
    if _tip_shares(modes.tip, rigid):
        return float("inf")
    elastic = ~rigid
    return float(np.sum((modes.tip[elastic] / modes.values[elastic]) ** 2))


def static_tip_growth(structure: Structure) -> Array:
    """Return the row -e_nᵀ K1⁻¹ K12: quasi-static tip displacement per temperature, m/K.

    Shape ``(thermal,)``. Rigid modes are left out (their thermal load is zero), which makes it the
    minimum-norm answer where K1 is singular.
    """
    if _is_long(structure):
        return _long_chain.static_tip_growth(structure)
    modes = mechanical_modes(structure)
    elastic = modes.values > 0
    weights = modes.tip[elastic] / modes.values[elastic] ** 2
    return np.asarray(-(modes.shapes[:, elastic] @ weights) @ structure.coupling_matrix)


def critical_alpha(structure: Structure) -> float:
    """Return α_c = S/β above which a tip in permanent contact runs away, m/s (DESIGN section 2).

    S = e_nᵀ K1⁻¹ e_n and β = -e_nᵀ K1⁻¹ K12 K2⁻¹ e_n. Ranks decide, nothing is inverted blindly:
    ``inf`` where the root is free or heat at the tip does not push it out (β <= 0), 0 where heat
    that stays in the structure (K2 singular) pushes the tip out.
    """
    if _is_long(structure):
        return _long_chain.critical_alpha(structure)
    flexibility = tip_flexibility(structure)
    if np.isinf(flexibility):
        return float("inf")
    growth = static_tip_growth(structure)
    thermal = thermal_modes(structure)
    per_mode = (growth @ thermal.shapes) * thermal.tip
    adiabatic = thermal.values == 0
    stored = float(per_mode[adiabatic].sum())
    if abs(stored) > _PARTICIPATES * np.abs(per_mode).max(initial=0.0) > 0:
        return 0.0 if stored > 0 else float("inf")
    beta = float(np.sum(per_mode[~adiabatic] / thermal.values[~adiabatic]))
    return flexibility / beta if beta > 0 else float("inf")


def contact_closed_matrix(structure: Structure, alpha: float) -> Array:
    """Return A of X' = A X + const. with the tip held at the gap and its contact heat, 1/s.

    X = [x_i, v_i, θ] without the tip's position. The contact force of equation (1a),
    λ = f_n - M_ni v_i' - C_ni v_i - K_ni x_i - K12_n θ + const., heats the tip node by α λ.
    """
    M, C, K = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    i, n = slice(0, -1), -1
    interior, thermal = structure.mechanical_size - 1, structure.thermal_size
    x, v = slice(0, interior), slice(interior, 2 * interior)
    theta = slice(2 * interior, 2 * interior + thermal)
    A = np.zeros((2 * interior + thermal, 2 * interior + thermal))
    force = np.zeros(2 * interior + thermal)  # λ as a row acting on X
    if interior:
        A[x, v] = np.eye(interior)
        A[v, x] = -np.linalg.solve(M[i, i], K[i, i])
        A[v, v] = -np.linalg.solve(M[i, i], C[i, i])
        A[v, theta] = -np.linalg.solve(M[i, i], K12[i])
        force[:] = -M[n, i] @ A[v]
        force[x] -= K[n, i]
        force[v] -= C[n, i]
    force[theta] -= K12[n]
    tip = np.zeros(thermal)
    tip[n] = alpha
    A[theta, theta] = -np.linalg.solve(C2, K2)
    A[theta] += np.outer(np.linalg.solve(C2, tip), force)
    return A


def growth_rate(structure: Structure, alpha: float) -> float:
    """Return the largest real eigenvalue of the contact-closed system, 1/s; negative: it decays.

    Where all eigenvalues are complex, the largest real part stands in.
    """
    eigenvalues = np.linalg.eigvals(contact_closed_matrix(structure, alpha))
    scale = np.abs(eigenvalues).max(initial=0.0)
    real = eigenvalues[np.abs(eigenvalues.imag) <= 1e-12 * scale].real  # LAPACK pairs the complex ones exactly
    return float(real.max() if real.size else eigenvalues.real.max())
