"""Steps a batch by central differences: the kernel, how it starts, and how its cases ended.

The equations stand in :mod:`workflow.schemes._central`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, project
from workflow.schemes._balance import Audit, audit_heat, lay_out_audit, no_audit
from workflow.schemes._central import Law, Operator
from workflow.schemes._central_balance import POWER, CentralBooks, account
from workflow.schemes._decoupled import Decoupled, Motion, start
from workflow.schemes._interface import Results, Sampling, Status, merge, schedule
from workflow.schemes._kernel import inlined, kernel
from workflow.schemes._lanes import PACK, WIDE, fill_lanes, lane_rows
from workflow.schemes._marks import DISPLACEMENT, GAP, TEMPERATURE, VELOCITY, Block, take_marks
from workflow.schemes._modal_lanes import (
    ALPHA,
    DRIFT,
    HEAT,
    OWN_ROWS,
    PRESSED,
    PUSHED,
    WARMING,
    WARMTH,
    Coefficients,
    by_mode,
    lay_out,
    moves_by_itself,
    step_freely,
)
from workflow.schemes._packs import (
    Lane,
    Mask,
    Pack,
    align_stack,
    flag,
    narrow,
    pack,
    raised,
    some,
    some_nonzero,
    spread,
    store,
    where,
    wide,
)
from workflow.schemes._stepping import Now, block_lanes, blocks, collect, enter, note, observe, watch
from workflow.schemes._tip_load import start_load, tip_load

ROUNDING = 16 * np.finfo(float).eps
"""A free step grows only above 1 by more than the few operations that compute its factor can err."""

AHEAD, HALF, FREE, LATEST, APPROACH, APPROACHED, SEPARATED = range(OWN_ROWS, OWN_ROWS + 7)
"""Rows of the lanes' own values: x_n at the next step's end, the last half-step velocity, the first
one without contact, the last p, the velocity before the present contact, and sums over the
contacts that have ended of its square and of its product with the velocity after."""

_ROWS = SEPARATED + 1

METRICS = {
    "effective_restitution": (
        "1",
        "speed of separation over speed of approach, least squares over all contacts that ended",
    )
}
"""What these schemes give beside the common metrics: unit and meaning."""


@inlined
def turn_about(begins: Mask, ended: Mask, v: Pack, after: Pack, own: Array, lane: Lane) -> None:
    """Count the contacts that have ended: the velocity before each, and its product with the one ``after``.

    A contact ``begins`` with the velocity ``v``.
    """
    if not (some(begins) or some(ended)):
        return
    approach = where(begins, v, pack(own, (APPROACH, lane)))
    store(own, (APPROACH, lane), approach)
    store(own, (APPROACHED, lane), pack(own, (APPROACHED, lane)) + where(ended, approach * approach, 0.0))
    store(own, (SEPARATED, lane), pack(own, (SEPARATED, lane)) - where(ended, approach * after, 0.0))


@inlined
def _meet(
    operator: Coefficients,
    law: Law,
    h: float,
    pushed: Pack,
    free: Pack,
    temperature: Pack,
    gap: Pack,
    own: Array,
    tip: Array,
    lane: Lane,
) -> tuple[bool, Pack, Pack, Pack, Pack]:
    """Return displacement, velocity and temperature of the tip at t_k, and the impulse about it.

    ``pushed`` is the load's impulse; ``free`` and ``temperature`` are of the tip without load and contact.
    What is returned first tells whether some lane is in contact or was so before.
    """
    x, before, about = pack(own, (AHEAD, lane)), pack(own, (HALF, lane)), spread(0.0, lane)
    after = free + operator.inverse_mass * pushed
    p = law.depth * (x - gap) + law.before * before + law.free * after
    presses = (x - gap > law.threshold) & ~(p <= 0.0)  # a NaN presses
    p = where(presses, p, 0.0)
    pressed = some(presses)
    engaged = pressed or raised(own, (PRESSED, lane))
    ahead = x + h * after
    if engaged:
        latest = pack(own, (LATEST, lane))
        about = 0.5 * (latest + p)
        after -= operator.inverse_mass * p
        ahead = x + h * after
        touches, touched = p > 0.0, latest > 0.0
        heat = pack(own, (ALPHA, lane)) * p
        temperature += 0.5 * operator.warming * heat
        if law.holds:
            ahead = where(touches, gap, ahead)
        store(own, (LATEST, lane), p)
        store(own, (HEAT, lane), heat)
        flag(own, (PRESSED, lane), pressed or some_nonzero(latest))  # the tip counts as touching for a step more
        turn_about(touches & ~touched, touched & ~touches, before, after, own, lane)
    store(own, (AHEAD, lane), ahead)
    store(own, (HALF, lane), after)
    store(own, (PUSHED, lane), pushed - p)
    return engaged, x, 0.5 * (before + after), temperature, about


@inlined
def _whole_impulse(v: Pack, sums: Array, own: Array, lane: Lane) -> None:
    """Count p_0, which spans half a step, as the impulse of a whole one; ``sums`` has rows where balances are kept."""
    latest = pack(own, (LATEST, lane))
    if sums.shape[0] > 0:
        store(sums, (POWER, lane), pack(sums, (POWER, lane)) + latest * v)
    store(own, (LATEST, lane), 2.0 * latest)


@inlined
def _step(
    operator: Coefficients,
    law: Law,
    step: int,
    now: Now,
    own: Array,
    motion: Array,
    tau: Array,
    block: Block,
    audit: Audit,
    lane: Lane,
) -> None:
    """Take a pack of lanes to t_k.

    Free velocity of the tip w_k+½ and its temperature from the thermal and mechanical modes, which take in
    the impulse p_k-1 and its heat; load and contact; what is watched.
    """
    h, tip, heated, audited = block.h, block.tip, tau.shape[0] > 0, audit.sums.shape[0] > 0
    if step > 0:
        if heated and audited:
            audit_heat(h, audit, own, lane)
        free, temperature = step_freely(operator, now.known, now.t, h, own, motion, tau, tau, lane)
    else:
        free, temperature = pack(own, (FREE, lane)), spread(0.0, lane)
    gap = pack(tip, (GAP, lane))
    pushed = h * tip_load(now.sine, now.leader, block.load, lane)
    engaged, x, v, temperature, p = _meet(operator, law, h, pushed, free, temperature, gap, own, tip, lane)
    if audited:
        account(step, h, law.stiffness, audit, own, x, v, gap, lane)
    if step == 0:
        _whole_impulse(v, audit.sums, own, lane)
    else:
        note(now.marked, engaged, now.lasts, False, h, x, v, temperature, p, gap, tip, lane)


@kernel
def _march(
    operator: Coefficients,
    law: Law,
    own: Array,
    motion: Array,
    tau: Array,
    tau_before: Array,
    block: Block,
    audit: Audit,
) -> None:
    """Step a block of cases; lanes never meet.

    ``tau_before`` is left with τ at the beginning of the last step, ``tau`` with τ at its end.
    """
    load, tip, lanes, h = block.load, block.tip, block.lanes, block.h
    align_stack()
    lay_out(operator, own, motion, tau, load, tip)
    lay_out_audit(audit)
    in_wide = lanes // WIDE * WIDE
    known, leader = moves_by_itself(own, lanes), start_load(h, load, lanes)
    for step in range(block.steps + 1):
        now = enter(step, 0.0, 1.0, leader, known, block)
        if step == block.steps:
            tau_before[:] = tau
        for first in range(0, in_wide, WIDE):
            _step(operator, law, step, now, own, motion, tau, block, audit, wide(first))
        for first in range(in_wide, lanes, PACK):
            _step(operator, law, step, now, own, motion, tau, block, audit, narrow(first))
        if now.marked:
            observe(take_marks(step, block), tip, lanes)


def _half_step_before(modal: Decoupled, cases: Cases, h: float) -> Array:
    """Return the modal w_-½ = v_0 - (h/2) a_0, with the acceleration without contact, ``(case, mode)``."""
    velocity = project(modal.to_modes, cases.velocity)
    force = cases.mean + cases.amplitude * np.sin(cases.phase)
    acceleration = project(modal.shapes.T, cases.steady) + force[:, None] * modal.tip
    acceleration -= modal.damping * velocity + modal.frequency**2 * project(modal.to_modes, cases.displacement)
    acceleration -= project(modal.coupling, project(modal.to_thermal, cases.temperature))
    return np.asarray(velocity - 0.5 * h * acceleration)


def _first_free(operator: Operator, begun: Motion, kick: Array) -> tuple[Array, Array]:
    """Return the remaining modal w_½ without tip load and contact, and that of the whole tip, ``(case,)``.

    ``kick`` is w_-½ - v_0, ``(case, mode)``.
    """
    h, modal = operator.h, operator.modal
    inertia, factor = operator.differences.damped(h, modal.damping)
    slope = operator.differences.slope(h, modal.rate)
    # what start() took off as dragged velocity is that of continuous time
    remaining = begun.velocity - project(modal.response * modal.rate, begun.heat)
    remaining += kick + project(operator.lead * slope, begun.heat)
    free = factor * remaining - h * modal.frequency**2 / inertia * begun.position
    for mode, heat in modal.pairs:
        free[:, mode] -= h * modal.coupling[mode, heat] / inertia[mode] * begun.heat[:, heat]
    row = np.concatenate([modal.tip, -slope * modal.tip_response])
    whole = project(row[None, :], np.concatenate([free, begun.heat], axis=1))[:, 0] + begun.drift
    return free, whole


def _run(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, modal = operator.h, operator.modal
    coefficients = operator.coefficients()
    begun = start(modal, cases)
    plan = schedule(sampling, h)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, plan, h)
    half = _half_step_before(modal, cases, h)
    free, free_tip = _first_free(operator, begun, half - project(modal.to_modes, cases.velocity))
    of_lane = np.zeros((_ROWS, cases.count))
    for row, values in (
        (ALPHA, cases.alpha),
        (DRIFT, begun.drift),
        (WARMTH, begun.warmth),
        (WARMING, begun.warming),
        (AHEAD, cases.displacement[:, -1]),
        (HALF, project(modal.tip[None, :], half)[:, 0]),
        (FREE, free_tip),
    ):
        of_lane[row] = values
    pairs, heat = by_mode((free * modal.tip).T, (begun.position * modal.tip).T), (begun.heat * modal.glow).T
    own, motion = lane_rows(_ROWS), lane_rows(*pairs.shape[:2])
    tau, tau_before = lane_rows(heat.shape[0]), lane_rows(heat.shape[0])
    closing = begun.closing + begun.closing_rate * sampling.duration
    growth = (modal.static_growth / modal.glow)[:, None]
    books = None
    if sampling.balances:
        inertia, factor = operator.differences.damped(h, modal.damping)
        implicit = float(operator.differences.implicit_heat)
        books = CentralBooks(operator.structure, modal, cases, begun.tip_force, h, implicit, half, inertia, factor)
    audit = no_audit() if books is None else books.audit
    rebound = np.full((2, cases.count), np.nan)
    for part, block in blocks(watched, block_lanes(pairs, heat, 0 if books is None else books.rows)):
        count = part.stop - part.start
        if books is not None:
            books.open(part)
        fill_lanes(own, of_lane[:, part])
        fill_lanes(motion, pairs[..., part])
        fill_lanes(tau, heat[..., part])
        _march(coefficients, operator.law, own, motion, tau, tau_before, block, audit)
        if books is not None:
            books.close(part, plan.steps * h)
        rebound[:, part] = own[[APPROACHED, SEPARATED], :count]
        reached = tau_before + plan.weight[-1] * (tau - tau_before)
        closing[part] += np.sum(growth * reached, axis=0)[:count]  # in one order whatever lanes are in use
    # squared: a contact that grows can stop short of infinity where its energy is beyond it
    finite = np.asarray(np.isfinite(watched.tip[[DISPLACEMENT, VELOCITY, TEMPERATURE]] ** 2).all(axis=0))
    status, messages = _judge(operator, finite)
    balances = {} if books is None else books.residuals
    return collect(watched, closing, status, messages, {"effective_restitution": restitution(*rebound), **balances})


def restitution(approached: Array, separated: Array) -> Array:
    """Return -Σ v⁺v⁻ / Σ (v⁻)² of each case; NaN where no contact has ended or a sum has left the finite numbers."""
    met = (approached > 0) & np.isfinite(approached) & np.isfinite(separated)
    return np.where(met, separated / np.where(met, approached, 1.0), np.nan)


def _judge(operator: Operator, finite: NDArray[np.bool_]) -> tuple[NDArray[np.int8], dict[int, str]]:
    """Decide what became of each case: by theory where it can be, else by its last state."""
    h, modal, differences = operator.h, operator.modal, operator.differences
    free = np.abs(differences.amplification(modal.frequency, modal.damping, h)).max(initial=0.0)
    heat = np.abs(differences.decay(h, modal.rate)).max(initial=0.0)
    growth = float(max(free, heat))
    if growth > 1 + ROUNDING:
        limit = differences.largest_stable_step(modal.frequency, modal.damping, modal.rate)
        what = "free step" if free >= heat else "explicit heat step"
        text = (
            f"the {what} grows {growth:.6g}-fold at h = {h:.6g} s; central differences are stable up to {limit:.7g} s"
        )
        return np.full(finite.size, Status.DIVERGED, dtype=np.int8), dict.fromkeys(range(finite.size), text)
    status = np.where(finite, Status.OK, Status.DIVERGED).astype(np.int8)
    text = f"the energy left the finite numbers at h = {h:.6g} s"
    return status, {int(case): text for case in np.flatnonzero(~finite)}


def compute(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    heated = cases.heated
    groups = [(np.flatnonzero(heated), operator), (np.flatnonzero(~heated), operator.without_heat())]
    with np.errstate(over="ignore", invalid="ignore"):  # a case that is lost says so by its status
        return merge([(w, _run(part, cases.take(w), sampling)) for w, part in groups if w.size])
