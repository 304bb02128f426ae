"""The time-stepping kernel of all schemes with a fixed step: blocks of cases, steps, samples, balances, contact.

A scheme gives its step (:class:`~workflow.schemes._fixed.blocks.Step`) and its contact law
(:mod:`workflow.schemes._fixed.contact`), whose type specialises the march when it is compiled.

A kernel loops over time, in a step over packs of lanes, and in a pack over its blocks, whose sum stays in a register
from block to block, in the same order for every lane. So nothing of a step is stored but the states. So that calls
within a step cost nothing,

- the number of lanes in a row of memory is asserted, see :mod:`workflow.kernels.lanes`, and so are the numbers of a
  block: the distance between rows is then a constant;
- functions called in every step are inlined and count no references to arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar

import numpy as np

from workflow.kernels.compiled import by_type, defines, inlined, kernel, part
from workflow.kernels.lanes import PACK, ROW, cached_lanes, lane_rows, lane_table, named_rows, rows_in
from workflow.kernels.packs import Lane, Pack, broad, broadest, narrow, pack, shared, spread, store
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed import balance, stepping
from workflow.schemes._fixed.balance import Account, Balances, Dense, dense_of
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.contact import (
    CentralStep,
    Contact,
    End,
    Law,
    TipInput,
    TipStep,
    contact_step,
    friction_heat,
    respond,
    was_pressed,
)
from workflow.schemes._fixed.free_motion import (
    DECAY,
    HEAT_DECAY,
    HEAT_INPUT,
    HEAT_SPEED,
    PLACE,
    SPEED,
    SPRING,
    TIP_PLACE,
    TIP_SPEED,
    FreeStep,
    LastStep,
    State,
    drives,
    end_state,
    ended,
    first_free,
    free_step,
    lay_out,
    plus,
    start,
)
from workflow.schemes._fixed.loads import DriveRows, start_load, tip_load, turn_drive, turn_load
from workflow.schemes._fixed.outcome import effective_restitution
from workflow.schemes._fixed.rows import Own
from workflow.schemes._fixed.sensing import sense, sensing_of
from workflow.schemes._fixed.stepping import Batch, CaseBlock, Ended, Now
from workflow.schemes._interface import Sampling

R = TypeVar("R", bound=Callable[..., tuple[float, float, float]])

KERNELS: dict[type, Callable[..., None]] = {}
"""The march of each contact law, by the type of its parameters."""

READ_EVERY_STEP = ("load", "tip", "motion", "tau", "sums", "velocity_before")
"""Rows that every step reads; contact reads others."""

FEW_ROWS = 60
"""Rows of lanes up to which a step takes packs of several registers, which share the fixed cost of a step.

With more rows narrow packs were faster on the processor where it was measured; the bits are the same.
"""


class FreeTip(NamedTuple):
    """The tip at a step's end without load and contact."""

    velocity: Pack
    temperature: Pack
    thermal_velocity: Pack
    """The thermal part of the velocity."""


@inlined
def _at_tip(coupled: Array | None, j: int, u: Pack, eta: Pack, lane: Lane) -> Pack:
    """Return the part of block j in the velocity of the tip."""
    return (
        u
        if coupled is None
        else shared(coupled, (j, TIP_SPEED), lane) * u + shared(coupled, (j, TIP_PLACE), lane) * eta
    )


@inlined
def _step_blocks(
    coupled: Array | None,
    account: Account | None,
    dense: Dense | None,
    step: FreeStep,
    state: State,
    velocity: Pack,
    contact: Pack | None,
    lane: Lane,
) -> Pack:
    """Step the blocks, and add their part to the tip's velocity."""
    motion, load = state.motion, pack(state.own.load, lane)
    taken = balance.nothing_taken(lane)
    for j in range(motion.shape[0]):
        before, place = ended(coupled, step, state, j, load, contact, lane)
        taken = balance.count_mode(account, dense, j, before, place, contact, taken, lane)
        u = shared(step.blocks, (j, DECAY), lane) * before + shared(step.blocks, (j, SPRING), lane) * place
        eta = place + step.tip.h * before
        store(motion, (j, SPEED, lane), u)
        store(motion, (j, PLACE, lane), eta)
        velocity += _at_tip(coupled, j, u, eta, lane)
    balance.add_modes(account, dense, taken, contact, lane)
    return velocity


@inlined
def _recorded(observed: Array | None, k: int, tau: Pack, lane: Lane) -> Pack:
    """Return the part of thermal mode k in the temperature that is recorded."""
    return tau if observed is None else shared(observed, (k,), lane) * tau


