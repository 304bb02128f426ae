"""Moreau–Jean θ-method with Newton's law at velocity level and implicitly coupled heat.

DESIGN section 2, "Discrete contact"; Acary & Brogliato (2008), chapters 8 and 10. θ = 1 is the
implicit Euler scheme of Thorin, Guérin and Legrand. In modal coordinates the pair
(ζ, ξ = η - hθζ) of a mode takes an impulse in ζ alone and steps by

    ζ ← ζ + w s,   ζ' = a ζ + b ξ,   ξ' = ξ + h ζ,

with s the load's impulse less the contact's.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from workflow.declare import quantity
from workflow.models import Array, Cases, Structure, poles
from workflow.schemes._balance import Audit, Books, account, couple, leak, no_audit, open_audit
from workflow.schemes._decoupled import Decoupled, decouple, start
from workflow.schemes._interface import Results, Sampling, Status, schedule
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._modal_lanes import (
    ALPHA,
    COMPLIANCE,
    DELASSUS,
    DRIFT,
    HEAT,
    HEAT_MODES,
    MODES,
    OWN_ROWS,
    PUSHED,
    RESTITUTION,
    WARMING,
    WARMTH,
    Coefficients,
    begin,
    conduct,
    grouped,
    pull_pairs,
    swing,
    swing_heated,
    take_heat,
)
from workflow.schemes._stepping import (
    DISPLACEMENT,
    FORCE,
    FORCE_BEFORE,
    GAP,
    LANES,
    NEW_DISPLACEMENT,
    NEW_TEMPERATURE,
    NEW_VELOCITY,
    STEP_IMPULSE,
    TEMPERATURE,
    VELOCITY,
    Block,
    advance_load,
    blocks,
    collect,
    fill_lanes,
    lane_rows,
    merge,
    observe,
    start_load,
    take_marks,
    watch,
)

READS = frozenset({"e", "h", "alpha"})

_ROUNDING = 16 * np.finfo(float).eps
"""A free step grows only above 1 by more than the few operations that compute its factor can err."""


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    theta: float = quantity("1", "weight of the step's end, 1: implicit Euler", default=1.0, at_least=0, at_most=1)


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
            modes=grouped(
                MODES,
                (1 - h * (1 - theta) * c - h**2 * theta * (2 - theta) * omega2) / inertia,
                -h * omega2 / inertia,
                tip**2 / inertia,
                tip * (thermal_kick + modal.response @ (mu * warm)),
                -tip * (modal.response @ modal.heat_tip),
            ),
            heat_modes=grouped(HEAT_MODES, decay, warm, -mu * modal.tip_response, modal.heat_tip),
            pair_mode=j,
            pair_heat=k,
            pair_pull=-h * tip[j] * modal.coupling[j, k] * (theta * decay[k] + 1 - theta) / inertia[j],
            inverse_mass=float(np.sum(tip**2 / inertia)),
            warming=float(np.sum(modal.heat_tip * warm)),
            theta=theta,
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
    lam = poles(frequency, damping)
    return (1 + (1 - options.theta) * h * lam) / (1 - options.theta * h * lam)


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return (1 - (1-θ)hμ)/(1 + θhμ) of each thermal mode."""
    return np.asarray((1 - (1 - options.theta) * h * rate) / (1 + options.theta * h * rate))


