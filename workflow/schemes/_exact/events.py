"""Events of contacts: impacts by Newton's law for the gaps, and which contacts are closed from then on.

An event sees contacts by their signals alone, expanded in the set S that is closed: gap'' of open contacts, forces of
closed ones. A state is put together only where S is left; a bounce is a jump in the coordinates of S. Contacts with
mass on their casing take Moreau's impulses

    u⁺ = u⁻ - W p,   0 <= p ⊥ -(u⁺ + e u⁻) >= 0,   u = w y' - d',

each of which heats at its place. Those that stay are a complementarity problem of forces,

    0 <= λ ⊥ W λ - (b + δ b') >= 0,   b = -gap'' + W_S λ_S,   b' = -gap''' + W_S λ_S' + Γ (λ - λ_S),

whose rates b', a moment δ later, decide where a force leaves a contact at zero. Of compliant contacts forces are
continuous: 0 <= λ ⊥ gap - W_S λ_S + W λ >= 0, a moment later.

A contact that bounces alone while the others are open is followed through its last bounces in closed form
(:mod:`.chattering`). Others may accumulate at e = 0 too, where W is not diagonal: a contact whose next bounce would be
lower than 1e-11 of the largest motion is held, if it and those at rest are still pressed when all its bounces have
ended, after 2 u⁺/(W λ)/(1 - e).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part
from workflow.kernels.lemke import solve_complementarity, solve_in_place
from workflow.schemes._exact.between import Between
from workflow.schemes._exact.chattering import Bounces, end_of_chattering
from workflow.schemes._exact.coating import START, distance_from_coat, fly_on, next_states
from workflow.schemes._exact.expansion import SUM_ROUNDING, expand, row_size
from workflow.schemes._exact.motion import Motion, seen_by
from workflow.schemes._exact.propagation import copy_state
from workflow.schemes._exact.record import (
    IMPACTS,
    LEAVES,
    STOPS,
    TOUCHES,
    YIELDS,
    Record,
    note_event,
    note_temperature,
)
from workflow.schemes._exact.set_motion import (
    HELD,
    PUSH,
    ROUNDING,
    SIZE,
    Case,
    Memory,
    SetMotion,
    enter,
    leave,
    motion_in,
    strike,
    tables_of,
)
from workflow.schemes._exact.tables import expansion, wave
from workflow.schemes._interface import AT_REST

COMPLETED, OUT_OF_EVENTS, OUT_OF_STEPS, INSIDE_CASING, NOT_FINITE, RUNNING, NO_IMPACT_LAW = range(7)
"""How a case ended, …"""

INVALID, INSEPARABLE = 7, 8
"""… and as a batch sets it: a value is not finite, a set of contacts cannot be separated."""

WAITING, NO_ROOM = -1, -2
"""What a march returns where it waits for a set, :attr:`Memory.wanted`, or for memory of one more motion."""

STEP, EVENT, DECISION = range(3)
"""What is due in a march."""

LOWEST_BOUNCE = 1e-11
"""Height of a bounce, over the largest motion of any contact, below which the contact may be held; gaps whose terms are
all smaller do not move."""

ZERO_FORCE = 64.0
"""Force and acceleration, over the rounding of their terms, below which they are 0 when a contact begins or opens."""

_MOMENT = 1e-9
"""δ over the time constant of the fastest pole: rates change forces by 1e-9 in it, above rounding and below what
decides between forces that are not 0."""

_CLEAR = 1e-9
"""Gap over the largest motion above which a contact is open without a look at rounding."""

_LOOSE = 1e3
"""Factor of the threshold of height once half the budget of events is spent: chattering up to 1e-7 of the displacement
scale is summed then, and the message of the case says so."""

_OPEN, _LEAVING, _RESTING, _RETURNING = range(4)
"""Kinds of contacts at an event: away from the casing, leaving it with a speed, at rest on it or striking it, leaving
by a bounce that is not followed."""


class Sets(NamedTuple):
    """The sets that are known of a structure at one µ; the first has all contacts open, and knows no α."""

    rows: Array
    """As :func:`~workflow.schemes._exact.closed_sets.closed_set_of` reads them, ``(set, number)``."""
    closed: NDArray[np.int8]
    """Which contacts are closed, and how, ``(set, contact)``: by numbers of :func:`~workflow.models.contact_system`."""
    first: NDArray[np.int64]
    """Row of the last set that was added of each α, -1 for none …"""
    following: NDArray[np.int64]
    """… and of the one before each set."""


@part
def slot_of(sets: Sets, variant: int, own: Memory, wanted: bool) -> int:
    """Return the row of the set that is closed, or wanted; -1 where it is not known."""
    k = 0 if sets.closed.shape[0] > 0 else -1
    while k >= 0:
        same = True
        for c in range(own.contacts.size):
            if sets.closed[k, c] != (own.contacts[c].wanted if wanted else own.contacts[c].closed):
                same = False
                break
        if same:
            return k
        k = sets.first[variant] if k == 0 else sets.following[k]
    return -1


@inlined
def pass_event(
    sets: Sets, between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory
) -> int:
    """Pass the event of the contact ``at.struck``, or the start (-1); return RUNNING or how the case ends or waits.

    An event that waits has changed nothing.
    """
    c = at.struck
    for i in range(own.contacts.size):
        each = own.contacts[i]
        each.before = each.taken = each.bounces = each.approach = 0.0
    if between.compliant:
        at.due = STEP if fly_on(case.coat, motion, at, own) else DECISION
        return RUNNING
    if c >= 0 and own.contacts[c].closed:
        own.watched[c].zeros, own.watched[c].speed, own.contacts[c].closed = 3, -1.0, 0
        change_set(motion, at, own)
        note_changes(record, at, own)
        return RUNNING
    if _sort_contacts(motion, case, at, own):
        return INSIDE_CASING
    lone = _lone(between, case, own)
    if lone == -1:
        at.due = STEP
        return RUNNING
    if lone >= 0:
        return _pass_lone(sets, between, motion, case, record, at, own, lone)
    return _strike_all(between, motion, case, record, at, own)


@part
def _lone(between: Between, case: Case, own: Memory) -> int:
    """Return the contact that may bounce alone while all others are open; -1 where none does anything, else -2.

    Contacts that nothing moves may touch their casing, if the one does not move them either.
    """
    lone = -1
    for c in range(own.contacts.size):
        own.contacts[c].before = own.contacts[c].approach
        if own.contacts[c].kind != _OPEN and not own.watched[c].still:
            lone = c if lone == -1 and own.contacts[c].kind == _RESTING and not own.contacts[c].closed else -2
    for c in range(own.contacts.size if lone >= 0 else 0):
        if own.watched[c].still and between.pairs[c, lone].mobility != 0.0:
            return -2
    return lone


@part
def change_set(motion: SetMotion, at: Any, own: Memory) -> None:
    """Leave the set; that of the contacts which are closed now is entered next."""
    leave(motion, own, motion.m.now, at.time)
    at.entered, at.due = 0, STEP


@part
def _sort_contacts(motion: SetMotion, case: Case, at: Any, own: Memory) -> bool:
    """Fill kinds and approach speeds; return whether a contact starts inside its casing.

    A contact is on its casing where it struck, is closed, or its gap is rounding.
    """
    m, begins, inside = motion.m, at.struck < 0, False
    least = AT_REST if begins else SUM_ROUNDING
    for c in range(own.contacts.size):
        own.contacts[c].kind = _RESTING
        if own.contacts[c].closed:
            continue
        gap, approach, is_on, size, pace = own.contacts[c].signal, -own.contacts[c].rate, c == at.struck, 0.0, 0.0
        if not is_on:
            if gap > _CLEAR * at.length and not own.watched[c].still:
                own.contacts[c].kind = _OPEN
                continue
            expand(seen_by(m, c), m.now, at.time)
            at.expanded = c
            size, pace = m.expansion.sums[expansion.SIZE, 0], row_size(m, expansion.D1)
            for i in range(case.acting if begins else 0):  # the casing may be as an earlier case left it
                omega = abs(case.waves[i, wave.OMEGA])
                turned = omega * case.duration * (abs(case.casing[i, 0, c]) + abs(case.casing[i, 1, c]))
                size, pace = size + turned, pace + omega * turned
            if not own.watched[c].still and abs(gap) > 4.0 * least * (at.length + size):
                own.contacts[c].kind, inside = _OPEN, inside or (begins and gap < 0.0)
                continue
        if own.watched[c].still or abs(approach) <= least * (pace + m.fastest * (at.length + size)):
            continue
        own.contacts[c].approach = approach
        if approach < 0.0:
            own.contacts[c].kind = _LEAVING
    return inside


@inlined
def _pass_lone(
    sets: Sets, between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory, c: int
) -> int:
    """Let a contact strike while all are open: it bounces, begins a contact, or flies on."""
    m, tally, t, u = seen_by(motion.m, c), record.tally[c], at.time, own.contacts[c].approach
    W = between.pairs[c, c].mobility
    if W <= 0.0:
        return NO_IMPACT_LAW
    for i in range(own.contacts.size):
        own.contacts[i].wanted = i == c
    slot = slot_of(sets, case.variant, own, True)
    if slot < 0:
        return WAITING
    place = tables_of(own, slot)
    if place < 0:
        return NO_ROOM
    p, stays = (1.0 + case.e) * u / W, u <= 0.0 or case.e == 0.0
    tally.speed, tally.max_speed = u, max(tally.max_speed, u)
    if u > 0.0:
        strike(motion, case, c, p)
    expand(m, m.now, t)
    at.expanded, at.due = c, STEP
    if not stays:
        bounces = Bounces(case.e, W, between.pairs[c, c].drag / W, 0.0, case.duration)
        end = _end_of_chattering(sets.rows[slot], place, motion, case, tally, at, own, c, bounces)
        if not np.isnan(end):  # p and all later impulses add up to m v⁻ and the impulse of the contact force
            stays, own.contacts[c].bounces, p = True, end - t, u / W
            expand(m, m.now, t)
    if u > 0.0:
        tally.impacts += 1
        _note_impulse(between, case, record, own, c, p)
        _note_temperatures(case, record, own)
    _forget(own)
    own.watched[c].zeros, own.watched[c].speed = 1, case.e * u
    if stays:
        own.watched[c].zeros, own.watched[c].speed = _order_of_rest(m), -1.0
        if own.watched[c].zeros < 0:
            own.contacts[c].closed = 1
            change_set(motion, at, own)
    note_changes(record, at, own)
    return RUNNING


@part
def _order_of_rest(m: Motion) -> int:
    """Return -1 where the contact that is expanded is pressed on its casing; else the order of its gap's zero."""
    sums, n = m.expansion.sums, m.blocks
    bend = sums[expansion.D2, n]
    if abs(bend) > ZERO_FORCE * SUM_ROUNDING * row_size(m, expansion.D2):
        return -1 if bend < 0.0 else 2
    return -1 if sums[expansion.D3, n] < 0.0 else 3


