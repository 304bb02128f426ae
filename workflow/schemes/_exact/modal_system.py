"""The structure in modes, with its tip free and with its tip held, for both regimes of the event-driven solver.

    z'' + c z' + ω² z + G τ = φᵀ (f̄ + F e_n) - b d'' - b' d',   τ' + μ τ = χᵀ q + α χ_n λ

F is the load on the tip besides the constant loads f̄. With the tip free, z are all modes and b = 0; with the tip held,
x_n = d(t), they are the fixed-interface modes and the constraint mode ψ of a unit displacement of the tip,
x_i = ψ d + φ z, b = φᵀ (M_in + M_ii ψ), b' likewise by C1, and the force on the casing is

    λ = f_n - M_ni x_i'' - C_ni x_i' - K_ni x_i - M_nn d'' - C_nn d' - K_nn d - K12_n θ.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from workflow.models import (
    Array,
    Modes,
    Structure,
    coupled_damping,
    held_damping,
    is_rayleigh,
    mechanical_modes,
    modal_coupling,
    static_tip_growth,
    thermal_modes,
)


@dataclass(frozen=True, eq=False)
class ModalSystem:
    """A structure with its tip free or held, in its modes z and the thermal modes τ.

    Its signal, the event function whose fall through zero ends the regime, is the gap d - x_n [m] of a free tip and the
    contact force λ [N] of a held one; d' and d'' are the casing's velocity and acceleration:

        signal = signal_steady · f̄ + signal_tip F + signal_gap · [d, d', d''] - r · z - r' · z' - k · τ.
    """

    frequency: Array
    """ω, 1/s, ``(mode,)``."""
    damping: Array
    """c, 1/s, ``(mode,)``; ``(mode, mode)`` where damping couples modes, of a held tip where it is not Rayleigh's."""
    coupling: Array
    """G, ``(mode, thermal mode)``."""
    rate: Array
    """μ, 1/s, ``(thermal mode,)``."""
    heat_tip: Array
    """χ_n, ``(thermal mode,)``."""
    observed: Array
    """χ_n, or of another temperature that is recorded wᵀχ, ``(thermal mode,)``."""
    reaction: Array
    """r, ``(mode,)``."""
    reaction_slope: Array
    """r', s, ``(mode,)``: a_K r for Rayleigh's damping."""
    thermal_reaction: Array
    """k, ``(thermal mode,)``."""
    signal_steady: Array
    """``(mechanical,)``."""
    signal_tip: float
    load: Array
    """Direction in which F acts, ``(mechanical,)``."""
    signal_gap: Array
    """``(3,)``."""
    gap_source: Array
    """Forces on z'' per d, d' and d'' of the casing of a held tip: 0, -b', -b, ``(mode, 3)``."""
    shapes: Array
    """φ, ``(mechanical, mode)``, without the row of a held tip."""
    heat_shapes: Array
    """χ, ``(thermal, thermal mode)``."""
    entry: Array
    """z per free mode y and, in the last row, per gap, ``(free mode + 1, mode)``: rows are the arguments. Velocities
    follow likewise from velocities and the rate of the gap."""
    exit: Array
    """The inverse, ``(mode + 1, free mode)``."""
    tangent: Array | None = None
    """Direction t of friction on a held tip, ``(mechanical,)``; ``None`` for none."""
    friction_force: Array | None = None
    """Force of friction on z'' per λ, µ φᵀt, ``(mode,)``; ``None`` without friction along t."""

    @property
    def is_coupled(self) -> bool:
        """Whether damping may couple the modes."""
        return self.damping.ndim == 2

    @cached_property
    def unheated(self) -> ModalSystem:
        """The system without thermal modes, where no heat acts."""
        names = "rate", "heat_tip", "observed", "thermal_reaction"
        none: dict[str, Any] = {name: np.zeros(0) for name in names}
        return replace(self, coupling=self.coupling[:, :0], heat_shapes=self.heat_shapes[:, :0], **none)

    def sliding(self, friction: float) -> ModalSystem:
        """Return the system of a held tip with friction µ along t.

        Friction is one more load, µ λ t: it divides λ by 1 - µ signal_steady · t.
        """
        if friction == 0 or self.tangent is None:
            return self
        own_share = 1.0 - friction * np.dot(self.signal_steady, self.tangent)
        return replace(
            self,
            reaction=self.reaction / own_share,
            reaction_slope=self.reaction_slope / own_share,
            thermal_reaction=self.thermal_reaction / own_share,
            signal_steady=self.signal_steady / own_share,
            signal_tip=self.signal_tip / own_share,
            signal_gap=self.signal_gap / own_share,
            friction_force=friction * (self.shapes.T @ self.tangent[: self.shapes.shape[0]]),
        )


@dataclass(frozen=True, eq=False)
class ModalBasis:
    """Modal data common to all regimes of a structure."""

    to_modes: Array
    """φᵀ M of the free modes."""
    to_thermal: Array
    """χᵀ C2."""
    tip: Array
    """φ_n, ``(mode,)``, 1/√kg."""
    damped_tip: Array
    """φᵀ C1 M⁻¹ e_n, ``(mode,)``, 1/(s √kg)."""
    tangent: Array
    """φᵀt of the direction of friction, ``(mode,)``, 1/√kg; 0 where there is none."""
    closing: Array
    """Quasi-static tip growth per τ, m, ``(thermal mode,)``."""
    mobility: float
    """Delassus operator of an impact, e_nᵀ M⁻¹ e_n, 1/kg."""
    tangential: float
    """e_nᵀ M⁻¹ t, 1/kg, the decrease of the mobility per friction coefficient."""
    heat_jump: float
    """Rise of the temperature that is recorded per heat at the tip, of the tip e_nᵀ C2⁻¹ e_n, K/J."""
    sensors: Array
    """Rows of sensors, ``(sensor, mode + thermal mode)``."""
    free: ModalSystem
    held: ModalSystem


def analyse(structure: Structure) -> ModalBasis:
    """Diagonalise the structure with its tip free and with its tip held."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    free, along = free_system(structure), mechanical.shapes.T @ structure.contacts.tangent[0]
    return ModalBasis(
        to_modes=mechanical.shapes.T @ structure.mass,
        to_thermal=thermal.shapes.T @ structure.heat_capacity,
        tip=mechanical.tip.copy(),
        damped_tip=free.damping @ mechanical.tip if free.is_coupled else free.damping * mechanical.tip,
        tangent=along,
        closing=static_tip_growth(structure) @ thermal.shapes,
        mobility=np.dot(mechanical.tip, mechanical.tip),
        tangential=np.dot(mechanical.tip, along),
        heat_jump=float(sum(float(tip) * float(seen) for tip, seen in zip(thermal.tip, free.observed, strict=True))),
        sensors=structure.sensed(mechanical.shapes, thermal.shapes),
        free=free,
        held=held_system(structure),
    )


def free_system(structure: Structure) -> ModalSystem:
    """Return the structure with its tip free."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    frequency, modes = mechanical.values, mechanical.values.size
    return ModalSystem(
        frequency=frequency,
        damping=coupled_damping(structure, mechanical),
        coupling=modal_coupling(structure, mechanical, thermal),
        rate=thermal.values,
        heat_tip=thermal.tip,
        observed=structure.contacts.recorded[0] @ thermal.shapes,
        reaction=mechanical.tip,
        reaction_slope=np.zeros(modes),
        thermal_reaction=np.zeros(thermal.values.size),
        signal_steady=np.zeros(modes),
        signal_tip=0.0,
        load=structure.load_direction,
        signal_gap=np.array([1.0, 0.0, 0.0]),
        gap_source=np.zeros((modes, 3)),
        shapes=mechanical.shapes,
        heat_shapes=thermal.shapes,
        entry=np.eye(modes + 1, modes),
        exit=np.eye(modes + 1, modes),
    )


def held_system(structure: Structure) -> ModalSystem:
    """Return the structure with its tip held at the gap."""
    mechanical, thermal = mechanical_modes(structure), thermal_modes(structure)
    pair = structure.mechanical.dense
    held, constraint_mode = pair.modes(held=True), pair.constraint  # s
    modes = Modes(np.sqrt(held.values), held.shapes)
    frequency, shapes = modes.values, modes.shapes[:-1]
    row = pair.forces(pair.deformation_of(modes.shapes))[-1]  # K_ni φ
    row[frequency == 0] = 0.0
    inertia = structure.mass[-1, :-1] @ shapes  # M_ni φ
    coupling = modal_coupling(structure, modes, thermal)
    force_steady = np.append(-shapes @ inertia, 1.0)
    to_modes = mechanical.shapes.T @ structure.mass
    interior = structure.mass[:-1, :-1]
    from_free = shapes.T @ interior @ mechanical.shapes[:-1]
    reaction = row - inertia * frequency**2
    damping, slope = _held_damping(structure, modes, reaction, inertia)
    return ModalSystem(
        frequency=frequency,
        damping=damping,
        coupling=coupling,
        rate=thermal.values,
        heat_tip=thermal.tip,
        observed=structure.contacts.recorded[0] @ thermal.shapes,
        reaction=reaction,
        reaction_slope=slope,
        thermal_reaction=structure.coupling_matrix[-1] @ thermal.shapes - inertia @ coupling,
        signal_steady=force_steady,
        signal_tip=np.dot(force_steady, structure.load_direction),
        load=structure.load_direction,
        **_by_casing(structure, constraint_mode, shapes, pair.tip_stiffness),
        shapes=shapes,
        heat_shapes=thermal.shapes,
        entry=np.vstack([from_free.T, -shapes.T @ (interior @ constraint_mode[:-1])]),
        exit=np.vstack([(to_modes[:, :-1] @ shapes).T, to_modes @ constraint_mode]),
        tangent=structure.contacts.tangent[0] if structure.contacts.slides else None,
    )


def _held_damping(structure: Structure, modes: Modes, reaction: Array, inertia: Array) -> tuple[Array, Array]:
    """Return c of the modes of a held tip, and the reaction per z', C_ni φ - M_ni φ c; a_K r for Rayleigh's damping."""
    if is_rayleigh(structure):
        return structure.damping.of_modes(modes.values), structure.damping.stiffness * reaction
    damping = held_damping(structure, modes)
    return damping, structure.damping_matrix[-1] @ modes.shapes - inertia @ damping


def _by_casing(structure: Structure, constraint_mode: Array, shapes: Array, stiffness: float) -> dict[str, Any]:
    """Return signal and forces on z'' by d, d' and d'' of the casing with the tip held; ``stiffness`` is sᵀ K1 s."""
    momentum, inertia = structure.mass @ constraint_mode, structure.mass[-1, :-1] @ shapes
    if is_rayleigh(structure):  # K1 s is 0 but at the tip
        damped = structure.damping.mass * momentum
        damped[-1] += structure.damping.stiffness * stiffness
    else:
        damped = structure.damping_matrix @ constraint_mode
    source = np.zeros((shapes.shape[1], 3))
    source[:, 1], source[:, 2] = -shapes.T @ damped[:-1], -shapes.T @ momentum[:-1]
    rate, acceleration = damped[-1] + np.dot(inertia, source[:, 1]), momentum[-1] + np.dot(inertia, source[:, 2])
    return {"signal_gap": np.array([-stiffness, -rate, -acceleration]), "gap_source": source}


def state_space(system: ModalSystem, alpha: float) -> tuple[Array, Array, Array]:
    """Return the system as X' = A X + B w, signal = row · X + …, for X = [z, z', τ] and w = [f̄, q, F, d, d', d''].

    Returns A ``(N, N)``, the row ``(N,)`` and B ``(N, mechanical + thermal + 4)``. The friction heat α λ acts at α >
    0, with the tip held only, as does friction along a tangent.
    """
    modes, mechanical, thermal = system.frequency.size, system.signal_steady.size, system.heat_shapes.shape[0]
    size = 2 * modes + system.rate.size
    z, u, tau = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, size)
    row = np.concatenate([-system.reaction, -system.reaction_slope, -system.thermal_reaction])
    per_force = np.zeros(size)
    per_force[tau] = alpha * system.heat_tip
    if system.friction_force is not None:
        per_force[u] = system.friction_force
    A = np.zeros((size, size))
    A[z, u] = np.eye(modes)
    A[u, z] = -np.diag(system.frequency**2)
    A[u, u] = -system.damping if system.is_coupled else -np.diag(system.damping)
    A[u, tau] = -system.coupling
    A[tau, tau] = -np.diag(system.rate)
    A += np.outer(per_force, row)
    B = np.outer(per_force, signal_inputs(system))
    B[u, : system.shapes.shape[0]] += system.shapes.T
    B[u, -4] += system.shapes.T @ system.load[: system.shapes.shape[0]]
    B[u, -3:] += system.gap_source
    B[tau, mechanical : mechanical + thermal] = system.heat_shapes.T
    return A, row, B


def signal_inputs(system: ModalSystem) -> Array:
    """Return the signal per w = [f̄, q, F, d, d', d'']."""
    heating = np.zeros(system.heat_shapes.shape[0])
    return np.concatenate([system.signal_steady, heating, [system.signal_tip], system.signal_gap])