@inlined
def _step_heat(
    account: Account | None,
    step: FreeStep,
    tau: Array,
    velocity: Pack,
    temperature: Pack,
    heat: Pack | None,
    lane: Lane,
) -> tuple[Pack, Pack]:
    """Step the thermal modes, and add their parts to velocity and temperature of the tip."""
    loss = spread(0.0, lane)
    for k in range(tau.shape[0]):
        before = pack(tau, (k, lane))
        loss = balance.with_loss(account, k, before, loss, lane)
        after = shared(step.heat_modes, (k, HEAT_DECAY), lane) * plus(
            before, shared(step.heat_modes, (k, HEAT_INPUT), lane), heat
        )
        store(tau, (k, lane), after)
        velocity += shared(step.heat_modes, (k, HEAT_SPEED), lane) * after
        temperature += _recorded(step.observed, k, after, lane)
    balance.add_loss(account, step.tip.h, loss, heat, lane)
    return velocity, temperature


@inlined
def _add_pairs(step: FreeStep, state: State, velocity: Pack, lane: Lane) -> Pack:
    """Add the load of thermal modes on blocks near resonance with them to the blocks and to the tip's velocity."""
    motion = state.motion
    for pair in range(step.pair_block.size):
        j, tau = step.pair_block[pair], pack(state.tau_paired, (step.pair_heat[pair], lane))
        for row in range(2):
            pulled = shared(step.pair_load, (pair, row), lane) * tau
            store(motion, (j, row, lane), pack(motion, (j, row, lane)) + pulled)
        velocity += shared(step.pair_load, (pair, 2), lane) * tau
    return velocity


@inlined
def _add_steady(coupled: Array | None, step: FreeStep, state: State, velocity: Pack, lane: Lane) -> Pack:
    """Add constant loads on drifting blocks to the blocks and to the tip's velocity."""
    for k in range(step.drifting.size):
        j, gained = step.drifting[k], pack(state.steady, (k, lane))
        store(state.motion, (j, SPEED, lane), pack(state.motion, (j, SPEED, lane)) + gained)
        velocity += gained if coupled is None else shared(coupled, (j, TIP_SPEED), lane) * gained
    return velocity


@inlined
def _step_states(
    step: FreeStep,
    account: Account | None,
    state: State,
    thermal_velocity: Pack,
    temperature: Pack,
    contact: Pack | None,
    heat: Pack | None,
    lane: Lane,
) -> FreeTip:
    """Step all thermal modes and blocks; the velocity and the temperature given are the known parts of the tip's."""
    thermal_velocity, temperature = _step_heat(account, step, state.tau, thermal_velocity, temperature, heat, lane)
    velocity = _step_blocks(step.coupled, account, dense_of(account), step, state, thermal_velocity, contact, lane)
    return FreeTip(velocity, temperature, thermal_velocity)


@inlined
def step_freely(step: FreeStep, warmed: bool, t: float, state: State, account: Account | None, lane: Lane) -> FreeTip:
    """Step all blocks to t, with impulse and heat of the step before; return the tip there without load and contact.

    In most steps there is no contact in any lane. ``warmed`` is the result of :func:`is_warmed`.
    """
    own = state.own
    drift, warmth = spread(0.0, lane), spread(0.0, lane)
    if warmed:
        drift = pack(own.drift, lane)
        warmth = pack(own.warmth, lane) + pack(own.warming, lane) * t
    if was_pressed(own, lane):
        contact, heat = pack(own.impulse, lane), friction_heat(own, lane)
        free = _step_states(step, account, state, drift, warmth, contact, heat, lane)
    else:
        free = _step_states(step, account, state, drift, warmth, None, None, lane)
    if step.pair_block.size + step.drifting.size == 0:
        return free
    velocity = _add_steady(step.coupled, step, state, _add_pairs(step, state, free.velocity, lane), lane)
    return FreeTip(velocity, free.temperature, free.thermal_velocity)


@part
def is_warmed(own: Own, lanes: int) -> bool:
    """Tell whether heating or the temperature of the surroundings moves the tip of some lane."""
    warmed = False
    for lane in range(lanes):
        warmed |= own.drift[lane] != 0.0 or own.warmth[lane] != 0.0 or own.warming[lane] != 0.0
    return warmed


@part
def store_heat(step: FreeStep, state: State, into: Array, lanes: int) -> None:
    """Store τ at the end of the last step, with its contact heat where ``heat_counts``."""
    own = state.own
    for k in range(into.shape[0]):
        for lane in range(lanes):
            heat = step.heat_modes[k, HEAT_INPUT] * (own.alpha[lane] * own.impulse[lane])
            into[k, lane] = state.tau[k, lane] + heat if step.heat_counts else state.tau[k, lane]


