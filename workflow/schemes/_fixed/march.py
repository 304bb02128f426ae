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

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np

from workflow.kernels.compiled import by_type, defines, inlined, kernel, part
from workflow.kernels.lanes import PACK, ROW, cached_lanes, lane_rows, lane_table, named_rows, rows_in, several_rows
from workflow.kernels.packs import Lane, Pack, broad, broadest, narrow, pack, shared, some, spread, store
from workflow.models import Array, Cases, Structure, project
from workflow.schemes._fixed import balance, stepping
from workflow.schemes._fixed.balance import Account, Balances, Dense, dense_of
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.contact import (
    Approach,
    Contact,
    TipInput,
    approach,
    ask,
    count_of,
    friction_heat,
    leave,
    respond_in,
    was_pressed,
)
from workflow.schemes._fixed.free_motion import (
    ABREAST,
    DECAY,
    HEAT_DECAY,
    HEAT_INPUT,
    HEAT_SPEED,
    PLACE,
    SPEED,
    SPRING,
    ContactRows,
    FreeStep,
    LastStep,
    State,
    drives,
    end_state,
    ended,
    first_free,
    free_step,
    lay_out,
    loaded,
    plus,
    start,
    with_heat,
)
from workflow.schemes._fixed.law import CentralStep, Coupling, Law, TipStep, coupling_of, respond
from workflow.schemes._fixed.loads import DriveRows, Start, load_at_end, start_load, tip_load, turn_drive, turn_load
from workflow.schemes._fixed.outcome import effective_restitution
from workflow.schemes._fixed.rows import Acting, Own
from workflow.schemes._fixed.sensing import sense, sensing_of
from workflow.schemes._fixed.stepping import Batch, CaseBlock, Ended, Now
from workflow.schemes._fixed.unsolved import divisors
from workflow.schemes._interface import Sampling

R = TypeVar("R", bound=Callable[..., tuple[float, float, float]])

KERNELS: dict[type, Callable[..., None]] = {}
"""The march of each contact law, by the type of its parameters."""

READ_EVERY_STEP = ("load", "tips", "motion", "tau", "sums", "velocity_before")
"""Rows that every step reads; contact reads others."""

FEW_ROWS = 60
"""Rows of lanes up to which a step takes packs of several registers, which share the fixed cost of a step.

With more rows narrow packs were faster on the processor where it was measured; the bits are the same.
"""


class FreeTip(NamedTuple):
    """A contact at a step's end without load and contact."""

    velocity: Pack
    temperature: Pack
    thermal_velocity: Pack
    """The thermal part of the velocity."""


@inlined
def _step_blocks(
    account: Account | None,
    dense: Dense | None,
    step: FreeStep,
    state: State,
    velocity: Pack,
    contact: Pack | None,
    lane: Lane,
) -> Pack:
    """Step the blocks; return the velocity of one contact with their part."""
    motion, load = state.motion, pack(state.own.load, lane)
    taken = balance.nothing_taken(lane)
    for j in range(motion.shape[0]):
        if step.rows is None:
            before, place = ended(step, state, j, load, contact, lane)
        else:
            u, eta = pack(motion, (j, SPEED, lane)), pack(motion, (j, PLACE, lane))
            before, place = loaded(step.rows, step, j, u, eta, load, lane)
        taken = balance.count_mode(account, dense, j, before, place, contact, taken, lane)
        u = shared(step.blocks, (j, DECAY), lane) * before + shared(step.blocks, (j, SPRING), lane) * place
        store(motion, (j, SPEED, lane), u)
        store(motion, (j, PLACE, lane), place + step.contact.h * before)
        velocity += u
    balance.add_modes(account, dense, taken, contact, lane)
    return velocity


@inlined
def _recorded(observed: Array | None, k: int, tau: Pack, lane: Lane) -> Pack:
    """Return the part of thermal mode k in the temperature that is recorded."""
    return tau if observed is None else shared(observed, (k,), lane) * tau


