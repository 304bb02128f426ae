"""What every fixed-step scheme shares: watching the tip, taking samples, closing load periods.

A scheme's kernel advances its own states and hands the tip's new values of each step to
:func:`observe`. Arrays run over the lanes (cases) of one block, contiguous in memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases
from workflow.schemes._interface import Results, Sampling, Schedule, complete_periods

LANES = 32
"""Cases stepped together: enough to fill vector registers while the states of 40 modes stay in
the first-level cache (2 states x 8 bytes x 40 modes x 32 lanes = 20 kB)."""

RESYNC = 64
"""Steps between exact evaluations of sin and cos of a load; in between a rotation continues it,
whose rounding stays below 64 eps = 1.4e-14 of the amplitude."""


class Load(NamedTuple):
    """Tip load F0 + F1 sin(2π f t + φ) of each lane and its running sine and cosine."""

    mean: Array
    amplitude: Array
    frequency: Array
    phase: Array
    sine: Array
    cosine: Array
    turn_sine: Array
    turn_cosine: Array
    force: Array


class Tip(NamedTuple):
    """State of the tip at the last step end and what has been counted so far, ``(lane,)``."""

    displacement: Array
    velocity: Array
    temperature: Array
    impulse: Array
    gap: Array
    touching: Array
    impacts: Array
    contact_time: Array
    penetration: Array
    hottest: Array
    period_impulse: Array
    period_contact: Array
    period_hottest: Array
    period: NDArray[np.int64]


class Marks(NamedTuple):
    """Steps in which a sample or the end of a load period falls due, and at which share."""

    sample_due: NDArray[np.int64]
    sample_weight: Array
    period_due: NDArray[np.int64]
    period_weight: Array
    next_sample: NDArray[np.int64]
    next_mark: NDArray[np.int64]


class Record(NamedTuple):
    """Where samples ``(lane, t)`` and closed periods ``(lane, period)`` are written."""

    displacement: Array
    velocity: Array
    temperature: Array
    impulse: Array
    period_impulse: Array
    period_temperature: Array
    period_contact: Array


NEVER = np.iinfo(np.int64).max


@numba.njit(nogil=True, cache=True)
def start_load(load: Load, h: float) -> None:
    """Set the load to t = 0 and its rotation to one step."""
    for lane in range(load.mean.size):
        turn = 2.0 * np.pi * load.frequency[lane] * h
        load.turn_sine[lane] = np.sin(turn)
        load.turn_cosine[lane] = np.cos(turn)
        load.sine[lane] = np.sin(load.phase[lane])
        load.cosine[lane] = np.cos(load.phase[lane])
        load.force[lane] = load.mean[lane] + load.amplitude[lane] * load.sine[lane]


@numba.njit(nogil=True, cache=True)
def advance_load(load: Load, step: int, h: float) -> None:
    """Move the load to the end of a step: f(step h)."""
    if step % RESYNC == 0:
        for lane in range(load.mean.size):
            angle = 2.0 * np.pi * (load.frequency[lane] * (step * h)) + load.phase[lane]
            load.sine[lane] = np.sin(angle)
            load.cosine[lane] = np.cos(angle)
    else:
        for lane in range(load.mean.size):
            s, c = load.sine[lane], load.cosine[lane]
            load.sine[lane] = s * load.turn_cosine[lane] + c * load.turn_sine[lane]
            load.cosine[lane] = c * load.turn_cosine[lane] - s * load.turn_sine[lane]
    for lane in range(load.mean.size):
        load.force[lane] = load.mean[lane] + load.amplitude[lane] * load.sine[lane]


@numba.njit(nogil=True, cache=True)
def start_marks(tip: Tip, marks: Marks, record: Record) -> None:
    """Take sample 0 and find the first step in which something falls due."""
    for lane in range(tip.gap.size):
        record.displacement[lane, 0] = tip.displacement[lane]
        record.velocity[lane, 0] = tip.velocity[lane]
        record.temperature[lane, 0] = tip.temperature[lane]
        record.impulse[lane, 0] = 0.0
        tip.penetration[lane] = max(0.0, tip.displacement[lane] - tip.gap[lane])
        tip.hottest[lane] = tip.temperature[lane]
        tip.period_hottest[lane] = tip.temperature[lane]
    marks.next_sample[0] = 1
    _find_next_mark(tip, marks)


@numba.njit(nogil=True, cache=True)
def _find_next_mark(tip: Tip, marks: Marks) -> None:
    mark = NEVER
    if marks.next_sample[0] < marks.sample_due.size:
        mark = marks.sample_due[marks.next_sample[0]]
    for lane in range(tip.gap.size):
        if tip.period[lane] < marks.period_due.shape[1]:
            mark = min(mark, marks.period_due[lane, tip.period[lane]])
    marks.next_mark[0] = mark


@numba.njit(nogil=True, cache=True)
def _between(before: float, after: float, share: float) -> float:
    """Linear between step ends; a step end itself is taken exactly."""
    return after if share == 1.0 else before + share * (after - before)


@numba.njit(nogil=True, cache=True)
def _write_marks(
    step: int, h: float, x: Array, v: Array, temperature: Array, p: Array, tip: Tip, marks: Marks, record: Record
) -> None:
    """Write the samples and close the load periods that end within this step."""
    while marks.next_sample[0] < marks.sample_due.size and marks.sample_due[marks.next_sample[0]] == step:
        k = marks.next_sample[0]
        share = marks.sample_weight[k]
        for lane in range(x.size):
            record.displacement[lane, k] = _between(tip.displacement[lane], x[lane], share)
            record.velocity[lane, k] = _between(tip.velocity[lane], v[lane], share)
            record.temperature[lane, k] = _between(tip.temperature[lane], temperature[lane], share)
            record.impulse[lane, k] = _between(tip.impulse[lane], tip.impulse[lane] + p[lane], share)
        marks.next_sample[0] += 1
    for lane in range(x.size):
        while tip.period[lane] < marks.period_due.shape[1] and marks.period_due[lane, tip.period[lane]] == step:
            k = tip.period[lane]
            share = marks.period_weight[lane, k]
            impulse = _between(tip.impulse[lane], tip.impulse[lane] + p[lane], share)
            reached = _between(tip.temperature[lane], temperature[lane], share)
            contact = tip.contact_time[lane] + (share * h if p[lane] > 0.0 else 0.0)
            record.period_impulse[lane, k] = impulse - tip.period_impulse[lane]
            record.period_temperature[lane, k] = max(tip.period_hottest[lane], reached)
            record.period_contact[lane, k] = contact - tip.period_contact[lane]
            tip.period_impulse[lane] = impulse
            tip.period_contact[lane] = contact
            tip.period_hottest[lane] = reached
            tip.period[lane] = k + 1
    _find_next_mark(tip, marks)


@numba.njit(nogil=True, cache=True)
def observe(
    step: int,
    last: bool,
    h: float,
    x: Array,
    v: Array,
    temperature: Array,
    p: Array,
    tip: Tip,
    marks: Marks,
    record: Record,
) -> None:
    """Take in the tip at the end of a step (1, 2, …): displacement, velocity, temperature, impulse.

    The ``last`` step counts only up to the duration, where the last sample lies.
    """
    if step == marks.next_mark[0]:
        _write_marks(step, h, x, v, temperature, p, tip, marks, record)
    share = marks.sample_weight[-1] if last else 1.0
    span = share * h
    if share != 1.0:
        for lane in range(x.size):
            x[lane] = _between(tip.displacement[lane], x[lane], share)
            v[lane] = _between(tip.velocity[lane], v[lane], share)
            temperature[lane] = _between(tip.temperature[lane], temperature[lane], share)
            p[lane] = share * p[lane]
    for lane in range(x.size):
        touches = 1.0 if p[lane] > 0.0 else 0.0
        tip.impacts[lane] += touches * (1.0 - tip.touching[lane])
        tip.touching[lane] = touches
        tip.contact_time[lane] += touches * span
        tip.penetration[lane] = max(tip.penetration[lane], x[lane] - tip.gap[lane])
        tip.hottest[lane] = max(tip.hottest[lane], temperature[lane])
        tip.period_hottest[lane] = max(tip.period_hottest[lane], temperature[lane])
        tip.impulse[lane] += p[lane]
        tip.displacement[lane] = x[lane]
        tip.velocity[lane] = v[lane]
        tip.temperature[lane] = temperature[lane]


@dataclass(frozen=True, eq=False)
class Block:
    """A run of consecutive cases that a kernel steps at once."""

    cases: slice
    load: Load
    tip: Tip
    marks: Marks
    record: Record


@dataclass(frozen=True, eq=False)
class Watch:
    """Everything that is watched in a batch, ready to be cut in blocks."""

    cases: Cases
    schedule: Schedule
    sampling: Sampling
    h: float
    record: Record
    period_due: NDArray[np.int64]
    period_weight: Array


def watch(cases: Cases, sampling: Sampling, schedule: Schedule, h: float) -> Watch:
    """Lay out the samples and load periods of a batch that is stepped with ``h``."""
    periods = complete_periods(cases, sampling)
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
    shape = (cases.count, sampling.count)
    record = Record(
        *(np.zeros(shape) for _ in range(4)),
        *(np.full((cases.count, longest), np.nan) for _ in range(3)),
    )
    return Watch(cases, schedule, sampling, h, record, due, weight)


def _lanes_of(part: slice, values: Array) -> Array:
    return np.array(values[part], dtype=np.float64)


def blocks(watched: Watch, mean: Array, lanes: int = LANES) -> list[Block]:
    """Cut the batch into blocks of ``lanes`` cases, each with fresh lane arrays.

    ``mean`` is the constant part of the tip force, N, ``(case,)``.
    """
    cases = watched.cases
    found = []
    for first in range(0, cases.count, lanes):
        part = slice(first, min(first + lanes, cases.count))
        count = part.stop - part.start
        lanes_of = partial(_lanes_of, part)
        zeros = partial(np.zeros, count)
        load = Load(
            mean=lanes_of(mean),
            amplitude=lanes_of(cases.amplitude),
            frequency=lanes_of(cases.frequency),
            phase=lanes_of(cases.phase),
            sine=zeros(),
            cosine=zeros(),
            turn_sine=zeros(),
            turn_cosine=zeros(),
            force=zeros(),
        )
        tip = Tip(
            displacement=lanes_of(cases.displacement[:, -1]),
            velocity=lanes_of(cases.velocity[:, -1]),
            temperature=lanes_of(cases.temperature[:, -1]),
            impulse=zeros(),
            gap=lanes_of(cases.gap),
            touching=zeros(),
            impacts=zeros(),
            contact_time=zeros(),
            penetration=zeros(),
            hottest=zeros(),
            period_impulse=zeros(),
            period_contact=zeros(),
            period_hottest=zeros(),
            period=np.zeros(count, dtype=np.int64),
        )
        marks = Marks(
            watched.schedule.due,
            watched.schedule.weight,
            watched.period_due[part],
            watched.period_weight[part],
            np.zeros(1, dtype=np.int64),
            np.zeros(1, dtype=np.int64),
        )
        record = Record(*(values[part] for values in watched.record))
        found.append(Block(part, load, tip, marks, record))
    return found


def collect(
    watched: Watch, done: list[Block], thermal_closing: Array, status: NDArray[np.int8], messages: dict[int, str]
) -> Results:
    """Put the blocks' counts together; a case that left the finite numbers has NaN from there on."""

    def counted(name: str) -> Array:
        return np.concatenate([getattr(block.tip, name) for block in done])

    record = watched.record
    steps = np.full(watched.cases.count, float(watched.schedule.steps))
    metrics = {
        "impacts": counted("impacts"),
        "contact_time": counted("contact_time"),
        "max_penetration": counted("penetration"),
        "max_temperature": counted("hottest"),
        "thermal_closing": thermal_closing,
    }
    lost = ~np.isfinite(counted("displacement") + counted("velocity") + counted("temperature"))
    for values in metrics.values():
        values[lost] = np.nan
    for values in record:
        values[~np.isfinite(values)] = np.nan
    open_ended = np.isnan(record.period_impulse)
    record.period_temperature[open_ended] = np.nan
    record.period_contact[open_ended] = np.nan
    with np.errstate(invalid="ignore"):
        share = record.period_contact * watched.cases.frequency[:, None]
    return Results(
        histories={
            "displacement": record.displacement,
            "velocity": record.velocity,
            "temperature": record.temperature,
            "impulse": record.impulse,
        },
        metrics={**metrics, "steps": steps},
        period_impulse=record.period_impulse,
        period_temperature=record.period_temperature,
        period_contact=share,
        status=status,
        messages=messages,
    )


def merge(parts: list[tuple[NDArray[np.int64], Results]]) -> Results:
    """Put together the results of groups of cases; each comes with the positions of its cases."""
    if len(parts) == 1:
        return parts[0][1]
    positions = np.concatenate([where for where, _ in parts])
    order = np.argsort(positions)
    results = [result for _, result in parts]

    def joined(arrays: list[Array]) -> Array:
        width = max((a.shape[1] for a in arrays if a.ndim == 2), default=0)
        wide = [
            np.pad(a, ((0, 0), (0, width - a.shape[1])), constant_values=np.nan) if a.ndim == 2 else a for a in arrays
        ]
        return np.concatenate(wide)[order]

    return Results(
        histories={name: joined([r.histories[name] for r in results]) for name in results[0].histories},
        metrics={name: joined([r.metrics[name] for r in results]) for name in results[0].metrics},
        period_impulse=joined([r.period_impulse for r in results]),
        period_temperature=joined([r.period_temperature for r in results]),
        period_contact=joined([r.period_contact for r in results]),
        status=np.concatenate([r.status for r in results])[order],
        messages={int(where[k]): text for where, r in parts for k, text in r.messages.items()},
    )
