"""The event loop: cases from their start to their end, one after the other.

Between events a set S of contacts is closed and the structure is linear (:mod:`.closed_sets`). Every signal, the gap of
an open contact or the force of a closed one, is searched by certified steps (:mod:`.step`); the first that falls
through zero is an event (:mod:`.events`), after which the same set goes on or another is entered. A signal that is
certified for longer than a step is not looked at again until then.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import inlined, kernel, of_case, part
from workflow.schemes._exact.between import Between
from workflow.schemes._exact.coating import BORDER, begin_on, leave_idle, refill, wear
from workflow.schemes._exact.events import (
    COMPLETED,
    EVENT,
    LOWEST_BOUNCE,
    NO_ROOM,
    NOT_FINITE,
    OUT_OF_EVENTS,
    OUT_OF_STEPS,
    RUNNING,
    STEP,
    WAITING,
    ZERO_FORCE,
    Sets,
    decide,
    pass_event,
    slot_of,
)
from workflow.schemes._exact.expansion import SUM_ROUNDING, accumulate, expand
from workflow.schemes._exact.motion import OUTPUTS, SIGNAL, Motion, seen_by
from workflow.schemes._exact.propagation import Observed, advance, copy_state, integral, observe
from workflow.schemes._exact.record import (
    Record,
    asked_of,
    contact_time,
    next_due,
    note_sensors,
    note_temperature,
    peak_temperature,
    write,
)
from workflow.schemes._exact.set_motion import (
    Case,
    Memory,
    SetMotion,
    enter,
    leave,
    motion_in,
    tables_of,
)
from workflow.schemes._exact.step import certified_step, has_no_zero
from workflow.schemes._exact.tables import expansion

SAME_TIME = 16.0 * 2.220446049250313e-16
"""Difference of times, over the duration, up to which they are equal: a dozen roundings of sums of steps."""

LATE = 1e-9
"""Delay of a sample, over the duration, up to which it is due at the end: the tolerance of the sampling interval."""

FIRST_STEP = 0.1
"""First step tried after an event, over the time constant of the fastest pole; it is lengthened while certified."""

PROGRESS = np.dtype(
    [
        ("begun", "i8"),  # 1 where its state is set, 2 where contacts have seen it
        ("entered", "i8"),  # whether the state is that of its set, not X of the contacts open
        ("due", "i8"),  # a step, an event or a decision
        ("struck", "i8"),  # contact of the last event, -1 for the start
        ("expanded", "i8"),  # contact whose signal is expanded at the present state, -1 for none
        ("events", "i8"),  # zeros of signals, which count for the budget
        ("listed", "i8"),  # impulses, beginnings and ends of contacts
        ("steps", "i8"),  # certified steps
        ("mapped", "i8"),  # rows of the map of a coating that are filled
        ("time", "f8"),  # reached, s
        ("until", "f8"),  # time of the next border of sectors at which something changes, s
        ("length", "f8"),  # largest |x| of a contact, plus those of the casing at the start: scale of displacements, m
        ("guess", "f8"),  # length of the next step tried first, s
    ]
)
"""Scalars of a case, all 0 at the beginning."""


class Outcome(NamedTuple):
    """What a march fills: the results of cases, :data:`PROGRESS`, and how they ended, ``(case,)``."""

    record: Record
    progress: Any
    ended: NDArray[np.int64]


@kernel
def run_cases(
    sets: Sets, between: Between, cases: Case, which: NDArray[np.int64], begin: int, outcome: Outcome, own: Memory
) -> int:
    """Run cases from position ``begin`` of ``which`` on; return the position of one that waits, or the end.

    A case that waits for a set or for memory goes on where it waited. Never raises.
    """
    record = outcome.record
    for k in range(begin, which.size):
        i = which[k]
        mine = Record(
            record.times,
            record.period_ends[i],
            record.histories[i],
            record.periods[i],
            record.tally[i],
            asked_of(record.asked, i),
        )
        ended = _run_case(sets, between, of_case(cases, i), mine, outcome.progress[i], own)
        outcome.ended[i] = ended
        if ended < 0:
            return k
    return which.size


@part
def _run_case(sets: Sets, between: Between, case: Case, record: Record, at: Any, own: Memory) -> int:
    """March a case to its end or until it waits."""
    if at.begun == 0:
        _begin(case, record, at, own)
    while True:
        slot = slot_of(sets, case.variant, own, False)
        if slot < 0:
            for c in range(own.contacts.size):
                own.contacts[c].wanted = own.contacts[c].closed
            return WAITING
        place = tables_of(own, slot)
        if place < 0:
            return NO_ROOM
        if at.entered == 0:
            refill(case.coat, own, place)
        motion = motion_in(sets.rows[slot], case, own, place, 0)
        if at.entered == 0:
            enter(motion, own, at.time)
            at.entered, at.expanded = 1, -1
            if at.events > 0:
                at.guess = FIRST_STEP / motion.m.fastest if motion.m.fastest > 0.0 else case.duration
            for s in range(own.watched.size):
                own.watched[s].certified = -1.0
            leave_idle(case.coat, own)
        ended = _stay(sets, between, motion, case, record, at, own)
        if ended != RUNNING:
            return ended


@part
def _begin(case: Case, record: Record, at: Any, own: Memory) -> None:
    """Set the initial state with the contacts closed that the tally holds; without any an event is due."""
    for k in range(own.slots.size):
        own.slots[k] = -1
    for i in range(own.modal.size):
        own.modal[i] = case.modal[i]
    at.begun, at.due, at.struck, at.length, at.guess = 1, EVENT, -1, case.reach, case.duration
    for c in range(own.contacts.size):
        tally = record.tally[c]
        each = own.contacts[c]
        each.closed = tally.held
        tally.contact_begin, tally.casing_flexibility = 0.0 if each.closed else np.inf, case.flexibility
        if each.closed:
            at.due = STEP
    for s in range(own.watched.size):
        own.watched[s].still, own.watched[s].zeros, own.watched[s].speed = False, 0, -1.0
    begin_on(case.coat, at, own)


@part
def _see_start(motion: SetMotion, case: Case, record: Record, at: Any, own: Memory) -> int:
    """Fill what the contacts see at the start; return RUNNING, or NOT_FINITE."""
    for c in range(own.contacts.size):
        observed, tally = observe(seen_by(motion.m, c), motion.m.now, 0.0), record.tally[c]
        if not (
            np.isfinite(observed.signal) and np.isfinite(observed.signal_rate) and np.isfinite(observed.temperature)
        ):
            return NOT_FINITE
        _see(observed, own, c)
        tally.max_temperature = tally.period_temperature = observed.temperature
        if not own.contacts[c].closed:
            at.length = max(at.length, case.reach + abs(observed.place - observed.signal))
    return RUNNING


@inlined
def _see(observed: Observed, own: Memory, c: int) -> None:
    """Keep what a contact sees."""
    own.contacts[c].signal, own.contacts[c].rate = observed.signal, observed.signal_rate
    own.contacts[c].temperature = observed.temperature


@part
def _stay(sets: Sets, between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory) -> int:
    """March in a set until it is left; return RUNNING or how the case ends or waits.

    A function of its own: called once a set and not once a step, as some hundred arguments are passed.
    """
    ended, states = RUNNING, record.asked.states
    if at.begun == 1:
        at.begun, ended = 2, _see_start(motion, case, record, at, own)
    while ended == RUNNING and at.entered == 1:
        if at.due == STEP:
            ended = _step(motion, case, record, at, own)
            continue
        listed = at.listed
        if at.due == EVENT:
            ended = pass_event(sets, between, motion, case, record, at, own)
        else:
            ended = decide(between, motion, case, record, at, own)
        if listed < min(at.listed, states.shape[0]):
            if at.entered == 1:
                leave(motion, own, motion.m.now, at.time)
            for row in range(listed, min(at.listed, states.shape[0])):
                for i in range(own.modal.size):
                    states[row, i] = own.modal[i]
    return ended


@inlined
def _step(motion: SetMotion, case: Case, record: Record, at: Any, own: Memory) -> int:
    """Do a certified step; return RUNNING or how the case ended."""
    m, T, t = motion.m, case.duration, at.time
    if t >= T:
        _finish(motion, case, record, own)
        return COMPLETED
    end = _end_of_step(case.coat, at, T)
    if t >= end:
        at.due, at.struck = EVENT, BORDER
        return RUNNING
    at.steps += 1
    if at.steps > case.budget.steps:
        return OUT_OF_STEPS
    h, struck = _first_zero(m, at, own, end, T)
    if not np.isfinite(h):
        return NOT_FINITE
    advance(m, m.now, t, h, m.after)
    sample = record.tally[0].next_sample
    if not _record(m, record, at, own, h, SAME_TIME * T):
        return NOT_FINITE
    if record.asked.rows.shape[0] > 0:
        _sense(motion, record, own, t, sample)
    copy_state(m.after, m.now)
    at.time = end if h >= end - t else t + h
    wear(case.coat, at, own, at.time)
    at.guess, at.expanded = 2.0 * h, -1
    for s in range(own.watched.size if h > SAME_TIME * T else 0):  # else another event of this instant
        own.watched[s].zeros, own.watched[s].speed = 0, -1.0
    if struck >= 0:
        own.watched[struck].still = False
        at.events += 1
        if at.events > case.budget.events:
            return OUT_OF_EVENTS
        at.due, at.struck = EVENT, struck
        at.guess = FIRST_STEP / m.fastest if m.fastest > 0.0 else T
    return RUNNING


@inlined
def _end_of_step(coat: Any, at: Any, T: float) -> float:
    """Return the time at which a step ends at the latest."""
    return T if coat is None else min(T, at.until)


@part
def _first_zero(motion: Motion, at: Any, own: Memory, end: float, T: float) -> tuple[float, int]:
    """Return the length of a certified step up to ``end`` and the signal that ends it by falling through zero, or -1.

    A signal that is known to have no zero for a while limits a step before it is looked at again.
    """
    signals, struck, h, guess, tried = own.watched.size, -1, end - at.time, at.guess, False
    begin = max(0, at.expanded)
    for k in range(signals):
        s = begin + k if begin + k < signals else begin + k - signals
        known = own.watched[s].certified - at.time
        if known >= h:
            continue
        if tried and struck < 0 and known > 0.5 * h and s < own.contacts.size:
            h = known
            continue
        length, falls = _zero_of(seen_by(motion, s), at, own, h, guess, T, tried)
        if not np.isfinite(length):
            return length, -1
        if falls:
            h, struck = length, s
        elif length < h:
            h, struck = length, -1
        if h == 0.0 and struck >= 0:
            break
        guess, tried = h, True
    return h, struck


@inlined
def _zero_of(m: Motion, at: Any, own: Memory, most: float, guess: float, T: float, tried: bool) -> tuple[float, bool]:
    """Return the length of a step up to ``most`` on which a signal has no zero, or that ends at its first.

    The second number tells which. ``tried`` tells whether ``most`` is the length for another signal.
    """
    s, t, sums, place = m.contact, at.time, m.expansion.sums, OUTPUTS * m.contact + SIGNAL
    watched = own.watched[s]
    zeros = watched.zeros
    least, constant = LOWEST_BOUNCE * at.length, m.outputs[place]
    if at.expanded != s:
        expand(m, m.now, t)
    at.expanded = -1
    is_gap = s < own.contacts.size and own.contacts[s].closed == 0
    watched.still = is_gap and zeros != 1 and sums[expansion.SIZE, 0] <= least
    if watched.still:  # nothing moves it: only what takes it out of rounding ends the set
        zeros, m.outputs[place] = 0, constant + least
        expand(m, m.now, t)
    if zeros < 0:
        zeros = int(abs(sums[expansion.D0, m.blocks]) <= ZERO_FORCE * SUM_ROUNDING * sums[expansion.SIZE, 0])
    beside = tried and zeros == 0
    if beside:
        accumulate(m)
    if beside and has_no_zero(m, 0, most):
        length, falls, known = most, False, _certain(m, most, T - t)
    else:
        length, falls = certified_step(m, zeros, watched.speed, guess, t, most, 0.0 if tried else SAME_TIME * T)
        known = length
    watched.certified = -1.0 if watched.still else t + known
    m.outputs[place] = constant
    return length, falls


@part
def _certain(m: Motion, h: float, most: float) -> float:
    """Return a time of up to 16 h in which the signal, which has no zero in h, certainly has none."""
    for _ in range(4):
        longer = min(2.0 * h, most)
        if longer <= h or not has_no_zero(m, 0, longer):
            break
        h = longer
    return h


@part
def _record(m: Motion, record: Record, at: Any, own: Memory, h: float, late: float) -> bool:
    """Write samples and load periods within a step, and add the impulses of closed contacts; whether all is finite.

    Impulses come first: what the integral takes of the propagation over h is overwritten by that to the samples.
    """
    t, contacts, sound = at.time, own.contacts.size, True
    for c in range(contacts):
        pushed = integral(seen_by(m, c), m.now, m.after, t, h) if own.contacts[c].closed else 0.0
        own.contacts[c].impulse = max(0.0, pushed + own.contacts[c].pressed * h)
    left = _write_due(m, record, own, t, h, late)
    for c in range(contacts):
        tally = record.tally[c]
        tally.impulse += own.contacts[c].impulse
        after = observe(seen_by(m, c), m.after, t + h)
        sound = sound and np.isfinite(after.signal) and np.isfinite(after.temperature)
        _see(after, own, c)
        if m.heated:
            note_temperature(tally, after.temperature)
            note_temperature(tally, peak_temperature(seen_by(m, c), t, left, t + h, tally.period_temperature))
        if not own.contacts[c].closed:
            height = 0.25 * h * min(own.watched[c].speed, -after.signal_rate)  # of a parabolic flight
            at.length = max(at.length, max(abs(after.place - after.signal), height))
    return sound


@inlined
def _write_due(m: Motion, record: Record, own: Memory, t: float, h: float, late: float) -> float:
    """Write the samples and load periods of all contacts within a step; return the end of the last period, or t."""
    left, times, ends, asked = t, record.times, record.period_ends, record.asked
    lead = Record(times, ends, record.histories[:, 0], record.periods[:, 0], record.tally[0], asked)
    while next_due(lead) < t + h - late:
        at, period = max(t, next_due(lead)), lead.tally.next_period
        advance(m, m.now, t, at - t, m.between)
        period_ends = m.heated and period < ends.size and ends[period] <= at
        for c in range(own.contacts.size):
            mine = Record(times, ends, record.histories[:, c], record.periods[:, c], record.tally[c], asked)
            by_contact = seen_by(m, c)
            if period_ends and c > 0:  # the search of the largest temperature has used it
                advance(m, m.now, t, at - t, m.between)
            pushed = integral(by_contact, m.now, m.between, t, at - t) if own.contacts[c].closed else 0.0
            impulse = max(0.0, pushed + own.contacts[c].pressed * (at - t))
            outputs = observe(by_contact, m.between, at)
            if m.heated:
                note_temperature(mine.tally, outputs.temperature)
            if period_ends:
                note_temperature(mine.tally, peak_temperature(by_contact, t, left, at, mine.tally.period_temperature))
            write(mine, at, outputs, mine.tally.impulse + impulse)
        left = at if period_ends else left
    return left


@part
def _sense(motion: SetMotion, record: Record, own: Memory, t: float, first: int) -> None:
    """Write what sensors show at the samples of a step from t on, from the ``first`` on."""
    m = motion.m
    for sample in range(first, record.tally[0].next_sample):
        at = max(t, record.times[sample])
        advance(m, m.now, t, at - t, m.between)
        leave(motion, own, m.between, at)
        note_sensors(record.asked, own.modal, motion.null.shape[0], sample)


@part
def _finish(motion: SetMotion, case: Case, record: Record, own: Memory) -> None:
    """Write the samples and periods that are due at the end, after any event there, and the state."""
    m, T, next_sample = motion.m, case.duration, record.tally[0].next_sample
    times, ends, asked = record.times, record.period_ends, record.asked
    for c in range(own.contacts.size):
        mine = Record(times, ends, record.histories[:, c], record.periods[:, c], record.tally[c], asked)
        observed = observe(seen_by(m, c), m.now, T)
        while next_due(mine) <= T * (1.0 + LATE):
            write(mine, T, observed, mine.tally.impulse)
        mine.tally.contact_time = contact_time(mine.tally, T)
    leave(motion, own, m.now, T)
    for sample in range(next_sample, record.times.size):
        note_sensors(record.asked, own.modal, motion.null.shape[0], sample)
    for i in range(own.modal.size):
        case.modal[i] = own.modal[i]
