"""Central differences: the step that carpenter, paoli_schatzman and explicit penalty share.

With half-step velocities w_k+½ = (x_k+1 - x_k)/h a mode steps by

    (1 + hc/2) w_k+½ = (1 - hc/2) w_k-½ - hω² η_k - h G τ_k + φ_n (h f_k - p_k),   η_k+1 = η_k + h w_k+½,

or, with damping at the velocity of the step before ("lagged"), by w_k+½ = (1 - hc) w_k-½ - …. The tip's
velocity is the central one, v_k = (w_k-½ + w_k+½)/2, which is known one step later. So is the
impulse: p_k = hλ_k spans half a step on either side of t_k, the step from t_k to t_k+1 has the impulse
(p_k + p_k+1)/2, and the samples satisfy the momentum balance. The first step starts from
w_-½ = v_0 - (h/2) a_0 with the acceleration a_0 without contact: p_0 spans half a step and counts whole. A contact
spring that starts pressed is part of a_0, as its p_0 spans a whole step; the temperatures at t = 0 have half its heat.

Temperatures step by (τ_k+1 - τ_k)/h = -μ τ_k + χ_n α λ_k, or with μ τ_k+1 where heat is implicit: τ' = D τ.
The temperature of a sample includes half the heat of p_k, as its impulse includes half of p_k, so that the
friction heat is αJ up to rounding.

A contact law is given x_n,k, w_k-½ and w_free, the tip's velocity w_k+½ without contact; it returns p_k and w_k+½.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from workflow.models import Array, Cases, ContactBasis, project
from workflow.schemes._fixed.blocks import Step, effective_mass
from workflow.schemes._fixed.law import CentralStep
from workflow.schemes._fixed.loads import Start


@dataclass(frozen=True)
class Differences:
    """Difference formulas of damping and heat: the options of a scheme by central differences."""

    damping: Literal["central", "lagged"] = "central"
    """Velocity in the damping force: ``central`` (x_k+1 - x_k-1)/2h or ``lagged`` (x_k - x_k-1)/h."""
    heat: Literal["explicit", "implicit"] = "implicit"
    """Temperature in conduction: ``implicit`` T_k+1 or ``explicit`` T_k, which has a stability limit of its own."""

    @property
    def method(self) -> Differences:
        """The method of a scheme with these options."""
        return self

    @property
    def limit_is(self) -> str:
        """The beginning of a sentence that ends with the largest stable step."""
        return "central differences are stable up to"

    @property
    def lagged(self) -> bool:
        """Whether the velocity of the step before damps."""
        return self.damping == "lagged"

    @property
    def implicit_heat(self) -> bool:
        """Whether the temperatures at a step's end conduct."""
        return self.heat == "implicit"

    def damped(self, h: float, damping: Array) -> tuple[Array, Array]:
        """Return the inertia 1 + hc/2 of each mode, and the factor of w_k-½."""
        if self.lagged:
            return np.ones_like(damping), 1 - h * damping
        inertia = 1 + h * damping / 2
        return inertia, (1 - h * damping / 2) / inertia

    def decay(self, h: float, rate: Array) -> Array:
        """Return the factor D of each thermal mode."""
        return np.asarray(1 / (1 + h * rate) if self.implicit_heat else 1 - h * rate)

    def amplification(self, frequency: Array, damping: Array, h: float) -> Any:
        """Return the roots z of z² - (1 + k - (hω)²/i) z + k = 0, i inertia, k factor of w_k-½.

        With q = (hω)²/(2i) the discriminant is taken as ((1 - k)/2)² - q (1 + k - q): the square of half the sum less
        k would lose all digits of 1 - k, and the damped rigid mode of a free root would seem to grow.
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

    def step(self, modal: ContactBasis, h: float) -> Step:
        """Return the coefficients of the step."""
        decay, (inertia, _) = self.decay(h, modal.rate), self.damped(h, modal.damping)
        heat_gain = modal.heat * (decay if self.implicit_heat else 1.0)
        return Step(
            tip=CentralStep(h, 1.0, 0.5 * modal.recorded @ heat_gain.T),
            inertia=effective_mass(modal, inertia, 0.0 if self.lagged else h / 2),
            stiffening=h,
            lever=h,
            energy_lever=h / 2,
            decay=decay,
            heat_gain=heat_gain,
            slope=-modal.rate * (decay if self.implicit_heat else 1.0),
            load_weight=np.ones_like(decay),
            damping_weight=np.ones_like(decay) if self.lagged else (1 + decay) / 2,
            stiffness_weight=decay,
            theta=0.0,
            heat_theta=float(self.implicit_heat),
            lagged=self.lagged,
        )

    def first_velocity(self, modal: ContactBasis, h: float, cases: Cases, begins: Start, force: Array) -> Array:
        """Return w_-½ = v_0 - (h/2) a_0 of the modes, ``(case, mode)``, with a_0 under springs' ``force`` alone."""
        velocity = project(modal.to_modes, cases.velocity)
        acceleration = project(modal.shapes.T, cases.steady) + cases.load_at(0.0)[:, None] * modal.load
        damped = modal.damping * velocity if modal.damping_matrix is None else project(modal.damping_matrix, velocity)
        acceleration -= damped + modal.frequency**2 * project(modal.to_modes, cases.displacement)
        acceleration -= project(modal.coupling, project(modal.to_thermal, cases.temperature))
        along = cases.friction[:, None] * project(modal.tangent.T, force)
        return np.asarray(velocity - 0.5 * h * (acceleration - project(modal.normal.T, force) + along))
