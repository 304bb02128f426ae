"""The θ-method in modal coordinates and its Delassus operator: the common step of moreau and implicit penalty.

With ξ = η - hθζ the pair (ζ, ξ) of a mode takes an impulse s (of the load less that of contact) in ζ alone:

    ζ ← ζ + φ_n s / (1 + hθc + h²θ²ω²),   ζ' = a ζ + b ξ,   ξ' = ξ + h ζ,
    a = (1 - h(1-θ)c - h²θ(2-θ)ω²) / (1 + hθc + h²θ²ω²),   b = -hω² / (1 + hθc + h²θ²ω²),

and a thermal mode steps by (1 + hθμ) τ' = (1 - h(1-θ)μ) τ + χ_n α p. Of a tip without mass the 1 of its static
deformation is 0, and its free step has the factor -(1-θ)/θ.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.models import Array, Structure, poles
from workflow.schemes._fixed.blocks import Blocks, Step
from workflow.schemes._fixed.contact import Contact, TipStep
from workflow.schemes._fixed.decoupled import Decoupled, Motion
from workflow.schemes._fixed.modal_balance import Terms
from workflow.schemes._fixed.modal_lanes import Coefficients, by_mode, pulls_on_speed
from workflow.schemes._fixed.sliding import sliding

NEEDS_IMPLICIT = "the reduction leaves the tip without mass, which an explicit step (theta = 0) cannot move"
"""Why an explicit θ-method cannot step a tip without mass."""


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares: structure, step h [s] and θ, the structure as it is stepped, and how it meets the casing."""

    structure: Structure
    h: float
    theta: float
    motion: Decoupled
    contact: Contact
    blocks: Blocks | None = None
    """Of a structure whose modes are coupled."""

    def delassus(self, h: float, alpha: Array, friction: Array | float = 0.0) -> Array:
        """Return the Delassus operator W = e_nᵀ Ŵ⁻¹ (e_n - µ t + α hθ K12 T̂⁻¹ e_n) of a step h, 1/kg, ``(case,)``."""
        motion, theta = self.motion, self.theta
        cold, per_alpha, tangential = motion.delassus(h, theta)
        return np.asarray(cold + alpha * per_alpha - friction * tangential)

    def factor(self, h: float, alpha: Array, friction: Array | float = 0.0) -> Array:
        """Return what contact divides by in a step h, ``(case,)``: it has one solution where that is positive."""
        return np.asarray(self.contact.factor(h, self.delassus(h, alpha, friction)))


def amplification(frequency: Array, damping: Array, h: float, theta: float) -> Any:
    """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode; -(1-θ)/θ where ω is infinite."""
    infinite = np.isinf(frequency)
    lam = poles(np.where(infinite, 0.0, frequency), np.where(infinite, 0.0, damping))
    factors = (1 + (1 - theta) * h * lam) / (1 - theta * h * lam)
    factors[infinite] = -(1 - theta) / theta if theta > 0 else -np.inf
    return factors


def thermal_amplification(rate: Array, h: float, theta: float) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return np.asarray((1 - (1 - theta) * h * rate) / (1 + theta * h * rate))


def coefficients(modal: Decoupled, h: float, theta: float, slides: bool = False) -> Coefficients:
    """Return the step's coefficients, with or without thermal states, with friction along the tangent or without."""
    omega2, c, tip, mu = modal.frequency**2, modal.damping, modal.tip, modal.rate
    inertia = modal.inertia(h, theta)
    warm = modal.heat_tip / (1 + h * theta * mu)
    thermal_kick = -h * theta * (modal.coupling @ warm) / inertia
    decay, scale = thermal_amplification(mu, h, theta), modal.heat_scale
    j, k = modal.pairs.T
    pull = -h * tip[j] * modal.coupling[j, k] * (theta * decay[k] + 1 - theta) / (inertia[j] * scale[k])
    return Coefficients(
        modes=by_mode(
            (modal.mass - h * (1 - theta) * c - h * h * theta * (2 - theta) * omega2) / inertia,
            -h * omega2 / inertia,
            tip**2 / inertia,
            tip * (thermal_kick + modal.response @ (mu * warm)),
            -tip * (modal.response @ modal.heat_tip),
        ),
        heat_modes=by_mode(decay, scale * warm, -mu * modal.tip_response / scale),
        pair_mode=j,
        pair_heat=k,
        pair_pull=pulls_on_speed(pull),
        tip=TipStep(h, theta, 1.0 - theta, np.sum(tip**2 / inertia), np.sum(modal.heat_tip * warm)),
        heat_counts=True,
        sliding=sliding(modal, inertia) if slides else None,
    )


def terms(modal: Decoupled, h: float, theta: float, begun: Motion) -> Terms:
    """Return how the step enters its balance."""
    warm = modal.heat_tip / (1 + h * theta * modal.rate)
    near = np.where(modal.response == 0, modal.coupling, 0.0)
    return Terms(
        lever=h * theta,
        kinetic=modal.mass,
        inertia=modal.inertia(h, theta),
        heat_speed=modal.mass * (modal.response @ (modal.rate * modal.heat_tip)) - h * theta * (near @ warm),
        heat_place=-modal.response @ modal.heat_tip,
        dragged=-np.sum(modal.rate * modal.tip_response * warm),
        velocity=begun.velocity,
        place=begun.position - h * theta * begun.velocity,
        opens=False,
    )


def step(modal: Decoupled, h: float, theta: float) -> Step:
    """Return the step as blocks take it."""
    decay, warm = thermal_amplification(modal.rate, h, theta), modal.heat_tip / (1 + h * theta * modal.rate)
    return Step(
        tip=TipStep(h, theta, 1.0 - theta, 0.0, np.sum(modal.heat_tip * warm)),
        inertia=modal.weight(modal.inertia(h, theta), h * theta),
        stiffening=2 * h * theta,
        lever=h * theta,
        decay=decay,
        warm=warm,
        pulls=theta * decay + 1 - theta,
        at_once=theta,
        heat_theta=theta,
        heat_counts=True,
        lagged=False,
    )
