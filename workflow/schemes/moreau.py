"""Moreau–Jean θ-method with Newton's law at velocity level and implicitly coupled heat.

DESIGN section 2, "Discrete contact"; Acary & Brogliato (2008), chapters 8 and 10. θ = 1 is the
implicit Euler scheme of Thorin, Guérin and Legrand. In modal coordinates the pair
(ζ, ξ = η - hθζ) of a mode takes an impulse in ζ alone and steps by

    ζ ← ζ + w s,   ζ' = a ζ + b ξ,   ξ' = ξ + h ζ,

with s the load's impulse less the contact's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from workflow.declare import quantity
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._decoupled import Decoupled, decouple, start
from workflow.schemes._interface import Results, Sampling, Status, schedule
from workflow.schemes._stepping import (
    Block,
    Load,
    Marks,
    Record,
    Tip,
    advance_load,
    blocks,
    collect,
    merge,
    observe,
    start_load,
    start_marks,
    watch,
)

READS = frozenset({"e", "h", "alpha"})

_ROUNDING = 16 * np.finfo(float).eps
"""A free step grows only above 1 by more than the few operations that compute its factor can err."""


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    theta: float = quantity("1", "weight of the step's end, 1: implicit Euler", default=1.0, at_least=0, at_most=1)


class Coefficients(NamedTuple):
    """One free step and one unit impulse in modal coordinates; the kernel's view of an operator."""

    keep: Array
    """a: ζ' per ζ, ``(mode,)``."""
    pull: Array
    """b: ζ' per ξ, ``(mode,)``."""
    push: Array
    """ζ per unit impulse at the tip, ``(mode,)``."""
    heat_push: Array
    """ζ per unit heat at the tip, ``(mode,)``."""
    heat_shift: Array
    """ξ per unit heat at the tip, ``(mode,)``."""
    decay: Array
    """τ' per τ, ``(thermal mode,)``."""
    warm: Array
    """τ per unit heat at the tip, ``(thermal mode,)``."""
    drag: Array
    """Tip velocity per τ, ``(thermal mode,)``."""
    glow: Array
    """Tip temperature per τ, ``(thermal mode,)``."""
    pair_mode: Array
    pair_heat: Array
    pair_pull: Array
    """ζ' of a mode per τ of a thermal mode near resonance with it, ``(pair,)``."""
    inverse_mass: float
    """Tip velocity per unit impulse, e_nᵀ Ŵ⁻¹ e_n."""
    warming: float
    """Tip temperature per unit heat."""


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares: structure, step and options, and what follows from them."""

    structure: Structure
    h: float
    theta: float
    modal: Decoupled

    def coefficients(self, modal: Decoupled) -> Coefficients:
        """Return the step's coefficients, with or without thermal states."""
        h, theta = self.h, self.theta
        omega2, c, tip, mu = modal.frequency**2, modal.damping, modal.tip, modal.rate
        inertia = 1 + h * theta * c + h**2 * theta**2 * omega2
        warm = modal.heat_tip / (1 + h * theta * mu)
        thermal_kick = -h * theta * (modal.coupling @ warm) / inertia
        decay = (1 - h * (1 - theta) * mu) / (1 + h * theta * mu)
        j, k = modal.pairs.T
        return Coefficients(
            keep=(1 - h * (1 - theta) * c - h**2 * theta * (2 - theta) * omega2) / inertia,
            pull=-h * omega2 / inertia,
            push=tip**2 / inertia,
            heat_push=tip * (thermal_kick + modal.response @ (mu * warm)),
            heat_shift=-tip * (modal.response @ modal.heat_tip),
            decay=decay,
            warm=warm,
            drag=-mu * modal.tip_response,
            glow=modal.heat_tip,
            pair_mode=j,
            pair_heat=k,
            pair_pull=-h * tip[j] * modal.coupling[j, k] * (theta * decay[k] + 1 - theta) / inertia[j],
            inverse_mass=float(np.sum(tip**2 / inertia)),
            warming=float(np.sum(modal.heat_tip * warm)),
        )


def init(structure: Structure, h: float, options: Options) -> Operator:
    """Diagonalise the structure once for a batch."""
    return Operator(structure, float(h), float(options.theta), decouple(structure))


def _heat_coupling(modal: Decoupled, h: float, theta: float) -> float:
    """Return e_nᵀ Ŵ⁻¹ hθ K12 T̂⁻¹ e_n, what α adds to W."""
    inertia = 1 + h * theta * modal.damping + h**2 * theta**2 * modal.frequency**2
    warm = modal.heat_tip / (1 + h * theta * modal.rate)
    return float(np.sum(modal.tip * h * theta * (modal.coupling @ warm) / inertia))


