"""Counts of the states of contacts, samples and load periods, for every fixed-step scheme.

A kernel advances its own states in blocks of up to ``LANES`` cases, one per lane. Each step gives each contact at
its end and the impulse in it, an ``End``. If a mark is due, a sample or the end of a load period, :func:`store_end`
stores it, and :func:`count_marked` interpolates between the old state and the new one and counts the new one; else
:func:`count_end` counts it at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lanes import LANES, PACK, ROW, LaneTable, named_rows, rows_in, several_rows
from workflow.kernels.packs import Lane, Pack, narrow, pack, some, some_nonzero, store, where
from workflow.models import Array, Cases, EndState, Sensors, Structure, project, sensed_values
from workflow.schemes._fixed.balance import Balance
from workflow.schemes._fixed.coating import Track, tracks_of
from workflow.schemes._fixed.contact import End
from workflow.schemes._fixed.loads import Drive, DriveRows, Loads, Start, Wave, rows_of_waves
from workflow.schemes._fixed.rows import Acting, ContactRecord
from workflow.schemes._interface import (
    HISTORIES,
    UNWORN,
    Results,
    Sampling,
    Schedule,
    Worn,
    complete_periods,
    schedule,
    sections_of,
    wear_results,
    worn_of,
)

NEVER = np.iinfo(np.int64).max

WAITING = 8
"""Samples that are buffered until they fill a cache line, which is then written whole."""


class Marks(NamedTuple):
    """Steps in which a sample or the end of a load period is due, and the fraction of the step at which it lies."""

    sample_due: NDArray[np.int64]
    sample_weight: Array
    period_due: NDArray[np.int64]
    period_weight: Array
    """``(case, period)``."""
    next_mark: NDArray[np.int64]
    """The next step in which anything is due, the next sample, the next step that ends a load period, ``(case, 3)``;
    only the rows of the first cases of blocks are used."""
    next_period: NDArray[np.int64]
    """``(case,)``."""


class BlockRecord(NamedTuple):
    """Output arrays of samples and of load periods that have ended."""

    histories: Array
    """Displacement, velocity, temperature and impulse, ``(case, 4, contact, t)``."""
    samples: Array
    """Buffered samples, a row for each quantity, contact and sample, ``(4 * contact * WAITING, lane)``."""
    periods: Array
    """Impulse, largest temperature, contact time, displacement, velocity and temperature at the end, and impacts,
    ``(case, 7, contact, period)``."""
    sensed: Array
    """What sensors show at samples, ``(case, sensor, t)``."""
    shown: Array
    """What they show at the beginning and the end of the step that is sampled next, ``(2, sensor, lane)``."""


class CaseBlock(NamedTuple):
    """Up to ``LANES`` consecutive cases that a kernel steps at once."""

    load: Loads
    contacts: Sequence[ContactRecord]
    marks: Marks
    record: BlockRecord
    """Both of all cases of the batch."""
    drive: Drive | None
    first: int
    cases: int
    """The block's first case, and number of cases."""
    lanes: int
    """Lanes in use, whole packs; the cases come first, idle lanes last."""
    steps: int
    h: float
    tracks: Sequence[Track] | None = None
    worn: Worn = UNWORN
    """The coating of the casing, and its worn depths."""


@inlined
def _between(before: Any, after: Any, share: float) -> Any:
    """Interpolate a number or a pack linearly at a fraction of a step; the step's end itself is exact."""
    return after if share == 1.0 else before + share * (after - before)


