"""Steps a batch by central differences: contact, how it starts, and how its cases ended.

The equations stand in :mod:`workflow.schemes._fixed.central`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import defines
from workflow.kernels.lanes import PACK
from workflow.kernels.packs import Lane, Pack, narrow, of_lane, pack, some, some_nonzero, spread, store, where
from workflow.models import Array, Cases, Structure, needs_matrices, project
from workflow.schemes._fixed import case_row, central, contact, dense, tip_row
from workflow.schemes._fixed.balance import Account
from workflow.schemes._fixed.central import Differences, Linear, Operator
from workflow.schemes._fixed.contact import Contact, End, Free, TipStep
from workflow.schemes._fixed.decoupled import Decoupled, Motion, start
from workflow.schemes._fixed.dense import DenseOperator
from workflow.schemes._fixed.drive import drive_of, gap_ahead, relative, relative_before
from workflow.schemes._fixed.march import Batch, case_rows, close_step, march_blocks, open_march
from workflow.schemes._fixed.marches import kernels_of
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.modal_balance import ModalBalance
from workflow.schemes._fixed.modal_lanes import Coefficients, State
from workflow.schemes._fixed.outcome import ROUNDING, Outcome, by_heat, judged
from workflow.schemes._fixed.sliding import friction_message, slides
from workflow.schemes._fixed.stable_steps import limit_text
from workflow.schemes._fixed.stepping import Now, collect, store_end, watch
from workflow.schemes._interface import Results, Sampling

KERNELS = kernels_of(__name__)


@defines(contact.steps_from_tip, Linear)
def _steps_from_own_rows(law: Linear) -> bool:
    """Displacement and half-step velocity are kept in ``case_row.AHEAD`` and ``case_row.HALF``."""
    return False


@defines(contact.meet, Linear)
def meet_linearly(law: Linear, step: TipStep, free: Free, own: Array, tip: Array, lane: Lane) -> End:
    """Return the tip at t_k and the impulse about it; the step from there on is closed with p_k."""
    x, before, about = pack(own, (case_row.AHEAD, lane)), pack(own, (case_row.HALF, lane)), spread(0.0, lane)
    after, temperature = free.velocity + step.inverse_mass * free.impulse, free.temperature
    depth, approach = x - free.gap, relative_before(free.drive, before, lane)
    leaving = relative(free.drive, after, lane)
    p = of_lane(law.depth, lane) * depth + of_lane(law.before, lane) * approach + of_lane(law.free, lane) * leaving
    presses = (depth > of_lane(law.threshold, lane)) & ~(p <= 0.0)  # a NaN presses
    p = where(presses, p, 0.0)
    pressed = some(presses)
    engaged = pressed or contact.was_pressed(own, lane)
    ahead = x + step.h * after
    if engaged:
        latest = pack(own, (case_row.LAST, lane))
        p = where(presses, p + of_lane(law.ambiguous, lane), 0.0)
        about = 0.5 * (latest + p)
        after -= of_lane(law.mobility, lane) * p
        ahead = x + step.h * after
        touches, touched = p > 0.0, latest > 0.0
        touching = pressed or some_nonzero(latest)  # for a step more
        temperature += 0.5 * step.warming * contact.press(touching, p, own, lane)
        if law.holds:
            ahead = where(touches, gap_ahead(free.drive, free.gap, step.h, lane), ahead)
        store(own, (case_row.LAST, lane), p)
        leaving = relative(free.drive, after, lane)
        contact.count_rebounds(touches & ~touched, touched & ~touches, approach, leaving, own, lane)
    store(own, (case_row.AHEAD, lane), ahead)
    store(own, (case_row.HALF, lane), after)
    store(own, (case_row.IMPULSE, lane), free.impulse - p)
    return End(engaged, x, 0.5 * (before + after), temperature, about)


@defines(contact.applied, Linear)
def _latest(law: Linear, end: End, own: Array, lane: Lane) -> Pack:
    """Return p_k, of which the end of the step before has half."""
    return pack(own, (case_row.LAST, lane))


@defines(contact.next_tip, Linear)
def _ahead(law: Linear, end: End, own: Array, lane: Lane) -> tuple[Pack, Pack]:
    """Return x_n,k+1 and w_k+½."""
    return pack(own, (case_row.AHEAD, lane)), pack(own, (case_row.HALF, lane))


@defines(contact.driven, Linear)
def _half_step_velocity(law: Linear, step: TipStep, end: End, own: Array, lane: Lane) -> Pack:
    """Return w_k+½: where the law puts the tip on the casing, that which takes it there."""
    half = pack(own, (case_row.HALF, lane))
    if not law.holds:
        return half
    held = (pack(own, (case_row.AHEAD, lane)) - end.displacement) * (1.0 / step.h)
    return where(pack(own, (case_row.LAST, lane)) > 0.0, held, half)


@defines(contact.contact_gain, Linear)
def _spring_gain(
    law: Linear, step: TipStep, end: End, change: Pack, free: Free, own: Array, tip: Array, lane: Lane
) -> Pack:
    """Return κ δ_k (s_k+1 - s_k-1)/2, with the depth δ and the distance s from the casing.

    That is the change of κ δ_k δ_k+1 / 2 less the work of κ δ_k over (x_k+1 - x_k-1)/2: 0 while contact lasts.
    """
    depth = end.displacement - free.gap
    if not some(depth > 0.0):
        return spread(0.0, lane)
    ahead = pack(own, (case_row.AHEAD, lane)) - gap_ahead(free.drive, free.gap, step.h, lane)
    moved = relative(free.drive, end.velocity, lane) + relative_before(free.drive, end.velocity, lane)
    behind = ahead - step.h * moved
    parted = where(behind < 0.0, behind, 0.0) - where(ahead < 0.0, ahead, 0.0)
    return 0.5 * of_lane(law.stiffness, lane) * where(depth > 0.0, depth, 0.0) * parted


@defines(open_march, Linear)
def _open_march(
    law: Linear, operator: Coefficients, now: Now, state: State, block: Block, account: Account | None
) -> None:
    """Take the step at t = 0, whose p_0 spans half a step: it counts as the impulse of a whole one."""
    own = state.own
    for first in range(0, block.lanes, PACK):
        lane = narrow(first)
        alone = pack(own, (case_row.FIRST, lane)), spread(0.0, lane)
        store_end(close_step(operator, law, now, alone, state, block, account, lane), block.tip, lane)
        store(own, (case_row.LAST, lane), 2.0 * pack(own, (case_row.LAST, lane)))


def _half_step_before(modal: Decoupled, cases: Cases, h: float) -> Array:
    """Return the modal w_-½ = v_0 - (h/2) a_0, with the acceleration without contact, ``(case, mode)``."""
    velocity = project(modal.to_modes, cases.velocity)
    force = cases.load_at(0.0)
    acceleration = project(modal.shapes.T, cases.steady) + force[:, None] * modal.tip
    acceleration -= modal.damping * velocity + modal.frequency**2 * project(modal.to_modes, cases.displacement)
    acceleration -= project(modal.coupling, project(modal.to_thermal, cases.temperature))
    return np.asarray(velocity - 0.5 * h * acceleration)


def _remaining_before(operator: Operator, cases: Cases, begun: Motion) -> Array:
    """Return the remaining modal w_-½, relative to what heat drags along, ``(case, mode)``."""
    modal, slope = operator.modal, operator.differences.slope(operator.h, operator.modal.rate)
    half = _half_step_before(modal, cases, operator.h)
    # what start() took off as dragged velocity is that of continuous time
    remaining = begun.velocity - project(modal.response * modal.rate, begun.heat)
    remaining += half - project(modal.to_modes, cases.velocity)
    return np.asarray(remaining + project(operator.lead * slope, begun.heat))


def _first_free(operator: Operator, begun: Motion, before: Array) -> tuple[Array, Array]:
    """Return the remaining modal w_½ without tip load and contact, and that of the whole tip, ``(case,)``."""
    h, modal = operator.h, operator.modal
    inertia, factor = operator.differences.damped(h, modal.damping)
    slope = operator.differences.slope(h, modal.rate)
    free = factor * before - h * modal.frequency**2 / inertia * begun.position
    for mode, heat in modal.pairs:
        free[:, mode] -= h * modal.coupling[mode, heat] / inertia[mode] * begun.heat[:, heat]
    row = np.concatenate([modal.tip, -slope * modal.tip_response])
    whole = project(row, np.concatenate([free, begun.heat], axis=1)) + begun.drift
    return free, whole


def _run(operator: Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step cases that all carry thermal states, or that all carry none."""
    h, modal, free = operator.h, operator.modal, operator.coefficients(slides(operator.modal, cases))
    begun = start(modal, cases)
    drive, _ = drive_of(cases, h, theta=0.0)
    watched = watch(cases, cases.mean + begun.tip_force, sampling, h, drive)
    before = _remaining_before(operator, cases, begun)
    speed, free_tip = _first_free(operator, begun, before)
    own = case_rows(cases, begun)
    own[case_row.AHEAD], own[case_row.FIRST] = cases.displacement[:, -1], free_tip
    own[case_row.HALF] = project(modal.tip, _half_step_before(modal, cases, h))
    balance = None
    if sampling.balances:
        balance = ModalBalance(operator.structure, modal, free, cases, begun, central.terms(operator, begun, before))
    law, place = operator.contact.law(h, cases, operator.delassus(cases.friction)), begun.position * modal.tip
    batch = Batch(modal, begun, free, operator.contact, law, speed * modal.tip, place, own, balance)
    ended = march_blocks(batch, watched, sampling.duration)
    # squared: a contact that grows can stop short of infinity where its energy is beyond it
    finite = np.isfinite(watched.tip[[tip_row.DISPLACEMENT, tip_row.VELOCITY, tip_row.TEMPERATURE]] ** 2).all(axis=0)
    return collect(ended, *_judge(operator, cases, np.isnan(law.ambiguous), np.asarray(finite)))


