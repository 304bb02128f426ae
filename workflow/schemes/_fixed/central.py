"""Central differences: the step that carpenter and explicit penalty share.

With half-step velocities w_k+½ = (x_k+1 - x_k)/h a mode steps by

    (1 + hc/2) w_k+½ = (1 - hc/2) w_k-½ - hω² η_k - h G τ_k + φ_n (h f_k - p_k),   η_k+1 = η_k + h w_k+½,

or, with damping at the velocity of the step before ("lagged"), by w_k+½ = (1 - hc) w_k-½ - …. The tip's
velocity is the central one, v_k = (w_k-½ + w_k+½)/2, which is known one step later. So is the
impulse: p_k = hλ_k spans half a step on either side of t_k, a step from t_k to t_k+1 holds
(p_k + p_k+1)/2, and the samples satisfy the theorem of momentum. The first step starts from
w_-½ = v_0 - (h/2) a_0 with the acceleration a_0 without contact: p_0 spans half a step and counts whole.

Temperatures step by (τ_k+1 - τ_k)/h = -μ τ_k + χ_n α λ_k, or with μ τ_k+1 where heat is implicit: τ' = D τ.
What a thermal mode drags along, η = R τ, is that of the difference equation: with m = (1 - D)/h

    R = D Q,   Q = -G / (m² - c m (1 + D)/2 + ω² D)        (lagged: c m for c m (1 + D)/2).

A sample's temperature holds half the heat of p_k, as its impulse holds half of p_k: what friction has
brought in is αJ up to rounding.

A contact law is given x_n,k, w_k-½ and w_free, the tip's velocity w_k+½ without contact.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from workflow.models import Array, Structure
from workflow.schemes._fixed.blocks import NO_DECAY, Blocks, Step, separate
from workflow.schemes._fixed.contact import CentralStep, Contact
from workflow.schemes._fixed.decoupled import Decoupled, Motion, decouple, dragged
from workflow.schemes._fixed.modal_balance import Terms
from workflow.schemes._fixed.modal_lanes import Coefficients, by_mode, pulls_on_speed
from workflow.schemes._fixed.sliding import sliding

NEEDS_MASS = (
    "the reduction leaves the tip without mass: central differences divide by the mass that contact acts on; "
    "moreau and implicit penalty step it"
)
"""Why central differences cannot step a tip without mass."""


@dataclass(frozen=True)
class Differences:
    """How damping and heat are differenced."""

    lagged: bool = False
    implicit_heat: bool = False

    def damped(self, h: float, damping: Array) -> tuple[Array, Array]:
        """Return the inertia 1 + hc/2 of each mode, and the factor of w_k-½."""
        if self.lagged:
            return np.ones_like(damping), 1 - h * damping
        inertia = 1 + h * damping / 2
        return inertia, (1 - h * damping / 2) / inertia

    def share(self, h: float) -> float:
        """Return the share of C1 in Ŵ, s."""
        return 0.0 if self.lagged else h / 2

    def decay(self, h: float, rate: Array) -> Array:
        """Return the factor D of each thermal mode."""
        return np.asarray(1 / (1 + h * rate) if self.implicit_heat else 1 - h * rate)

    def slope(self, h: float, rate: Array) -> Array:
        """Return m = (1 - D)/h of each thermal mode, 1/s."""
        return np.asarray(rate / (1 + h * rate) if self.implicit_heat else rate)

    def amplification(self, frequency: Array, damping: Array, h: float) -> Any:
        """Return the roots z of z² - (1 + k - (hω)²/i) z + k = 0, i inertia, k factor of w_k-½.

        With q = (hω)²/(2i) the root is taken of ((1 - k)/2)² - q (1 + k - q): the square of half the sum less k
        loses all digits of 1 - k, and the damped rigid mode of a free root seems to grow.
        """
        inertia, factor = self.damped(h, damping)
        q = h * frequency * (h * frequency) / (2 * inertia)
        lost = (1 - factor) / 2
        half = (1 + factor) / 2 - q
        root = np.sqrt(lost * lost - q * (1 + factor - q) + 0j)
        return np.stack([half + root, half - root], axis=-1)

    def largest_stable_step(self, frequency: Array, damping: Array, rate: Array) -> float:
        """Return the step up to which no free mode grows: the least of 2/ω or 4/(c + √(c² + 4ω²)), and 2/μ."""
        fastest = 2 * frequency
        if self.lagged:
            fastest = damping + np.sqrt(damping**2 + fastest**2)
        limits = [float(np.max(fastest, initial=0.0)) / 4]
        if not self.implicit_heat:
            limits.append(float(np.max(rate, initial=0.0)) / 2)
        return 1 / max(limits) if max(limits) > 0 else float("inf")


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares: structure, step, differences and contact, and what follows from them."""

    structure: Structure
    h: float
    differences: Differences
    modal: Decoupled
    """With the response R of the difference equation instead of that of continuous time."""
    lead: Array
    """Q, ``(mode, thermal mode)``."""
    contact: Contact
    blocks: Blocks | None = None
    """Of a structure whose modes are coupled."""

    def delassus(self, friction: Array) -> Array | float:
        """Return W of cases, 1/kg: one for all without friction, else ``(case,)``."""
        cold = delassus(self.modal, self.h, self.differences)
        if self.modal.along is None or not friction.any():
            return cold
        return np.asarray(cold - friction * tip_yields(self.modal, self.h, self.differences, self.modal.along))

    def without_heat(self) -> Operator:
        """Return the same without thermal states, for cases where none can act."""
        return replace(self, modal=self.modal.without_heat(), lead=np.zeros((self.modal.frequency.size, 0)))

    def coefficients(self, slides: bool) -> Coefficients:
        """Return the step's coefficients, with friction along the tangent or without."""
        h, modal = self.h, self.modal
        tip, mu = modal.tip, modal.rate
        inertia, factor = self.differences.damped(h, modal.damping)
        decay = self.differences.decay(h, mu)
        enters = modal.heat_tip * (decay if self.differences.implicit_heat else 1.0)
        slope = self.differences.slope(h, mu)
        decay = np.where(decay == 0, NO_DECAY, decay)
        pull = -h * modal.frequency**2 / inertia
        j, k = modal.pairs.T
        return Coefficients(
            modes=by_mode(
                factor + h * pull,
                pull,
                tip**2 / inertia,
                tip * (self.lead @ (slope * enters)),
                -tip * (self.lead @ enters),
            ),
            heat_modes=by_mode(
                decay, modal.heat_scale * enters / decay, -slope * modal.tip_response / modal.heat_scale
            ),
            pair_mode=j,
            pair_heat=k,
            pair_pull=pulls_on_speed(-h * tip[j] * modal.coupling[j, k] / (inertia[j] * modal.heat_scale[k])),
            tip=self.contact.felt_by(
                CentralStep(h, 1.0, 0.0, np.sum(tip**2 / inertia), np.sum(modal.heat_tip * enters))
            ),
            heat_counts=False,
            sliding=sliding(modal, inertia) if slides else None,
        )


