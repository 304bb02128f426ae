"""What every fixed-step scheme shares: watching the tip, taking samples, closing load periods.

A scheme's kernel advances its own states in blocks of up to ``LANES`` cases, one per lane::

    leader = start_load(h, load, lanes)
    for step in range(1, block.steps + 1):
        now = enter(step, 1 - theta, theta, leader, known, block)
        for first in range(0, lanes, PACK):
            ...  # with tip_load(now.sine, …), find the tip at the step's end and the impulse in the step
            note(now.marked, engaged, now.lasts, True, h, x, v, temperature, p, gap, tip, narrow(first))
        if now.marked:
            observe(take_marks(step, block), tip, lanes)
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases
from workflow.schemes._interface import HISTORIES, Results, Sampling, Schedule, complete_periods
from workflow.schemes._kernel import inlined
from workflow.schemes._lanes import PACK, cached_lanes, fill_lanes, lane_rows
from workflow.schemes._marks import (
    CONTACT_TIME,
    DISPLACEMENT,
    GAP,
    HOTTEST,
    IMPACTS,
    IMPULSE,
    NEVER,
    NEW_DISPLACEMENT,
    NEW_TEMPERATURE,
    NEW_VELOCITY,
    PENETRATION,
    PERIOD_HOTTEST,
    STEP_IMPULSE,
    TEMPERATURE,
    TIP_ROWS,
    TOUCHING,
    VELOCITY,
    WAITING,
    Block,
    Marks,
    Record,
)
from workflow.schemes._packs import Lane, Pack, narrow, pack, some, some_nonzero, store, where
from workflow.schemes._tip_load import AMPLITUDE, FREQUENCY, LOAD_ROWS, MEAN, OWN_SINE, PHASE, turn_load, weigh_load


class Now(NamedTuple):
    """A step, as its packs of lanes see it."""

    t: float
    """Time at its end, s."""
    marked: bool
    """Whether something falls due in it."""
    lasts: bool
    """Whether something falls due in the next one, which asks for the state at this one's end."""
    sine: float
    leader: int
    """The sine that acts in it, as :func:`weigh_load` returned it, and the lane that it is of."""
    known: bool
    """Whether some lane has a known part of its motion."""


@inlined
def enter(step: int, before: float, after: float, leader: int, known: bool, block: Block) -> Now:
    """Move the load to the end of a step, weigh it at its two ends, and tell what the step is."""
    if step > 0:
        turn_load(step, block.h, leader, block.load, block.lanes)
    sine = weigh_load(before, after, OWN_SINE, leader, block.load, block.lanes)
    mark = block.marks.next_mark[0]
    return Now(step * block.h, step == mark, step + 1 == mark, sine, leader, known)


@inlined
def prepare(x: Pack, v: Pack, temperature: Pack, p: Pack, tip: Array, lane: Lane) -> None:
    """Hand the tip's state at the end of a step and the impulse in it to :func:`observe`."""
    store(tip, (NEW_DISPLACEMENT, lane), x)
    store(tip, (NEW_VELOCITY, lane), v)
    store(tip, (NEW_TEMPERATURE, lane), temperature)
    store(tip, (STEP_IMPULSE, lane), p)


