"""The event loop: cases from their start to their end, one after the other.

A regime is the linear structure with its tip free or held. Its signal is the gap while the tip is free, the contact
force while it is held. A certified step (:mod:`.step`) ends at the first zero of the signal, or has none. At a zero of
the gap :func:`.events.impact` applies Newton's law, and the tip flies on or is held; at a zero of the force it is free.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import kernel, of_case, part
from workflow.schemes._exact.events import enter_contact, impact, release
from workflow.schemes._exact.expansion import SUM_ROUNDING, expand
from workflow.schemes._exact.layout import Case, in_row
from workflow.schemes._exact.motion import Motion, Motions, Scratch, fill_modal, motions_of, set_free, set_held
from workflow.schemes._exact.propagation import Observed, advance, copy_state, integral, observe
from workflow.schemes._exact.record import (
    IMPACTS,
    LEAVES,
    TOUCHES,
    Record,
    asked_of,
    contact_time,
    next_due,
    note_event,
    note_sensors,
    note_temperature,
    record_step,
    write,
)
from workflow.schemes._exact.step import Start, certified_step
from workflow.schemes._exact.tables import expansion

COMPLETED, OUT_OF_EVENTS, OUT_OF_STEPS, INSIDE_CASING, NOT_FINITE, RUNNING, INVALID, NO_IMPACT_LAW, INSEPARABLE = range(
    9
)
"""How a case ended; a batch sets :data:`INVALID` where a value of the case is not finite, and :data:`INSEPARABLE`."""

SAME_TIME = 16.0 * 2.220446049250313e-16
"""Difference of times, over the duration, up to which they are equal: a dozen roundings of sums of steps."""

LATE = 1e-9
"""Delay of a sample, over the duration, up to which it is due at the end: the tolerance of the sampling interval."""

FIRST_STEP = 0.1
"""First step tried after an event, over the time constant of the fastest pole; it is lengthened while certified."""


@kernel
def run_cases(
    free: Array,
    held: Array,
    cases: Case,
    which: NDArray[np.int64],
    record: Record,
    scratch: Scratch,
    ended: NDArray[np.int64],
) -> None:
    """Run some cases of a batch and fill how they ended; never raises.

    ``free`` and ``held`` are the rows of the regimes with the tip free and held, ``(regime, number)``.
    """
    for k in range(which.size):
        i = which[k]
        own = Record(
            record.times,
            record.period_ends[i],
            record.histories[i],
            record.periods[i],
            record.tally[i],
            asked_of(record.asked, i),
        )
        case = of_case(cases, i)
        motions = motions_of(in_row(free[case.free]), in_row(held[case.held]), case, scratch)
        ended[i] = _run_case(motions, case, own)


@part
def _run_case(motions: Motions, case: Case, record: Record) -> int:
    """Run one case and return how it ended."""
    tally, T = record.tally, case.duration
    ended, event, start, observed = _begin(motions, case, record)
    while ended == RUNNING:
        if event:
            if case.mobility <= 0.0:
                return NO_IMPACT_LAW
            tally.events += 1
            if tally.events > case.budget.events:
                return OUT_OF_EVENTS
            was_held, before, approach = tally.held != 0, tally.impulse, 0.0 if tally.held else tally.speed
            start, observed = _pass_event(motions, case, tally, observed)
            if tally.events <= record.asked.states.shape[0]:
                _fill_now(motions, tally)
                for i in range(motions.free.modal.size):
                    record.asked.states[tally.events - 1, i] = motions.free.modal[i]
            kind = LEAVES if was_held else TOUCHES if tally.held else IMPACTS
            note_event(record.asked, tally.events - 1, tally.time, kind, tally.impulse - before, approach, 0)
        if tally.time >= T:
            _finish(motions, case, record, observed)
            return COMPLETED
        tally.steps += 1
        if tally.steps > case.budget.steps:
            return OUT_OF_STEPS
        held, sample = tally.held != 0, tally.next_sample
        h, event, observed = _step(motions.held if held else motions.free, record, start, T, observed)
        if not np.isfinite(h):
            return NOT_FINITE
        if record.asked.rows.shape[0] > 0:
            _sense(motions, record, sample)
        if held:
            copy_state(motions.held.after, motions.held.now)
        else:
            copy_state(motions.free.after, motions.free.now)
        if not tally.held:
            # height of a parabolic flight from impact to impact
            height = 0.25 * h * min(start.speed, -observed.signal_rate)
            tally.length = max(tally.length, max(abs(observed.place - observed.signal), height))
            if event:
                tally.speed = max(0.0, -observed.signal_rate)
                event = tally.speed > 0.0 or h == 0.0  # a tip on the casing at this instant
        tally.time = T if h >= T - tally.time else tally.time + h
        start = Start(0, -1.0, False, 2.0 * h)
    return ended


@part
def _fill_now(motions: Motions, tally: Any) -> None:
    """Fill [y, y', τ] of the free tip from the current state."""
    held = tally.held != 0
    fill_modal(motions, held, motions.held.now if held else motions.free.now, tally.time)


@part
def _begin(motions: Motions, case: Case, record: Record) -> tuple[int, bool, Start, Observed]:
    """Set the initial state; return RUNNING or how it ended, whether an event is due at t = 0, start and outputs."""
    free, tally = motions.free, record.tally
    for i in range(free.modal.size):
        motions.free.modal[i] = case.modal[i]
    start = Start(0, -1.0, False, case.duration)
    tally.contact_begin = np.inf
    if tally.held:
        set_held(motions, 0.0)
        tally.contact_begin = 0.0
        observed = observe(motions.held, motions.held.now, 0.0)
        tally.max_temperature = observed.temperature
        return RUNNING, False, start, observed
    set_free(motions, 0.0)
    observed = observe(free, free.now, 0.0)
    if not (np.isfinite(observed.signal) and np.isfinite(observed.signal_rate) and np.isfinite(observed.temperature)):
        return NOT_FINITE, False, start, observed
    tally.max_temperature = tally.period_temperature = observed.temperature
    given = Observed(case.distance, -case.speed, observed.temperature, 0.0, observed.place, observed.speed)
    write(record, 0.0, given, 0.0)
    note_sensors(record.asked, free.modal, motions.exit.shape[1], 0)
    expand(free, free.now, 0.0)
    tally.length = case.reach + abs(observed.place - case.distance)
    touches = abs(case.distance) <= 4.0 * SUM_ROUNDING * (tally.length + free.expansion.sums[expansion.SIZE, 0])
    if case.distance < 0.0 and not touches:
        return INSIDE_CASING, False, start, observed
    event = touches and case.speed >= 0.0
    if touches:
        tally.speed = case.speed
        start = Start(2 if event else 1, -1.0, False, case.duration)
    return RUNNING, event, start, observed


@part
def _pass_event(motions: Motions, case: Case, tally: Any, observed: Observed) -> tuple[Start, Observed]:
    """End a contact, or apply an impact and begin a contact if the tip stays; return the start of the next step."""
    free, t = motions.free, tally.time
    guess = FIRST_STEP / free.fastest if free.fastest > 0.0 else case.duration
    if tally.held:
        release(motions, tally)
        return Start(3, -1.0, False, guess), observe(free, free.now, t)
    before, speed = tally.impulse, case.e * tally.speed
    stays, since = impact(motions, case, tally)
    if tally.speed > 0.0:
        temperature = observed.temperature + case.alpha * (tally.impulse - before) * case.heat_jump
        observed = Observed(0.0, speed, temperature, 0.0, observed.place, observed.speed)
        note_temperature(tally, temperature)
    if not stays:
        return Start(1, speed, True, guess), observed
    zeros = enter_contact(motions, case.thresholds.force, t)
    if zeros < 0:
        return Start(-zeros, -1.0, False, guess), observed
    tally.held, tally.contact_begin = 1, since
    return Start(zeros, -1.0, True, guess), observe(motions.held, motions.held.now, t)


@part
def _step(m: Motion, record: Record, start: Start, T: float, observed: Observed) -> tuple[float, bool, Observed]:
    """Do a certified step to ``m.after``; return its length, whether an event ends it, and the outputs at its end.

    The length is NaN where the state is not finite.
    """
    tally, t, tolerance = record.tally, record.tally.time, SAME_TIME * T
    if not start.expanded:
        expand(m, m.now, t)
    h, event = certified_step(m, start, t, T - t, tolerance)
    if not np.isfinite(h):
        return h, False, observed
    advance(m, m.now, t, h, m.after)
    impulse = integral(m, m.now, m.after, t, h) if tally.held else 0.0
    after = observe(m, m.after, t + h)
    if not (np.isfinite(after.signal) and np.isfinite(after.temperature)):
        return np.nan, False, after
    record_step(record, m, t, h, after, tolerance)
    tally.impulse += impulse
    return h, event, after


@part
def _sense(motions: Motions, record: Record, first: int) -> None:
    """Write what sensors show at the samples of a step, from the ``first`` on."""
    t, held = record.tally.time, record.tally.held != 0
    m = motions.held if held else motions.free
    for sample in range(first, record.tally.next_sample):
        at = max(t, record.times[sample])
        advance(m, m.now, t, at - t, m.between)
        fill_modal(motions, held, m.between, at)
        note_sensors(record.asked, motions.free.modal, motions.exit.shape[1], sample)


@part
def _finish(motions: Motions, case: Case, record: Record, observed: Observed) -> None:
    """Write the samples and periods that are due at the end, after any event there."""
    tally, modal, T = record.tally, motions.free.modal, case.duration
    _fill_now(motions, tally)
    for sample in range(tally.next_sample, record.times.size):
        note_sensors(record.asked, modal, motions.exit.shape[1], sample)
    while next_due(record) <= T * (1.0 + LATE):
        write(record, T, observed, tally.impulse)
    for i in range(modal.size):
        case.modal[i] = modal[i]
    tally.contact_time = contact_time(tally, T)
