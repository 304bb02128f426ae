"""The θ-method in the modes of a structure, its Delassus operator and its stability, for moreau and penalty.

    x' = x + h (θ v' + (1-θ) v),   M (v' - v) = h (f_θ - C1 v_θ - K1 x_θ - K12 T_θ) - (e_n - µ t) p,
    C2 (T' - T) = h (q - K2 T_θ) + α p e_n,

with temperatures T and (·)_θ = θ (·)' + (1-θ) (·). With ξ = x - hθv that is the step of
:mod:`~workflow.schemes._fixed.blocks`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, ContactBasis, Structure, analyse_contacts, poles, project
from workflow.schemes._fixed.blocks import Blocks, Step, effective_mass, separate
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import TipStep
from workflow.schemes._fixed.loads import start_of
from workflow.schemes._fixed.march import step_batch
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, judged
from workflow.schemes._fixed.step_limits import largest_stable_step, largest_step, limit_text
from workflow.schemes._fixed.stepping import Ended, collect
from workflow.schemes._fixed.unsolved import divisors, explained, friction_message
from workflow.schemes._interface import Results, Sampling

_MOST_GROWTH = 300.0
"""Logarithm of the largest growth within a run whose squares are still finite (355), with a margin of 1e24 for loads
and units."""


@dataclass(frozen=True, eq=False)
class Operator:
    """Common data of a batch: structure, step h [s] and θ, the structure in blocks, and its contact."""

    structure: Structure
    h: float
    theta: float
    blocks: Blocks
    contact: Contact

    def factor(self, h: float, alpha: Array, friction: Array | float = 0.0) -> Array:
        """Return the divisor of each contact in a step h, ``(case, contact)``: that alone has a solution where > 0."""
        modal = self.blocks.modal
        return divisors(step(modal, h, self.theta), modal, self.contact, alpha, friction)

    def run(self, cases: Cases, sampling: Sampling, heated: bool) -> Results:
        """Step cases that all carry thermal states, or that all carry none."""
        h, blocks = self.h, self.blocks if heated else self.blocks.without_heat()
        yields = 1 / self.contact.stiffness if self.contact.stiffness > 0 else 0.0
        drive, begins = start_of(self.structure, cases, h, self.theta, sampling.duration, yields)
        velocity = project(blocks.modal.to_modes, begins.coordinate_velocity)
        ended = step_batch(self.structure, blocks, self.contact, cases, velocity, sampling, drive, begins)
        finite = ended.watched.finite("displacement", "temperature", "impulse")
        judged_blocks = self.blocks if self.contact.judges_heat else blocks
        return collect(ended, *_judge(self, judged_blocks, cases, sampling.duration, finite, ended))


def init(structure: Structure, h: float, theta: float, contact: Contact) -> Operator:
    """Separate a structure into blocks, once for a batch."""
    modal = analyse_contacts(structure)
    return Operator(structure, h, theta, separate(modal, step(modal, h, theta)), contact)


def amplification(frequency: Array, damping: Array, h: float, theta: float) -> Any:
    """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode."""
    lam = poles(frequency, damping)
    return np.asarray((1 + (1 - theta) * h * lam) / (1 - theta * h * lam))


def thermal_amplification(rate: Array, h: float, theta: float) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return np.asarray((1 - (1 - theta) * h * rate) / (1 + theta * h * rate))


def step(modal: ContactBasis, h: float, theta: float) -> Step:
    """Return the coefficients of the step."""
    lever = h * theta
    weight = 1 / (1 + lever * modal.rate)
    inertia = 1 + lever * modal.damping + lever * lever * modal.frequency**2
    return Step(
        tip=TipStep(h, theta, modal.recorded @ (modal.heat * weight).T),
        inertia=effective_mass(modal, inertia, lever),
        stiffening=2 * lever,
        lever=lever,
        energy_lever=lever,
        decay=thermal_amplification(modal.rate, h, theta),
        heat_gain=modal.heat * weight,
        slope=-modal.rate * weight,
        load_weight=weight,
        damping_weight=weight,
        stiffness_weight=weight**2,
        coupling_theta=theta,
        heat_theta=theta,
        lagged=False,
    )


def _judge(
    operator: Operator, blocks: Blocks, cases: Cases, duration: float, finite: NDArray[np.bool_], ended: Ended
) -> Outcome:
    """Return status and message of each case."""
    h, theta, growth = operator.h, operator.theta, _spectral_radius(operator, blocks)
    grown = None
    if growth > 1 + ROUNDING:
        modal = blocks.modal
        limit = largest_stable_step(np.concatenate([poles(modal.frequency, modal.damping).ravel(), -modal.rate]), theta)
        grown = (
            f"the free step grows {growth:.6g}-fold at theta = {theta:g} and h = {h:.6g} s; "
            f"it is stable up to h = {limit_text(limit)} s"
        )

    message = cache(partial(_message, operator, duration))  # a limit takes hundreds of trials
    modal, contact = operator.blocks.modal, operator.contact
    together = explained(operator.structure, modal, contact, lambda h: step(modal, h, theta), h, ended.unsolved)

    def explain(case: int) -> str:
        alpha, friction = float(cases.alpha[case]), float(cases.friction[case])
        if len(modal.normal) == 1 and not modal.contacts.is_compliant:
            return message(alpha, friction)
        return together(alpha, friction, case)

    return judged(finite, ended.ambiguous, explain, grown, f"the state left the finite numbers at h = {h:.6g} s")


def _spectral_radius(operator: Operator, blocks: Blocks) -> float:
    """Return the spectral radius of the free step; it is at most 1 where θ >= 1/2 and modes are not coupled."""
    if operator.theta >= 0.5 and blocks.outward is None:
        return 1.0
    return max(blocks.spectral_radius, float(np.abs(blocks.step.decay).max(initial=0.0)))


def _message(operator: Operator, duration: float, alpha: float, friction: float) -> str:
    """Return the message of a case whose contact has no unique solution."""
    h, name = operator.h, operator.contact.name

    def factor(step: float, coupling: float) -> float:
        return float(operator.factor(step, np.array(coupling), np.array(friction)).min())

    if factor(h, 0.0) <= 0:
        return friction_message(h, friction, name)
    limit = largest_step(lambda step: factor(step, alpha) > 0, h)
    return f"contact has no unique solution at h = {h:.6g} s ({name} <= 0 at alpha = {alpha:.6g}): " + _admissible_step(
        limit, operator.theta, duration
    )


def _admissible_step(limit: float, theta: float, duration: float) -> str:
    """Return the text on the largest admissible step of a case without a unique solution; W > 0 up to ``limit``.

    Friction heat that stays at the tip expands it, so that W falls to 0 about linearly, as 1 - r at h = r ``limit``.
    The heat of a pressed tip then grows by the factor (1 + r (1 - θ)/θ)/(1 - r) in each step, which has no bound at the
    limit itself. Half of the limit is recommended, or a smaller fraction where the squares of that growth over the
    duration would not be finite; as r → 0 the growth is that of the model.
    """
    for share in (0.5, 0.1, 0.01) if limit > 0 else ():
        factor = (1 + share * (1 - theta) / theta) / (1 - share)
        if np.log(factor) * duration / (share * limit) < _MOST_GROWTH:
            return (
                f"{limit:.6g} s is the limit, near which the heat of a step multiplies itself; "
                f"the largest admissible h is {share * limit:.6g} s"
            )
    return (
        f"{limit:.6g} s is the limit, but there is no largest admissible h, as the heat of a pressed tip overflows "
        "within the duration; shorten the duration, or lower alpha"
    )