@part
def _close_periods(step: int, block: CaseBlock) -> None:
    """Write the load periods that end within this step, and find the step in which the next one ends."""
    h, periods = block.h, block.record.periods
    period_due, period_weight, next_period = block.marks.period_due, block.marks.period_weight, block.marks.next_period
    next_due = NEVER
    for lane in range(block.cases):
        case = block.first + lane
        while next_period[case] < period_due.shape[1] and period_due[case, next_period[case]] == step:
            k = next_period[case]
            share = period_weight[case, k]
            for c in range(len(block.contacts)):
                own, ended = block.contacts[c], periods[case, :, c, k]
                p = own.step_impulse[lane]
                impulse = _between(own.impulse[lane], own.impulse[lane] + p, share)
                reached = _between(own.temperature[lane], own.temperature_end[lane], share)
                contact = own.contact_time[lane] + (share * h if p > 0.0 else 0.0)
                impacts = own.impacts[lane] + (1.0 if p > 0.0 and own.touching[lane] == 0.0 else 0.0)
                ended[0] = impulse - own.period_impulse[lane]
                ended[1] = max(own.period_hottest[lane], reached)
                ended[2] = contact - own.period_contact[lane]
                ended[3] = _between(own.displacement[lane], own.displacement_end[lane], share)
                ended[4] = _between(own.velocity[lane], own.velocity_end[lane], share)
                ended[5] = reached
                ended[6] = impacts - own.period_impacts[lane]
                own.hottest[lane] = max(own.hottest[lane], ended[1])
                own.period_impulse[lane], own.period_contact[lane] = impulse, contact
                own.period_hottest[lane], own.period_impacts[lane] = reached, impacts
            next_period[case] = k + 1
        if next_period[case] < period_due.shape[1]:
            next_due = min(next_due, period_due[case, next_period[case]])
    block.marks.next_mark[block.first, 2] = next_due


@part
def _sample(k: int, share: float, block: CaseBlock) -> None:
    """Interpolate sample k at a fraction ``share`` of the step; write ``WAITING`` samples at a time."""
    contacts, waiting, histories = block.contacts, block.record.samples, block.record.histories
    sensed, shown = block.record.sensed, block.record.shown
    for sensor in range(sensed.shape[1]):
        for i in range(block.cases):
            sensed[block.first + i, sensor, k] = _between(shown[0, sensor, i], shown[1, sensor, i], share)
    slot = (k - 1) % WAITING
    for first in range(0, block.lanes, PACK):
        lane = narrow(first)
        for c in range(len(contacts)):
            own, row = contacts[c], 4 * c * WAITING + slot
            impulse = pack(own.impulse, lane)
            for j, begun, ended in (
                (0, pack(own.displacement, lane), pack(own.displacement_end, lane)),
                (1, pack(own.velocity, lane), pack(own.velocity_end, lane)),
                (2, pack(own.temperature, lane), pack(own.temperature_end, lane)),
                (3, impulse, impulse + pack(own.step_impulse, lane)),
            ):
                store(waiting, (row + j * WAITING, lane), _between(begun, ended, share))
    if slot == WAITING - 1 or k == histories.shape[3] - 1:
        for case in range(block.cases):
            for j in range(histories.shape[1]):
                for c in range(len(contacts)):
                    for i in range(slot + 1):
                        histories[block.first + case, j, c, k - slot + i] = waiting[(4 * c + j) * WAITING + i, case]


@part
def _take_marks(step: int, block: CaseBlock) -> float:
    """Write the samples and load periods that are due within this step; return the fraction of it that counts.

    All steps but the last count whole, the last up to the duration, where the last sample lies.
    """
    next_mark, due, weight = block.marks.next_mark[block.first], block.marks.sample_due, block.marks.sample_weight
    mark = block.steps
    while next_mark[1] < due.size and due[next_mark[1]] == step:
        _sample(next_mark[1], weight[next_mark[1]], block)
        next_mark[1] += 1
    if next_mark[1] < due.size:
        mark = due[next_mark[1]]
    if step == next_mark[2]:
        _close_periods(step, block)
    next_mark[0] = min(mark, next_mark[2])
    return weight[-1] if step == block.steps else 1.0


class Batch(NamedTuple):
    """All cases of a march, which steps them block by block."""

    values: Array
    """Rows of all cases, ``(row, case)``."""
    lanes: Array
    """Rows of the block that is stepped, ``(row, ROW)``."""
    whole: CaseBlock
    """Views of the lanes by name, as many as a block has cases at most, with marks and outputs."""