@part
def _end_of_chattering(
    row: Array, place: int, motion: SetMotion, case: Case, tally: Any, at: Any, own: Memory, c: int, bounces: Bounces
) -> float:
    """Return the time at which the chattering after an impact ends, and stop the contact; NaN where it is not summed.

    It is summed where its flights are low and its impacts weak
    (:class:`~workflow.schemes._exact.set_motion.Thresholds`), and where they are more than the budget of events has
    left; then the end is infinite if the contact force falls before. Flights no higher than the rounding of the
    displacement are low whatever the largest impact was: only the rounding of a force near zero has lifted it. ``row``
    and ``place`` are those of the set with the contact closed.
    """
    m, t, speed, limits = motion.m, at.time, own.contacts[c].approach, case.thresholds
    pressing = -m.expansion.sums[expansion.D2, m.blocks]
    rounding = SUM_ROUNDING * m.expansion.sums[expansion.SIZE, 0]
    if speed >= limits.speed * tally.max_speed:
        tally.unsettled_speed = np.inf
        if speed * speed > 2.0 * pressing * rounding:
            return np.nan
    if speed >= tally.unsettled_speed or pressing <= 0.0:
        return np.nan
    left = case.budget.events - at.events
    height, most = speed * speed / (2.0 * pressing), max(limits.height * at.length, rounding)
    if height >= most and not (left < at.events and height < _LOOSE * most):
        return np.nan
    copy_state(m.now, m.after)
    strike(motion, case, c, -case.e * speed / bounces.mobility)
    trial = motion_in(row, case, own, place, 1)
    leave(motion, own, m.now, t)
    enter(trial, own, t)
    pressed, leaving, count = seen_by(trial.m, c), 0.0, 0.0
    end = float(t)
    if _is_pressed(pressed, t, limits.force):  # else the force is rounding, which would press it back for ever
        over = Bounces(case.e, bounces.mobility, bounces.drag, 4.0 * max(height, most), case.duration)
        end, leaving, count = end_of_chattering(pressed, t, case.e * speed, over)
    if height < most and np.isfinite(end):
        return end
    if count > left:
        tally.summed_speed, tally.summed_height = max(tally.summed_speed, speed), max(tally.summed_height, height)
        if end == np.inf:
            tally.leaving_speed = max(tally.leaving_speed, leaving)
        return end
    copy_state(m.after, m.now)
    at.expanded, tally.unsettled_speed = -1, 0.5 * speed
    return np.nan