@inlined
def note(
    prepared: bool,
    engaged: bool,
    lasts: bool,
    from_tip: bool,
    span: float,
    x: Pack,
    v: Pack,
    temperature: Pack,
    p: Pack,
    gap: Pack,
    tip: Array,
    lane: Lane,
) -> None:
    """Take in the tip's state at the end of a step of ``span`` s and the impulse in it, or leave it to :func:`observe`.

    That takes it in where it is only to be ``prepared``, when what falls due in the step has been taken.
    Where no lane is ``engaged``, in contact or just released, none of the counts changes. The
    state is kept where it ``lasts``, up to a step in which something falls due, and but for the
    temperature where the scheme goes on ``from_tip``.
    """
    if prepared:
        prepare(x, v, temperature, p, tip, lane)
        return
    hottest = pack(tip, (PERIOD_HOTTEST, lane))
    if lasts or from_tip:
        store(tip, (DISPLACEMENT, lane), x)
        store(tip, (VELOCITY, lane), v)
    if lasts:
        store(tip, (TEMPERATURE, lane), temperature)
    if some(temperature > hottest):
        store(tip, (PERIOD_HOTTEST, lane), where(temperature > hottest, temperature, hottest))
    if some(x > gap):
        depth, deepest = x - gap, pack(tip, (PENETRATION, lane))
        store(tip, (PENETRATION, lane), where(depth > deepest, depth, deepest))
    if engaged:
        touches, touched = where(p > 0.0, 1.0, 0.0), pack(tip, (TOUCHING, lane))
        if some_nonzero(touches - touched):
            store(tip, (IMPACTS, lane), pack(tip, (IMPACTS, lane)) + touches * (1.0 - touched))
            store(tip, (TOUCHING, lane), touches)
        store(tip, (CONTACT_TIME, lane), pack(tip, (CONTACT_TIME, lane)) + touches * span)
        store(tip, (IMPULSE, lane), pack(tip, (IMPULSE, lane)) + p)


@inlined
def observe(span: float, tip: Array, lanes: int) -> None:
    """Take in the rows ``NEW_…`` and ``STEP_IMPULSE`` of the tip at the end of a step of ``span`` s."""
    for first in range(0, lanes, PACK):
        lane = narrow(first)
        x, v = pack(tip, (NEW_DISPLACEMENT, lane)), pack(tip, (NEW_VELOCITY, lane))
        temperature, p = pack(tip, (NEW_TEMPERATURE, lane)), pack(tip, (STEP_IMPULSE, lane))
        note(False, True, True, True, span, x, v, temperature, p, pack(tip, (GAP, lane)), tip, lane)


@dataclass(frozen=True, eq=False)
class Watch:
    """Everything that is watched in a batch, ready to be cut in blocks.

    ``load`` and ``tip`` hold the rows of all cases, ``(row, case)``: how they start, and once
    their block is done how they ended.
    """

    cases: Cases
    schedule: Schedule
    interval: float
    h: float
    load: Array
    tip: Array
    record: Record
    period_due: NDArray[np.int64]
    period_weight: Array


def watch(cases: Cases, mean: Array, sampling: Sampling, schedule: Schedule, h: float) -> Watch:
    """Lay out the samples and load periods of a batch that is stepped with ``h``.

    ``mean`` is the constant part of the tip force, N, ``(case,)``.
    """
    periods = complete_periods(cases.frequency, sampling)
    longest = int(periods.max(initial=0))
    ends = np.arange(1, longest + 1)
    counted = ends <= periods[:, None]
    position = np.zeros(counted.shape)
    np.divide(ends / h, cases.frequency[:, None], out=position, where=counted)
    nearest = np.round(position)
    on_step = np.abs(position - nearest) <= 1e-9 * np.maximum(nearest, 1.0)  # as for the step count
    weight = np.where(on_step, 1.0, position - np.floor(position))
    due = np.where(on_step, nearest, np.ceil(position)).astype(np.int64)
    due = np.where(counted, np.minimum(due, schedule.steps), NEVER)

    load = np.zeros((LOAD_ROWS, cases.count))
    for row, values in (
        (MEAN, mean),
        (AMPLITUDE, cases.amplitude),
        (FREQUENCY, cases.frequency),
        (PHASE, cases.phase),
    ):
        load[row] = values

    tip = np.zeros((TIP_ROWS, cases.count))
    for row, values in (
        (DISPLACEMENT, cases.displacement[:, -1]),
        (VELOCITY, cases.velocity[:, -1]),
        (TEMPERATURE, cases.temperature[:, -1]),
        (GAP, cases.gap),
        (PENETRATION, np.fmax(0.0, cases.displacement[:, -1] - cases.gap) + 0.0),  # of two zeros NumPy takes either
        (HOTTEST, cases.temperature[:, -1]),
        (PERIOD_HOTTEST, cases.temperature[:, -1]),
    ):
        tip[row] = values

    record = Record(
        np.empty((cases.count, 4, schedule.due.size)),  # the march fills it; zeros would be fresh pages each time
        lane_rows(4 * WAITING),
        np.full((cases.count, 3, longest), np.nan),
    )
    record.histories[..., 0] = tip[[DISPLACEMENT, VELOCITY, TEMPERATURE, IMPULSE]].T
    return Watch(cases, schedule, sampling.interval, h, load, tip, record, due, weight)


