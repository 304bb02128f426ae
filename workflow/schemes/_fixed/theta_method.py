"""The θ-method in modal coordinates, its Delassus operator, and how its cases ended: moreau and implicit penalty.

With ξ = η - hθζ the pair (ζ, ξ) of a mode takes an impulse s (of the load less that of contact) in ζ alone:

    ζ ← ζ + φ_n s / (1 + hθc + h²θ²ω²),   ζ' = a ζ + b ξ,   ξ' = ξ + h ζ,
    a = (1 - h(1-θ)c - h²θ(2-θ)ω²) / (1 + hθc + h²θ²ω²),   b = -hω² / (1 + hθc + h²θ²ω²),

and a thermal mode steps by (1 + hθμ) τ' = (1 - h(1-θ)μ) τ + χ_n α p. Of a tip without mass the 1 of its static
deformation is 0, and its free step has the factor -(1-θ)/θ.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.complex_numbers import magnitude, over
from workflow.kernels.sums import product, total
from workflow.models import Array, Cases, Structure, poles
from workflow.schemes._fixed.books import Books, Terms
from workflow.schemes._fixed.contact import Law, TipStep
from workflow.schemes._fixed.decoupled import Decoupled, Motion, start
from workflow.schemes._fixed.drive import drive_of
from workflow.schemes._fixed.march import Batch, case_rows, march_blocks
from workflow.schemes._fixed.marks import TIP_DISPLACEMENT, TIP_TEMPERATURE
from workflow.schemes._fixed.modal_lanes import Coefficients, by_mode
from workflow.schemes._fixed.outcome import ROUNDING
from workflow.schemes._fixed.sliding import friction_message, slides, sliding, yields_aside
from workflow.schemes._fixed.stable_steps import largest_step, limit_text
from workflow.schemes._fixed.stepping import Watch, watch
from workflow.schemes._interface import Sampling, Status, schedule
from workflow.schemes._sweep.sweeps import Swept

_MOST_GROWTH = 300.0
"""Logarithm of the largest growth within a run that still has squares among the finite numbers (355), with a margin of
1e24 for loads and units."""


NEEDS_IMPLICIT = "the reduction leaves the tip without mass, which an explicit step (theta = 0) cannot move"
"""Why an explicit θ-method cannot step a tip without mass."""


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares: structure, step h [s] and θ, and the structure as it is stepped."""

    structure: Structure
    h: float
    theta: float
    motion: Decoupled | Swept


class Ended(NamedTuple):
    """What a march leaves."""

    watched: Watch
    closing: Array
    """Quasi-static tip growth at the end, m, ``(case,)``."""
    balances: dict[str, Array]
    own: Array
    """Rows ``CASE_…``, ``(row, case)``."""

    @property
    def finite(self) -> NDArray[np.bool_]:
        """Which cases ended with finite numbers, ``(case,)``."""
        return np.asarray(np.isfinite(self.watched.tip[[TIP_DISPLACEMENT, TIP_TEMPERATURE]]).all(axis=0))


def amplification(frequency: Array, damping: Array, h: float, theta: float) -> Any:
    """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode; -(1-θ)/θ where ω is infinite."""
    infinite = np.isinf(frequency)
    lam = poles(np.where(infinite, 0.0, frequency), np.where(infinite, 0.0, damping))
    factors = over(1 + (1 - theta) * h * lam, 1 - theta * h * lam)
    factors[infinite] = -(1 - theta) / theta if theta > 0 else -np.inf
    return factors


def thermal_amplification(rate: Array, h: float, theta: float) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return np.asarray((1 - (1 - theta) * h * rate) / (1 + theta * h * rate))


def delassus(motion: Decoupled | Swept, h: float, theta: float, alpha: Array, friction: Array | float = 0.0) -> Array:
    """Return the Delassus operator W = e_nᵀ Ŵ⁻¹ (e_n - µ t + α hθ K12 T̂⁻¹ e_n), 1/kg, ``(case,)``."""
    cold, per_alpha = motion.delassus(h, theta)
    inverse_mass = np.asarray(cold + alpha * per_alpha)
    if isinstance(motion, Swept) or motion.along is None:
        return inverse_mass
    return inverse_mass - friction * yields_aside(motion, motion.inertia(h, theta))