def delassus(modal: Decoupled, h: float, theta: float, alpha: Array) -> Array:
    """Return the Delassus operator W = e_nᵀ Ŵ⁻¹ (e_n + α hθ K12 T̂⁻¹ e_n), 1/kg, ``(case,)``."""
    inertia = 1 + h * theta * modal.damping + h**2 * theta**2 * modal.frequency**2
    return np.asarray(float(np.sum(modal.tip**2 / inertia)) + alpha * _heat_coupling(modal, h, theta))


def largest_admissible_step(modal: Decoupled, h: float, theta: float, alpha: float) -> float:
    """Return the largest step below ``h`` up to which W > 0 for every smaller step."""
    steps = h * np.logspace(-12, 0, 481)
    positive = np.array([float(delassus(modal, s, theta, np.array(alpha))) > 0 for s in steps])
    if not positive[0]:
        return 0.0
    first_bad = int(np.argmin(positive))
    return float(
        brentq(lambda s: float(delassus(modal, s, theta, np.array(alpha))), steps[first_bad - 1], steps[first_bad])
    )


def amplification(frequency: Array, damping: Array, h: float, options: Options) -> Any:
    """Return the eigenvalues (1 + (1-θ)hλ)/(1 - θhλ) of the free step of each mode."""
    root = np.emath.sqrt((damping / 2) ** 2 - frequency**2 + 0j)
    lam = np.stack([-damping / 2 + root, -damping / 2 - root], axis=-1)
    return (1 + (1 - options.theta) * h * lam) / (1 - options.theta * h * lam)


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return np.asarray((1 - (1 - options.theta) * h * rate) / (1 + options.theta * h * rate))


def cost(structure: Structure, h: float, options: Options, sampling: Sampling) -> float:
    """Return estimated seconds per heated case, from per-mode costs of a current core."""
    per_step = 6e-9 + 0.35e-9 * structure.mechanical_size + 0.2e-9 * structure.thermal_size
    return sampling.steps(h) * per_step + 5e-6


@numba.njit(nogil=True, cache=True)
def _march(
    steps: int,
    h: float,
    theta: float,
    operator: Coefficients,
    e: Array,
    alpha: Array,
    delassus_operator: Array,
    drift: Array,
    warmth: Array,
    warming: Array,
    zeta: Array,
    xi: Array,
    tau: Array,
    tau_before: Array,
    load: Load,
    tip: Tip,
    marks: Marks,
    record: Record,
) -> None:
    """Step a block of cases; states are ``(mode, lane)`` and lanes never meet."""
    lanes = e.size
    impulse = np.zeros(lanes)  # of load and contact, what the tip takes in one step
    heat = np.zeros(lanes)
    x, v, temperature, p = np.empty(lanes), np.empty(lanes), np.empty(lanes), np.zeros(lanes)
    start_load(load, h)
    start_marks(tip, marks, record)
    for step in range(1, steps + 1):
        for lane in range(lanes):
            v[lane] = drift[lane]
            temperature[lane] = warmth[lane] + warming[lane] * (step * h)
        for k in range(tau.shape[0]):
            warm, decay = operator.warm[k], operator.decay[k]
            drag, glow = operator.drag[k], operator.glow[k]
            for lane in range(lanes):
                before = tau[k, lane] + warm * heat[lane]
                tau_before[k, lane] = before
                tau[k, lane] = decay * before
                v[lane] += drag * tau[k, lane]
                temperature[lane] += glow * tau[k, lane]
        for j in range(zeta.shape[0]):
            keep, pull, push = operator.keep[j], operator.pull[j], operator.push[j]
            heat_push, heat_shift = operator.heat_push[j], operator.heat_shift[j]
            for lane in range(lanes):
                before = zeta[j, lane] + push * impulse[lane] + heat_push * heat[lane]
                place = xi[j, lane] + heat_shift * heat[lane]
                after = keep * before + pull * place
                zeta[j, lane] = after
                xi[j, lane] = place + h * before
                v[lane] += after
        for pair in range(operator.pair_mode.size):
            j, k, gain = operator.pair_mode[pair], operator.pair_heat[pair], operator.pair_pull[pair]
            for lane in range(lanes):
                zeta[j, lane] += gain * tau_before[k, lane]
                v[lane] += gain * tau_before[k, lane]
        for lane in range(lanes):
            impulse[lane] = (1.0 - theta) * load.force[lane]
        advance_load(load, step, h)
        for lane in range(lanes):
            pushed = h * (impulse[lane] + theta * load.force[lane])
            free = v[lane] + operator.inverse_mass * pushed
            active = tip.displacement[lane] + 0.5 * h * tip.velocity[lane] >= tip.gap[lane]
            closing = (free + e[lane] * tip.velocity[lane]) / delassus_operator[lane]
            p[lane] = 0.0 if not active or closing <= 0.0 else closing  # a NaN passes
            impulse[lane] = pushed - p[lane]
            heat[lane] = alpha[lane] * p[lane]
            v[lane] = free - delassus_operator[lane] * p[lane]
            temperature[lane] += operator.warming * heat[lane]
            x[lane] = tip.displacement[lane] + h * (theta * v[lane] + (1.0 - theta) * tip.velocity[lane])
        observe(step, step == steps, h, x, v, temperature, p, tip, marks, record)
    for k in range(tau.shape[0]):
        for lane in range(lanes):
            tau[k, lane] += operator.warm[k] * heat[lane]