@part
def _is_pressed(m: Motion, t: float, threshold: float) -> bool:
    """Whether the force of a contact is positive beyond rounding."""
    expand(m, m.now, t)
    force, size = m.expansion.sums[expansion.D0, m.blocks], m.expansion.sums[expansion.SIZE, 0]
    return bool(force > threshold * SUM_ROUNDING * size)


@part
def _strike_all(between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory) -> int:
    """Apply the impulses of an impact of the contacts on their casing, if any approaches: a decision is due then.

    Those that leave or rest by them get their kinds. Where a closed one leaves, so does the state its set.
    """
    p, size, strikes, opens = own.problem, 0, False, False
    at.due = DECISION
    for c in range(own.contacts.size):
        if own.contacts[c].kind != _OPEN:
            own.contacts[size].member = c
            p.active[size] = own.contacts[c].closed != 0 or own.contacts[c].approach > 0.0
            p.constant[size] = -(1.0 + case.e) * own.contacts[c].approach
            strikes |= own.contacts[c].approach > 0.0
            size += 1
    if not strikes:
        return RUNNING
    _fill_matrix(between, own, size)
    if not solve_complementarity(p, size):
        return NO_IMPACT_LAW
    for r in range(size):
        c, after = own.contacts[r].member, own.contacts[own.contacts[r].member].approach
        for q in range(size):
            after -= p.matrix[r, q] * p.solution[q]
        if p.active[r]:
            after = -case.e * own.contacts[c].approach
        own.contacts[r].impulse = p.solution[r]
        own.contacts[c].kind = _LEAVING if after < 0.0 else _RESTING
        own.contacts[c].approach = after
        opens |= own.contacts[c].closed != 0 and after < 0.0
    if opens:
        change_set(motion, at, own)
        at.due = DECISION
    for r in range(size):
        c = own.contacts[r].member
        if own.contacts[c].kind != _RESTING:
            own.contacts[c].closed = 0
        record.tally[c].impacts += own.contacts[r].impulse != 0.0
    _apply(between, motion, case, record, at, own, size)
    return RUNNING


