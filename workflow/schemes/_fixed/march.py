"""The march of all schemes with a fixed step: blocks of cases, steps, samples, balances; contact by its law.

A scheme gives its free step (:class:`~workflow.schemes._fixed.modal_lanes.Coefficients`) and its contact law
(:mod:`workflow.schemes._fixed.contact`), whose type specialises the march when it is compiled. The kernel itself is
the scheme's (:mod:`workflow.schemes._fixed.marches`), so that numba's cache finds it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workflow.kernels.compiled import by_type, defines, inlined
from workflow.kernels.lanes import PACK, lane_rows
from workflow.kernels.packs import Lane, Pack, broad, broadest, narrow, pack, spread, store
from workflow.models import Array, Cases, project
from workflow.schemes._fixed import block_lanes, case_row, modal_lanes, stepping, tip_row
from workflow.schemes._fixed.balance import Account, count_friction_heat, count_work, lay_out_account, of_modes
from workflow.schemes._fixed.block_lanes import DRIVES, BlockAccount, BlockStep
from workflow.schemes._fixed.contact import CentralStep, Contact, End, Free, Law, TipStep, meet
from workflow.schemes._fixed.decoupled import Decoupled, Motion
from workflow.schemes._fixed.drive import turn_drive
from workflow.schemes._fixed.marks import Block
from workflow.schemes._fixed.modal_balance import Balances
from workflow.schemes._fixed.modal_lanes import Coefficients, State, by_mode
from workflow.schemes._fixed.outcome import effective_restitution
from workflow.schemes._fixed.stepping import Ended, Now, Watch
from workflow.schemes._fixed.tip_load import start_load, turn_load

FEW_ROWS = 60
"""Rows of lanes up to which a step takes packs of several registers, which share what a step costs beside its modes.

Through more rows narrow packs were faster on the processor it was chosen on, with the same bits.
"""


@by_type
def open_march(
    step: TipStep, law: Law, operator: Coefficients, now: Now, state: State, block: Block, account: Account | None
) -> None:
    """Do what a scheme does at t = 0: nothing for the θ-method."""


@inlined
def _load_tip(blocks: BlockStep | None, velocity: Pack, load: Pack, own: Array, lane: Lane) -> tuple[Pack, Pack]:
    """Return the tip's velocity with what the load of a step does to blocks, and the load that is left to contact."""
    if blocks is None:
        return velocity, load
    store(own, (case_row.LOAD, lane), load)
    return velocity + blocks.load * load, spread(0.0, lane)


@inlined
def _count_motion(account: Account | None, operator: Coefficients, state: State, t: float, lanes: int) -> None:
    """Count the energy of blocks in a step to t that contact has closed."""
    if account is not None:
        _count_blocks(account.blocks, operator.blocks, account.sums, operator, state, t, lanes)


@inlined
def _count_blocks(
    energy: BlockAccount | None,
    blocks: BlockStep | None,
    sums: Array,
    operator: Coefficients,
    state: State,
    t: float,
    lanes: int,
) -> None:
    if energy is not None and blocks is not None:
        block_lanes.move(
            energy, blocks.blocks, operator.heat_modes[:, modal_lanes.HEAT_INPUT], state, operator.tip.h, t, lanes
        )
        block_lanes.count(energy, operator.tip.h, state.own, sums, lanes)


@inlined
def close_step(
    operator: Coefficients,
    law: Law,
    now: Now,
    alone: tuple[Pack, Pack],
    state: State,
    block: Block,
    account: Account | None,
    lane: Lane,
) -> End:
    """Close a step by load and contact, and count what they do.

    ``alone`` are velocity and temperature of the tip at its end without them.
    """
    tip, own, step = block.tip, state.own, operator.tip
    gap, load = pack(tip, (tip_row.GAP, lane)), stepping.load_impulse(now, step.h, block, lane)
    velocity, load = _load_tip(operator.blocks, alone[0], load, own, lane)
    free = Free(velocity, alone[1], load, gap, block.drive)
    end, ahead = meet(step, law, free, own, tip, lane)
    modal_lanes.store_slid(operator.sliding, ahead.impulse, own, lane)
    count_work(account, step, end, ahead.driven, free, own, tip, lane)
    count_friction_heat(account, now.step, block.steps, own, lane)
    return end