class Now(NamedTuple):
    """Time and load of a step, common to its packs of lanes."""

    t: float
    """Time at its end, s."""
    last: bool
    marked: bool
    """Whether a sample or the end of a load period is due in it: the state at its end is stored then, and
    :func:`count_marked` counts it later. So it is at t = 0, which is not counted."""
    next_marked: bool
    """Whether one is due in the next step, which then needs the state at the end of this one."""
    first: bool
    """Whether it is that of central differences at t = 0."""
    waits: bool
    waited: bool
    """Whether the impulse of one contact enters the states in the next step, as nothing reads them before, and whether
    that of the last step enters in this one."""
    warmed: bool
    """Whether heating or the temperature of the surroundings moves a contact of some lane."""


@inlined
def step_at(step: int, warmed: bool, waits: bool, waited: bool, block: CaseBlock) -> Now:
    """Return a step."""
    mark = block.marks.next_mark[block.first, 0]
    marked = step == mark or step == 0
    return Now(step * block.h, step == block.steps, marked, step + 1 == mark, step == 0, waits, waited, warmed)


@inlined
def show(
    now: Now, h: float, end: End, temperature: Pack, engaged: bool, act: Acting, own: ContactRecord, lane: Lane
) -> None:
    """Count what a contact shows at a step's end, or store it for :func:`count_marked`; begin the next step from it."""
    if now.marked or now.next_marked:
        store_end(end, temperature, own, lane)
    store(act.place, lane, end.place)
    store(act.speed, lane, end.speed)
    if now.marked:
        return
    count_end(end.depth, temperature, end.impulse, engaged, h, own, lane)


@inlined
def store_end(end: End, temperature: Pack, own: ContactRecord, lane: Lane) -> None:
    """Store the contact's state at the end of a step and the impulse in it, for :func:`count_marked` or the next."""
    store(own.displacement_end, lane, end.displacement)
    store(own.velocity_end, lane, end.velocity)
    store(own.temperature_end, lane, temperature)
    store(own.depth_end, lane, end.depth)
    store(own.step_impulse, lane, end.impulse)


@inlined
def count_end(
    depth: Pack, temperature: Pack, p: Pack, engaged: bool, span: float, own: ContactRecord, lane: Lane
) -> None:
    """Count the contact's state at the end of a step of ``span`` s and the impulse p in it.

    Where no lane is ``engaged`` no count of contact changes.
    """
    hottest = pack(own.period_hottest, lane)
    if some(temperature > hottest):
        store(own.period_hottest, lane, where(temperature > hottest, temperature, hottest))
    deepest = pack(own.penetration, lane)
    if some(depth > deepest):
        store(own.penetration, lane, where(depth > deepest, depth, deepest))
    if engaged:
        touches, touched = where(p > 0.0, 1.0, 0.0), pack(own.touching, lane)
        if some_nonzero(touches - touched):
            store(own.impacts, lane, pack(own.impacts, lane) + touches * (1.0 - touched))
            store(own.touching, lane, touches)
        store(own.contact_time, lane, pack(own.contact_time, lane) + touches * span)
        store(own.impulse, lane, pack(own.impulse, lane) + p)


@part
def begin_next(share: float, block: CaseBlock) -> None:
    """Move the states of contacts that :func:`store_end` stored to the beginning of the next step."""
    for c in range(len(block.contacts)):
        own = block.contacts[c]
        for begun, ended in (
            (own.displacement, own.displacement_end),
            (own.velocity, own.velocity_end),
            (own.temperature, own.temperature_end),
            (own.depth, own.depth_end),
        ):
            for i in range(block.lanes):
                begun[i] = _between(begun[i], ended[i], share)


