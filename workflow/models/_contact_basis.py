"""A structure in its modes with all contacts open, and its thermal modes, in which every scheme moves it.

y'' + c y' + ω² y + G τ = φᵀ(f̄ + F b) - Σ λ_i (w_i - µ t_i),   τ' + μ τ = χᵀq + α Σ λ_i s_i,   x = φ y,  θ = χ τ
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.models._contacts import Contacts
from workflow.models._modes import coupled_damping, mechanical_modes, modal_coupling, thermal_modes
from workflow.models._static import static_growth
from workflow.models._structure import Structure


@dataclass(frozen=True, eq=False)
class ContactBasis:
    """A structure with all contacts open, in its modes."""

    contacts: Contacts
    shapes: Array
    """φ, ``(mechanical, mode)``."""
    heat_shapes: Array
    """χ, ``(thermal, thermal mode)``."""
    to_modes: Array
    """φ⁻¹ = φᵀ M."""
    to_thermal: Array
    """χ⁻¹ = χᵀ C2."""
    frequency: Array
    """ω, rad/s, ``(mode,)``."""
    damping: Array
    """c, 1/s, ``(mode,)``."""
    damping_matrix: Array | None
    """φᵀ C1 φ, ``(mode, mode)``, where damping couples modes; ``damping`` is its diagonal."""
    coupling: Array
    """G = φᵀ K12 χ, ``(mode, thermal mode)``."""
    rate: Array
    """μ, 1/s, ``(thermal mode,)``."""
    normal: Array
    """w, 1/√kg, ``(contact, mode)``; that of the tip is φ_n."""
    tangent: Array
    """t, 1/√kg, ``(contact, mode)``."""
    heat: Array
    """s, 1/√(J/K), ``(contact, thermal mode)``."""
    recorded: Array
    """Temperature that is recorded of each contact, ``(contact, thermal mode)``: s, or a mean over a depth."""
    growth: Array
    """Quasi-static displacement -w K1⁻¹ K12 χ - r of each contact, ``(contact, thermal mode)``."""
    load: Array
    """φᵀ b, 1/√kg, ``(mode,)``."""
    sensors: Array
    """Rows of sensors, ``(sensor, mode + thermal mode)``."""

    @property
    def residual_coupling(self) -> Array:
        """R per thermal mode, m, ``(contact, thermal mode)``."""
        return np.asarray(self.contacts.residual_coupling @ self.heat_shapes)

    @property
    def size(self) -> int:
        """Number of states [y, y', τ]."""
        return 2 * self.frequency.size + self.rate.size

    @property
    def inputs(self) -> int:
        """Number of inputs [g, q, F, d, d', d''] of a set."""
        return self.frequency.size + self.rate.size + 1 + 3 * self.contacts.count

    @property
    def unheated(self) -> ContactBasis:
        """The same without thermal modes, where no heat acts."""
        none: dict[str, Any] = {name: getattr(self, name)[:0] for name in ("rate", "to_thermal")}
        for name in ("heat_shapes", "coupling", "heat", "recorded", "growth"):
            none[name] = getattr(self, name)[:, :0]
        none["sensors"] = self.sensors[:, : self.frequency.size]
        return replace(self, **none)

    @property
    def is_single(self) -> bool:
        """Whether there is one contact, with mass, on which the load acts, and damping couples no modes."""
        is_one = self.contacts.count == 1 and not self.contacts.is_compliant
        return is_one and self.damping_matrix is None and np.array_equal(self.load, self.normal[0])


def analyse_contacts(structure: Structure) -> ContactBasis:
    """Return a structure in its modes with all contacts open."""
    contacts = structure.contacts
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    damping, normal = coupled_damping(structure, mechanical), contacts.normal @ mechanical.shapes
    return ContactBasis(
        contacts=contacts,
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        to_modes=mechanical.shapes.T @ structure.mass,
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        frequency=mechanical.values,
        damping=damping if damping.ndim == 1 else np.diag(damping).copy(),
        damping_matrix=None if damping.ndim == 1 else damping,
        coupling=modal_coupling(structure, mechanical, thermal),
        rate=thermal.values,
        normal=normal,
        tangent=contacts.tangent @ mechanical.shapes,
        heat=contacts.heat @ thermal.shapes,
        recorded=contacts.recorded @ thermal.shapes,
        growth=static_growth(structure) @ thermal.shapes,
        load=normal[0] if structure.load is None else mechanical.shapes.T @ structure.load,
        sensors=structure.sensed(mechanical.shapes, thermal.shapes),
    )