@inlined
def _step_heat(
    account: Account | None, step: FreeStep, state: State, known: FreeTip, heat: Pack | None, struck: bool, lane: Lane
) -> tuple[Pack, Pack]:
    """Step the thermal modes; return velocity and temperature of one contact with their parts."""
    tau, loss, velocity, temperature = state.tau, spread(0.0, lane), known.thermal_velocity, known.temperature
    for k in range(tau.shape[0]):
        before = pack(tau, (k, lane))
        loss = balance.with_loss(account, k, before, loss, lane)
        before = plus(before, shared(step.heat_modes, (k, HEAT_INPUT), lane), heat)
        after = shared(step.heat_modes, (k, HEAT_DECAY), lane) * with_heat(step.rows, state, k, before, struck, lane)
        store(tau, (k, lane), after)
        velocity += shared(step.heat_modes, (k, HEAT_SPEED), lane) * after
        temperature += _recorded(step.observed, k, after, lane)
    balance.add_loss(account, state, step.contact.h, loss, heat, struck, lane)
    return velocity, temperature


@inlined
def _add_pairs(step: FreeStep, state: State, velocity: Pack, lane: Lane) -> Pack:
    """Add the load of thermal modes on blocks near resonance with them, and its part in the velocity of one contact."""
    motion = state.motion
    for pair in range(step.pair_block.size):
        j, tau = step.pair_block[pair], pack(state.tau_paired, (step.pair_heat[pair], lane))
        for row in range(2):
            pulled = shared(step.pair_load, (pair, row), lane) * tau
            store(motion, (j, row, lane), pack(motion, (j, row, lane)) + pulled)
        velocity += shared(step.pair_load, (pair, 2), lane) * tau
    return velocity


@inlined
def _add_steady(step: FreeStep, state: State, velocity: Pack, lane: Lane) -> Pack:
    """Add constant loads on drifting blocks, and their part in the velocity of one contact."""
    for k in range(step.drifting.size):
        j, gained = step.drifting[k], pack(state.steady, (k, lane))
        store(state.motion, (j, SPEED, lane), pack(state.motion, (j, SPEED, lane)) + gained)
        velocity += gained
    return velocity


@inlined
def _known(warmed: bool, t: float, act: Acting, lane: Lane) -> FreeTip:
    """Return the known part of a contact's motion by constant loads."""
    drift, warmth = spread(0.0, lane), spread(0.0, lane)
    if warmed:
        drift = pack(act.drift, lane)
        warmth = pack(act.warmth, lane) + pack(act.warming, lane) * t
    return FreeTip(drift, warmth, drift)


@inlined
def _step_states(
    step: FreeStep,
    account: Account | None,
    state: State,
    known: FreeTip,
    contact: Pack | None,
    heat: Pack | None,
    struck: bool,
    lane: Lane,
) -> FreeTip:
    """Step all thermal modes and blocks; return what they move one contact by, besides what is ``known``."""
    thermal_velocity, temperature = _step_heat(account, step, state, known, heat, struck, lane)
    velocity = _step_blocks(account, dense_of(account), step, state, thermal_velocity, contact, lane)
    return FreeTip(velocity, temperature, thermal_velocity)


@inlined
def step_freely(step: FreeStep, warmed: bool, t: float, state: State, account: Account | None, lane: Lane) -> FreeTip:
    """Step all blocks to t, with the impulses of the step before; return one contact there without load and contact.

    In most steps there is no contact in any lane. ``warmed`` is the result of :func:`is_warmed`. Where contacts have
    rows they are moved by :func:`_move_contacts`.
    """
    own, known, struck = state.own, _known(warmed, t, state.acts[0], lane), was_pressed(state.own, lane)
    if step.rows is not None:
        if struck:
            _strike(state, count_of(state.coupling, state.acts), lane)
        free = _step_states(step, account, state, known, None, None, struck, lane)
    elif struck:
        contact, heat = pack(state.acts[0].impulse, lane), friction_heat(own, state.acts[0], lane)
        free = _step_states(step, account, state, known, contact, heat, True, lane)
    else:
        free = _step_states(step, account, state, known, None, None, False, lane)
    if step.pair_block.size + step.drifting.size != 0:
        velocity = _add_steady(step, state, _add_pairs(step, state, free.velocity, lane), lane)
        free = FreeTip(velocity, free.temperature, free.thermal_velocity)
    _move_contacts(step.rows, warmed, t, state, lane)
    return free


