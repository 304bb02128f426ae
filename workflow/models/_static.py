"""Static response of the tip, and the heat coupling above which a tip in permanent contact runs away."""

from __future__ import annotations

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._sliding import static_share
from workflow.models._structure import Structure

_CANCELLED = 1e-13
"""Growth by the tip's heat, over its largest term, up to which it is rounding."""


def tip_flexibility(structure: Structure) -> float:
    """Return S = e_nᵀ K1⁻¹ e_n, the static compliance of the tip, m/N; ``inf`` for a free root."""
    stiffness = structure.mechanical.tip_stiffness
    return 1 / stiffness if stiffness > 0 else float("inf")


def static_tip_growth(structure: Structure) -> Array:
    """Return the row -e_nᵀ K1⁻¹ K12: quasi-static tip displacement per temperature, m/K.

    Shape ``(thermal,)``. Rigid modes are left out (their thermal load is zero): an unconstrained part grows about its
    centre of mass.
    """
    if structure.tip_growth is not None:
        return structure.tip_growth
    pair = structure.mechanical
    if pair.tip_stiffness > 0:
        response, deformation = pair.constraint / pair.tip_stiffness, pair.deformed / pair.tip_stiffness
    else:
        response = pair.solve(pair.unit_tip)
        deformation = pair.deformation_of(response)
    return pair.work(response, deformation, structure.expansion)


def critical_alpha(structure: Structure, friction: float = 0.0) -> float:
    """Return α_c = S/β above which a tip in permanent contact runs away, W/N; 0 where it is never stable there.

    S = e_nᵀ K1⁻¹ (e_n - µ t), see :mod:`workflow.models._sliding`, and β = -e_nᵀ K1⁻¹ K12 K2⁻¹ e_n. With the steady
    temperatures χ for 1 K at the tip and the conductance σ of the tip K2⁻¹ e_n = χ/σ. Singular cases are decided by
    rank: ``inf`` where the root is free or heat at the tip does not push it out (β <= 0), 0 where heat that cannot
    leave the structure (σ = 0) pushes the tip out.
    """
    yields = 1 - friction * static_share(structure)
    if yields <= 0:
        return 0.0
    terms = static_tip_growth(structure) * structure.thermal.constraint
    pushed, flexibility = float(terms.sum()), tip_flexibility(structure)
    if np.isinf(flexibility) or pushed <= _CANCELLED * np.abs(terms).max(initial=0.0):
        return float("inf")
    return structure.thermal.tip_stiffness * flexibility / pushed * yields


def instantaneous_growth(structure: Structure) -> float:
    """Return the instantaneous static tip growth by heat loads on temperatures without heat capacity, m."""
    given = structure.coordinates
    if given is None or not given.expansive.any():
        return 0.0
    return float(structure.mechanical.solve(given.displacement_basis.T @ given.expansive)[-1])


def rounding_of_flexibility(structure: Structure) -> float:
    """Estimate the relative change of S = e_nᵀ K1⁻¹ e_n by the rounding of the entries of K1, 1.

    With u = K1⁻¹ e_n a change of the entries changes S by -uᵀ δK1 u; independent changes by half a unit in the last
    place give ε/2 √(Σ (u_i K_ij u_j)²)/S. It is large where entries cancel to a far smaller stiffness.
    """
    response = structure.mechanical.solve(structure.mechanical.unit_tip)
    entries = scipy.sparse.coo_array(structure.mechanical.stiffness)
    row, column = entries.coords
    energies = response[row] * entries.data * response[column]
    return float(np.finfo(float).eps / 2 * np.linalg.norm(energies) / abs(response[-1]))