def _largest_stable_step(modal: Decoupled, theta: float) -> float:
    """Return the step up to which no free mode grows: 2 Re λ + (1-2θ) h |λ|² <= 0 for every λ."""
    if theta >= 0.5:
        return float("inf")
    root = np.emath.sqrt((modal.damping / 2) ** 2 - modal.frequency**2 + 0j)
    lam = np.concatenate([-modal.damping / 2 + root, -modal.damping / 2 - root, -modal.rate + 0j])
    lam = lam[np.abs(lam) > 0]
    return float(np.min(-2 * lam.real / ((1 - 2 * theta) * np.abs(lam) ** 2), initial=np.inf))


def _run(operator: Operator, modal: Decoupled, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, theta = operator.h, operator.theta
    coefficients = operator.coefficients(modal)
    motion = start(modal, cases)
    plan = schedule(sampling, h)
    watched = watch(cases, sampling, plan, h)
    w = delassus(modal, h, theta, cases.alpha)
    ill_posed = w <= 0
    done = blocks(watched, cases.mean + motion.tip_force)
    closing = motion.closing + motion.closing_rate * sampling.duration
    for block in done:
        part = block.cases
        zeta = np.ascontiguousarray((motion.velocity[part] * modal.tip).T)
        xi = np.ascontiguousarray((motion.position[part] * modal.tip).T) - h * theta * zeta
        tau = np.ascontiguousarray(motion.heat[part].T)
        tau_before = tau.copy()
        _march(
            plan.steps,
            h,
            theta,
            coefficients,
            np.ascontiguousarray(cases.e[part]),
            np.ascontiguousarray(cases.alpha[part]),
            np.where(ill_posed, np.nan, w)[part],
            motion.drift[part],
            motion.warmth[part],
            motion.warming[part],
            zeta,
            xi,
            tau,
            tau_before,
            block.load,
            block.tip,
            block.marks,
            block.record,
        )
        reached = tau_before + plan.weight[-1] * (tau - tau_before)
        closing[part] += project(modal.static_growth[None, :], reached.T)[:, 0]
    status, messages = _judge(operator, modal, cases, ill_posed, done)
    return collect(watched, done, closing, status, messages)


def _judge(
    operator: Operator, modal: Decoupled, cases: Cases, ill_posed: NDArray[np.bool_], done: list[Block]
) -> tuple[NDArray[np.int8], dict[int, str]]:
    """Decide what became of each case: by theory where it can be, else by its last state."""
    h, theta = operator.h, operator.theta
    options = Options(theta)
    free = np.abs(amplification(modal.frequency, modal.damping, h, options)).max(initial=0.0)
    heat = np.abs(thermal_amplification(modal.rate, h, options)).max(initial=0.0)
    growth = float(max(free, heat))
    finite = np.concatenate([np.isfinite(b.tip.displacement + b.tip.temperature) for b in done])
    status = np.full(cases.count, Status.OK, dtype=np.int8)
    messages: dict[int, str] = {}
    for case in np.flatnonzero(~finite if growth <= 1 + _ROUNDING else np.ones(cases.count, dtype=bool)):
        if ill_posed[case] and not finite[case]:
            limit = largest_admissible_step(modal, h, theta, float(cases.alpha[case]))
            status[case] = Status.ILL_POSED
            messages[int(case)] = (
                f"contact has no unique solution at h = {h:.6g} s (W <= 0 at alpha = {cases.alpha[case]:.6g}); "
                f"the largest admissible h is {limit:.6g} s"
            )
        elif growth > 1 + _ROUNDING:
            limit = _largest_stable_step(modal, theta)
            status[case] = Status.DIVERGED
            messages[int(case)] = f"the free step grows {growth:.6g}-fold at theta = {theta:g} and h = {h:.6g} s; " + (
                f"it is stable up to h = {limit:.6g} s" if limit > 0 else "it is stable at no h"
            )
        else:
            status[case] = Status.DIVERGED
            messages[int(case)] = f"the state left the finite numbers at h = {h:.6g} s"
    return status, messages


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), operator.modal), (np.flatnonzero(~heated), operator.modal.without_heat())]
    return merge([(w, _run(operator, modal, cases.take(w), sampling)) for w, modal in groups if w.size])
