"""Output of a case during its march: samples, load periods, and scalars."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import part
from workflow.schemes._exact.motion import Motion
from workflow.schemes._exact.peak_temperature import peak_temperature
from workflow.schemes._exact.propagation import Observed, advance, integral, observe

TALLY = np.dtype(
    [
        ("time", "f8"),  # reached, s
        ("held", "i8"),  # whether the tip is held at the gap
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
        ("events", "i8"),  # impacts and releases that count for the budget
        ("steps", "i8"),  # certified steps
        ("impacts", "i8"),  # velocity jumps
        ("releases", "i8"),  # contacts that have ended
        ("max_speed", "f8"),  # largest impact speed, m/s
        ("length", "f8"),  # largest |x_n|, plus those of the casing at the start: scale of displacements, m
        ("unsettled_speed", "f8"),  # half the impact speed at which chattering was last found not to end, m/s
        ("summed_speed", "f8"),  # of chattering that is summed because it exceeds the budget: largest speed, m/s
        ("summed_height", "f8"),  # … largest height above the casing, m
        ("leaving_speed", "f8"),  # … largest speed with which the tip then leaves, if it does not come to rest, m/s
    ]
)
"""Scalars of a case, all 0 at the beginning."""

_DISPLACEMENT, _VELOCITY, _TEMPERATURE, _IMPULSE = range(4)
"""Rows of :attr:`Record.histories`, as in :data:`workflow.schemes.HISTORIES`."""

_PERIOD_IMPULSE, _PERIOD_TEMPERATURE, _PERIOD_CONTACT, _END, _PERIOD_IMPACTS = 0, 1, 2, 3, 6
"""Rows of :attr:`Record.periods`."""


RELEASE, IMPACT, TOUCH = 0.0, 1.0, 2.0
"""Kinds of events: a contact ends, an impact with a flight after it, a contact begins (by an impact where there is an
impulse)."""


class Record(NamedTuple):
    """Output arrays of one case, or those of a batch: all but sample times and events have one more axis before."""

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
    events: Array
    """Time [s], kind, impulse [N s] and the state [y, y', τ] after each event, ``(event, 3 + N)``; events beyond its
    rows are left out."""


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
    x = outputs.place if tally.held else outputs.place - outputs.signal
    v = outputs.speed if tally.held else -(outputs.signal_rate - outputs.speed)
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
def record_step(record: Record, m: Motion, t: float, dt: float, final: Observed, tolerance: float) -> None:
    """Write samples and load periods within a step from ``m.now`` at t to ``m.after``, whose outputs are ``final``.

    The largest temperature is searched over load periods, independently of the samples between.
    """
    tally, heated, left = record.tally, m.heated, t
    while next_due(record) < t + dt - tolerance:
        at = max(t, next_due(record))
        advance(m, m.now, t, at - t, m.between)
        impulse = integral(m, m.now, m.between, t, at - t) if tally.held else 0.0
        outputs = observe(m, m.between, at)
        if heated:
            note_temperature(tally, outputs.temperature)
            if tally.next_period < record.period_ends.size and record.period_ends[tally.next_period] <= at:
                note_temperature(tally, peak_temperature(m, t, left, at, tally.period_temperature))
                left = at
        write(record, at, outputs, tally.impulse + impulse)
    if heated:
        note_temperature(tally, final.temperature)
        note_temperature(tally, peak_temperature(m, t, left, t + dt, tally.period_temperature))