@inlined
def _strike(state: State, contacts: int, lane: Lane) -> None:
    """Add the impulses of contact in the last step to the blocks."""
    for c in range(contacts):
        p = pack(state.acts[c].impulse, lane)
        if some(~(p <= 0.0)):  # a NaN too
            for j in range(state.motion.shape[0]):
                for row in range(2):
                    moved = pack(state.motion, (j, row, lane)) + pack(state.drives, (c, j, row, lane)) * p
                    store(state.motion, (j, row, lane), moved)


@inlined
def _move_contacts(rows: ContactRows | None, warmed: bool, t: float, state: State, lane: Lane) -> None:
    """Store velocities and temperatures of contacts that have rows without load and contact."""
    if rows is not None:
        for first in range(0, count_of(state.coupling, state.acts), ABREAST):
            _move_abreast(rows, warmed, t, state, first, lane)


@inlined
def _move_abreast(rows: ContactRows, warmed: bool, t: float, state: State, first: int, lane: Lane) -> None:
    """Store those of :data:`ABREAST` contacts."""
    motion, tau, zero = state.motion, state.tau, spread(0.0, lane)
    v0, v1, v2, v3 = zero, zero, zero, zero
    t0, t1, t2, t3 = zero, zero, zero, zero
    for k in range(tau.shape[0]):
        x = pack(tau, (k, lane))
        v0 += shared(rows.heat_speed, (k, first), lane) * x
        v1 += shared(rows.heat_speed, (k, first + 1), lane) * x
        v2 += shared(rows.heat_speed, (k, first + 2), lane) * x
        v3 += shared(rows.heat_speed, (k, first + 3), lane) * x
        t0 += shared(rows.temperature, (k, first), lane) * x
        t1 += shared(rows.temperature, (k, first + 1), lane) * x
        t2 += shared(rows.temperature, (k, first + 2), lane) * x
        t3 += shared(rows.temperature, (k, first + 3), lane) * x
    thermal = v0, v1, v2, v3
    for j in range(motion.shape[0]):
        x = pack(motion, (j, SPEED, lane))
        v0 += shared(rows.speed, (j, first), lane) * x
        v1 += shared(rows.speed, (j, first + 1), lane) * x
        v2 += shared(rows.speed, (j, first + 2), lane) * x
        v3 += shared(rows.speed, (j, first + 3), lane) * x
    for j in range(rows.place.shape[0]):
        x = pack(motion, (j, PLACE, lane))
        v0 += shared(rows.place, (j, first), lane) * x
        v1 += shared(rows.place, (j, first + 1), lane) * x
        v2 += shared(rows.place, (j, first + 2), lane) * x
        v3 += shared(rows.place, (j, first + 3), lane) * x
    _keep_contact(state.acts, first, warmed, t, FreeTip(v0, t0, thermal[0]), lane)
    _keep_contact(state.acts, first + 1, warmed, t, FreeTip(v1, t1, thermal[1]), lane)
    _keep_contact(state.acts, first + 2, warmed, t, FreeTip(v2, t2, thermal[2]), lane)
    _keep_contact(state.acts, first + 3, warmed, t, FreeTip(v3, t3, thermal[3]), lane)
    if rows.expansion.shape[0] > 0:
        for c in range(first, min(first + ABREAST, len(state.acts))):
            act = state.acts[c]
            expansion = pack(act.grown, lane) + pack(act.growing, lane) * t
            for k in range(tau.shape[0]):
                expansion += shared(rows.expansion, (k, c), lane) * pack(tau, (k, lane))
            store(act.expansion, lane, expansion)


@inlined
def _keep_contact(acts: Sequence[Acting], c: int, warmed: bool, t: float, moved: FreeTip, lane: Lane) -> None:
    """Store how the states move a contact, with its known part."""
    if c < len(acts):
        known = _known(warmed, t, acts[c], lane)
        store(acts[c].velocity, lane, known.velocity + moved.velocity)
        store(acts[c].temperature, lane, known.temperature + moved.temperature)
        store(acts[c].thermal_velocity, lane, known.thermal_velocity + moved.thermal_velocity)


