"""The θ-method with a contact spring and damper whose force at the step's end is found with the step.

The free step, its heat and W are those of :mod:`workflow.schemes.moreau`; the impulse of a step is
p = h (θ λ' + (1-θ) λ), both forces by the law λ = max(0, κ (x_n - d) + c v_n) where x_n > d. With the tip at
(x_a, v_a) for λ' = 0 there are two branches:

    apart      λ' = 0,                                            consistent where x_a <= d or λ' below is not > 0
    in contact λ' = (κ (x_a - d) + c v_a) / (1 + hθW (hθκ + c)),  consistent where then x_n' > d

The force jumps by c v_n at the casing: where neither is consistent (the damper alone would push the
tip out again) λ' is what puts the tip on the casing, between the two.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Structure
from workflow.schemes import moreau
from workflow.schemes._balance import (
    ENERGY,
    SPENT,
    Audit,
    Books,
    audit_step,
    keep_energy,
    lay_out_audit,
    no_audit,
)
from workflow.schemes._central_march import APPROACHED, LATEST, SEPARATED, restitution, turn_about
from workflow.schemes._decoupled import Decoupled, start
from workflow.schemes._interface import Results, Sampling, Status, merge, schedule
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._lanes import PACK, WIDE, fill_lanes, lane_rows
from workflow.schemes._marks import (
    DISPLACEMENT,
    GAP,
    NEW_DISPLACEMENT,
    NEW_VELOCITY,
    TEMPERATURE,
    VELOCITY,
    Block,
    take_marks,
)
from workflow.schemes._modal_lanes import (
    ALPHA,
    DELASSUS,
    DRIFT,
    HEAT,
    PRESSED,
    PUSHED,
    WARMING,
    WARMTH,
    Coefficients,
    by_mode,
    lay_out,
    moves_by_itself,
    step_freely,
    take_heat,
)
from workflow.schemes._modal_march import coefficients as free_step
from workflow.schemes._packs import (
    Lane,
    Pack,
    align_stack,
    flag,
    narrow,
    pack,
    raised,
    some_nonzero,
    store,
    weighed,
    where,
    wide,
)
from workflow.schemes._stepping import Now, block_lanes, blocks, collect, enter, note, observe, watch
from workflow.schemes._tip_load import start_load, tip_load

YIELD, REACH = SEPARATED + 1, SEPARATED + 2
"""Further rows of the lanes' own values: 1 / (1 + hθW (hθκ + c)), NaN where that is not > 0, and the force per
depth that puts the tip on the casing, 1/(h²θ²W), infinite where no force does."""

_ROWS = REACH + 1


@dataclass(frozen=True, eq=False)
class Operator:
    """What a batch shares: structure, step, θ, modes, contact stiffness [N/m] and damping [N s/m]."""

    structure: Structure
    h: float
    theta: float
    modal: Decoupled
    stiffness: float
    damping: float

    def yielding(self, modal: Decoupled, h: float, alpha: Array) -> Array:
        """Return 1 + hθW (hθκ + c), ``(case,)``: contact has one solution where it is positive."""
        w = moreau.delassus(modal, h, self.theta, alpha)
        return np.asarray(1 + h * self.theta * w * (h * self.theta * self.stiffness + self.damping))


def amplification(frequency: Array, damping: Array, h: float, theta: float) -> Any:
    """Return the eigenvalues of the free step of each mode."""
    return moreau.amplification(frequency, damping, h, moreau.Options(theta))


def thermal_amplification(rate: Array, h: float, theta: float) -> Array:
    """Return the factor of the free heat step of each thermal mode."""
    return moreau.thermal_amplification(rate, h, moreau.Options(theta))


@inlined
def _meet(
    operator: Coefficients,
    stiffness: float,
    damping: float,
    h: float,
    pushed: Pack,
    free: Pack,
    gap: Pack,
    own: Array,
    tip: Array,
    lane: Lane,
) -> tuple[bool, Pack, Pack, Pack]:
    """Close the step: return displacement and velocity of the tip at its end, and the impulse p in it.

    ``pushed`` is the load's impulse, ``free`` the tip's velocity without load and contact.
    What is returned first tells whether some lane is in contact or was so before.
    """
    theta = operator.theta
    x, v = pack(tip, (DISPLACEMENT, lane)), pack(tip, (VELOCITY, lane))
    w, held = pack(own, (DELASSUS, lane)), pack(own, (LATEST, lane))
    begun = h * (1.0 - theta) * held
    apart = free + operator.inverse_mass * pushed - w * begun
    depth = x + h * weighed(theta, apart, operator.rest, v) - gap
    pressed = (stiffness * depth + damping * apart) * pack(own, (YIELD, lane))
    most = depth * pack(own, (REACH, lane))
    pressed = where(pressed > most, most, pressed)
    pressed = where(depth > 0.0, pressed, 0.0)
    pressed = where(pressed <= 0.0, 0.0, pressed)  # a NaN passes
    p = begun + h * theta * pressed
    after = apart - w * (h * theta * pressed)
    store(own, (PUSHED, lane), pushed - p)
    taken = some_nonzero(p) or some_nonzero(pressed)  # with θ = 0 a force acts from the next step on
    engaged = taken or raised(own, (PRESSED, lane))
    if engaged:
        touches, touched = pressed > 0.0, held > 0.0
        store(own, (LATEST, lane), pressed)
        flag(own, (PRESSED, lane), taken)
        store(own, (HEAT, lane), pack(own, (ALPHA, lane)) * p)
        turn_about(touches & ~touched, touched & ~touches, v, after, own, lane)
    return engaged, x + h * weighed(theta, after, operator.rest, v), after, p


@inlined
def _store_energy(stiffness: float, h: float, tip: Array, sums: Array, lanes: int) -> None:
    """Count the contact spring's energy ½ κ (x_n - d)², and take its work out of what is lost."""
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        gap = pack(tip, (GAP, lane))
        depth_before, depth = pack(tip, (DISPLACEMENT, lane)) - gap, pack(tip, (NEW_DISPLACEMENT, lane)) - gap
        depth_before, depth = where(depth_before > 0.0, depth_before, 0.0), where(depth > 0.0, depth, 0.0)
        moved = 0.5 * h * (pack(tip, (VELOCITY, lane)) + pack(tip, (NEW_VELOCITY, lane)))
        store(sums, (SPENT, lane), pack(sums, (SPENT, lane)) - 0.5 * stiffness * (depth_before + depth) * moved)
        keep_energy(pack(sums, (ENERGY, lane)) + 0.5 * stiffness * depth * depth, sums, lane)