@part
def _fill_matrix(between: Between, own: Memory, size: int) -> None:
    """Fill the matrix of the complementarity problem of the members."""
    for r in range(size):
        for q in range(size):
            own.problem.matrix[r, q] = between.pairs[own.contacts[r].member, own.contacts[q].member].mobility


@part
def _apply(between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory, size: int) -> None:
    """Apply the impulses of the members: a jump in the set or, where it was left, of X."""
    for r in range(size):
        c, p = own.contacts[r].member, own.contacts[r].impulse
        if p != 0.0:
            if at.entered == 1:
                strike(motion, case, c, p)
            else:
                _strike_modes(between, case, own, c, p)
            _note_impulse(between, case, record, own, c, p)
    _note_temperatures(case, record, own)
    _forget(own)


@part
def _strike_modes(between: Between, case: Case, own: Memory, c: int, p: float) -> None:
    """Apply an impulse to X: y' jumps by -(w - µ t) p, τ by α s p."""
    for i in range(own.modal.size):
        own.modal[i] += p * (case.alpha * between.jumps[1, c, i] - between.jumps[0, c, i])


@part
def _note_impulse(between: Between, case: Case, record: Record, own: Memory, c: int, p: float) -> None:
    """Add the impulse of a contact to its tally and its event, and its heat to the temperatures that are seen."""
    record.tally[c].impulse += p
    own.contacts[c].taken += p
    for i in range(own.contacts.size):
        own.contacts[i].temperature += case.alpha * between.pairs[i, c].warming * p