@inlined
def count_marked(step: int, block: CaseBlock) -> None:
    """Write the samples and load periods of a step whose end :func:`store_end` stored, then count that end.

    Of the last step all that lies after the duration is cut off.
    """
    share = _take_marks(step, block) if step == block.marks.next_mark[block.first, 0] else 1.0
    begin_next(share, block)
    for c in range(len(block.contacts)):
        own = block.contacts[c]
        for first in range(0, block.lanes, PACK):
            lane = narrow(first)
            p = share * pack(own.step_impulse, lane)
            count_end(pack(own.depth, lane), pack(own.temperature, lane), p, True, share * block.h, own, lane)


@dataclass(frozen=True, eq=False)
class Watch:
    """Contacts, samples and load periods of a batch.

    ``contacts``, ``(contact, row, case)``, holds the rows of all cases at t = 0, and at the end after it.
    """

    cases: Cases
    schedule: Schedule
    interval: float
    h: float
    contacts: Array
    sensors: Sensors | None
    drive: DriveRows | None
    """Harmonics of the casing, ``(…, case)``."""
    tracks: Array | None
    """The coating where contacts pass, ``(contact, row, case)``."""
    worn: Worn
    histories: Array
    periods: Array
    """Output arrays, ``(case, 4, contact, t)`` and ``(case, 7, contact, period)``: see :class:`BlockRecord`."""
    period_due: NDArray[np.int64]
    period_weight: Array
    sensed: Array
    shown: Array
    """Those of :class:`BlockRecord`, ``(case, sensor, t)`` and ``(2, sensor, case)``."""

    @property
    def contact(self) -> Any:
        """The contacts by the names of their rows, ``(contact, case)`` each."""
        return named_rows(ContactRecord, self.contacts)

    @property
    def elapsed(self) -> float:
        """Seconds from t = 0 to the end of the last step."""
        return self.schedule.steps * self.h

    def reached(self, before: Array, after: Array) -> Array:
        """Interpolate states at the end of the duration between the last step's beginning and end."""
        return np.asarray(before + self.schedule.weight[-1] * (after - before))

    def finite(self, *rows: str) -> NDArray[np.bool_]:
        """Return which cases have finite numbers in some rows of all contacts, ``(case,)``."""
        return np.asarray(np.isfinite([self.contact[row] for row in rows]).all(axis=(0, 1)))


class Ended(NamedTuple):
    """Results of a march."""

    watched: Watch
    metrics: dict[str, Array]
    """Metrics that are not counted, ``(case,)``: ``thermal_closing``, and those of the scheme."""
    balance: Balance | None
    end: EndState | None
    """That at the end of the last step, in the structure's coordinates."""
    ambiguous: NDArray[np.bool_]
    """Whether contact has no unique solution, alone or together, ``(case,)``."""
    unsolved: Array
    """Time of the step in which contact had no solution, s, 0 for none, ``(case,)``."""


def period_marks(cases: Cases, periods: NDArray[np.int64], steps: int, h: float) -> tuple[NDArray[np.int64], Array]:
    """Return the step in which each load period ends, :data:`NEVER` beyond ``periods``, and at which fraction of it.

    ``(case, period)`` each.
    """
    ends = np.arange(1, int(periods.max(initial=0)) + 1)
    counted = ends <= periods[:, None]
    position = np.zeros(counted.shape)
    np.divide(ends / h, cases.period_frequency[:, None], out=position, where=counted)
    nearest = np.round(position)
    on_step = np.abs(position - nearest) <= 1e-9 * np.maximum(nearest, 1.0)  # the tolerance of the step count
    weight = np.where(on_step, 1.0, position - np.floor(position))
    due = np.where(on_step, nearest, np.ceil(position)).astype(np.int64)
    return np.where(counted, np.minimum(due, steps), NEVER), weight