def coefficients(modal: Decoupled, h: float, theta: float, slides: bool = False) -> Coefficients:
    """Return the step's coefficients, with or without thermal states, with friction along the tangent or without."""
    omega2, c, tip, mu = modal.frequency**2, modal.damping, modal.tip, modal.rate
    inertia = modal.inertia(h, theta)
    warm = modal.heat_tip / (1 + h * theta * mu)
    thermal_kick = -h * theta * product(modal.coupling, warm) / inertia
    decay, scale = (1 - h * (1 - theta) * mu) / (1 + h * theta * mu), modal.heat_scale
    j, k = modal.pairs.T
    return Coefficients(
        modes=by_mode(
            (modal.mass - h * (1 - theta) * c - h * h * theta * (2 - theta) * omega2) / inertia,
            -h * omega2 / inertia,
            tip**2 / inertia,
            tip * (thermal_kick + product(modal.response, mu * warm)),
            -tip * product(modal.response, modal.heat_tip),
        ),
        heat_modes=by_mode(decay, scale * warm, -mu * modal.tip_response / scale),
        pair_mode=j,
        pair_heat=k,
        pair_pull=-h * tip[j] * modal.coupling[j, k] * (theta * decay[k] + 1 - theta) / (inertia[j] * scale[k]),
        tip=TipStep(
            h,
            theta,
            1.0 - theta,
            total(tip**2 / inertia),
            total(modal.heat_tip * warm),
        ),
        heat_counts=True,
        sliding=sliding(modal, inertia) if slides else None,
    )


def _terms(modal: Decoupled, h: float, theta: float, begun: Motion) -> Terms:
    """Return how the step enters its balance."""
    warm = modal.heat_tip / (1 + h * theta * modal.rate)
    decay = thermal_amplification(modal.rate, h, theta)
    near = np.where(modal.response == 0, modal.coupling, 0.0)
    return Terms(
        lever=h * theta,
        kinetic=modal.mass,
        inertia=modal.inertia(h, theta),
        heat_speed=modal.mass * product(modal.response, modal.rate * modal.heat_tip) - h * theta * product(near, warm),
        heat_place=-product(modal.response, modal.heat_tip),
        dragged=-total(modal.rate * modal.tip_response * warm),
        decay=decay,
        warm=warm,
        warm_next=decay * warm,
        velocity=begun.velocity,
        place=begun.position - h * theta * begun.velocity,
        opens=False,
    )


def step_modes(
    kernel: Callable[..., None],
    operator: Operator,
    modal: Decoupled,
    law: Law,
    cases: Cases,
    sampling: Sampling,
) -> Ended:
    """Step cases in modes by a kernel of the scheme; ``modal`` has thermal states or has not."""
    h, theta = operator.h, operator.theta
    drive, stepped = drive_of(cases, h, theta)
    begun = start(modal, stepped)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, schedule(sampling, h), h, drive)
    zeta = begun.velocity * modal.tip
    xi = begun.position * modal.tip - h * theta * zeta
    free = coefficients(modal, h, theta, slides(modal, cases))
    books = None
    if sampling.balances:
        books = Books(operator.structure, modal, free, stepped, begun, _terms(modal, h, theta, begun))
    batch = Batch(modal, begun, free, law, zeta, xi, case_rows(cases, begun), books)
    closing, balances = march_blocks(kernel, batch, watched, sampling.duration)
    return Ended(watched, closing, balances, batch.own)


def _growth(operator: Operator) -> float:
    """Return the largest factor of a free step; none is above 1 where θ >= 1/2."""
    motion, h, theta = operator.motion, operator.h, operator.theta
    if theta >= 0.5:
        return 1.0
    free = magnitude(amplification(_natural(operator), motion.damping, h, theta)).max(initial=0.0)
    heat = np.abs(thermal_amplification(motion.rate, h, theta)).max(initial=0.0)
    return float(max(free, heat))


def _natural(operator: Operator) -> Array:
    """Return ω of the modes that are stepped, rad/s, the last one infinite where the tip has no mass."""
    frequency = operator.motion.frequency.copy()
    if operator.structure.has_massless_tip:
        frequency[-1] = np.inf
    return frequency