@defines(open_march, CentralStep)
def _open_centrally(
    step: TipStep,
    law: Law,
    operator: Coefficients,
    now: Now,
    state: State,
    block: Block,
    account: Account | None,
) -> None:
    """Take the step at t = 0, whose p_0 spans half a step: it counts as the impulse of a whole one."""
    own = state.own
    for first in range(0, block.lanes, PACK):
        lane = narrow(first)
        alone = pack(own, (case_row.FIRST, lane)), spread(0.0, lane)
        stepping.store_end(close_step(operator, law, now, alone, state, block, account, lane), block.tip, lane)
        store(own, (case_row.CONTACT, lane), 2.0 * pack(own, (case_row.CONTACT, lane)))
    _count_motion(account, operator, state, now.t, block.lanes)


@inlined
def _step(
    operator: Coefficients, law: Law, now: Now, state: State, block: Block, account: Account | None, lane: Lane
) -> None:
    """Take a pack of lanes through a step: free motion, load and contact, counts."""
    alone = modal_lanes.step_freely(operator, now.warmed, now.t, state, of_modes(operator.blocks, account), lane)
    end = close_step(operator, law, now, alone, state, block, account, lane)
    if now.marked:
        stepping.store_end(end, block.tip, lane)
    else:
        stepping.count_end(end, now.next_marked, operator.tip.h, block.tip, lane)


@inlined
def _rows(state: State, account: Account | None) -> int:
    """Return the rows of lanes that a step goes through."""
    rows: int = 2 * state.motion.shape[0] + state.tau.shape[0]
    if account is not None:
        rows += account.former.shape[0] + account.sums.shape[0]
    return rows


@inlined
def march(operator: Coefficients, law: Law, state: State, block: Block, account: Account | None) -> None:
    """Step a block of cases; lanes never meet.

    ``state.tau_before`` is left with τ at the beginning of the last step, ``state.tau`` with τ at its end.
    """
    load, tip, lanes, h, theta = block.load, block.tip, block.lanes, block.h, operator.tip.theta
    modal_lanes.lay_out(operator, state, load, tip)
    lay_out_account(account)
    in_broad = lanes // broadest() * broadest() if _rows(state, account) <= FEW_ROWS else 0
    paired = operator.pair_mode.size > 0
    warmed, leader = modal_lanes.is_warmed(state.own, lanes), start_load(h, load, lanes)
    turn_drive(block.drive, 0, h, theta, tip, lanes)
    open_march(operator.tip, law, operator, stepping.step_at(0, theta, leader, warmed, block), state, block, account)
    modal_lanes.count_at_intervals(account, 0, block.steps, operator, state, lanes)
    for step in range(1, block.steps + 1):
        turn_load(step, h, leader, load, lanes)
        turn_drive(block.drive, step, h, theta, tip, lanes)
        now = stepping.step_at(step, theta, leader, warmed, block)
        if paired or now.last:
            modal_lanes.store_heat(operator, state, state.tau_before, lanes)
        for first in range(0, in_broad, broadest()):
            _step(operator, law, now, state, block, account, broad(first))
        for first in range(in_broad, lanes, PACK):
            _step(operator, law, now, state, block, account, narrow(first))
        _count_motion(account, operator, state, now.t, lanes)
        modal_lanes.count_at_intervals(account, step, block.steps, operator, state, lanes)
        if now.marked:
            stepping.count_stored(step, block)
    modal_lanes.close_balance(of_modes(operator.blocks, account), operator, state, lanes)
    modal_lanes.store_heat(operator, state, state.tau, lanes)