@by_type
def open_march(
    tip_step: TipStep,
    law: Law,
    step: FreeStep,
    now: Now,
    state: State,
    block: CaseBlock,
    account: Account | None,
    in_broad: int,
) -> None:
    """Do a scheme's work at t = 0: none for the θ-method."""


@defines(open_march, CentralStep)
def _open_centrally(
    tip_step: TipStep,
    law: Law,
    step: FreeStep,
    now: Now,
    state: State,
    block: CaseBlock,
    account: Account | None,
    in_broad: int,
) -> None:
    for first in range(0, in_broad, broadest()):
        _open(step, law, now, state, block, account, broad(first))
    for first in range(in_broad, block.lanes, PACK):
        _open(step, law, now, state, block, account, narrow(first))
    balance.count_step(account, dense_of(account), step, state, False, block.lanes)


@inlined
def _open(
    step: FreeStep, law: Law, now: Now, state: State, block: CaseBlock, account: Account | None, lane: Lane
) -> None:
    """Do the step at t = 0, whose p_0 spans half a step, but for springs: it counts as the impulse of a whole one."""
    own = state.own
    free = FreeTip(pack(own.first, lane), spread(0.0, lane), pack(own.thermal_velocity, lane))
    stepping.store_end(close_step(step, law, now, free, state, block, account, lane), block.tip, lane)
    if step.tip.stiffness == 0.0:
        store(own.before, lane, 2.0 * pack(own.before, lane))


@inlined
def close_step(
    step: FreeStep,
    law: Law,
    now: Now,
    free: FreeTip,
    state: State,
    block: CaseBlock,
    account: Account | None,
    lane: Lane,
) -> End:
    """Complete a step by load and contact, and count their work."""
    tip, load = block.tip, step.tip.h * tip_load(now.sine, now.leader, block.load, block.drive, lane)
    driven = TipInput(free.velocity, free.temperature, load, pack(tip.gap, lane), block.drive)
    end = contact_step(step.tip, law, driven, state.own, tip, lane)
    balance.count_work(account, step.tip, end, free.thermal_velocity, driven, state.own, tip, lane)
    balance.measure(account, dense_of(account), step, state, lane)
    return end


@inlined
def _step(
    step: FreeStep, law: Law, now: Now, state: State, block: CaseBlock, account: Account | None, lane: Lane
) -> None:
    """Do a step of a pack of lanes: free motion, load and contact, counts."""
    free = step_freely(step, now.warmed, now.t, state, account, lane)
    end = close_step(step, law, now, free, state, block, account, lane)
    if now.marked:
        stepping.store_end(end, block.tip, lane)
    else:
        stepping.count_end(end, now.next_marked, step.tip.h, block.tip, lane)


@inlined
def march(step: FreeStep, law: Law, state: State, block: CaseBlock, account: Account | None) -> None:
    """Step a block of cases, whose lanes are independent.

    On return ``state.tau_before`` is τ at the beginning of the last step, ``state.tau`` is τ at its end.
    """
    load, tip, lanes, h, theta = block.load, block.tip, block.lanes, block.h, step.tip.theta
    lay_out(step, state)
    balance.lay_out_account(account)
    in_broad = lanes // broadest() * broadest() if 2 * len(state.motion) + len(state.tau) <= FEW_ROWS else 0
    paired, warmed = step.pair_block.size > 0, is_warmed(state.own, lanes)
    leader = start_load(h, load, lanes)
    turn_drive(block.drive, 0, h, theta, tip, lanes)
    open_march(step.tip, law, step, stepping.step_at(0, theta, leader, warmed, block), state, block, account, in_broad)
    for k in range(1, block.steps + 1):
        turn_load(k, h, leader, load, lanes)
        turn_drive(block.drive, k, h, theta, tip, lanes)
        now = stepping.step_at(k, theta, leader, warmed, block)
        if paired or now.last:
            store_heat(step, state, state.tau_before, lanes)
        for first in range(0, in_broad, broadest()):
            _step(step, law, now, state, block, account, broad(first))
        for first in range(in_broad, lanes, PACK):
            _step(step, law, now, state, block, account, narrow(first))
        balance.count_step(account, dense_of(account), step, state, now.last, lanes)
        if step.sensors.shape[0] > 0 and (now.marked or now.next_marked):
            sense(
                step.sensors,
                state,
                tip.new_displacement if now.marked else tip.displacement,
                now.t,
                block.record.shown,
                lanes,
            )
        if now.marked:
            stepping.count_stored(k, block)
    store_heat(step, state, state.tau, lanes)