def cost(structure: Structure, h: float, options: Options, sampling: Sampling) -> float:
    """Return estimated seconds per heated case: a fixed model of steps, groups of modes and samples.

    Its numbers lie between what a batch of eight and what a batch of a thousand cases took on one
    core of a server processor of 2024 (Zen 5, vectors of eight, about 3 GHz), heated, full with 20
    nodes and reduced to 3 + 12 modes: 2.8 ns a step for the tip and 0.65 ns for each group of
    modes, 15 ns a sample, 1.5 us to set a case up. A processor with vectors of four takes about
    twice as long; fewer than eight cases cost together what eight do. Balances cost three to five
    times the step itself: 3 ns, 1.6 and 0.8 ns for each group of mechanical and thermal modes
    and 0.6 ns for each pair of groups.
    """
    modes, heat_modes = -(-structure.mechanical_size // MODES), -(-structure.thermal_size // HEAT_MODES)
    step = 2.8e-9 + 0.65e-9 * (modes + heat_modes)
    if sampling.balances:
        step += 3e-9 + 1.6e-9 * modes + 0.8e-9 * heat_modes + 0.6e-9 * modes * heat_modes
    return sampling.steps(h) * step + sampling.count * 1.5e-8 + 1.5e-6


@inlined
def _touch(
    theta: float, inverse_mass: float, warming: float, h: float, own: Array, load: Array, tip: Array, lanes: int
) -> None:
    """Close the step: load and contact impulse at the tip, from its free velocity to its new state.

    After an impulse the velocity is -e v_n,k to the bit, not to the rounding of v_free - W p: a tip
    at rest on its casing keeps its place and stays active for any number of steps.
    """
    assert own.shape[1] == LANES
    assert load.shape[1] == LANES
    assert tip.shape[1] == LANES
    for lane in range(lanes):
        x, v = tip[DISPLACEMENT, lane], tip[VELOCITY, lane]
        pushed = h * ((1.0 - theta) * load[FORCE_BEFORE, lane] + theta * load[FORCE, lane])
        free = tip[NEW_VELOCITY, lane] + inverse_mass * pushed
        closing = (free + own[RESTITUTION, lane] * v) * own[COMPLIANCE, lane]
        p = closing if x + 0.5 * h * v >= tip[GAP, lane] else 0.0
        p = 0.0 if p <= 0.0 else p  # a NaN passes
        after = -own[RESTITUTION, lane] * v if p > 0.0 else free - own[DELASSUS, lane] * p
        own[PUSHED, lane] = pushed - p
        own[HEAT, lane] = own[ALPHA, lane] * p
        tip[STEP_IMPULSE, lane] = p
        tip[NEW_VELOCITY, lane] = after
        tip[NEW_TEMPERATURE, lane] += warming * own[HEAT, lane]
        tip[NEW_DISPLACEMENT, lane] = x + h * (theta * after + (1.0 - theta) * v)


@kernel
def _march(
    operator: Coefficients, own: Array, motion: Array, tau: Array, tau_before: Array, block: Block, audit: Audit
) -> None:
    """Step a block of cases; lanes never meet.

    A step: free velocity and temperature of the tip from the thermal and mechanical modes, which
    take in the impulse and heat of the step before; load and contact; what is watched.

    ``tau_before`` is left with τ at the beginning of the last step, ``tau`` with τ at its end.
    """
    modes, heat_modes = operator.modes, operator.heat_modes
    load, tip, lanes, h, next_mark = block.load, block.tip, block.lanes, block.h, block.marks.next_mark
    heated, paired = tau.shape[0] > 0, operator.pair_mode.size > 0
    theta, audited, sums = audit.theta, audit.sums.shape[0] > 0, audit.sums
    start_load(h, load, lanes)
    if audited:
        open_audit(audit, lanes)
    for step in range(1, block.steps + 1):
        begin(step * h, own, tip, lanes)
        if heated:
            if paired or step == block.steps:
                take_heat(heat_modes, tau, own, tau_before, lanes)
            conduct(heat_modes, tau, own, tip, lanes)
            swing_heated(modes, h, motion, own, tip, lanes)
            if paired:
                pull_pairs(operator, tau_before, motion, tip, lanes)
        else:
            swing(modes, h, motion, own, tip, lanes)
        advance_load(step, h, load, lanes)
        _touch(operator.theta, operator.inverse_mass, operator.warming, h, own, load, tip, lanes)
        if audited:
            if heated:
                leak(h, audit.heat_modes, audit.heat, own, sums, lanes)
                couple(audit.coupling, audit.heat, audit.motion, lanes)
            account(theta, h, audit.modes, audit.motion, own, load, tip, sums, lanes)
        observe(take_marks(step, block) if step == next_mark[0] else h, tip, lanes)
    take_heat(heat_modes, tau, own, tau, lanes)


def _largest_stable_step(modal: Decoupled, theta: float) -> float:
    """Return the step up to which no free mode grows: 2 Re λ + (1-2θ) h |λ|² <= 0 for every λ."""
    if theta >= 0.5:
        return float("inf")
    lam = np.concatenate([poles(modal.frequency, modal.damping).ravel(), -modal.rate + 0j])
    lam = lam[np.abs(lam) > 0]
    return float(np.min(-2 * lam.real / ((1 - 2 * theta) * np.abs(lam) ** 2), initial=np.inf))


def _run(operator: Operator, modal: Decoupled, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, theta = operator.h, operator.theta
    coefficients = operator.coefficients(modal)
    begun = start(modal, cases)
    plan = schedule(sampling, h)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, plan, h)
    w = delassus(modal, h, theta, cases.alpha)
    ill_posed = w <= 0
    of_lane = np.zeros((OWN_ROWS, cases.count))
    for row, values in (
        (RESTITUTION, cases.e),
        (ALPHA, cases.alpha),
        (DELASSUS, w),
        (COMPLIANCE, np.where(ill_posed, np.nan, 1 / np.where(ill_posed, 1.0, w))),
        (DRIFT, begun.drift),
        (WARMTH, begun.warmth),
        (WARMING, begun.warming),
    ):
        of_lane[row] = values
    zeta = begun.velocity * modal.tip
    xi = begun.position * modal.tip - h * theta * zeta
    pairs = grouped(MODES, zeta.T, xi.T).reshape(-1, 2 * MODES, cases.count)
    heat = grouped(HEAT_MODES, begun.heat.T)[:, 0]
    own, motion = lane_rows(OWN_ROWS), lane_rows(*pairs.shape[:2])
    tau, tau_before = lane_rows(*heat.shape[:2]), lane_rows(*heat.shape[:2])
    closing = begun.closing + begun.closing_rate * sampling.duration
    growth = grouped(HEAT_MODES, modal.static_growth)[:, 0, :, None]
    books = Books(operator.structure, modal, cases, begun.tip_force, h, theta) if sampling.balances else None
    audit = no_audit() if books is None else books.audit
    for part, block in blocks(watched):
        if books is not None:
            books.open(part)
        fill_lanes(own, of_lane[:, part])
        fill_lanes(motion, pairs[..., part])
        fill_lanes(tau, heat[..., part])
        _march(coefficients, own, motion, tau, tau_before, block, audit)
        if books is not None:
            books.close(part, plan.steps * h)
        reached = tau_before + plan.weight[-1] * (tau - tau_before)
        sums = np.sum(growth * reached, axis=(0, 1))  # in the same order whatever lanes are in use
        closing[part] += sums[: part.stop - part.start]
    finite = np.asarray(np.isfinite(watched.tip[[DISPLACEMENT, TEMPERATURE]]).all(axis=0))
    status, messages = judge(operator, modal, cases, ill_posed, finite)
    balances = {} if books is None else books.residuals
    return collect(watched, closing, status, messages, balances)


def judge(
    operator: Operator, modal: Decoupled, cases: Cases, ill_posed: NDArray[np.bool_], finite: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], dict[int, str]]:
    """Decide what became of each case: by theory where it can be, else by its last state."""
    h, theta = operator.h, operator.theta
    options = Options(theta)
    free = np.abs(amplification(modal.frequency, modal.damping, h, options)).max(initial=0.0)
    heat = np.abs(thermal_amplification(modal.rate, h, options)).max(initial=0.0)
    growth = float(max(free, heat))
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
    with np.errstate(over="ignore", invalid="ignore"):  # a case that is lost says so by its status
        return merge([(w, _run(operator, modal, cases.take(w), sampling)) for w, modal in groups if w.size])
