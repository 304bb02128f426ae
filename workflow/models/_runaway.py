"""Static answers of the tip, and the heat coupling above which a tip in permanent contact runs away."""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.models import _long_chain
from workflow.models._chain import Chain
from workflow.models._modes import mechanical_modes, thermal_modes
from workflow.models._sliding import static_share
from workflow.models._sparse import Sparse
from workflow.models._structure import Matrices, Structure

_PARTICIPATES = 1e-9
"""A null mode takes part at the tip above this share of the largest tip participation: well above
the rounding of its shape (about 1e-14), well below any mode of a structure that is linked."""


def _tip_shares(tip: Array, null: Array) -> bool:
    return bool(np.any(np.abs(tip[null]) > _PARTICIPATES * np.abs(tip).max(initial=0.0)))


def tip_flexibility(structure: Structure) -> float:
    """Return S = e_nᵀ K1⁻¹ e_n, the static compliance of the tip, m/N; ``inf`` for a free root."""
    if isinstance(structure, Chain):
        return _long_chain.tip_flexibility(structure)
    if isinstance(structure, Sparse):
        return 1 / structure.mechanical.tip_stiffness
    modes = mechanical_modes(structure)
    rigid = modes.values == 0
    moving = modes.inertia > 0
    if _tip_shares(modes.tip[moving], rigid[moving]):
        return float("inf")
    elastic = ~rigid
    return float(np.sum((modes.tip[elastic] / modes.values[elastic]) ** 2))


def static_tip_growth(structure: Structure) -> Array:
    """Return the row -e_nᵀ K1⁻¹ K12: quasi-static tip displacement per temperature, m/K.

    Shape ``(thermal,)``. Rigid modes are left out (their thermal load is zero), which makes it the
    minimum-norm answer where K1 is singular.
    """
    if isinstance(structure, Chain):
        return _long_chain.static_tip_growth(structure)
    if isinstance(structure, Matrices | Sparse) and structure.tip_growth is not None:
        return structure.tip_growth
    modes = mechanical_modes(structure)
    elastic = modes.values > 0
    weights = modes.tip[elastic] / modes.values[elastic] ** 2
    return -modes.shapes[:, elastic] @ weights @ structure.coupling_matrix


def critical_alpha(structure: Structure, friction: float = 0.0) -> float:
    """Return α_c = S/β above which a tip in permanent contact runs away, m/s; 0 where it has no stable place there.

    S = e_nᵀ K1⁻¹ (e_n - µ t), see :mod:`workflow.models._sliding`, and β = -e_nᵀ K1⁻¹ K12 K2⁻¹ e_n. Ranks decide,
    nothing is inverted blindly: ``inf`` where the root is free or heat at the tip does not push it out (β <= 0), 0
    where heat that stays in the structure (K2 singular) pushes the tip out.
    """
    if friction != 0:
        yields = 1 - friction * static_share(structure)
        return critical_alpha(structure) * yields if yields > 0 else 0.0
    if isinstance(structure, Chain):
        return _long_chain.critical_alpha(structure)
    if isinstance(structure, Sparse):
        return structure.critical_alpha
    flexibility = tip_flexibility(structure)
    if np.isinf(flexibility):
        return float("inf")
    growth = static_tip_growth(structure)
    thermal = thermal_modes(structure)
    per_mode = (growth @ thermal.shapes) * thermal.tip
    adiabatic = thermal.values == 0
    stored = np.sum(per_mode[adiabatic])
    if abs(stored) > _PARTICIPATES * np.abs(per_mode).max(initial=0.0) > 0:
        return 0.0 if stored > 0 else float("inf")
    beta = np.sum(per_mode[~adiabatic] / thermal.values[~adiabatic])
    return flexibility / beta if beta > 0 else float("inf")