def _largest_stable_step(operator: Operator) -> float:
    """Return the step up to which no free mode grows: 2 Re λ + (1-2θ) h |λ|² <= 0 for every λ."""
    motion, theta = operator.motion, operator.theta
    if theta >= 0.5:
        return float("inf")
    if operator.structure.has_massless_tip:
        return 0.0
    lam = np.concatenate([poles(motion.frequency, motion.damping).ravel(), -motion.rate + 0j])
    lam = lam[lam != 0]
    return float(np.min(-2 * lam.real / ((1 - 2 * theta) * (lam.real**2 + lam.imag**2)), initial=np.inf))


def _admissible_step(limit: float, theta: float, duration: float) -> str:
    """Return up to which step a case without a unique solution runs; ``limit`` is that up to which W > 0.

    W falls to 0 as friction heat that stays at the tip pushes it on: about linearly, as 1 - r at h = r ``limit``. A
    pressed tip's heat then grows by the factor (1 + r (1 - θ)/θ)/(1 - r) in each step, which has no bound at the limit
    itself. Half of it is recommended, or a smaller share where that growth over the duration would leave numbers
    whose squares are finite; as r → 0 the growth is that of the model.
    """
    for share in (0.5, 0.1, 0.01) if limit > 0 else ():
        factor = (1 + share * (1 - theta) / theta) / (1 - share)
        if np.log(factor) * duration / (share * limit) < _MOST_GROWTH:
            return (
                f"{limit:.6g} s is the limit, near which the heat of a step multiplies itself; "
                f"the largest admissible h is {share * limit:.6g} s"
            )
    return (
        f"{limit:.6g} s is the limit, but there is no largest admissible h, as no step helps: the heat of a pressed "
        "tip grows out of the finite numbers within the duration; shorten it, or lower alpha"
    )


class Contact(NamedTuple):
    """Whether the contact of a step has one solution: where ``factor(h, alpha, friction)``, ``(case,)``, > 0."""

    factor: Callable[[float, Array, Array], Array]
    name: str
    """The factor as messages write it."""

    def message(self, operator: Operator, alpha: float, friction: float, duration: float) -> str:
        """Return what is said of a case without a unique solution."""
        h, none, slid = operator.h, np.array(0.0), np.array(friction)
        if self.factor(h, none, slid) <= 0:
            return friction_message(h, friction, self.name)
        limit = largest_step(lambda step: bool(self.factor(step, np.array(alpha), slid) > 0), h)
        return (
            f"contact has no unique solution at h = {h:.6g} s ({self.name} <= 0 at alpha = {alpha:.6g}): "
            + _admissible_step(limit, operator.theta, duration)
        )


def judge(
    operator: Operator, contact: Contact, cases: Cases, duration: float, finite: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], dict[int, str]]:
    """Decide what became of each case: by theory where it can be, else by whether its last state is ``finite``."""
    h, theta, growth = operator.h, operator.theta, _growth(operator)
    ill_posed = contact.factor(h, cases.alpha, cases.friction) <= 0
    status = np.full(cases.count, Status.OK, dtype=np.int8)
    messages: dict[int, str] = {}
    said: dict[tuple[float, float], str] = {}  # a limit is found by hundreds of trials
    for case in map(int, np.flatnonzero(~finite | (growth > 1 + ROUNDING))):
        if ill_posed[case] and not finite[case]:
            status[case] = Status.ILL_POSED
            law = float(cases.alpha[case]), float(cases.friction[case])
            if law not in said:
                said[law] = contact.message(operator, *law, duration)
            messages[case] = said[law]
            continue
        status[case] = Status.DIVERGED
        messages[case] = f"the state left the finite numbers at h = {h:.6g} s"
        if growth > 1 + ROUNDING:
            limit = _largest_stable_step(operator)
            messages[case] = f"the free step grows {growth:.6g}-fold at theta = {theta:g} and h = {h:.6g} s; " + (
                f"it is stable up to h = {limit_text(limit)} s" if limit > 0 else "it is stable at no h"
            )
    return status, messages