@part
def _note_temperatures(case: Case, record: Record, own: Memory) -> None:
    """Note the temperatures after impulses."""
    for c in range(own.contacts.size if case.alpha > 0.0 else 0):
        note_temperature(record.tally[c], own.contacts[c].temperature)


@part
def _forget(own: Memory) -> None:
    """Forget until when signals have no zero."""
    for s in range(own.watched.size):
        own.watched[s].certified = -1.0


@part
def decide(between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory) -> int:
    """Decide which contacts are closed from now on; return RUNNING or how the case ends."""
    m, changes = motion.m, own.watched.size > own.contacts.size  # a coating: its depths have
    moment = _MOMENT / m.fastest if m.fastest > 0.0 else _MOMENT * case.duration
    if between.compliant:
        sound = _next_compliant_set(case.coat, between, motion, case, record, at, own, moment)
    else:
        sound = _next_set(between, motion, case, record, at, own, moment)
    if not sound:
        return NO_IMPACT_LAW
    at.due = STEP
    for c in range(own.contacts.size):
        changes |= own.contacts[c].wanted != own.contacts[c].closed
        own.contacts[c].closed = own.contacts[c].wanted
    if changes:
        change_set(motion, at, own)
    note_changes(record, at, own)
    return RUNNING


@part
def _next_set(
    between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory, moment: float
) -> bool:
    """Fill which contacts are wanted closed from now on; return whether the forces have a solution."""
    while True:
        _look(motion, at, own)
        _fill_push(between, case, own, 0)
        if not _solve_forces(between, own, 0.0):
            return False
        _fill_push(between, case, own, 1)
        if not _solve_forces(between, own, moment):
            return False
        if not _hold_low_bounces(between, case, at, own, moment):
            break
        _stop(between, motion, case, record, at, own)
    for c in range(own.contacts.size):
        if own.contacts[c].kind == _RESTING:
            loose = 2 if _parting(between, own, c) > own.signals[ROUNDING, c] else 3
            kept = own.watched[c].zeros if own.contacts[c].closed else -1
            own.watched[c].zeros, own.watched[c].speed = kept if own.contacts[c].wanted else loose, -1.0
        elif own.contacts[c].kind == _LEAVING:
            own.watched[c].zeros, own.watched[c].speed = 1, -own.contacts[c].approach
    return True


@part
def _look(motion: SetMotion, at: Any, own: Memory) -> None:
    """Fill what the signals of contacts on their casing say: -gap'' and -gap''' of open ones, forces of closed ones.

    Rows of rounding hold the size of their terms.
    """
    n = motion.m.blocks
    for c in range(own.contacts.size):
        if own.contacts[c].kind != _OPEN:
            m, closed = seen_by(motion.m, c), own.contacts[c].closed
            expand(m, m.now, at.time)
            at.expanded = c
            for row in range(2):
                derivative = row + (expansion.D0 if closed else expansion.D2)
                value, size = m.expansion.sums[derivative, n], row_size(m, derivative)
                own.signals[PUSH + row, c], own.signals[ROUNDING + row, c] = (0.0, 0.0) if closed else (-value, size)
                own.signals[HELD + row, c], own.signals[SIZE + row, c] = (value, size) if closed else (0.0, 0.0)


@part
def _fill_push(between: Between, case: Case, own: Memory, row: int) -> None:
    """Fill b of each contact for row 0, its rate for row 1, under the forces of the contacts."""
    for c in range(own.contacts.size):
        if own.contacts[c].kind != _OPEN:
            total, size = own.signals[PUSH + row, c], own.signals[ROUNDING + row, c]
            for i in range(own.contacts.size):
                if own.contacts[i].kind != _OPEN:
                    W = between.pairs[c, i].mobility
                    total += W * own.signals[HELD + row, i]
                    size += abs(W) * own.signals[SIZE + row, i]
                    if row == 1:
                        slows = between.pairs[c, i].drag - case.alpha * between.pairs[c, i].closing
                        total += slows * (own.contacts[i].force - own.signals[HELD, i])
                        size += abs(slows) * (abs(own.contacts[i].force) + own.signals[SIZE, i])
            own.signals[ROUNDING + row, c] = ZERO_FORCE * SUM_ROUNDING * size
            is_zero = own.watched[c].still or abs(total) <= own.signals[ROUNDING + row, c]
            own.signals[PUSH + row, c] = 0.0 if is_zero else total