def contact_law(kind: type[Any]) -> Callable[[R], R]:
    """Return a decorator of the contact law for a type of parameters, a named tuple.

    The law is called as :func:`~workflow.schemes._fixed.contact.respond`, and may use what numba compiles. Its march is
    compiled at the first call.
    """

    def add(law: R) -> R:
        def march_cases(step: FreeStep, law: Law, state: State, batch: Batch, account: Account | None) -> None:
            whole = batch.whole
            for first in range(0, batch.values.shape[1], whole.lanes):
                marks, record, lanes = stepping.load_block(batch, first)
                block = CaseBlock(whole.load, whole.tip, marks, record, whole.drive, lanes, whole.steps, whole.h)
                march(step, law, state, block, account)
                stepping.store_block(batch, first)

        march_cases.__module__ = law.__module__  # the key of the cache: the machine code depends on that source too
        KERNELS[kind] = kernel(march_cases)
        return defines(respond, kind)(law)

    return add


def _state(lanes: Mapping[str, Array], free: FreeStep) -> State:
    """Return the state of a block of cases, in named lanes."""
    return State(
        own=named_rows(Own, lanes["own"]),
        motion=lanes["motion"],
        drives=lanes["drives"],
        steady=lanes["steady"],
        tau=lanes["tau"],
        tau_before=lanes["tau_before"],
        tau_paired=lanes["tau_before" if free.heat_counts else "tau"],
        sensing=lanes["sensing"],
    )


def step_batch(
    structure: Structure,
    blocks: Blocks,
    contact: Contact,
    w: Array,
    cases: Cases,
    velocity: Array,
    sampling: Sampling,
    drive: DriveRows | None,
) -> Ended:
    """Step all cases by a scheme's step, with W ``(case,)`` and the initial modal ``velocity`` ``(case, mode)``.

    For central differences that is the velocity half a step before t = 0.
    """
    modal, begun = blocks.modal, start(blocks, cases, velocity)
    sensors, sensing = sensing_of(blocks, cases, begun)
    free = free_step(blocks, contact, begun.drifting, sensors)
    watched = stepping.watch(structure, cases, sampling, blocks.step.tip.h, drive)
    states, rows_of_cases = begun.states, np.zeros((rows_in(Own), cases.count))
    own = named_rows(Own, rows_of_cases)
    own.alpha, own.mobility = cases.alpha, np.where(contact.factor(free.tip.h, w) <= 0, np.nan, w)
    own.drift, own.warmth, own.warming = begun.drift, begun.warmth, begun.warming
    if not free.heat_counts:
        states, own.first, own.thermal_velocity = first_free(blocks, begun)
        own.ahead, own.half = cases.displacement[:, -1], project(modal.tip, velocity)

    law, scale, tau = contact.law(cases), blocks.scale[:, None, None], begun.heat * modal.heat_scale[:, None]
    balances = Balances(structure, blocks, free, cases, begun) if sampling.balances else None
    table = lane_table(
        {
            **stepping.rows_of(watched),
            "own": rows_of_cases,
            "motion": scale * states.swapaxes(0, 1),
            "drives": scale * drives(blocks, cases).swapaxes(0, 1),
            "steady": blocks.scale[begun.drifting, None] * begun.steady,
            "tau": tau,
            "tau_before": np.zeros_like(tau),
            "sensing": sensing,
            **{f"law.{name}": values for name, values in law._asdict().items() if isinstance(values, np.ndarray)},
            **({} if balances is None else balances.rows),
        }
    )
    lanes = table.lanes
    account = None if balances is None else balances.account(lanes)
    law = law._make(
        lanes[f"law.{name}"] if f"law.{name}" in lanes else float(value) for name, value in law._asdict().items()
    )
    width = cached_lanes(sum(lanes[name].size for name in READ_EVERY_STEP if name in lanes) // ROW)
    batch = stepping.batch_of(watched, table, lane_rows(4 * stepping.WAITING), width)
    KERNELS[type(law)](free, law, _state(lanes, free), batch, account)

    ended = table.cases
    watched.tips[:] = ended["tip"]
    closing = begun.closing + begun.closing_rate * sampling.duration
    heat = watched.reached(ended["tau_before"], ended["tau"])
    closing += project(modal.static_growth / modal.heat_scale, heat.T)
    own = named_rows(Own, ended["own"])
    rebounds = effective_restitution(own.approached, own.separated) if contact.rebounds else {}
    end = None
    if sampling.ends:
        motion, pushed = (
            ended[name].swapaxes(0, 1) / np.where(scale == 0, np.inf, scale)[:, 0] for name in ("motion", "drives")
        )
        tau = ended["tau"] / modal.heat_scale[:, None]
        last = LastStep(watched.elapsed, motion, pushed, tau, own.load, own.impulse, watched.tip.displacement)
        end = end_state(blocks, cases, begun, last)
    return Ended(watched, closing, rebounds, None if balances is None else balances.result(ended, watched.elapsed), end)