def watch(
    structure: Structure, cases: Cases, sampling: Sampling, h: float, begins: Start, drive: DriveRows | None = None
) -> Watch:
    """Return the samples and load periods of a batch that is stepped with ``h``, and its contacts as they begin."""
    plan, count = schedule(sampling, h), begins.displacement.shape[1]
    periods = complete_periods(cases.period_frequency, sampling)
    due, weight = period_marks(cases, periods, plan.steps, h)

    contacts = np.zeros((count, rows_in(ContactRecord), cases.count))
    contact: Any = named_rows(ContactRecord, contacts)
    contact["displacement"], contact["velocity"] = begins.displacement.T, begins.velocity.T
    for row in ("temperature", "hottest", "period_hottest"):
        contact[row] = recorded_temperatures(structure, cases.temperature).T
    contact["depth"] = (begins.displacement - begins.gap).T
    contact["penetration"] = np.fmax(0.0, contact["depth"]) + 0.0  # of two zeros fmax returns either

    histories = np.empty((cases.count, 4, count, plan.due.size))
    record = np.full((cases.count, 7, count, due.shape[1]), np.nan)
    for k, row in enumerate(HISTORIES):
        histories[:, k, :, 0] = contact[row].T
    start = sensed_values(structure.sensors, cases)
    sensed = np.full((*start.shape, plan.due.size), np.nan)
    sensed[..., 0], shown = start, np.stack([start.T, start.T])
    outputs = histories, record, due, weight, sensed, shown
    worn = worn_of(cases, count, sampling)
    tracks = tracks_of(cases, worn, contact["depth"].T, structure.contacts.casing_flexibility)
    return Watch(cases, plan, sampling.interval, h, contacts, structure.sensors, drive, tracks, worn, *outputs)


def rows_of(watched: Watch) -> dict[str, Array]:
    """Return the rows of a batch that every block has: load, contacts, what sensors show, and the drive, if any."""
    drive = {} if watched.drive is None else watched.drive._asdict()
    tracks = {} if watched.tracks is None else {"tracks": watched.tracks}
    waves = rows_of_waves(watched.cases.load_harmonics, watched.h, 1)
    load = {"mean": watched.cases.mean[None], "load_waves": waves}
    return {**load, "contacts": watched.contacts, "shown": watched.shown, **drive, **tracks}


def recorded_temperatures(structure: Structure, temperature: Array) -> Array:
    """Return the temperatures that are recorded at the contacts, K, ``(case, contact)``."""
    return project(structure.contacts.recorded, temperature)


def batch_of(watched: Watch, table: LaneTable, samples: Array, width: int) -> Batch:
    """Return a batch for kernels, which step ``width`` cases at once.

    ``table`` has the rows of :func:`rows_of`, ``samples`` are lanes ``(4 * contact * WAITING, ROW)``.
    """
    lanes, plan, count = table.lanes, watched.schedule, watched.cases.count
    marks = Marks(
        sample_due=plan.due,
        sample_weight=plan.weight,
        period_due=watched.period_due,
        period_weight=watched.period_weight,
        next_mark=np.ones((count, 3), dtype=np.int64),  # the first step looks for the first mark
        next_period=np.zeros(count, dtype=np.int64),
    )
    record = BlockRecord(watched.histories, samples, watched.periods, watched.sensed, lanes["shown"])
    drive = None if watched.drive is None else DriveRows(*(lanes[name] for name in DriveRows._fields)).named
    load = Loads(lanes["mean"][0], cast(Sequence[Wave], named_rows(Wave, lanes["load_waves"])))
    contacts = several_rows(ContactRecord, lanes["contacts"])
    tracks = None if watched.tracks is None else several_rows(Track, lanes["tracks"])
    places = 0, count, width, plan.steps
    whole = CaseBlock(load, contacts, marks, record, drive, *places, watched.h, tracks, watched.worn)
    return Batch(table.values, table.buffer, whole)


@inlined
def load_block(batch: Batch, first: int) -> int:
    """Copy the cases of a block from the ``first`` on to the lanes; return their number. Idle lanes are 0.

    The caller makes the :class:`CaseBlock`: numba returns no records.
    """
    values, lanes = batch.values, batch.lanes
    assert lanes.shape[1] == ROW
    count = int(min(batch.whole.lanes, values.shape[1] - first))
    for row in range(values.shape[0]):
        for lane in range(count):
            lanes[row, lane] = values[row, first + lane]
        for lane in range(count, LANES):
            lanes[row, lane] = 0.0
    return count