def block_lanes(pairs: Array, heat: Array, rows: int) -> int:
    """Return the lanes of a block of modes ``(mode, 2, case)`` and ``(thermal mode, case)``, and further ``rows``."""
    return cached_lanes(2 * pairs.shape[0] + heat.shape[0] + rows + TIP_ROWS + LOAD_ROWS)


def blocks(watched: Watch, most: int) -> Iterator[tuple[slice, Block]]:
    """Cut the batch into blocks of ``most`` cases, and take the counts of each when the next one is asked for.

    All blocks share one set of lane arrays, which stays in the processor's cache.
    """
    load, tip, samples = lane_rows(LOAD_ROWS), lane_rows(TIP_ROWS), watched.record.samples
    schedule = watched.schedule
    for first in range(0, watched.cases.count, most):
        part = slice(first, min(first + most, watched.cases.count))
        count = part.stop - part.start
        fill_lanes(load, watched.load[:, part])
        fill_lanes(tip, watched.tip[:, part])
        tip[GAP, count:] = np.inf
        marks = Marks(
            sample_due=schedule.due,
            sample_weight=schedule.weight,
            period_due=watched.period_due[part],
            period_weight=watched.period_weight[part],
            next_mark=np.ones(3, dtype=np.int64),  # the first step looks for the first mark
            next_period=np.zeros(count, dtype=np.int64),
        )
        record = Record(watched.record.histories[part], samples, watched.record.periods[part])
        yield part, Block(load, tip, marks, record, -(-count // PACK) * PACK, schedule.steps, watched.h)
        watched.tip[:, part] = tip[:, :count]


def _blank_what_was_lost(watched: Watch, case: int) -> None:
    """Put NaN in all samples and load periods of a case from its first non-finite sample on."""
    histories, periods = watched.record.histories[case], watched.record.periods[case]
    bad = ~np.isfinite(histories).all(axis=0)
    first = int(np.argmax(bad)) if bad.any() else histories.shape[1] - 1
    histories[:, first:] = np.nan
    ends = np.arange(1, periods.shape[1] + 1)
    periods[:, ends > watched.cases.frequency[case] * watched.interval * (first - 1)] = np.nan


def collect(
    watched: Watch,
    thermal_closing: Array,
    status: NDArray[np.int8],
    messages: dict[int, str],
    balances: dict[str, Array],
) -> Results:
    """Put the blocks' counts together; a case that left the finite numbers has NaN from there on."""
    tip, record = watched.tip, watched.record
    metrics = {
        "impacts": tip[IMPACTS],
        "contact_time": tip[CONTACT_TIME],
        "max_penetration": tip[PENETRATION],
        "max_temperature": np.maximum(tip[HOTTEST], tip[PERIOD_HOTTEST]),
        "thermal_closing": thermal_closing,
        **balances,
    }
    lost = ~np.isfinite(tip[[DISPLACEMENT, VELOCITY, TEMPERATURE, IMPULSE]]).all(axis=0)
    for values in metrics.values():
        values[lost] = np.nan
    for case in np.flatnonzero(lost):
        _blank_what_was_lost(watched, int(case))
    impulse, temperature, contact = record.periods.swapaxes(0, 1)
    return Results(
        histories=dict(zip(HISTORIES, record.histories.swapaxes(0, 1), strict=True)),
        metrics={**metrics, "steps": np.full(watched.cases.count, float(watched.schedule.steps))},
        period_impulse=impulse,
        period_temperature=temperature,
        period_contact=contact * watched.cases.frequency[:, None],
        status=status,
        messages=messages,
    )
