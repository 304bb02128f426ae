"""The time-stepping kernel of all schemes with a fixed step: blocks of cases, steps, samples, balances, contact.

A scheme gives its step (:class:`~workflow.schemes._fixed.blocks.Step`) and its contact law
(:mod:`workflow.schemes._fixed.contact`), whose type specialises the march when it is compiled.

A kernel loops over time, in a step over packs of lanes, and in a pack over its blocks, whose sum stays in a register
from block to block, in the same order for every lane. So that calls
within a step cost nothing,

- the number of lanes in a row of memory is asserted, see :mod:`workflow.kernels.lanes`, and so are the numbers of a
  block: the distance between rows is then a constant;
- functions called in every step are inlined and count no references to arrays.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import by_type, defines, inlined, kernel
from workflow.kernels.lanes import PACK, ROW, cached_lanes, lane_rows, lane_table, named_rows, rows_in, several_rows
from workflow.kernels.packs import Lane, Pack, broad, lanes_of, narrow, pack, spread
from workflow.models import Array, Cases, Structure, project, row_totals
from workflow.schemes._fixed import balance, stepping
from workflow.schemes._fixed.balance import Account, Balances, dense_of
from workflow.schemes._fixed.blocks import Blocks
from workflow.schemes._fixed.coating import enter_sectors, fill_map, wear
from workflow.schemes._fixed.contact import (
    Contact,
    Meeting,
    approach,
    count_of,
    effective_restitution,
    leave,
    respond_in,
    was_pressed,
)
from workflow.schemes._fixed.free_motion import (
    FreeStep,
    InitialState,
    LastStep,
    ModeWork,
    Moved,
    State,
    drives,
    end_state,
    free_step,
    is_warmed,
    keep_before,
    keep_moved,
    lay_out,
    moved_of,
    start,
    step_freely,
    strike,
)
from workflow.schemes._fixed.law import CentralStep, Law, TipStep, coupling_of, respond
from workflow.schemes._fixed.loads import (
    DriveRows,
    Start,
    load_in_step,
    turn_casing,
    turn_waves,
)
from workflow.schemes._fixed.rows import Acting, Own
from workflow.schemes._fixed.sensing import sense, sensing_of
from workflow.schemes._fixed.stepping import Batch, CaseBlock, Ended, Now
from workflow.schemes._fixed.unsolved import divisors
from workflow.schemes._interface import Sampling, Worn

R = TypeVar("R", bound=Callable[..., tuple[float, float, float]])

KERNELS: dict[type, Callable[..., None]] = {}
"""The march of each contact law, by the type of its parameters."""

READ_EVERY_STEP = ("load_waves", "motion", "tau", "sums", "velocity_before")
"""Rows by which the lanes of a block are chosen, besides the drives of a contact."""

FEW_ROWS = 60
"""Rows of lanes up to which a step takes packs of several registers, which share the fixed cost of a step.

