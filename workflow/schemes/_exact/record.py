"""Output of a case: samples, load periods and scalars, among them the largest tip temperature.

The largest temperature within a step is certified. The temperature is expanded like the signal
(:mod:`workflow.schemes._exact.expansion`), and an interval needs no further search where the bounds prove one of these:

- the temperature stays below the largest one so far;
- it is monotone or convex: its largest value is at an end of the interval, and the ends are evaluated;
- it is concave: the largest value is at an end or where the rate is zero, which is then solved for.

Otherwise the interval is bisected.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.schemes._exact.expansion import (
    SUM_ROUNDING,
    accumulate,
    bounds,
    expand_output,
    expanded_blocks,
)
from workflow.schemes._exact.motion import TEMPERATURE, Motion
from workflow.schemes._exact.propagation import Observed, advance, observe
from workflow.schemes._exact.tables import expansion, first, state

TALLY = np.dtype(
    [
        ("held", "i8"),  # 1 where the tip is held at the gap, 2 where it crushes a coating
        ("speed", "f8"),  # approach speed of the last event of the free tip, m/s
        ("impulse", "f8"),  # of the contact force since t = 0, N s
        ("contact_time", "f8"),  # of contacts that have ended, s
        ("contact_begin", "f8"),  # when the present contact began, s; inf where the tip is free
        ("max_temperature", "f8"),  # largest tip temperature, K
        ("next_sample", "i8"),
        ("next_period", "i8"),
        ("period_temperature", "f8"),  # largest tip temperature of the present load period, K
        ("period_impulse", "f8"),  # impulse at its beginning, N s
        ("period_contact", "f8"),  # time in contact until its beginning, s
        ("period_impacts", "i8"),  # velocity jumps until its beginning
        ("impacts", "i8"),  # velocity jumps
        ("releases", "i8"),  # contacts that have ended
        ("max_speed", "f8"),  # largest impact speed, m/s
        ("unsettled_speed", "f8"),  # half the impact speed at which chattering was last found not to end, m/s
        ("summed_speed", "f8"),  # of chattering that is summed because it exceeds the budget: largest speed, m/s
        ("summed_height", "f8"),  # … largest height above the casing, m
        ("casing_flexibility", "f8"),  # x - d of a contact per its signal, m/N, on an elastic casing
        ("leaving_speed", "f8"),  # … largest speed with which the tip then leaves, if it does not come to rest, m/s
    ]
)
"""Scalars of a case, all 0 at the beginning."""

_DISPLACEMENT, _VELOCITY, _TEMPERATURE, _IMPULSE = range(4)
"""Rows of :attr:`Record.histories`, as in :data:`workflow.schemes.HISTORIES`."""

_PERIOD_IMPULSE, _PERIOD_TEMPERATURE, _PERIOD_CONTACT, _END, _PERIOD_IMPACTS = 0, 1, 2, 3, 6
"""Rows of :attr:`Record.periods`."""

_SURE = 1e-12
"""Excess over the largest temperature, relative to it, up to which a later maximum is not searched for: a hundredth of
the promised accuracy, 1e-10."""

_SHORTEST = 1e-15
"""Length of an interval, over the time, below which it is not bisected: a few roundings of the time itself."""


class Asked(NamedTuple):
    """What is recorded where it is asked for, of one case or, but for ``rows``, of a batch; else without rows."""

    rows: Array
    """Rows of sensors of [y, τ], in the modes of the free structure, ``(sensor, mode + thermal mode)``."""
    sensed: Array
    """What sensors show at samples, ``(sensor, t)``."""
    events: Array
    """With the columns of :data:`EVENT`, ``(event, 5)``; events beyond its rows are left out."""
    states: Array
    """[y, y', τ] after each event, ``(event, N)``; likewise."""


EVENT = ("time", "kind", "impulse", "approach", "contact")
"""Columns of events: s, place in :data:`~workflow.variables.EVENT_KINDS`, N s, m/s, number of the contact from 0."""

IMPACTS, TOUCHES, LEAVES, YIELDS, STOPS = range(5)
"""Kinds of events: an impact with a flight after it; a contact begins, by an impact if there is an impulse; it ends; it
begins to crush its coating; it ends to."""


class Record(NamedTuple):
    """Output arrays of one case, or those of a batch: all but sample times have one more axis before."""

    times: Array
    """Sample times, s."""
    period_ends: Array
    """Ends of complete load periods, s; inf beyond them."""
    histories: Array
    """m, m/s, K, N s, ``(4, t)``."""
    periods: Array
    """Impulse [N s], largest tip temperature [K], time in contact [s] of load periods, the tip's displacement [m],
    velocity [m/s] and temperature [K] at their ends, and impacts in them, ``(7, period)``."""
    tally: Any
    """One element of an array of :data:`TALLY`."""
    asked: Asked


@part
def asked_of(asked: Asked, i: int) -> Asked:
    """Return what is asked for of one case of a batch."""
    return Asked(asked.rows, asked.sensed[i], asked.events[i], asked.states[i])


@part
def note_sensors(asked: Asked, modal: Array, modes: int, sample: int) -> None:
    """Write what sensors show at a sample, in the state [y, y', τ]."""
    for s in range(asked.rows.shape[0]):
        value = 0.0
        for j in range(modes):
            value += asked.rows[s, j] * modal[j]
        for j in range(modal.size - 2 * modes):
            value += asked.rows[s, modes + j] * modal[2 * modes + j]
        asked.sensed[s, sample] = value


@part
def note_event(asked: Asked, number: int, t: float, kind: int, impulse: float, approach: float, contact: int) -> None:
    """Write an event of a contact, if there is room for it."""
    if number < asked.events.shape[0]:
        row = asked.events[number]
        row[0], row[1], row[2], row[3], row[4] = t, kind, impulse, approach, contact


@part
def contact_time(tally: Any, t: float) -> float:
    """Return the time in contact until t, s."""
    return float(tally.contact_time + max(0.0, t - tally.contact_begin))


@part
def note_temperature(tally: Any, temperature: float) -> None:
    """Update the largest tip temperatures."""
    tally.max_temperature = max(tally.max_temperature, temperature)
    tally.period_temperature = max(tally.period_temperature, temperature)


@part
def next_due(record: Record) -> float:
    """Return the time of the next sample or end of a load period; inf if there is none."""
    sample, period = record.tally.next_sample, record.tally.next_period
    due = record.times[sample] if sample < record.times.size else np.inf
    if period < record.period_ends.size:
        due = min(due, record.period_ends[period])
    return due


@part
def write(record: Record, t: float, outputs: Observed, impulse: float) -> None:
    """Write the sample, the load period or both that are due at t."""
    tally, histories, periods = record.tally, record.histories, record.periods
    sample, period = tally.next_sample, tally.next_period
    due = record.times[sample] if sample < record.times.size else np.inf
    end = record.period_ends[period] if period < record.period_ends.size else np.inf
    yields = tally.casing_flexibility
    x = outputs.place + yields * outputs.signal if tally.held else outputs.place - outputs.signal
    v = outputs.speed + yields * outputs.signal_rate if tally.held else -(outputs.signal_rate - outputs.speed)
    if due <= end:
        histories[_DISPLACEMENT, sample] = x
        histories[_VELOCITY, sample] = v
        histories[_TEMPERATURE, sample] = outputs.temperature
        histories[_IMPULSE, sample] = impulse
        tally.next_sample += 1
    if end <= due:
        contact = contact_time(tally, t)
        periods[_PERIOD_IMPULSE, period] = impulse - tally.period_impulse
        periods[_PERIOD_TEMPERATURE, period] = tally.period_temperature
        periods[_PERIOD_CONTACT, period] = contact - tally.period_contact
        periods[_END, period], periods[_END + 1, period], periods[_END + 2, period] = x, v, outputs.temperature
        periods[_PERIOD_IMPACTS, period] = tally.impacts - tally.period_impacts
        tally.period_impacts = tally.impacts
        tally.period_impulse, tally.period_contact, tally.period_temperature = impulse, contact, outputs.temperature
        tally.next_period += 1


@part
def peak_temperature(m: Motion, t: float, left: float, right: float, largest: float) -> float:
    """Return the larger of ``largest`` and the largest tip temperature, K, between the times ``left`` and ``right``.

    Both lie in a step from ``m.now`` at t. ``largest`` is at least the temperature at both ends.
    """
    if m.cooling and _is_monotone(m, right - t):
        return largest
    return _searched(m, t, left, right, largest)


@part
def _is_monotone(m: Motion, span: float) -> bool:
    """Whether the temperature, a sum of decaying terms, is certainly monotone over a step.

    Its rate is a sum of terms r exp(-μ τ), each between r and r max(0, 1 - μ τ).
    """
    f, low, high = m.first, 0.0, 0.0
    for j in range(m.firsts):
        rate = f[m.slow + TEMPERATURE, j] * m.now[state.FIRST_SLOPE, j]
        later = rate * max(0.0, 1.0 - f[first.RATE, j] * span)
        low += min(rate, later)
        high += max(rate, later)
    return high <= 0.0 or low >= 0.0


@part
def _searched(m: Motion, t: float, left: float, right: float, largest: float) -> float:
    """Return the larger of ``largest`` and the largest temperature, interval by interval from left to right."""
    at = left
    while at < right:
        advance(m, m.now, t, at - t, m.between)
        expand_output(m, TEMPERATURE, m.between, at)
        if not m.cooling:
            accumulate(m)
        largest = max(largest, m.expansion.sums[expansion.D0, m.blocks])
        if not np.isfinite(m.expansion.sums[expansion.FOURTH, m.blocks]):
            return largest
        span = right - at
        while span > _SHORTEST * right:
            if _peaks_at_an_end(m, span, largest):
                break
            bend = _bend(m, span)
            if bend != 0:
                largest = _concave_peak(m, t, at, span, largest) if bend < 0 else largest
                break
            span *= 0.5
        at = right if span >= right - at else at + max(span, _SHORTEST * right)
    return largest


@part
def _peaks_at_an_end(m: Motion, h: float, largest: float) -> bool:
    """Whether certainly no temperature on (0, h) exceeds both ends and ``largest``: it is monotone or stays below."""
    s = bounds(m, m.blocks if m.cooling else expanded_blocks(m, h), h)
    d1, d2, d3 = s.d1, s.d2, s.d3
    c0, c1 = d1, d1 + 2.0 * d2 / 3.0
    c2, c3 = d1 + 4.0 * d2 / 3.0 + d3, d1 + 2.0 * d2 + 3.0 * d3
    if min(min(c0, c1), min(c2, c3 - 4.0 * s.fourth)) >= s.tail_slope:
        return True
    if max(max(c0, c1), max(c2, c3 + 4.0 * s.fourth)) <= -s.tail_slope:
        return True
    level = largest + _SURE * abs(largest) + SUM_ROUNDING * m.expansion.sums[expansion.SIZE, 0]
    b2 = d1 / 2.0 + d2 / 6.0
    b3 = 0.75 * d1 + d2 / 2.0 + d3 / 4.0
    b4 = d1 + d2 + d3 + s.fourth
    return bool(s.d0 + s.tail + max(max(0.0, d1 / 4.0), max(b2, max(b3, b4))) <= level)


@part
def _bend(m: Motion, h: float) -> int:
    """Return the sign of the second derivative of the temperature on (0, h), 0 where it is not certain."""
    s = bounds(m, m.blocks, h)
    b1, b2 = s.d2 + 1.5 * s.d3, s.d2 + 3.0 * s.d3
    if s.d2 < 0.0 and b1 < 0.0 and b2 + 6.0 * s.fourth < 0.0:
        return -1
    return 1 if s.d2 > 0.0 and b1 > 0.0 and b2 - 6.0 * s.fourth > 0.0 else 0


@part
def _concave_peak(m: Motion, t: float, at: float, h: float, largest: float) -> float:
    """Return the largest temperature on (at, at + h), where it is concave.

    Newton's method on the rate, bracketed by points where it is positive and negative: the rate times the distance to
    the bracket's other end bounds the remaining gain.
    """
    sums, n = m.expansion.sums, m.blocks
    rate, bend, third = sums[expansion.D1, n], sums[expansion.D2, n], sums[expansion.D3, n]
    if rate <= 0.0:
        return largest
    low, high, tau = 0.0, h, 0.0
    for _ in range(100):
        slope = bend + third * tau
        tau = tau - rate / slope if slope < 0.0 else high
        if not (low < tau < high):
            tau = 0.5 * (low + high)
        advance(m, m.now, t, at + tau - t, m.between)
        outputs = observe(m, m.between, at + tau)
        largest, rate = max(largest, outputs.temperature), outputs.warming
        if rate > 0.0:
            low = tau
            gain = rate * (high - tau)
        else:
            high = tau
            gain = -rate * (tau - low)
        if gain <= _SURE * abs(largest) or high - low <= _SHORTEST * (at + h):
            break
    return largest