@part
def is_warmed(acts: Sequence[Acting], lanes: int) -> bool:
    """Tell whether heating or the temperature of the surroundings moves a contact of some lane."""
    warmed = False
    for c in range(len(acts)):
        for lane in range(lanes):
            warmed |= acts[c].drift[lane] != 0.0 or acts[c].warmth[lane] != 0.0 or acts[c].warming[lane] != 0.0
    return warmed


@part
def store_heat(step: FreeStep, state: State, into: Array, lanes: int) -> None:
    """Store τ at the end of the last step, with its contact heat where ``heat_counts``."""
    for k in range(into.shape[0]):
        for first in range(0, lanes, PACK):
            lane = narrow(first)
            tau = pack(state.tau, (k, lane))
            if step.heat_counts and step.rows is None:
                tau += shared(step.heat_modes, (k, HEAT_INPUT), lane) * friction_heat(state.own, state.acts[0], lane)
            elif step.heat_counts:
                tau = with_heat(step.rows, state, k, tau, True, lane)
            store(into, (k, lane), tau)


@by_type
def open_march(
    contact: TipStep,
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
    contact: TipStep,
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
    first = Now(now.t, now.last, True, now.next_marked, now.sine, now.leader, now.warmed)
    acts = state.acts
    for c in range(count_of(state.coupling, acts)):
        store(acts[c].velocity, lane, pack(acts[c].first, lane))
        store(acts[c].temperature, lane, spread(0.0, lane))
    known = FreeTip(pack(acts[0].first, lane), spread(0.0, lane), pack(acts[0].thermal_velocity, lane))
    close_step(step, law, first, known, state, block, account, lane)
    if step.contact.stiffness == 0.0:
        for c in range(count_of(state.coupling, acts)):
            store(acts[c].before, lane, 2.0 * pack(acts[c].before, lane))


@inlined
def _free_of(step: FreeStep, free: FreeTip, act: Acting, lane: Lane) -> FreeTip:
    """Return a contact at the step's end without load and contact: ``free`` of one, what was stored of several."""
    if step.rows is None:
        return free
    return FreeTip(pack(act.velocity, lane), pack(act.temperature, lane), pack(act.thermal_velocity, lane))


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
) -> None:
    """Complete a step by load and contact; store or count what the contacts show, and count work."""
    load = step.contact.h * tip_load(now.sine, now.leader, block.load, block.drive, lane)
    store(state.own.load, lane, load)
    _close_all(state.coupling, step, law, now, free, state, block, account, load, lane)
    balance.measure(account, dense_of(account), step, state, lane)


@inlined
def _close_all(
    coupling: Coupling | None,
    step: FreeStep,
    law: Law,
    now: Now,
    free: FreeTip,
    state: State,
    block: CaseBlock,
    account: Account | None,
    load: Pack,
    lane: Lane,
) -> None:
    """Complete a step of all contacts: those that are several are asked together."""
    contact, acts, tips, engaged = step.contact, state.acts, block.tips, was_pressed(state.own, lane)
    last = load_at_end(contact, now.leader, block.load, block.drive, lane)
    if coupling is None:
        own = _free_of(step, free, acts[0], lane)
        driven = TipInput(own.velocity, own.temperature, load, last, pack(tips[0].gap, lane), block.drive)
        begun = approach(contact, driven, state.own, acts, tips[0], 0, lane)
        engaged |= begun.near
        if engaged:
            ask(begun, acts[0], lane)
            respond_in(law, contact, state.own, acts, coupling, now.t, lane)
        _close(step, now, begun, engaged, free, driven, state, block, account, 0, lane)
        return
    for c in range(len(acts)):
        own = _free_of(step, free, acts[c], lane)
        driven = TipInput(own.velocity, own.temperature, load, last, pack(tips[c].gap, lane), block.drive)
        engaged |= approach(contact, driven, state.own, acts, tips[c], c, lane).near
    if engaged:
        for c in range(len(acts)):
            own = _free_of(step, free, acts[c], lane)
            driven = TipInput(own.velocity, own.temperature, load, last, pack(tips[c].gap, lane), block.drive)
            ask(approach(contact, driven, state.own, acts, tips[c], c, lane), acts[c], lane)
        respond_in(law, contact, state.own, acts, coupling, now.t, lane)
    for c in range(len(acts)):
        own = _free_of(step, free, acts[c], lane)
        driven = TipInput(own.velocity, own.temperature, load, last, pack(tips[c].gap, lane), block.drive)
        begun = approach(contact, driven, state.own, acts, tips[c], c, lane)
        _close(step, now, begun, engaged, free, driven, state, block, account, c, lane)