With more rows narrow packs were faster on the processor where it was measured; the bits are the same.
"""


@inlined
def _step(step: FreeStep, law: Law, now: Now, state: State, block: CaseBlock, lane: Lane) -> None:
    """Do a step of a pack of lanes: free motion with the load, contact, counts."""
    load = step.contact.h * load_in_step(block.load, False, lane)
    spent, moved = step_freely(step, step.rows, now.waited, now.warmed, now.t, state, load, lane)
    taken = _touch(step, law, now, state, block, load, moved, lane)
    balance.count_step(
        state.account, dense_of(state.account), step, state, spent, load, taken, now.waits, now.last, lane
    )


@inlined
def _touch(
    step: FreeStep, law: Law, now: Now, state: State, block: CaseBlock, load: Pack, moved: Moved, lane: Lane
) -> Pack:
    """Complete a step by contact: its laws where some contact may act, and what the contacts show; return their work.

    ``moved`` is how one contact without rows moves.
    """
    contact, own, acts = step.contact, state.own, state.acts
    engaged, count = was_pressed(own, lane), count_of(state.coupling, acts)
    ends = load_in_step(block.load, True, lane) if contact.compliant else load
    met = Meeting(own, acts, block.drive, ends, now.first)
    for c in range(count):
        engaged |= approach(contact, met, c, moved_of(step.rows, acts[c], moved, lane).velocity, lane)
    if engaged:
        if step.rows is None:
            keep_moved(state.account, acts[0], moved, lane)
        enter_sectors(block.tracks, block.worn, contact, now.t, acts, lane)
        respond_in(law, contact, own, acts, state.coupling, now.t, lane)
        strike(step, state, now.waits, lane)
    taken = spread(0.0, lane)
    for c in range(count):
        by = moved_of(step.rows, acts[c], moved, lane)
        temperature = pack(acts[c].temperature, lane) if engaged else by.temperature
        end = leave(contact, met, c, by.velocity, engaged, lane)
        taken += balance.count_work(state.account, contact, end, load, by, state, c, engaged, lane)
        stepping.show(now, contact.h, end, temperature, engaged, acts[c], block.contacts[c], lane)
        wear(block.tracks, block.worn, contact, now.t, c, acts[c], end.depth, engaged, lane)
    return taken


@by_type
def _begins(contact: TipStep) -> int:
    """Return the first step: central differences do one at t = 0."""
    return 1


@defines(_begins, CentralStep)
def _begins_centrally(contact: TipStep) -> int:
    return 0


@inlined
def march(step: FreeStep, law: Law, state: State, block: CaseBlock) -> None:
    """Step a block of cases, whose lanes are independent.

    On return ``state.tau_before`` is τ at the beginning of the last step.
    """
    load, lanes, h, theta = block.load, block.lanes, block.h, step.contact.theta
    lay_out(step, state)
    balance.lay_out_account(state.account, dense_of(state.account))
    _, width = lanes_of(broad(0, state.account))
    wide = lanes // width if width > PACK and 2 * len(state.motion) + len(state.tau) <= FEW_ROWS else 0
    paired, warmed, senses = step.pair_block.size > 0, is_warmed(state.acts, lanes), step.sensors.shape[0] > 0
    waits = step.rows is None and dense_of(state.account) is None and not paired and not senses
    stepping.keep_idle_off(state.acts, block.cases, lanes)
    for k in range(block.steps + 1):
        turn_waves(load.waves, k, h, theta, lanes)
        turn_casing(block.drive, k, h, theta, state.acts, lanes)
        if k < _begins(step.contact):
            continue
        now = stepping.step_at(k, warmed, waits and k < block.steps - 2, waits and k < block.steps - 1, block)
        shows = now.marked or now.next_marked
        if paired or k >= block.steps - 1 or (senses and shows):
            keep_before(state, lanes)
        for w in range(wide):
            _step(step, law, now, state, block, broad(w * width, state.account))
        for first in range(wide * width, lanes, PACK):
            _step(step, law, now, state, block, narrow(first))
        fill_map(block.tracks, block.worn, now.t)
        if k == 0:
            continue
        if senses and shows:
            sense(step.sensors, state, block.contacts, now.t, block.record.shown, lanes)
        if now.marked:
            stepping.count_marked(k, block)
        elif now.next_marked:
            stepping.begin_next(1.0, block)


def contact_law(kind: type[Any]) -> Callable[[R], R]:
    """Return a decorator of the contact law for a type of parameters, a named tuple.

    The law is called as :func:`~workflow.schemes._fixed.law.respond`, and may use what numba compiles. Its march is
    compiled at the first call.
    """

    def add(law: R) -> R:
        def march_cases(step: FreeStep, law: Law, state: State, batch: Batch) -> None:
            whole = batch.whole
            for first in range(0, batch.values.shape[1], whole.lanes):
                count = stepping.load_block(batch, first)
                stop, size = first + count, (first, count, stepping.packed(count), whole.steps, whole.h)
                worn = Worn(whole.worn.depth[first:stop], whole.worn.map[first:stop], whole.worn.every)
                parts = whole.load, whole.contacts, whole.marks, whole.record, whole.drive
                block = CaseBlock(*parts, *size, whole.tracks, worn)
                march(step, law, state, block)
                stepping.store_block(batch, first)

        march_cases.__module__ = law.__module__  # the key of the cache: the machine code depends on that source too
        KERNELS[kind] = kernel(march_cases)
        return defines(respond, kind)(law)

    return add


def _state(
    lanes: Mapping[str, Array], contacts: int, batch: Batch, account: Account | None, work: ModeWork | None
) -> State:
    """Return the state of a block of cases, in named lanes."""
    names = ("motion", "drives", "steady", "tau", "motion_before", "tau_before", "sensing")
    acts = several_rows(Acting, lanes["acts"])
    own, rows = named_rows(Own, lanes["own"]), (lanes[name] for name in names)
    return State(own, acts, coupling_of(contacts), batch.whole.drive, account, work, *rows)


def _of_cases(table: Array, cases: Cases) -> Array:
    """Return the diagonal of a table such as W of each case, ``(contact, case)``."""
    cold, slid, warm = table.diagonal(axis1=1, axis2=2)[..., None]
    return np.asarray(cold + warm * cases.alpha - slid * cases.friction)


def _rows_of_contacts(
    blocks: Blocks,
    free: FreeStep,
    cases: Cases,
    velocity: Array,
    force: Array,
    begins: Start,
    ambiguous: NDArray[np.bool_],
) -> Array:
    """Return the rows :class:`Acting` of contacts that begin a march, ``(contact, row, case)``.

    Contacts that are ``ambiguous``, ``(case, contact)``, have no mobility.
    """
    modal, own = blocks.modal, free.contact
    rows = np.zeros((len(modal.normal), rows_in(Acting), cases.count))
    acts = cast(Any, named_rows(Acting, rows))
    acts["mobility"] = np.where(ambiguous.T, np.nan, _of_cases(own.delassus, cases))
    if modal.contacts.is_compliant:
        acts["sinking"] = _of_cases(own.sinking, cases)
    for name in ("place", "speed", "origin", "origin_speed"):
        acts[name] = getattr(begins, name).T
    if blocks.step.is_central:
        acts["speed"] = (project(modal.normal, velocity) - begins.origin_speed).T
    else:
        acts["force"] = force.T
    acts["casing"], acts["level"] = cases.clearances.T, np.inf
    return rows


def step_batch(
    structure: Structure,
    blocks: Blocks,
    contact: Contact,
    cases: Cases,
    velocity: Array,
    force: Array,
    sampling: Sampling,
    drive: DriveRows | None,
    begins: Start,
) -> Ended:
    """Step all cases by a scheme's step, from contacts that start as in ``begins``.

    ``velocity`` is the initial one of the modes, ``(case, mode)``, of central differences half a step before t = 0;
    ``force`` that of the contacts' springs at t = 0, N, ``(case, contact)``.
    """
    modal, step, contacts = blocks.modal, blocks.step, len(blocks.modal.normal)
    begun = start(blocks, cases, velocity, force)
    sensors, sensing = sensing_of(blocks, cases, begun)
    free = free_step(blocks, contact, begun.drifting, sensors)
    watched = stepping.watch(structure, cases, sampling, step.tip.h, begins, drive)
    ambiguous = divisors(step, modal, contact, cases.alpha, cases.friction) <= 0
    rows_of_cases = np.zeros((rows_in(Own), cases.count))
    rows_of_contacts = _rows_of_contacts(blocks, free, cases, velocity, force, begins, ambiguous)
    own, acts = named_rows(Own, rows_of_cases), cast(Any, named_rows(Acting, rows_of_contacts))
    own.alpha, own.friction = cases.alpha, cases.friction
    acts["drift"], acts["warmth"], acts["warming"] = begun.drift.T, begun.warmth.T, begun.warming.T
    acts["grown"] = project(modal.residual_coupling, begun.settled.T).T
    acts["growing"] = project(modal.residual_coupling, begun.warming_modes.T).T

    law, scale = contact.law(cases), blocks.scale[:, None, None]
    motion, tau = scale * begun.states.swapaxes(0, 1), (begun.heat * blocks.heat_scale[:, None])[:, None]
    balances = Balances(structure, blocks, free, cases, begun) if sampling.balances else None
    if balances is not None:
        acts["relative"] = balances.relative.T
    table = lane_table(
        {
            **stepping.rows_of(watched),
            "own": rows_of_cases,
            "acts": rows_of_contacts,
            "motion": motion,
            "drives": scale * drives(blocks, cases).swapaxes(1, 2),
            "steady": blocks.scale[begun.drifting, None] * begun.steady,
            "tau": tau,
            "motion_before": np.zeros_like(motion if step.is_central and sampling.ends else motion[:0]),
            "tau_before": np.zeros((len(tau), 1 + step.is_central, cases.count)),
            "sensing": sensing,
            **{f"law.{name}": values for name, values in law._asdict().items() if isinstance(values, np.ndarray)},
            **({} if balances is None else balances.rows),
        }
    )
    lanes = table.lanes
    account, work = (None, None) if balances is None else (balances.account(lanes), balances.work(lanes))
    law = law._make(
        lanes[f"law.{name}"] if f"law.{name}" in lanes else float(value) for name, value in law._asdict().items()
    )
    read = lanes["drives"][0].size + sum(lanes[name].size for name in READ_EVERY_STEP if name in lanes)
    width = cached_lanes(read // ROW)
    batch = stepping.batch_of(watched, table, lane_rows(4 * contacts * stepping.WAITING), width)
    KERNELS[type(law)](free, law, _state(lanes, contacts, batch, account, work), batch)
    return _ended(blocks, contact, sampling, begun, watched, table.cases, balances, ambiguous)


def _ended(
    blocks: Blocks,
    contact: Contact,
    sampling: Sampling,
    begun: InitialState,
    watched: stepping.Watch,
    ended: Mapping[str, Array],
    balances: Balances | None,
    ambiguous: NDArray[np.bool_],
) -> Ended:
    """Return the results of a march from the rows of all cases at its end."""
    watched.contacts[:] = ended["contacts"]
    if watched.tracks is not None:
        watched.tracks[:] = ended["tracks"]
    if blocks.modal.contacts.is_compliant:  # their forces are finite: no impact
        watched.contact["impacts"] *= 0.0
        watched.periods[:, 6] *= 0.0
    own, acts = named_rows(Own, ended["own"]), cast(Any, named_rows(Acting, ended["acts"]))
    before, after = (ended[name] / blocks.heat_scale[:, None, None] for name in ("tau_before", "tau"))
    ends = (before[:, 1], before[:, 0]) if blocks.step.is_central else (before[:, 0], after[:, 0])
    closing = (
        begun.closing + begun.closing_rate * sampling.duration + project(blocks.modal.growth, watched.reached(*ends).T)
    )
    metrics = {"thermal_closing": closing.max(axis=1)}
    if contact.rebounds:
        metrics |= effective_restitution(row_totals(acts["approached"].T), row_totals(acts["separated"].T))
    end = None
    if sampling.ends:
        unscale = 1 / np.where(blocks.scale == 0, np.inf, blocks.scale)[:, None]
        motion, begin = (
            ended[name].swapaxes(0, 1) * unscale[: len(ended[name])] for name in ("motion", "motion_before")
        )
        last = LastStep(watched.elapsed, motion, begin, after[:, 0], before[:, 0], watched.contact["displacement_end"])
        end = end_state(blocks, begun, last)
    balance = None if balances is None else balances.result(ended, watched.elapsed)
    return Ended(watched, metrics, balance, end, ambiguous.any(axis=1) | (own.unsolved > 0), own.unsolved)
