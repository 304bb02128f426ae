"""The modes in which a structure is stepped: mechanical modes of the free tip, and thermal modes.

Their coupling, and damping that couples modes, are removed in the steps of a scheme
(:mod:`workflow.schemes._fixed.blocks`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workflow.models import (
    Array,
    Modes,
    Structure,
    coupled_damping,
    mechanical_modes,
    modal_coupling,
    needs_matrices,
    thermal_modes,
)

_LEAST_SHARE = 1e-30
"""Least component of a thermal mode at the tip, relative to the largest: smaller ones are replaced by it."""


LEAST_SHARE = 1e-14
"""Component of a mode at the tip, relative to the largest, up to which it is the rounding of the shape."""


@dataclass(frozen=True, eq=False)
class Decoupled:
    """A structure in its modes."""

    frequency: Array
    damping: Array
    """``frequency``, ``damping``: ω_j [rad/s] and c_j = a_M + a_K ω_j² [1/s], ``(mode,)``."""
    tip: Array
    """φ_jn, 1/√kg, ``(mode,)``."""
    rate: Array
    heat_tip: Array
    """``rate``, ``heat_tip``: μ_l [1/s] and χ_ln [1/√(J/K)], ``(thermal mode,)``."""
    coupling: Array
    """G = φᵀ K12 χ, ``(mode, thermal mode)``."""
    to_modes: Array
    to_thermal: Array
    """``to_modes``, ``to_thermal``: φ⁻¹ = φᵀ M and χ⁻¹ = χᵀ C2, which transform states to modal coordinates."""
    shapes: Array
    heat_shapes: Array
    """``shapes``, ``heat_shapes``: φ and χ."""
    static_growth: Array
    """Quasi-static tip displacement -e_nᵀ K1⁻¹ K12 χ_l of each thermal mode, ``(thermal mode,)``."""
    sensors: Array
    """Rows of sensors, ``(sensor, mode + thermal mode)``."""
    tangent: Array | None = None
    """φ_jᵀ t of the direction t of friction, 1/√kg, ``(mode,)``; ``None`` where there is none."""
    damping_matrix: Array | None = None
    """φᵀ C1 φ where damping couples the modes, ``(mode, mode)``; ``damping`` is its diagonal."""
    load: Array | None = None
    """φ_jᵀ b of a load that does not act on the tip, 1/√kg, ``(mode,)``."""
    observed: Array | None = None
    """wᵀχ_l of another temperature than the tip's that is recorded, 1/√(J/K), ``(thermal mode,)``."""

    @property
    def recorded(self) -> Array:
        """The temperature that is recorded per thermal mode, ``(thermal mode,)``."""
        return self.heat_tip if self.observed is None else self.observed

    @property
    def is_coupled(self) -> bool:
        """Whether damping or a load away from the tip couples the modes, which are then stepped in blocks."""
        return self.damping_matrix is not None or self.load is not None

    @property
    def heat_scale(self) -> Array:
        """χ_ln by which kernels scale thermal modes, so that the tip's temperature is their sum, ``(thermal mode,)``.

        Components below :data:`_LEAST_SHARE` of the largest are replaced by that: far less than rounding.
        """
        least = _LEAST_SHARE * np.abs(self.heat_tip).max(initial=0.0)
        return np.where(np.abs(self.heat_tip) > least, self.heat_tip, least)

    def effective_mass(self, diagonal: Array, share: float) -> Array:
        """Return Ŵ: its ``diagonal`` ``(mode,)``, with ``share`` [s] times the off-diagonal damping, if any."""
        if self.damping_matrix is None:
            return diagonal
        return np.diag(diagonal) + share * (self.damping_matrix - np.diag(self.damping))

    def without_heat(self) -> Decoupled:
        """Return the same structure without thermal states, for cases where none can act."""
        return replace(
            self,
            rate=np.zeros(0),
            heat_tip=np.zeros(0),
            observed=None,
            coupling=self.coupling[:, :0],
            to_thermal=self.to_thermal[:0],
            heat_shapes=self.heat_shapes[:, :0],
            static_growth=np.zeros(0),
            sensors=self.sensors[:, : self.tip.size],
        )


def decouple(structure: Structure) -> Decoupled:
    """Transform a structure to its modes."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    coupling = modal_coupling(structure, mechanical, thermal)
    damper = coupled_damping(structure, mechanical)
    return Decoupled(
        frequency=mechanical.values,
        damping=np.diag(damper).copy() if damper.ndim == 2 else damper,
        tip=mechanical.tip,
        rate=thermal.values,
        heat_tip=thermal.tip,
        coupling=coupling,
        to_modes=mechanical.shapes.T @ structure.mass,
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        static_growth=_static_growth(structure, mechanical, thermal, coupling),
        sensors=structure.sensed(mechanical.shapes, thermal.shapes),
        tangent=None if structure.tangent is None else mechanical.shapes.T @ structure.tangent,
        damping_matrix=damper if damper.ndim == 2 else None,
        load=None if structure.load is None else mechanical.shapes.T @ structure.load,
        observed=None if structure.observed is None else structure.observed @ thermal.shapes,
    )


def _static_growth(structure: Structure, mechanical: Modes, thermal: Modes, coupling: Array) -> Array:
    """Return -e_nᵀ K1⁻¹ K12 χ_l; of a reduced structure with a free root that of the full structure.

    With a free root the growth at the tip depends on the masses of the omitted modes.
    """
    elastic = mechanical.values > 0
    if structure.tip_growth is not None and not elastic.all():
        return structure.tip_growth @ thermal.shapes
    weights = mechanical.tip[elastic] / mechanical.values[elastic] ** 2
    return -weights @ coupling[elastic]


def modes_at_tip(tip: Array) -> NDArray[np.bool_]:
    """Return which modes move the tip, ``(mode,)``."""
    return np.asarray(np.abs(tip) > LEAST_SHARE * np.abs(tip).max(initial=0.0))


def operator_name(structure: Structure) -> str:
    """Return the coordinates in which a structure is stepped, as ``plan`` prints them."""
    coupled = ", coupled by damping or by where the load acts" if needs_matrices(structure) else ""
    return f"{structure.mechanical_size} + {structure.thermal_size} modes with the tip's own{coupled}"