@inlined
def _close(
    step: FreeStep,
    now: Now,
    begun: Approach,
    engaged: bool,
    free: FreeTip,
    driven: TipInput,
    state: State,
    block: CaseBlock,
    account: Account | None,
    c: int,
    lane: Lane,
) -> None:
    """Complete a step of contact ``c``."""
    tip, contact = block.tips[c], step.contact
    end = leave(contact, begun, engaged, driven, state.own, state.acts, state.coupling, tip, c, lane)
    thermal = _free_of(step, free, state.acts[c], lane).thermal_velocity
    balance.count_work(account, contact, end, thermal, driven, state, tip, c, lane)
    if now.marked:
        stepping.store_end(end, tip, lane)
    else:
        stepping.count_end(end, now.next_marked, contact.h, tip, lane)


@inlined
def _step(
    step: FreeStep, law: Law, now: Now, state: State, block: CaseBlock, account: Account | None, lane: Lane
) -> None:
    """Do a step of a pack of lanes: free motion, load and contact, counts."""
    free = step_freely(step, now.warmed, now.t, state, account, lane)
    close_step(step, law, now, free, state, block, account, lane)


@inlined
def march(step: FreeStep, law: Law, state: State, block: CaseBlock, account: Account | None) -> None:
    """Step a block of cases, whose lanes are independent.

    On return ``state.tau_before`` is τ at the beginning of the last step, ``state.tau`` is τ at its end.
    """
    load, tips, lanes, h, theta = block.load, block.tips, block.lanes, block.h, step.contact.theta
    lay_out(step, state)
    balance.lay_out_account(account)
    in_broad = lanes // broadest() * broadest() if 2 * len(state.motion) + len(state.tau) <= FEW_ROWS else 0
    paired, warmed = step.pair_block.size > 0, is_warmed(state.acts, lanes)
    leader = start_load(h, load, lanes)
    turn_drive(block.drive, 0, h, theta, tips, lanes)
    begins = stepping.step_at(0, theta, leader, warmed, block)
    open_march(step.contact, law, step, begins, state, block, account, in_broad)
    for k in range(1, block.steps + 1):
        turn_load(k, h, leader, load, lanes)
        turn_drive(block.drive, k, h, theta, tips, lanes)
        now = stepping.step_at(k, theta, leader, warmed, block)
        if paired or now.last:
            store_heat(step, state, state.tau_before, lanes)
        for first in range(0, in_broad, broadest()):
            _step(step, law, now, state, block, account, broad(first))
        for first in range(in_broad, lanes, PACK):
            _step(step, law, now, state, block, account, narrow(first))
        balance.count_step(account, dense_of(account), step, state, now.last, lanes)
        if step.sensors.shape[0] > 0 and (now.marked or now.next_marked):
            sense(step.sensors, state, tips, now.marked, now.t, block.record.shown, lanes)
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
                block = CaseBlock(whole.load, whole.tips, marks, record, whole.drive, lanes, whole.steps, whole.h)
                march(step, law, state, block, account)
                stepping.store_block(batch, first)

        march_cases.__module__ = law.__module__  # the key of the cache: the machine code depends on that source too
        KERNELS[kind] = kernel(march_cases)
        return defines(respond, kind)(law)

    return add


