"""The θ-method in the modes of a structure, for moreau and penalty.

    x' = x + h (θ v' + (1-θ) v),   M (v' - v) = h (f_θ - C1 v_θ - K1 x_θ - K12 T_θ) - (e_n - µ t) p,
    C2 (T' - T) = h (q - K2 T_θ) + α p e_n,

with temperatures T and (·)_θ = θ (·)' + (1-θ) (·). With ξ = x - hθv that is the step of
:mod:`~workflow.schemes._fixed.blocks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workflow.models import Array, Cases, ContactBasis, Structure, poles, project
from workflow.schemes._fixed import operator
from workflow.schemes._fixed.blocks import Step, effective_mass
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import TipStep
from workflow.schemes._fixed.loads import Start
from workflow.schemes._fixed.step_limits import largest_stable_step


@dataclass(frozen=True)
class ThetaMethod:
    """The method with a weight θ of the step's end."""

    theta: float

    @property
    def limit_is(self) -> str:
        """The beginning of a sentence that ends with the largest stable step."""
        return f"theta = {self.theta:g} is stable up to h ="

    def step(self, modal: ContactBasis, h: float) -> Step:
        """Return the coefficients of the step."""
        lever = h * self.theta
        weight = 1 / (1 + lever * modal.rate)
        inertia = 1 + lever * modal.damping + lever * lever * modal.frequency**2
        return Step(
            tip=TipStep(h, self.theta, modal.recorded @ (modal.heat * weight).T),
            inertia=effective_mass(modal, inertia, lever),
            stiffening=2 * lever,
            lever=lever,
            energy_lever=lever,
            decay=self.decay(h, modal.rate),
            heat_gain=modal.heat * weight,
            slope=-modal.rate * weight,
            load_weight=weight,
            damping_weight=weight,
            stiffness_weight=weight**2,
            theta=self.theta,
            heat_theta=self.theta,
            lagged=False,
        )

    def first_velocity(self, modal: ContactBasis, h: float, cases: Cases, begins: Start, force: Array) -> Array:
        """Return the velocity of the modes at t = 0, ``(case, mode)``."""
        return project(modal.to_modes, begins.coordinate_velocity)

    def amplification(self, frequency: Array, damping: Array, h: float) -> Any:
        """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode."""
        lam = poles(frequency, damping)
        return np.asarray((1 + (1 - self.theta) * h * lam) / (1 - self.theta * h * lam))

    def decay(self, h: float, rate: Array) -> Array:
        """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
        return np.asarray((1 - (1 - self.theta) * h * rate) / (1 + self.theta * h * rate))

    def largest_stable_step(self, frequency: Array, damping: Array, rate: Array) -> float:
        """Return the step up to which no free mode grows, s."""
        return largest_stable_step(np.concatenate([poles(frequency, damping).ravel(), -rate]), self.theta)


def init(structure: Structure, h: float, theta: float, contact: Contact) -> operator.Operator:
    """Separate a structure into blocks, once for a batch."""
    return operator.init(structure, h, ThetaMethod(theta), contact)