@inlined
def packed(count: int) -> int:
    """Return the number of lanes of the packs that so many cases fill."""
    return -(-count // PACK) * PACK


@inlined
def keep_idle_off(acts: Sequence[Acting], cases: int, lanes: int) -> None:
    """Put the casings of idle lanes, those after the ``cases``, out of reach: they never touch."""
    for act in acts:
        for lane in range(cases, lanes):
            act.casing[lane] = np.inf


@inlined
def store_block(batch: Batch, first: int) -> None:
    """Copy the lanes back to the cases from the ``first`` on."""
    values, lanes = batch.values, batch.lanes
    for row in range(values.shape[0]):
        for lane in range(min(batch.whole.lanes, values.shape[1] - first)):
            values[row, first + lane] = lanes[row, lane]


def _blank_lost_samples(watched: Watch, case: int) -> None:
    """Set all samples and load periods of a case to NaN from its first non-finite sample on."""
    histories, periods = watched.histories[case], watched.periods[case]
    bad = ~np.isfinite(histories).all(axis=(0, 1))
    first = int(np.argmax(bad)) if bad.any() else histories.shape[-1] - 1
    histories[..., first:] = watched.sensed[case, :, first:] = np.nan
    ends = np.arange(1, periods.shape[-1] + 1)
    periods[..., ends > watched.cases.period_frequency[case] * watched.interval * (first - 1)] = np.nan


def _shift(watched: Watch) -> None:
    """Add the displacement by constant loads from which the casing was seen, of contacts without mass."""
    if watched.cases.offset.any():
        for displacement in (watched.histories[:, 0], watched.periods[:, 3]):
            displacement += watched.cases.offset[:, :, None]


def collect(ended: Ended, status: NDArray[np.int8], messages: dict[int, str]) -> Results:
    """Return the results of all blocks; a case has NaN from its first non-finite sample on."""
    _shift(ended.watched)
    watched, contact, shape = ended.watched, ended.watched.contact, ended.watched.cases.contact_shape
    histories, record = (each if shape else each[:, :, 0] for each in (watched.histories, watched.periods))
    counted = {
        "impacts": contact["impacts"],
        "contact_time": contact["contact_time"],
        "max_penetration": contact["penetration"],
        "max_temperature": np.maximum(contact["hottest"], contact["period_hottest"]),
    }
    if watched.tracks is not None:
        counted["border_work"] = cast(Any, named_rows(Track, watched.tracks))["border_work"]
    metrics = {name: values.T if shape else values[0] for name, values in counted.items()}
    metrics |= ended.metrics | ({} if ended.balance is None else ended.balance.residuals())
    lost = ~watched.finite("displacement", "velocity", "temperature", "impulse")
    metrics = {
        name: np.where(lost.reshape(-1, *(1,) * (each.ndim - 1)), np.nan, each) for name, each in metrics.items()
    }
    for case in np.flatnonzero(lost):
        _blank_lost_samples(watched, int(case))
    impulse, temperature, touched = record[:, :3].swapaxes(0, 1)
    periods = (watched.period_due < NEVER).sum(axis=1)
    named = dict(zip(HISTORIES, histories.swapaxes(0, 1), strict=True))
    if watched.sensors is not None:
        named["sensor_value"] = watched.sensors.with_contacts(watched.sensed, watched.histories[:, 0])
    frequency = watched.cases.period_frequency.reshape(-1, *(1,) * (touched.ndim - 1))
    return Results(
        histories=named,
        metrics={**metrics, "steps": np.full(watched.cases.count, float(watched.schedule.steps))},
        period_impulse=impulse,
        period_temperature=temperature,
        period_contact=touched * frequency,
        status=status,
        messages=messages,
        sections=sections_of(record[:, 3:], periods, histories[:, :3, ..., 0]),
        wear=wear_results(watched.cases, watched.worn, lost),
        end=ended.end,
    )