@part
def _solve_forces(between: Between, own: Memory, moment: float) -> bool:
    """Find the forces of contacts at rest a moment later, and which are closed then; return whether there are such."""
    p, size = own.problem, 0
    for c in range(own.contacts.size):
        own.contacts[c].force, own.contacts[c].wanted = 0.0, 0
        if own.contacts[c].kind >= _RESTING:
            own.contacts[size].member, p.active[size] = c, own.contacts[c].closed != 0
            p.constant[size] = -own.signals[PUSH, c] - moment * (own.signals[PUSH + 1, c] if moment > 0.0 else 0.0)
            size += 1
    _fill_matrix(between, own, size)
    if not solve_complementarity(p, size):
        return False
    for r in range(size):
        each = own.contacts[own.contacts[r].member]
        each.force, each.wanted = p.solution[r], p.active[r]
    return True


@part
def _parting(between: Between, own: Memory, c: int) -> float:
    """Return the acceleration of a contact's gap under the forces of those at rest, m/s²."""
    bend = -own.signals[PUSH, c]
    for i in range(own.contacts.size):
        bend += between.pairs[c, i].mobility * own.contacts[i].force
    return float(bend)


@part
def _hold_low_bounces(between: Between, case: Case, at: Any, own: Memory, moment: float) -> bool:
    """Let contacts rest that leave so slowly that they would return from a height of nothing; return whether any do.

    None does that would lose its force, or take another's, before its bounces end: the last one opens it for good.
    """
    pressed, held, later, is_rounding = _pressed(own), 0, 0.0, True
    for c in range(own.contacts.size):
        if own.contacts[c].kind == _LEAVING:
            bend, square = _parting(between, own, c), own.contacts[c].approach * own.contacts[c].approach
            if bend < 0.0 and square <= -2.0 * bend * LOWEST_BOUNCE * at.length:
                own.contacts[c].kind, held = _RETURNING, held + 1
                lasts = 2.0 * own.contacts[c].approach / bend / (1.0 - case.e) if case.e < 1.0 else np.inf
                own.contacts[c].bounces, later = lasts if case.e < 1.0 else 0.0, max(later, lasts)
                is_rounding = is_rounding and square <= -2.0 * bend * SUM_ROUNDING * at.length
    if held == 0:
        return False
    holds = is_rounding or (_solve_forces(between, own, later) and _pressed(own) >= pressed + held)
    for c in range(own.contacts.size):
        if own.contacts[c].kind == _RETURNING:
            own.contacts[c].kind = _RESTING if holds else _LEAVING
            own.contacts[c].bounces *= holds
    if not holds:
        _solve_forces(between, own, moment)
    return holds


@part
def _pressed(own: Memory) -> int:
    """Return how many of the contacts at rest have a force."""
    pressed = 0
    for c in range(own.contacts.size):
        pressed += own.contacts[c].wanted
    return pressed


@part
def _stop(between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory) -> None:
    """Apply the impulses that stop the contacts at rest: of those whose low bounces are not followed."""
    size, a = 0, own.problem.tableau
    for c in range(own.contacts.size):
        if own.contacts[c].kind == _RESTING:
            own.contacts[size].member = c
            size += 1
    _fill_matrix(between, own, size)
    for r in range(size):
        for q in range(size):
            a[r, q] = own.problem.matrix[r, q]
        a[r, size] = own.contacts[own.contacts[r].member].approach
        own.contacts[own.contacts[r].member].approach = 0.0
    if solve_in_place(a, size):
        for r in range(size):
            own.contacts[r].impulse = a[r, size]
            for c in range(own.contacts.size):
                if own.contacts[c].kind == _LEAVING:
                    own.contacts[c].approach -= between.pairs[c, own.contacts[r].member].mobility * a[r, size]
        _apply(between, motion, case, record, at, own, size)