@inlined
def _step(
    operator: Coefficients,
    stiffness: float,
    damping: float,
    now: Now,
    observed: bool,
    own: Array,
    motion: Array,
    tau: Array,
    tau_before: Array,
    block: Block,
    lane: Lane,
) -> None:
    """Take a pack of lanes through a step, as :mod:`workflow.schemes.moreau` does, with another contact."""
    h, tip = block.h, block.tip
    free, temperature = step_freely(operator, now.known, now.t, h, own, motion, tau, tau_before, lane)
    gap = pack(tip, (GAP, lane))
    pushed = h * tip_load(now.sine, now.leader, block.load, lane)
    engaged, x, v, p = _meet(operator, stiffness, damping, h, pushed, free, gap, own, tip, lane)
    temperature += operator.warming * pack(own, (HEAT, lane))
    note(observed, engaged, now.lasts, True, h, x, v, temperature, p, gap, tip, lane)


@kernel
def _march(
    operator: Coefficients,
    stiffness: float,
    damping: float,
    own: Array,
    motion: Array,
    tau: Array,
    tau_before: Array,
    block: Block,
    audit: Audit,
) -> None:
    """Step a block of cases; lanes never meet."""
    load, tip, lanes, h, theta = block.load, block.tip, block.lanes, block.h, operator.theta
    align_stack()
    lay_out(operator, own, motion, tau, load, tip)
    lay_out_audit(audit)
    in_wide, audited = lanes // WIDE * WIDE, audit.sums.shape[0] > 0
    paired, known, leader = operator.pair_mode.size > 0, moves_by_itself(own, lanes), start_load(h, load, lanes)
    for step in range(1, block.steps + 1):
        now = enter(step, 1.0 - theta, theta, leader, known, block)
        seen = now.marked or audited
        if paired or step == block.steps:
            take_heat(operator.heat_modes, tau, own, tau_before, lanes)
        for first in range(0, in_wide, WIDE):
            _step(operator, stiffness, damping, now, seen, own, motion, tau, tau_before, block, wide(first))
        for first in range(in_wide, lanes, PACK):
            _step(operator, stiffness, damping, now, seen, own, motion, tau, tau_before, block, narrow(first))
        if audited:
            audit_step(theta, h, leader, audit, own, load, lanes)
            _store_energy(stiffness, h, tip, audit.sums, lanes)
        if seen:
            observe(take_marks(step, block) if now.marked else h, tip, lanes)
    take_heat(operator.heat_modes, tau, own, tau, lanes)