def _state(lanes: Mapping[str, Array], free: FreeStep, contacts: int) -> State:
    """Return the state of a block of cases, in named lanes."""
    return State(
        own=named_rows(Own, lanes["own"]),
        acts=several_rows(Acting, lanes["acts"]),
        coupling=coupling_of(contacts),
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
    cases: Cases,
    velocity: Array,
    sampling: Sampling,
    drive: DriveRows | None,
    begins: Start,
) -> Ended:
    """Step all cases by a scheme's step, from contacts that start as in ``begins``.

    ``velocity`` is the initial one of the modes, ``(case, mode)``, of central differences half a step before t = 0.
    """
    modal, begun, (contacts, _) = blocks.modal, start(blocks, cases, velocity), blocks.modal.normal.shape
    sensors, sensing = sensing_of(blocks, cases, begun)
    free = free_step(blocks, contact, begun.drifting, sensors)
    watched = stepping.watch(structure, cases, sampling, blocks.step.tip.h, begins, drive)
    states = begun.states
    rows_of_cases, rows_of_contacts = (
        np.zeros((rows_in(Own), cases.count)),
        np.zeros((contacts, rows_in(Acting), cases.count)),
    )
    own, acts = named_rows(Own, rows_of_cases), cast(Any, named_rows(Acting, rows_of_contacts))
    own.alpha, own.friction = cases.alpha, cases.friction
    w = blocks.step.mobility(modal, cases.alpha, cases.friction)
    acts["mobility"] = np.where(divisors(blocks.step, modal, contact, cases.alpha, cases.friction) <= 0, np.nan, w).T
    if modal.contacts.is_compliant:
        cold, slid, warm = free.contact.sinking.diagonal(axis1=1, axis2=2)[..., None]
        acts["sinking"] = cold + warm * cases.alpha - slid * cases.friction
        acts["grown"] = project(modal.residual_coupling, begun.settled.T).T
        acts["growing"] = project(modal.residual_coupling, begun.warming_modes.T).T
        acts["last"] = contact.stiffness * np.fmax(0.0, begins.place - begins.gap).T
    acts["drift"], acts["warmth"], acts["warming"] = begun.drift.T, begun.warmth.T, begun.warming.T
    if not free.heat_counts:
        states, first, thermal_velocity = first_free(blocks, begun)
        acts["first"], acts["thermal_velocity"] = first.T, thermal_velocity.T
        acts["ahead"], acts["half"] = begins.place.T, project(modal.normal, velocity).T

    law, scale, tau = contact.law(cases), blocks.scale[:, None, None], begun.heat * modal.heat_scale[:, None]
    balances = Balances(structure, blocks, free, cases, begun) if sampling.balances else None
    if balances is not None:
        acts["relative"] = balances.relative.T
    table = lane_table(
        {
            **stepping.rows_of(watched),
            "own": rows_of_cases,
            "acts": rows_of_contacts,
            "motion": scale * states.swapaxes(0, 1),
            "drives": scale * drives(blocks, cases).swapaxes(1, 2),
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
    batch = stepping.batch_of(watched, table, lane_rows(4 * contacts * stepping.WAITING), width)
    KERNELS[type(law)](free, law, _state(lanes, free, contacts), batch, account)

    ended = table.cases
    watched.tips[:] = ended["tips"]
    if modal.contacts.is_compliant:  # their forces are finite: no impact
        watched.tip["impacts"] *= 0.0
        watched.periods[:, 6] *= 0.0
    closing = begun.closing + begun.closing_rate * sampling.duration
    heat = watched.reached(ended["tau_before"], ended["tau"])
    closing += project(modal.static_growth / modal.heat_scale, heat.T)
    own, acts = named_rows(Own, ended["own"]), cast(Any, named_rows(Acting, ended["acts"]))
    metrics = {"thermal_closing": closing.max(axis=1)}
    if contact.rebounds:
        metrics |= effective_restitution(acts["approached"].sum(axis=0), acts["separated"].sum(axis=0))
    end = None
    if sampling.ends:
        unscale = 1 / np.where(scale == 0, np.inf, scale)[:, 0]
        motion, pushed = ended["motion"].swapaxes(0, 1) * unscale, ended["drives"].swapaxes(1, 2) * unscale
        tau = ended["tau"] / modal.heat_scale[:, None]
        last = LastStep(watched.elapsed, motion, pushed, tau, own.load, acts["impulse"], watched.tip["displacement"])
        end = end_state(blocks, cases, begun, last)
    balance = None if balances is None else balances.result(ended, watched.elapsed)
    return Ended(watched, metrics, balance, end, own.unsolved)
