"""The structure with its tip held at the gap, in modes, closed by the heat of its contact force.

With x = φ η + ψ x_n (fixed-interface modes and constraint mode), θ = χ τ (thermal modes of the whole structure),
x_n constant and loads left out, equation (1) becomes

    η'' + c η' + ω² η + κ τ = 0               κ = φᵀ K12 χ
    τ' + μ τ = t α λ                          t = χ_n
    λ = g τ - L (η'' + a_M η')                g = -ψᵀ K12 χ,  L = φᵀ M ψ

the last one being (1a) multiplied by ψᵀ. With a free root ψ strains no spring, so g is exactly zero. Friction µ along t
adds µ φᵀt λ to the first line and divides λ by 1 - µ (ψᵀt - L φᵀt).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import Complex
from workflow.models._damping import held_damping, is_rayleigh
from workflow.models._modes import poles
from workflow.models._pair import Modes
from workflow.models._structure import Structure

Indices = NDArray[np.intp]

_NEAR = 1e-6
"""Share of two roots of a mode below which their distance is not used."""


@dataclass(frozen=True, eq=False)
class ContactClosed:
    """The system in modes; rigid interior modes, which nothing drives, are left out.

    Attributes
    ----------
    modes
        ω² [1/s²], c [1/s] and L [√kg] of the interior modes, shape ``(3, mechanical mode)``.
    heat
        μ [1/s], t [1/√(J/K)] and g [N/√(J K)] of the thermal modes, shape ``(3, thermal mode)``.
    coupling
        κ, shape ``(mechanical mode, thermal mode)``.
    mass_damping, stiffness_damping
        a_M [1/s] and a_K [s].
    has_rigid
        Whether an interior mode is rigid: it has the eigenvalues 0 and -a_M.
    damping, drag
        φᵀ C1 φ [1/s] and φᵀ C1 ψ [√kg/s], where damping is not Rayleigh's: then λ = g τ - L η'' - drag η'. Else empty.
    """

    modes: Array
    heat: Array
    coupling: Array
    mass_damping: float
    stiffness_damping: float
    has_rigid: bool
    damping: Array
    drag: Array
    slid: Array
    """φᵀt of the interior modes, then ψᵀt: what a force along the tangent drives; empty where there is none."""

    @property
    def is_coupled(self) -> bool:
        """Whether damping couples the modes: then the characteristic function does not hold."""
        return self.drag.size > 0

    def poles(self) -> Complex:
        """Return the eigenvalues without contact heat where damping couples no modes, 1/s: roots of modes, then -μ."""
        return np.append(poles(np.sqrt(self.modes[0]), self.modes[1]), -self.heat[0])

    def first_orders(self) -> Complex:
        """Return ds/dα of the eigenvalue at each pole at α = 0, the residue of G there, 1/s per W/N."""
        omega2, damping, participation = self.modes
        decay, tip, static = self.heat
        s = poles(np.sqrt(omega2), damping).T
        driven = np.stack([(self.coupling * tip / (root[:, None] + decay)).sum(axis=1) for root in s])
        apart, least = 2 * s + damping, _NEAR * np.abs(s)
        inertia = participation * s * (s + self.mass_damping)
        mechanical = inertia * driven / np.where(np.abs(apart) < least, least, apart)
        k = -decay
        rest = k * (k + damping[:, None]) + omega2[:, None]
        share = participation[:, None] * k * (k + self.mass_damping)
        share = np.divide(share, rest, out=np.zeros_like(rest), where=rest != 0)
        return np.append(mechanical.T, tip * (static + (share * self.coupling).sum(axis=0)))

    def contact_force(self, s: Complex) -> tuple[Complex, Complex]:
        """Return G(s), the contact force by a unit heat load at the tip as exp(s t), and dG/ds; ``(s,)`` each.

        G = Σ_k [g_k + Σ_j L_j h_j(s) κ_jk] t_k/(s + μ_k), h_j = (s² + a_M s)/(s² + c_j s + ω_j²).
        """
        omega2, damping, participation = self.modes
        decay, tip, static = self.heat
        s = s[:, None]
        warmth = tip / (s + decay)
        cooling = -warmth / (s + decay)
        rest = s * (s + damping) + omega2
        share = participation * s * (s + self.mass_damping) / rest
        slope = (participation * (2 * s + self.mass_damping) - share * (2 * s + damping)) / rest
        driven = static + share @ self.coupling
        return (driven * warmth).sum(axis=1), (driven * cooling + (slope @ self.coupling) * warmth).sum(axis=1)

    def part(self, modes: Indices, heats: Indices) -> ContactClosed:
        """Return the system of some modes."""
        coupling = self.coupling[np.ix_(modes, heats)]
        return replace(self, modes=self.modes[:, modes], heat=self.heat[:, heats], coupling=coupling)

    def matrix(self, alpha: float, friction: float = 0.0) -> Array:
        """Return A of X' = A X, X = [ω η, η', τ], 1/s."""
        omega2, damping, participation = self.modes
        decay, tip, static = self.heat
        modes, heats = omega2.size, decay.size
        place, speed, heat = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, 2 * modes + heats)
        diagonal, omega = np.arange(modes), np.sqrt(omega2)
        A = np.zeros((2 * modes + heats, 2 * modes + heats))
        A[diagonal, diagonal + modes] = omega
        A[diagonal + modes, diagonal] = -omega
        A[diagonal + modes, diagonal + modes] = -damping
        if self.is_coupled:
            A[speed, speed] = -self.damping
        A[speed, heat] = -self.coupling
        force = np.zeros(2 * modes + heats)  # λ, the rate of η' inserted: c - a_M = a_K ω²
        force[place] = participation * omega
        force[speed] = participation * self.stiffness_damping * omega2
        if self.is_coupled:
            force[speed] = participation @ self.damping - self.drag
        force[heat] = static
        for j in range(modes):
            force[heat] += participation[j] * self.coupling[j]
        if friction != 0:
            slid, along = self.slid[:-1], self.slid[-1]
            force /= 1 - friction * (along - participation @ slid)
            A[speed] += friction * slid[:, None] * force
        A[heat] = alpha * tip[:, None] * force
        A[2 * modes + np.arange(heats), 2 * modes + np.arange(heats)] -= decay
        return A


def contact_closed(structure: Structure, few: int | None = None, slides: bool = False) -> ContactClosed:
    """Return the contact-closed system of a structure in all its modes, or in the ``few`` lowest of both kinds.

    Friction drives rigid modes of the interior too: they are kept where the contact ``slides``.
    """
    pair, mechanical, thermal = structure.mechanical, structure.mechanical.held_modes(few), structure.thermal.modes(few)
    elastic = (mechanical.values > 0) | slides
    omega2, shapes = mechanical.values[elastic], np.ascontiguousarray(mechanical.shapes[:, elastic])
    constraint, expansions = pair.constraint, structure.expansions(thermal.shapes)
    rayleigh = is_rayleigh(structure)
    damping = np.zeros((0, 0)) if rayleigh else held_damping(structure, Modes(omega2, shapes))
    return ContactClosed(
        modes=np.stack(
            [
                omega2,
                structure.damping.mass + structure.damping.stiffness * omega2 if rayleigh else np.diag(damping),
                shapes.T @ pair.inertia_of(constraint),
            ]
        ),
        heat=np.stack([thermal.values, thermal.tip, pair.work(constraint, pair.deformed, expansions)]),
        coupling=-pair.work(shapes, pair.deformation_of(shapes), expansions),
        mass_damping=structure.damping.mass,
        stiffness_damping=structure.damping.stiffness,
        has_rigid=bool(np.any(~elastic)),
        damping=np.zeros((0, 0)) if rayleigh else damping,
        drag=np.zeros(0) if rayleigh else shapes.T @ (structure.damping_matrix @ constraint),
        slid=_slid(structure, shapes, constraint),
    )


def _slid(structure: Structure, shapes: Array, constraint: Array) -> Array:
    if structure.tangent is None:
        return np.zeros(0)
    return np.column_stack([shapes, constraint]).T @ structure.tangent