@dataclass(frozen=True, eq=False)
class Batch:
    """All cases of a batch at t = 0, ready to be cut in blocks.

    Attributes
    ----------
    modal, begun
        The structure, and the cases' modal states with what is known of their motion.
    operator, contact, law
        Free step, how the scheme meets the casing, and its contact law; parameters of that which differ between cases
        are ``(case,)``.
    march
        The kernel.
    speed, place
        ζ and ξ of each mode, times its share in the tip, ``(case, mode)``.
    own
        Rows of ``case_row``, ``(row, case)``; at the end what the last step left there.
    balance
        Energy and heat balances, if they are asked for.
    drives
        What acts on blocks, ``(block, row, case)``; ``None`` where the structure is stepped in modes.
    """

    modal: Decoupled
    begun: Motion
    operator: Coefficients
    contact: Contact
    law: Law
    march: Callable[..., None]
    speed: Array
    place: Array
    own: Array
    balance: Balances | None
    drives: Array | None = None


def case_rows(cases: Cases, begun: Motion, w: Array) -> Array:
    """Return the rows of ``case_row`` at t = 0 as far as all schemes share them, ``(row, case)``; W as a law has it."""
    own = np.zeros((case_row.ROWS, cases.count))
    own[case_row.ALPHA], own[case_row.DRIFT], own[case_row.WARMTH] = cases.alpha, begun.drift, begun.warmth
    own[case_row.WARMING], own[case_row.FRICTION] = begun.warming, cases.friction
    own[case_row.MOBILITY] = w
    return own


def law_rows(own: Array, law: Law) -> tuple[Array, Law]:
    """Return the cases' rows with parameters of a law that differ between them, and the law with the rows of these."""
    each = {name: values for name, values in law._asdict().items() if isinstance(values, np.ndarray)}
    rows = dict(zip(each, range(len(own), len(own) + len(each)), strict=True))
    shared = {name: float(value) for name, value in law._asdict().items() if name not in each}
    return np.vstack([own, *each.values()]), law._replace(**shared, **rows)


def march_blocks(batch: Batch, watched: Watch, duration: float) -> Ended:
    """Step all cases in blocks."""
    modal, begun, operator, balance = batch.modal, batch.begun, batch.operator, batch.balance
    motion, tau = by_mode(batch.speed.T, batch.place.T), (begun.heat * modal.heat_scale).T
    lanes, before = lane_rows(tau.shape[0]), lane_rows(tau.shape[0])
    paired = before if operator.heat_counts else lanes
    own, law = law_rows(batch.own, batch.law)
    acts = np.zeros((0, DRIVES, len(batch.place))) if batch.drives is None else batch.drives
    drives = lane_rows(*acts.shape[:2])
    state = State(lane_rows(len(own)), lane_rows(*motion.shape[:2]), lanes, before, paired, drives)
    filled = [(state.own, own), (state.motion, motion), (state.tau, tau), (drives, acts)]
    account = None if balance is None else balance.account
    closing = begun.closing + begun.closing_rate * duration
    growth = modal.static_growth / modal.heat_scale
    rows = 2 * motion.shape[0] + tau.shape[0] + drives.shape[0] * drives.shape[1]
    if balance is not None:
        rows, filled = rows + balance.rows, filled + balance.filled
    for part, block in stepping.blocks(watched, stepping.block_lanes(rows), *filled):
        batch.march(operator, law, state, block, account)
        if balance is not None:
            balance.close(part, state)
        count = part.stop - part.start
        own[:, part] = state.own[:, :count]
        reached = watched.reached(state.tau_before, state.tau)
        closing[part] += project(growth, reached.T)[:count]
    rebounds = effective_restitution(own) if batch.contact.rebounds else {}
    return Ended(watched, closing, rebounds, None if balance is None else balance.result(watched.elapsed))
