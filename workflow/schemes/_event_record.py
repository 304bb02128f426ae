"""What the event-driven scheme writes of a case: samples, load periods, contact time, temperatures."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.models import Array
from workflow.schemes._event_motion import advance, integral, observe
from workflow.schemes._event_response import Response
from workflow.schemes._kernel import part


class Record(NamedTuple):
    """Where one case writes."""

    times: Array
    """Sample times, s."""
    period_ends: Array
    histories: Array
    """Displacement, velocity, temperature, impulse, ``(4, t)``."""
    periods: Array
    """Impulse, largest temperature, time in contact of load periods, ``(3, period)``."""
    counts: Array
    """impacts, contact time, largest temperature, thermal closing, steps, releases, time reached."""


class Watch(NamedTuple):
    """What has been written and accumulated so far."""

    next: Array
    """Next sample and next period end, integers."""
    totals: Array
    """Impulse, contact time of closed phases, start of the present phase (or inf), largest
    temperature, largest of this period, impulse and contact time at the last period's end."""
    tally: Array
    """What the march counts, see there."""


def watch() -> Watch:
    """Return an empty watch."""
    return Watch(np.zeros(2, dtype=np.int64), np.zeros(7), np.zeros(5))


IMPULSE, CONTACT, SINCE, HOTTEST, PERIOD_HOTTEST, PERIOD_IMPULSE, PERIOD_CONTACT = range(7)


@part
def contact_time(watch: Watch, t: float) -> float:
    return float(watch.totals[CONTACT] + max(0.0, t - watch.totals[SINCE]))


@part
def heat_seen(watch: Watch, temperature: float) -> None:
    watch.totals[HOTTEST] = max(watch.totals[HOTTEST], temperature)
    watch.totals[PERIOD_HOTTEST] = max(watch.totals[PERIOD_HOTTEST], temperature)


@part
def write(
    record: Record,
    watch: Watch,
    gap: float,
    held: bool,
    t: float,
    seen: tuple[float, float, float, float],
    impulse: float,
) -> None:
    """Write the sample or close the load period that falls due at t."""
    sample, period = watch.next[0], watch.next[1]
    due = record.times[sample] if sample < record.times.size else np.inf
    end = record.period_ends[period] if period < record.period_ends.size else np.inf
    if due <= end:
        record.histories[0, sample] = gap if held else gap - seen[0]
        record.histories[1, sample] = 0.0 if held else -seen[1]
        record.histories[2, sample] = seen[2]
        record.histories[3, sample] = impulse
        watch.next[0] += 1
    if end <= due:
        contact = contact_time(watch, t)
        totals = watch.totals
        record.periods[0, period] = impulse - totals[PERIOD_IMPULSE]
        record.periods[1, period] = totals[PERIOD_HOTTEST]
        record.periods[2, period] = contact - totals[PERIOD_CONTACT]
        totals[PERIOD_IMPULSE], totals[PERIOD_CONTACT], totals[PERIOD_HOTTEST] = impulse, contact, seen[2]
        watch.next[1] += 1


@part
def next_due(record: Record, watch: Watch) -> float:
    sample, period = watch.next[0], watch.next[1]
    due = record.times[sample] if sample < record.times.size else np.inf
    if period < record.period_ends.size:
        due = min(due, record.period_ends[period])
    return due


@part
def see(
    record: Record,
    watch: Watch,
    r: Response,
    held: bool,
    gap: float,
    motion: Array,
    t: float,
    dt: float,
    first: tuple[float, float, float, float],
    final: tuple[float, float, float, float],
    tolerance: float,
    scratch: Array,
) -> None:
    """Write what falls due within a step, and follow the tip temperature through it.

    Between points where it rises at the left and falls at the right its maximum is evaluated once,
    at that of the cubic through both: an error of second order in a fourth-order position.
    """
    heated = r.firsts > 0
    last, last_t = first, t
    while next_due(record, watch) < t + dt - tolerance:
        at = max(t, next_due(record, watch))
        advance(r, motion, t, at - t, scratch)
        part = integral(r, motion, scratch, t, at - t) if held else 0.0
        seen = observe(r, scratch, at)
        if heated:
            warmest_between(watch, r, motion, t, last_t, at, last, seen, scratch)
        write(record, watch, gap, held, at, seen, watch.totals[IMPULSE] + part)
        last, last_t = seen, at
    if heated:
        warmest_between(watch, r, motion, t, last_t, t + dt, last, final, scratch)


@part
def warmest_between(
    watch: Watch,
    r: Response,
    motion: Array,
    t: float,
    left: float,
    right: float,
    first: tuple[float, float, float, float],
    final: tuple[float, float, float, float],
    scratch: Array,
) -> None:
    """Follow the tip temperature between two points of time of a step that starts at t."""
    if first[3] > 0.0 and final[3] < 0.0:
        top = left + _hermite_top(first[2], first[3], final[2], final[3], right - left)
        advance(r, motion, t, top - t, scratch)
        heat_seen(watch, observe(r, scratch, top)[2])
    heat_seen(watch, final[2])


@part
def _hermite_top(a: float, da: float, b: float, db: float, h: float) -> float:
    """Return where on [0, h] the cubic with these end values and slopes (da > 0 > db) is largest."""
    low, high = 0.0, h
    for _ in range(60):
        tau = 0.5 * (low + high)
        s = tau / h
        rate = 6.0 * s * (1.0 - s) * (b - a) / h + (1.0 - s) * (1.0 - 3.0 * s) * da + s * (3.0 * s - 2.0) * db
        if rate > 0.0:
            low = tau
        else:
            high = tau
    return 0.5 * (low + high)