def _judge(operator: Operator, cases: Cases, ambiguous: Any, finite: NDArray[np.bool_]) -> Outcome:
    """Decide what became of each case; ``ambiguous`` are those whose contact has no unique solution, or one for all."""
    h, modal, differences = operator.h, operator.modal, operator.differences
    free = np.abs(differences.amplification(modal.frequency, modal.damping, h)).max(initial=0.0)
    heat = np.abs(differences.decay(h, modal.rate)).max(initial=0.0)
    growth, grown = float(max(free, heat)), None
    if growth > 1 + ROUNDING:
        limit = differences.largest_stable_step(modal.frequency, modal.damping, modal.rate)
        what = "free step" if free >= heat else "explicit heat step"
        grown = (
            f"the {what} grows {growth:.6g}-fold at h = {h:.6g} s; central differences are stable up to "
            f"{limit_text(limit, 7)} s"
        )

    def explain(case: int) -> str:
        return friction_message(h, float(cases.friction[case]), operator.contact.name)

    left = f"the energy left the finite numbers at h = {h:.6g} s"
    return judged(finite, ambiguous & (grown is None), explain, grown, left)


def init(structure: Structure, h: float, differences: Differences, contact: Contact) -> Operator | DenseOperator:
    """Diagonalise a structure once for a batch, or invert its matrices where modes do not separate it."""
    step = dense.init_central if needs_matrices(structure) else central.operator
    return step(structure, h, differences, contact)


def compute(operator: Operator | DenseOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; thermal states are carried only in the cases where they can act."""
    if isinstance(operator, DenseOperator):
        return dense.compute(operator, cases, sampling)
    return by_heat(cases, lambda some, hot: _run(operator if hot else operator.without_heat(), some, sampling))