def terms(operator: Operator, begun: Motion, before: Array) -> Terms:
    """Return how the step enters its balance, from the remaining modal w_-½, ``before``, ``(case, mode)``.

    The step conserves w² (1 - (ωh)²/4) + ω² (η_k + η_k+1)²/4, which is w² + ω² η_k η_k+1; lagged damping spends
    hc v_k w_k-½ = hc v_k² - hc (w_k+½² - w_k-½²)/4.
    """
    h, modal, differences = operator.h, operator.modal, operator.differences
    inertia, _ = differences.damped(h, modal.damping)
    enters = modal.heat_tip * (differences.decay(h, modal.rate) if differences.implicit_heat else 1.0)
    slope, drags = differences.slope(h, modal.rate) * enters, modal.tip @ operator.lead
    place = -operator.lead @ enters
    kinetic = 1 - (h * modal.frequency) ** 2 / 4 - (h * modal.damping / 2 if differences.lagged else 0.0)
    return Terms(
        lever=h / 2,
        kinetic=kinetic,
        inertia=inertia,
        heat_speed=inertia * (operator.lead @ slope),
        heat_place=place,
        dragged=-np.sum(drags * slope),
        velocity=before,
        place=begun.position - h * before,
        opens=True,
    )


def step(modal: Decoupled, h: float, differences: Differences) -> Step:
    """Return the step as blocks take it."""
    decay, (inertia, _) = differences.decay(h, modal.rate), differences.damped(h, modal.damping)
    warm = modal.heat_tip * (decay if differences.implicit_heat else 1.0)
    return Step(
        tip=CentralStep(h, 1.0, 0.0, 0.0, np.sum(modal.heat_tip * warm)),
        inertia=modal.weight(inertia, differences.share(h)),
        stiffening=h,
        lever=h,
        decay=decay,
        warm=warm,
        pulls=np.ones_like(decay),
        at_once=0.0,
        heat_theta=float(differences.implicit_heat),
        heat_counts=False,
        lagged=differences.lagged,
    )


def delassus(modal: Decoupled, h: float, differences: Differences) -> float:
    """Return W = e_nᵀ (M + h/2 C1)⁻¹ e_n, 1/kg: the tip's half-step velocity per unit impulse."""
    return tip_yields(modal, h, differences, modal.tip)


def tip_yields(modal: Decoupled, h: float, differences: Differences, force: Array) -> float:
    """Return the tip's half-step velocity per unit impulse along a force on the modes, 1/kg."""
    inertia, _ = differences.damped(h, modal.damping)
    if modal.damper is None:
        return np.sum(modal.tip * force / inertia)
    return float(modal.tip @ np.linalg.solve(modal.weight(inertia, differences.share(h)), force))


def operator(structure: Structure, h: float, differences: Differences, contact: Contact) -> Operator:
    """Return the operator of a structure that modes separate."""
    modal = decouple(structure)
    decay = differences.decay(h, modal.rate)
    slope = differences.slope(h, modal.rate)
    c, middle = modal.damping[:, None], 1.0 if differences.lagged else (1 + decay) / 2
    lead, pairs = dragged(modal.coupling, slope**2, -c * (slope * middle), modal.frequency[:, None] ** 2 * decay)
    blocks = separate(modal, step(modal, h, differences)) if modal.is_coupled else None
    return Operator(
        structure, h, differences, replace(modal, response=lead * decay, pairs=pairs), lead, contact, blocks
    )