@part
def _next_compliant_set(
    coat: Any, between: Between, motion: SetMotion, case: Case, record: Record, at: Any, own: Memory, moment: float
) -> bool:
    """Fill which contacts are wanted closed a moment later; return whether their forces have a solution."""
    p, contacts, same, struck = own.problem, own.contacts.size, True, at.struck
    _fill_distances(between, motion, case, at, own)
    if coat is not None:
        return next_states(coat, between, case, record, at, own, moment)
    for c in range(contacts):
        own.contacts[c].member, p.active[c] = c, own.contacts[c].closed != 0
        p.constant[c] = own.signals[PUSH, c] + moment * own.signals[PUSH + 1, c]
    if struck >= 0:
        p.active[struck] = not p.active[struck]
    _fill_matrix(between, own, contacts)
    if not solve_complementarity(p, contacts):
        return False
    for c in range(contacts):
        same = same and p.active[c] == (own.contacts[c].closed != 0)
    if same and struck >= 0:
        p.active[struck] = not p.active[struck]
    for c in range(contacts):
        if p.active[c] != (own.contacts[c].closed != 0):
            own.watched[c].zeros, own.watched[c].speed = 1 if struck >= 0 else -1 if p.active[c] else 0, -1.0
        own.contacts[c].wanted = p.active[c]
    return True


@part
def _fill_distances(between: Between, motion: SetMotion, case: Case, at: Any, own: Memory) -> None:
    """Fill d - x and its rate of compliant contacts without forces."""
    n, begins, contacts = motion.m.blocks, at.struck == START, own.contacts.size
    for c in range(contacts):
        m = seen_by(motion.m, c)
        expand(m, m.now, at.time)
        at.expanded = c
        for row in range(2):
            value = m.expansion.sums[expansion.D0 + row, n]
            own.signals[HELD + row, c] = value if own.contacts[c].closed else 0.0
            own.signals[PUSH + row, c] = 0.0 if own.contacts[c].closed or own.watched[c].still else value
        own.signals[ROUNDING, c] = AT_REST * (at.length + m.expansion.sums[expansion.SIZE, 0])
        distance_from_coat(case.coat, own, c)
    for c in range(contacts):
        for row in range(2):
            for i in range(contacts):
                own.signals[PUSH + row, c] -= between.pairs[c, i].mobility * own.signals[HELD + row, i]
        own.contacts[c].before = -own.signals[PUSH + 1, c]
        if begins and abs(own.signals[PUSH, c]) <= own.signals[ROUNDING, c]:
            own.signals[PUSH, c] = 0.0
            if abs(own.signals[PUSH + 1, c]) <= motion.m.fastest * own.signals[ROUNDING, c]:
                own.signals[PUSH + 1, c] = 0.0


@part
def note_changes(record: Record, at: Any, own: Memory) -> None:
    """List the events of contacts, and begin or end contacts in the tally.

    Contacts begin after the bounces that are not followed.
    """
    for c in range(own.contacts.size):
        tally, each, impulse = record.tally[c], own.contacts[c], max(0.0, own.contacts[c].taken)
        closed, was, crushed = each.closed != 0 or each.crushes, tally.held != 0, tally.held == 2
        if crushed and not each.crushes:
            note_event(record.asked, at.listed, at.time, STOPS, 0.0, 0.0, c)
            at.listed += 1
        if impulse > 0.0 or was != closed:
            kind = IMPACTS if was == closed else LEAVES if was else TOUCHES
            note_event(record.asked, at.listed, at.time, kind, impulse, 0.0 if was else own.contacts[c].before, c)
            at.listed += 1
        if each.crushes and not crushed:
            note_event(record.asked, at.listed, at.time, YIELDS, 0.0, 0.0, c)
            at.listed += 1
        if closed:
            tally.contact_begin = own.contacts[c].bounces + (tally.contact_begin if was else at.time)
            tally.held = 2 if each.crushes else 1
        elif was:
            tally.contact_time += max(0.0, at.time - tally.contact_begin)
            tally.held, tally.contact_begin = 0, np.inf
            tally.releases += 1
