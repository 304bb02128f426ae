"""The event loop of several contacts, or of contacts without mass.

Between events a set S of contacts is closed and the structure is linear (:mod:`.closed_sets`). Every signal, the gap of
an open contact or the force of a closed one, is searched by certified steps (:mod:`.step`); the first that falls
through zero ends the set (:mod:`.contact_events`). A signal that is certified for longer is not looked at again until
then.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, kernel, of_case, part
from workflow.schemes._exact.closed_sets import ClosedSet, closed_set_in
from workflow.schemes._exact.contact_events import LOWEST_BOUNCE, ZERO_FORCE, begin_case, pass_event
from workflow.schemes._exact.contact_motion import (
    ContactCase,
    Contacting,
    Memory,
    enter,
    fill_casing,
    leave,
    motion_in,
)
from workflow.schemes._exact.event_loop import (
    COMPLETED,
    FIRST_STEP,
    LATE,
    NOT_FINITE,
    OUT_OF_EVENTS,
    OUT_OF_STEPS,
    RUNNING,
    SAME_TIME,
)
from workflow.schemes._exact.expansion import SUM_ROUNDING, accumulate, expand
from workflow.schemes._exact.motion import OUTPUTS, SIGNAL, Motion, seen_by
from workflow.schemes._exact.propagation import advance, copy_state, integral, observe
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
from workflow.schemes._exact.step import Start, certified_step, has_no_zero
from workflow.schemes._exact.tables import expansion

WAITING = -1
"""What the kernel returns where it waits for a set, see :attr:`Memory.wanted`."""

PROGRESS = np.dtype(
    [
        *((name, "i8") for name in ("begun", "events", "listed", "steps")),
        *((name, "f8") for name in ("time", "length", "guess")),
    ]
)
"""Scalars of a case, all 0 at the beginning: whether it has begun; time reached, s; events, those of each contact, and
certified steps; the largest motion of a contact, m; the length of the next step tried first, s."""


class Sets(NamedTuple):
    """The sets that are known of a structure at one α and µ."""

    rows: Array
    """As :func:`~workflow.schemes._exact.closed_sets.closed_set_of` reads them, ``(set, number)``."""
    closed: NDArray[np.bool_]
    """Which contacts are closed, ``(set, contact)``."""


class Outcome(NamedTuple):
    """What a march fills: the results of cases, :data:`PROGRESS`, and how they ended, ``(case,)``."""

    record: Record
    progress: Any
    ended: NDArray[np.int64]


@kernel
def run_contacts(
    sets: Sets,
    structure: Contacting,
    cases: ContactCase,
    which: NDArray[np.int64],
    begin: int,
    outcome: Outcome,
    own: Memory,
) -> int:
    """Run cases from position ``begin`` of ``which`` on; return the position of one that waits for a set, or the end.

    A case that waits goes on where it waited.
    """
    record, ended = outcome.record, outcome.ended
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
        ended[i] = _march(sets, structure, of_case(cases, i), mine, outcome.progress[i], own)
        if ended[i] == WAITING:
            return k
    return which.size


@part
def _march(sets: Sets, structure: Contacting, case: ContactCase, record: Record, at: Any, own: Memory) -> int:
    """March a case to its end or until it waits for a set."""
    T = case.duration
    if at.begun == 0:
        for k in range(own.filled.size):
            own.filled[k] = False
        at.begun, at.guess = 1, T
        ended = begin_case(structure, case, record, at, own)
        if ended != RUNNING:
            return ended
    while True:
        slot = _slot(sets.closed, own.wanted)
        if slot < 0:
            return WAITING
        s = closed_set_in(sets.rows[slot])
        m = motion_in(s, case, own, slot)
        enter(m, s, own, at.time)
        for c in range(own.certified.size):
            own.certified[c] = -1.0
        struck = -1
        if at.events > 0:
            at.guess = FIRST_STEP / m.fastest if m.fastest > 0.0 else T
        while struck < 0:
            if at.time >= T:
                _finish(m, s, case, record, own)
                return COMPLETED
            at.steps += 1
            if at.steps > case.budget.steps:
                return OUT_OF_STEPS
            h, struck = _first_zero(m, own, at, T)
            if not np.isfinite(h):
                return NOT_FINITE
            advance(m, m.now, at.time, h, m.after)
            sample = record.tally[0].next_sample
            _record(m, record, own, at.time, h, SAME_TIME * T)
            if record.asked.rows.shape[0] > 0:
                _sense(m, s, case, record, own, at.time, sample)
            copy_state(m.after, m.now)
            at.time = T if h >= T - at.time else at.time + h
            at.guess = 2.0 * h
            for c in range(own.zeros.size if h > SAME_TIME * T else 0):  # else another event of this instant
                own.zeros[c], own.speed[c] = 0, -1.0
        at.events += 1
        if at.events > case.budget.events:
            return OUT_OF_EVENTS
        fill_casing(case, at.time, own)
        leave(m, s, own, m.now, at.time)
        ended = pass_event(structure, case, record, at, own, m.fastest, struck)
        if ended != RUNNING:
            return ended


@part
def _slot(closed: NDArray[np.bool_], wanted: NDArray[np.bool_]) -> int:
    """Return the row of the set that is wanted, -1 where there is none."""
    for k in range(closed.shape[0]):
        same = True
        for c in range(wanted.size):
            if closed[k, c] != wanted[c]:
                same = False
                break
        if same:
            return k
    return -1


@inlined
def _first_zero(m: Motion, own: Memory, at: Any, T: float) -> tuple[float, int]:
    """Return the length of a certified step and the contact whose signal ends it by falling through zero, or -1."""
    struck, h, guess, tried = -1, T - at.time, at.guess, False
    for c in range(own.wanted.size):
        if own.certified[c] - at.time >= h:
            continue
        length, falls = _zero_of(seen_by(m, c), own, at, h, guess, T, tried)
        if not np.isfinite(length):
            return length, -1
        if falls:
            h, struck = length, c
        elif length < h:
            h, struck = length, -1
        if h == 0.0 and struck >= 0:
            break
        guess, tried = h, True
    if struck >= 0:
        own.still[struck] = False
    return h, struck


@part
def _zero_of(m: Motion, own: Memory, at: Any, most: float, guess: float, T: float, tried: bool) -> tuple[float, bool]:
    """Return the length of a step up to ``most`` on which a contact's signal has no zero, or that ends at its first.

    The second number tells which. ``tried`` tells whether ``most`` is the length for another contact.
    """
    c, t, sums, place = m.contact, at.time, m.expansion.sums, OUTPUTS * m.contact + SIGNAL
    zeros, least, constant = own.zeros[c], LOWEST_BOUNCE * at.length, m.outputs[place]
    expand(m, m.now, t)
    own.still[c] = not own.wanted[c] and sums[expansion.SIZE, 0] <= least
    if own.still[c]:  # nothing moves it: only what takes it out of rounding ends the set
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
        start = Start(zeros, own.speed[c], True, guess)
        length, falls = certified_step(m, start, t, most, 0.0 if tried else SAME_TIME * T)
        known = length
    own.certified[c] = -1.0 if own.still[c] else t + known
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


@inlined
def _record(m: Motion, record: Record, own: Memory, t: float, h: float, late: float) -> None:
    """Write samples and load periods within a step, and add the impulses of closed contacts.

    Impulses come first: what the integral takes of the propagation over h is overwritten by that to the samples.
    """
    for c in range(own.wanted.size):
        held = record.tally[c].held
        own.impulse[c] = max(0.0, integral(seen_by(m, c), m.now, m.after, t, h)) if held else 0.0
    left = _write_due(m, record, own, t, h, late)
    for c in range(own.wanted.size):
        tally = record.tally[c]
        if m.heated:
            note_temperature(tally, observe(seen_by(m, c), m.after, t + h).temperature)
            note_temperature(tally, peak_temperature(seen_by(m, c), t, left, t + h, tally.period_temperature))
        tally.impulse += own.impulse[c]


@inlined
def _write_due(m: Motion, record: Record, own: Memory, t: float, h: float, late: float) -> float:
    """Write the samples and load periods of all contacts within a step; return the end of the last period, or t."""
    left, times, ends, asked = t, record.times, record.period_ends, record.asked
    lead = Record(times, ends, record.histories[:, 0], record.periods[:, 0], record.tally[0], asked)
    while next_due(lead) < t + h - late:
        at, period = max(t, next_due(lead)), lead.tally.next_period
        advance(m, m.now, t, at - t, m.between)
        period_ends = m.heated and period < ends.size and ends[period] <= at
        for c in range(own.wanted.size):
            mine = Record(times, ends, record.histories[:, c], record.periods[:, c], record.tally[c], asked)
            by_contact = seen_by(m, c)
            if period_ends and c > 0:  # the search of the largest temperature has used it
                advance(m, m.now, t, at - t, m.between)
            held = mine.tally.held
            impulse = max(0.0, integral(by_contact, m.now, m.between, t, at - t)) if held else 0.0
            outputs = observe(by_contact, m.between, at)
            if m.heated:
                note_temperature(mine.tally, outputs.temperature)
            if period_ends:
                note_temperature(mine.tally, peak_temperature(by_contact, t, left, at, mine.tally.period_temperature))
            write(mine, at, outputs, mine.tally.impulse + impulse)
        left = at if period_ends else left
    return left


@part
def _sense(m: Motion, s: ClosedSet, case: ContactCase, record: Record, own: Memory, t: float, first: int) -> None:
    """Write what sensors show at the samples of a step from t on, from the ``first`` on."""
    for sample in range(first, record.tally[0].next_sample):
        at = max(t, record.times[sample])
        advance(m, m.now, t, at - t, m.between)
        fill_casing(case, at, own)
        leave(m, s, own, m.between, at)
        note_sensors(record.asked, own.modal, s.place.shape[1], sample)


@part
def _finish(m: Motion, s: ClosedSet, case: ContactCase, record: Record, own: Memory) -> None:
    """Write the samples and periods that are due at the end, after any event there, and the state."""
    T, next_sample = case.duration, record.tally[0].next_sample
    times, ends, asked = record.times, record.period_ends, record.asked
    for c in range(own.wanted.size):
        mine = Record(times, ends, record.histories[:, c], record.periods[:, c], record.tally[c], asked)
        observed = observe(seen_by(m, c), m.now, T)
        while next_due(mine) <= T * (1.0 + LATE):
            write(mine, T, observed, mine.tally.impulse)
        mine.tally.contact_time = contact_time(mine.tally, T)
    fill_casing(case, T, own)
    leave(m, s, own, m.now, T)
    for sample in range(next_sample, record.times.size):
        note_sensors(record.asked, own.modal, s.place.shape[1], sample)
    for i in range(own.modal.size):
        case.modal[i] = own.modal[i]
