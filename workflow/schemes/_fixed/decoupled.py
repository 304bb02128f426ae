"""The modes in which a structure is stepped: mechanical modes with all contacts open, and thermal modes.

Their coupling, and damping that couples modes, are removed in the steps of a scheme
(:mod:`workflow.schemes._fixed.blocks`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workflow.models import (
    Array,
    Contacts,
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
    normal: Array
    tangent: Array
    """w_i and t_i of the contacts, 1/√kg, ``(contact, mode)``; that of the tip is φ_jn."""
    rate: Array
    """μ_l, 1/s, ``(thermal mode,)``."""
    heat: Array
    recorded: Array
    """s_i of the contacts and the temperature that is recorded there, 1/√(J/K), ``(contact, thermal mode)``."""
    coupling: Array
    """G = φᵀ K12 χ, ``(mode, thermal mode)``."""
    to_modes: Array
    to_thermal: Array
    """``to_modes``, ``to_thermal``: φ⁻¹ = φᵀ M and χ⁻¹ = χᵀ C2, which transform states to modal coordinates."""
    shapes: Array
    heat_shapes: Array
    """``shapes``, ``heat_shapes``: φ and χ."""
    static_growth: Array
    """Quasi-static displacement -w_i K1⁻¹ K12 χ_l of each contact, ``(contact, thermal mode)``."""
    sensors: Array
    """Rows of sensors, ``(sensor, mode + thermal mode)``."""
    load: Array
    """φ_jᵀ b of the direction b of the load, 1/√kg, ``(mode,)``."""
    damping_matrix: Array | None
    """φᵀ C1 φ where damping couples the modes, ``(mode, mode)``; ``damping`` is its diagonal."""
    contacts: Contacts
    """Their residual flexibility, if they have no mass, and the flexibility of their casing."""
    residual_coupling: Array
    """r_i of the thermal modes, m, ``(contact, thermal mode)``; 0 of contacts with mass."""
    is_single: bool
    """Whether there is one contact, with mass, on which the load acts, and damping couples no modes: these are scaled
    then so that the velocity of the contact is their sum."""

    @property
    def heat_scale(self) -> Array:
        """χ_ln by which kernels scale thermal modes, so that the tip's temperature is their sum, ``(thermal mode,)``.

        Components below :data:`_LEAST_SHARE` of the largest are replaced by that: far less than rounding.
        """
        if not self.is_single:
            return np.ones_like(self.rate)
        (heat,) = self.heat
        least = _LEAST_SHARE * np.abs(heat).max(initial=0.0)
        return np.asarray(np.where(np.abs(heat) > least, heat, least))

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
            heat=self.heat[:, :0],
            recorded=self.recorded[:, :0],
            coupling=self.coupling[:, :0],
            to_thermal=self.to_thermal[:0],
            heat_shapes=self.heat_shapes[:, :0],
            static_growth=self.static_growth[:, :0],
            residual_coupling=self.residual_coupling[:, :0],
            sensors=self.sensors[:, : self.frequency.size],
        )


def decouple(structure: Structure) -> Decoupled:
    """Transform a structure to its modes."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    coupling = modal_coupling(structure, mechanical, thermal)
    damper, contacts = coupled_damping(structure, mechanical), structure.contacts
    heat = contacts.heat @ thermal.shapes
    own = contacts.residual_coupling
    residual_coupling = np.zeros_like(heat) if own is None else own @ thermal.shapes
    return Decoupled(
        frequency=mechanical.values,
        damping=np.diag(damper).copy() if damper.ndim == 2 else damper,
        normal=contacts.normal @ mechanical.shapes,
        tangent=contacts.tangent @ mechanical.shapes,
        rate=thermal.values,
        heat=heat,
        recorded=contacts.recorded @ thermal.shapes,
        coupling=coupling,
        to_modes=mechanical.shapes.T @ structure.mass,
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        static_growth=_static_growth(structure, mechanical, thermal, coupling) - residual_coupling,
        sensors=structure.sensed(mechanical.shapes, thermal.shapes),
        load=mechanical.shapes.T @ structure.load_direction,
        damping_matrix=damper if damper.ndim == 2 else None,
        contacts=contacts,
        residual_coupling=residual_coupling,
        is_single=contacts.count == 1 and structure.load is None and damper.ndim == 1 and not contacts.is_compliant,
    )


def _static_growth(structure: Structure, mechanical: Modes, thermal: Modes, coupling: Array) -> Array:
    """Return -w_i K1⁻¹ K12 χ_l; of a reduced structure with a free root that of the full structure.

    With a free root the growth at the tip depends on the masses of the omitted modes.
    """
    elastic = mechanical.values > 0
    if structure.tip_growth is not None and not elastic.all():
        return structure.tip_growth[None] @ thermal.shapes
    weights = (structure.contacts.normal @ mechanical.shapes)[:, elastic] / mechanical.values[elastic] ** 2
    return np.asarray(-weights @ coupling[elastic])


def modes_at(rows: Array) -> NDArray[np.bool_]:
    """Return which modes move some of the rows, ``(mode,)``."""
    return np.asarray((np.abs(rows) > LEAST_SHARE * np.abs(rows).max(axis=-1, keepdims=True, initial=0.0)).any(axis=0))


def operator_name(structure: Structure) -> str:
    """Return the coordinates in which a structure is stepped, as ``plan`` prints them."""
    coupled = ", coupled by damping or by where the load acts" if needs_matrices(structure) else ""
    return f"{structure.mechanical_size} + {structure.thermal_size} modes with the tip's own{coupled}"