def _run(operator: Operator, modal: Decoupled, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, theta = operator.h, operator.theta
    coefficients = free_step(modal, h, theta)
    begun = start(modal, cases)
    plan = schedule(sampling, h)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, plan, h)
    w, yielding = moreau.delassus(modal, h, theta, cases.alpha), operator.yielding(modal, h, cases.alpha)
    ill_posed, reach = yielding <= 0, h**2 * theta**2 * w
    of_lane = np.zeros((_ROWS, cases.count))
    for row, values in (
        (ALPHA, cases.alpha),
        (DELASSUS, w),
        (DRIFT, begun.drift),
        (WARMTH, begun.warmth),
        (WARMING, begun.warming),
        (YIELD, np.where(ill_posed, np.nan, 1 / np.where(ill_posed, 1.0, yielding))),
        (REACH, np.where(reach > 0, 1 / np.where(reach > 0, reach, 1.0), np.inf)),
    ):
        of_lane[row] = values
    zeta = begun.velocity * modal.tip
    xi = begun.position * modal.tip - h * theta * zeta
    pairs, heat = by_mode(zeta.T, xi.T), (begun.heat * modal.glow).T
    own, motion = lane_rows(_ROWS), lane_rows(*pairs.shape[:2])
    tau, tau_before = lane_rows(heat.shape[0]), lane_rows(heat.shape[0])
    closing = begun.closing + begun.closing_rate * sampling.duration
    growth = (modal.static_growth / modal.glow)[:, None]
    books = Books(operator.structure, modal, cases, begun.tip_force, h, theta) if sampling.balances else None
    audit = no_audit() if books is None else books.audit
    rebound = np.full((2, cases.count), np.nan)
    for part, block in blocks(watched, block_lanes(pairs, heat, 0 if books is None else books.rows)):
        count = part.stop - part.start
        if books is not None:
            books.open(part)
        fill_lanes(own, of_lane[:, part])
        fill_lanes(motion, pairs[..., part])
        fill_lanes(tau, heat[..., part])
        _march(coefficients, operator.stiffness, operator.damping, own, motion, tau, tau_before, block, audit)
        if books is not None:
            books.close(part, plan.steps * h)
        rebound[:, part] = own[[APPROACHED, SEPARATED], :count]
        reached = tau_before + plan.weight[-1] * (tau - tau_before)
        closing[part] += np.sum(growth * reached, axis=0)[:count]  # in one order whatever lanes are in use
    finite = np.asarray(np.isfinite(watched.tip[[DISPLACEMENT, TEMPERATURE]]).all(axis=0))
    status, messages = _judge(operator, modal, cases, ill_posed, finite)
    balances = {} if books is None else books.residuals
    return collect(watched, closing, status, messages, {"effective_restitution": restitution(*rebound), **balances})


def _judge(
    operator: Operator, modal: Decoupled, cases: Cases, ill_posed: NDArray[np.bool_], finite: NDArray[np.bool_]
) -> tuple[NDArray[np.int8], dict[int, str]]:
    """Decide what became of each case; only its contact tells it from one of ``moreau``."""
    free = moreau.Operator(operator.structure, operator.h, operator.theta, modal)
    status, messages = moreau.judge(free, cases, np.zeros_like(ill_posed), finite)
    for case in np.flatnonzero(ill_posed & ~finite):
        limit = _largest_admissible_step(operator, modal, float(cases.alpha[case]))
        status[case] = Status.ILL_POSED
        messages[int(case)] = (
            f"contact has no unique solution at h = {operator.h:.6g} s (1 + hθW (hθκ + c) <= 0 at alpha = "
            f"{cases.alpha[case]:.6g}); the largest admissible h is {limit:.6g} s"
        )
    return status, messages


def _largest_admissible_step(operator: Operator, modal: Decoupled, alpha: float) -> float:
    """Return the largest step below h up to which contact has one solution at every smaller step."""
    from scipy.optimize import brentq

    def yielding(h: float) -> float:
        return float(operator.yielding(modal, h, np.array(alpha)))

    steps = operator.h * np.logspace(-12, 0, 481)
    first_bad = int(np.argmin([yielding(h) > 0 for h in steps]))
    return float(brentq(yielding, steps[first_bad - 1], steps[first_bad])) if first_bad else 0.0


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), operator.modal), (np.flatnonzero(~heated), operator.modal.without_heat())]
    with np.errstate(over="ignore", invalid="ignore"):  # a case that is lost says so by its status
        return merge([(w, _run(operator, modal, cases.take(w), sampling)) for w, modal in groups if w.size])
