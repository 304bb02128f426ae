"""Events of several contacts, or of contacts without mass: impacts, and which contacts are closed from then on.

Contacts with mass that are closed at the instant take Moreau's impulses

    u⁺ = u⁻ - W p,   0 <= p ⊥ -(u⁺ + e u⁻) >= 0,   u = w y' - d',   W = w (w - µ t)ᵀ,

each of which heats at its place, and those that stay are a complementarity problem of forces,

    0 <= λ ⊥ W λ - (b + δ b') >= 0,   b = w (g - c y' - ω² y - G τ) - d'',

whose rates b', a moment δ later, decide where a force leaves a contact at zero. Without mass, or on an elastic casing,
forces are continuous: 0 <= λ ⊥ d - w y + (R - µ R^t + c) λ >= 0, a moment later. Bounces may accumulate at e = 0 too
where W is not diagonal; a contact whose next bounce would be lower than 1e-11 of the largest motion is held, if it and
those at rest are still pressed when all its bounces have ended, after 2 u⁺/(W λ)/(1 - e).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels.compiled import part
from workflow.kernels.lemke import solve_complementarity, solve_in_place
from workflow.schemes._exact.contact_motion import ContactCase, Contacting, Memory, damped, fill_casing, load_at
from workflow.schemes._exact.event_loop import INSIDE_CASING, NO_IMPACT_LAW, RUNNING
from workflow.schemes._exact.expansion import SUM_ROUNDING
from workflow.schemes._exact.record import IMPACTS, LEAVES, TOUCHES, Record, note_event, note_temperature
from workflow.schemes._exact.tables import wave
from workflow.schemes._interface import AT_REST

LOWEST_BOUNCE = 1e-11
"""Height of a bounce, over the largest motion of any contact, below which the contact may be held; gaps whose terms are
all smaller do not move."""

_MOMENT = 1e-9
"""δ over the time constant of the fastest pole: rates change forces by 1e-9 in it, above rounding and below what
decides between forces that are not 0."""

ZERO_FORCE = 64.0
"""Force and acceleration, over the rounding of their terms, below which they are 0 when a contact begins or opens."""

_OPEN, _LEAVING, _RESTING, _RETURNING = 0, 1, 2, 3
"""Kinds of contacts at an event: away from the casing, leaving it with a speed, at rest on it, leaving by a bounce that
is not followed."""


@part
def begin_case(structure: Contacting, case: ContactCase, record: Record, at: Any, own: Memory) -> int:
    """Set the initial state and the first set; return RUNNING or how the case ended."""
    for i in range(own.modal.size):
        own.modal[i] = case.modal[i]
    for c in range(own.wanted.size):
        own.wanted[c], own.still[c], own.zeros[c], own.speed[c] = False, False, 0, -1.0
        tally = record.tally[c]
        tally.contact_begin, tally.casing_flexibility = np.inf, case.flexibility
        tally.max_temperature = tally.period_temperature = _temperature(structure, own, c)
    at.length = case.reach
    fill_casing(case, 0.0, own)
    fastest = structure.frequency[structure.frequency.size - 1] if structure.frequency.size > 0 else 0.0
    return pass_event(structure, case, record, at, own, fastest, -1)


@part
def _temperature(structure: Contacting, own: Memory, c: int) -> float:
    """Return the temperature of a contact at the last event."""
    n, total = structure.frequency.size, 0.0
    for j in range(structure.rate.size):
        total += structure.heat[c, j] * own.modal[2 * n + j]
    return float(total)


@part
def pass_event(
    structure: Contacting, case: ContactCase, record: Record, at: Any, own: Memory, fastest: float, struck: int
) -> int:
    """Pass the event of a contact, or the start (-1): fill what is closed from then on; return RUNNING or how it ended.

    State and casing are those of the instant.
    """
    moment = _MOMENT / fastest if fastest > 0.0 else _MOMENT * case.duration
    for c in range(own.wanted.size):
        own.taken[0, c] = own.taken[1, c] = own.bounces[c] = 0.0
    if structure.compliant:
        _fill_distances(structure, case, at, own, fastest, struck < 0)
        sound = _next_compliant_set(structure, case, own, at.time, moment, struck)
    elif struck >= 0 and own.wanted[struck]:
        own.wanted[struck], own.zeros[struck], own.speed[struck], sound = False, 3, -1.0, True
    else:
        inside = _fill_kinds(structure, case, at, own, struck)
        if inside:
            return INSIDE_CASING
        sound = _strike(structure, case, record, own)
        sound = sound and _next_set(structure, case, record, at, own, moment)
    for c in range(own.wanted.size):
        _note_event(record, at, own, c)
        _note_change(record.tally[c], own.wanted[c], own.bounces[c], at.time)
    return RUNNING if sound else NO_IMPACT_LAW


@part
def _note_event(record: Record, at: Any, own: Memory, c: int) -> None:
    """List the event of a contact that takes an impulse, begins or ends."""
    was = record.tally[c].held != 0
    impulse = max(0.0, own.taken[1, c])
    if impulse == 0.0 and was == own.wanted[c]:
        return
    kind = IMPACTS if was == own.wanted[c] else LEAVES if was else TOUCHES
    approach = 0.0 if was else own.taken[0, c]
    note_event(record.asked, at.listed, at.time, kind, impulse, approach, c)
    at.listed += 1


@part
def _note_change(tally: Any, closed: bool, bounces: float, t: float) -> None:
    """Begin or end a contact in the tally; ``bounces`` take so much of its time that are not followed."""
    if closed:
        tally.contact_begin = bounces + (tally.contact_begin if tally.held else t)
        tally.held = 1
    elif tally.held:
        tally.contact_time += max(0.0, t - tally.contact_begin)
        tally.held, tally.contact_begin = 0, np.inf
        tally.releases += 1


@part
def _fill_kinds(structure: Contacting, case: ContactCase, at: Any, own: Memory, struck: int) -> bool:
    """Fill kinds, gaps and approach speeds of contacts, and the largest motion; return whether one is inside.

    A contact is on its casing where it struck, is closed, or its gap is rounding.
    """
    n, inside, begins = structure.frequency.size, False, struck < 0
    least = AT_REST if begins else SUM_ROUNDING
    fastest = structure.frequency[n - 1] if begins and n > 0 else 0.0
    for c in range(own.wanted.size):
        place, size, speed, turning = 0.0, 0.0, 0.0, 0.0
        for k in range(n):
            term = structure.normal[c, k] * own.modal[k]
            place += term
            size += abs(term)
            pace = structure.normal[c, k] * own.modal[n + k]
            speed += pace
            turning += abs(pace)
        own.distance[c] = own.casing[0, c] - place
        own.approach[c] = speed - own.casing[1, c]
        at.length = max(at.length, abs(place))
        for i in range(case.acting if begins else 0):  # the casing may be as an earlier case left it
            omega = abs(case.waves[i, wave.OMEGA])
            turned = omega * case.duration * (abs(case.casing[i, 0, c]) + abs(case.casing[i, 1, c]))
            size, turning = size + turned, turning + omega * turned
        turning += fastest * (at.length + size)
        if own.wanted[c]:
            own.kinds[c], own.approach[c] = _RESTING, 0.0
        elif c == struck or own.still[c] or abs(own.distance[c]) <= 4.0 * least * (at.length + size):
            own.kinds[c] = _RESTING
            if own.still[c] or abs(own.approach[c]) <= least * (turning + abs(own.casing[1, c])):
                own.approach[c] = 0.0
            elif own.approach[c] < 0.0:
                own.kinds[c] = _LEAVING
        else:
            own.kinds[c] = _OPEN
            inside |= begins and own.distance[c] < 0.0
        own.taken[0, c] = own.approach[c]
    return inside


@part
def _operator(structure: Contacting, case: ContactCase, i: int, j: int) -> float:
    """Return W, or R - µ R^t + c of compliant contacts, of a pair."""
    return float(structure.delassus[i, j] - case.friction * structure.tangential[i, j])


@part
def _strike(structure: Contacting, case: ContactCase, record: Record, own: Memory) -> bool:
    """Apply the impulses of an impact of the contacts on their casing, if any approaches; return whether there are any.

    Those that leave or rest by them get their kinds.
    """
    p, size, strikes = own.problem, 0, False
    for c in range(own.wanted.size):
        if own.kinds[c] != _OPEN:
            own.members[size], p.active[size] = c, own.wanted[c] or own.approach[c] > 0.0
            p.constant[size] = -(1.0 + case.e) * own.approach[c]
            strikes |= own.approach[c] > 0.0
            size += 1
    if not strikes:
        return True
    _fill_matrix(structure, case, own, size)
    if not solve_complementarity(p, size):
        return False
    for r in range(size):
        c, after = own.members[r], own.approach[own.members[r]]
        for q in range(size):
            after -= p.matrix[r, q] * p.solution[q]
        if p.active[r]:
            after = -case.e * own.approach[c]
        own.impulse[r] = p.solution[r]
        own.kinds[c] = _LEAVING if after < 0.0 else _RESTING
        own.approach[c] = after
    _apply(structure, case, record, own, size, True)
    return True


@part
def _fill_matrix(structure: Contacting, case: ContactCase, own: Memory, size: int) -> None:
    """Fill the matrix of the complementarity problem of the members."""
    for r in range(size):
        for q in range(size):
            own.problem.matrix[r, q] = _operator(structure, case, own.members[r], own.members[q])


@part
def _apply(structure: Contacting, case: ContactCase, record: Record, own: Memory, size: int, counts: bool) -> None:
    """Apply the impulses of the members: y' jumps by -(w - µ t) p, τ by α s p."""
    n = structure.frequency.size
    for r in range(size):
        c, impulse = own.members[r], own.impulse[r]
        if impulse != 0.0:
            for k in range(n):
                own.modal[n + k] -= impulse * (structure.normal[c, k] - case.friction * structure.tangent[c, k])
            for j in range(structure.rate.size):
                own.modal[2 * n + j] += case.alpha * impulse * structure.heat[c, j]
            record.tally[c].impulse += impulse
            record.tally[c].impacts += counts
            own.taken[1, c] += impulse
    for c in range(own.wanted.size):
        if structure.rate.size > 0:
            note_temperature(record.tally[c], _temperature(structure, own, c))


@part
def _fill_push(structure: Contacting, case: ContactCase, own: Memory, t: float, row: int) -> None:
    """Fill ``push[row]``: b of each contact for row 0, its rate for row 1, under the forces ``own.force``."""
    n, heats = structure.frequency.size, structure.rate.size
    load, rate = load_at(case, t)
    load += case.constant[n + heats]
    a, y, v, tau = own.acceleration, own.modal[:n], own.modal[n : 2 * n], own.modal[2 * n :]
    for k in range(n):
        if row == 0:
            a[0, k] = case.constant[k] + load * structure.load[k] - damped(structure, v, k)
            a[0, k] -= structure.frequency[k] * structure.frequency[k] * y[k]
            for j in range(heats):
                a[0, k] -= structure.coupling[k, j] * tau[j]
        else:
            for c in range(own.wanted.size):
                a[0, k] -= (structure.normal[c, k] - case.friction * structure.tangent[c, k]) * own.force[c]
    if row == 1:
        for k in range(n):
            a[1, k] = rate * structure.load[k] - structure.frequency[k] * structure.frequency[k] * v[k]
            a[1, k] -= damped(structure, a[0], k)
        for j in range(heats):
            warming = case.constant[n + j] - structure.rate[j] * tau[j]
            for c in range(own.wanted.size):
                warming += case.alpha * structure.heat[c, j] * own.force[c]
            for k in range(n):
                a[1, k] -= structure.coupling[k, j] * warming
    every = 0.0
    for k in range(n):
        every += abs(a[row, k]) + structure.frequency[k] * structure.frequency[k] * abs(v[k] if row == 1 else y[k])
    for c in range(own.wanted.size):
        total, most = -own.casing[2 + row, c], 0.0
        for k in range(n):
            total += structure.normal[c, k] * a[row, k]
            most = max(most, abs(structure.normal[c, k]))
        own.rounding[row, c] = ZERO_FORCE * SUM_ROUNDING * (most * every + abs(own.casing[2 + row, c]))
        own.push[row, c] = 0.0 if own.still[c] or abs(total) <= own.rounding[row, c] else total


@part
def _next_set(structure: Contacting, case: ContactCase, record: Record, at: Any, own: Memory, moment: float) -> bool:
    """Fill the contacts that are closed from now on; return whether the forces have a solution."""
    p, contacts = own.problem, own.wanted.size
    while True:
        for c in range(contacts):
            own.force[c] = 0.0
        _fill_push(structure, case, own, at.time, 0)
        if not _solve_forces(structure, case, own, 0.0):
            return False
        for r in range(contacts):
            own.force[r] = 0.0
        size = 0
        for c in range(contacts):
            if own.kinds[c] == _RESTING:
                own.force[c] = p.solution[size]
                size += 1
        _fill_push(structure, case, own, at.time, 1)
        if not _solve_forces(structure, case, own, moment):
            return False
        if not _hold_low_bounces(structure, case, at, own, moment):
            break
        _stop(structure, case, record, own)
    size = 0
    for c in range(contacts):
        was, own.wanted[c] = own.wanted[c], False
        if own.kinds[c] == _RESTING:
            own.wanted[c] = p.active[size]
            size += 1
            loose = 2 if _parting(structure, case, own, c) > own.rounding[0, c] else 3
            own.zeros[c], own.speed[c] = (own.zeros[c] if was else -1) if own.wanted[c] else loose, -1.0
        elif own.kinds[c] == _LEAVING:
            own.zeros[c], own.speed[c] = 1, -own.approach[c]
    return True


@part
def _solve_forces(structure: Contacting, case: ContactCase, own: Memory, moment: float) -> bool:
    """Solve the complementarity problem of the forces of contacts at rest, a moment later; whether it has one."""
    p, size = own.problem, 0
    for c in range(own.wanted.size):
        if own.kinds[c] >= _RESTING:
            own.members[size], p.active[size] = c, own.wanted[c]
            p.constant[size] = -own.push[0, c] - moment * (own.push[1, c] if moment > 0.0 else 0.0)
            size += 1
    _fill_matrix(structure, case, own, size)
    return solve_complementarity(p, size)


@part
def _parting(structure: Contacting, case: ContactCase, own: Memory, c: int) -> float:
    """Return the acceleration of a contact's gap under the forces of those at rest, m/s²."""
    bend, size = -own.push[0, c], 0
    for i in range(own.wanted.size):
        if own.kinds[i] == _RESTING:
            bend += _operator(structure, case, c, i) * own.problem.solution[size]
            size += 1
    return float(bend)


@part
def _hold_low_bounces(structure: Contacting, case: ContactCase, at: Any, own: Memory, moment: float) -> bool:
    """Let contacts rest that leave so slowly that they would return from a height of nothing; return whether any do.

    None does that would lose its force, or take another's, before its bounces end: the last one opens it for good.
    """
    pressed, held, later, is_rounding = _pressed(own), 0, 0.0, True
    for c in range(own.wanted.size):
        if own.kinds[c] == _LEAVING:
            bend, square = _parting(structure, case, own, c), own.approach[c] * own.approach[c]
            if bend < 0.0 and square <= -2.0 * bend * LOWEST_BOUNCE * at.length:
                own.kinds[c], held = _RETURNING, held + 1
                own.bounces[c] = 2.0 * own.approach[c] / bend / (1.0 - case.e) if case.e < 1.0 else 0.0
                later = max(later, own.bounces[c]) if case.e < 1.0 else np.inf
                is_rounding = is_rounding and square <= -2.0 * bend * SUM_ROUNDING * at.length
    if held == 0:
        return False
    holds = is_rounding or (_solve_forces(structure, case, own, later) and _pressed(own) >= pressed + held)
    for c in range(own.wanted.size):
        if own.kinds[c] == _RETURNING:
            own.kinds[c], own.bounces[c] = _RESTING if holds else _LEAVING, own.bounces[c] if holds else 0.0
    if not holds:
        _solve_forces(structure, case, own, moment)
    return holds


@part
def _pressed(own: Memory) -> int:
    """Return how many of the contacts at rest have a force."""
    pressed, size = 0, 0
    for c in range(own.wanted.size):
        if own.kinds[c] >= _RESTING:
            pressed, size = pressed + own.problem.active[size], size + 1
    return pressed


@part
def _stop(structure: Contacting, case: ContactCase, record: Record, own: Memory) -> None:
    """Apply the impulses that stop the contacts at rest: of those whose low bounces are not followed."""
    size, a = 0, own.problem.tableau
    for c in range(own.wanted.size):
        if own.kinds[c] == _RESTING:
            own.members[size] = c
            size += 1
    for r in range(size):
        for q in range(size):
            a[r, q] = _operator(structure, case, own.members[r], own.members[q])
        a[r, size] = own.approach[own.members[r]]
        own.approach[own.members[r]] = 0.0
    if solve_in_place(a, size):
        for r in range(size):
            own.impulse[r] = a[r, size]
            for c in range(own.wanted.size):
                if own.kinds[c] == _LEAVING:
                    own.approach[c] -= _operator(structure, case, c, own.members[r]) * own.impulse[r]
        _apply(structure, case, record, own, size, False)


@part
def _fill_distances(
    structure: Contacting, case: ContactCase, at: Any, own: Memory, fastest: float, begins: bool
) -> None:
    """Fill d - x and its rate of compliant contacts without forces."""
    n, heats = structure.frequency.size, structure.rate.size
    load, rate = load_at(case, at.time)
    mean = case.constant[n + heats]
    for c in range(own.wanted.size):
        place, speed = structure.residual_load[c] * (mean + load), structure.residual_load[c] * rate
        for k in range(n):
            place += structure.normal[c, k] * own.modal[k]
            speed += structure.normal[c, k] * own.modal[n + k]
        for j in range(heats):
            warming = case.constant[n + j] - structure.rate[j] * own.modal[2 * n + j]
            place -= structure.residual_coupling[c, j] * own.modal[2 * n + j]
            speed -= structure.residual_coupling[c, j] * warming
        own.distance[c], own.approach[c] = own.casing[0, c] - place, speed - own.casing[1, c]
        own.taken[0, c] = own.approach[c]
        at.length = max(at.length, abs(place))
    for c in range(own.wanted.size):
        if own.still[c] or (begins and abs(own.distance[c]) <= AT_REST * at.length):
            own.distance[c] = 0.0
            if own.still[c] or abs(own.approach[c]) <= AT_REST * fastest * at.length:
                own.approach[c] = 0.0


@part
def _next_compliant_set(
    structure: Contacting, case: ContactCase, own: Memory, t: float, moment: float, struck: int
) -> bool:
    """Fill the contacts that are closed a moment later; return whether their forces have a solution."""
    p, contacts, same = own.problem, own.wanted.size, True
    for c in range(contacts):
        own.members[c], p.active[c] = c, own.wanted[c]
        p.constant[c] = own.distance[c] - moment * own.approach[c]
    if struck >= 0:
        p.active[struck] = not p.active[struck]
    _fill_matrix(structure, case, own, contacts)
    if not solve_complementarity(p, contacts):
        return False
    for c in range(contacts):
        same = same and p.active[c] == own.wanted[c]
    if same and struck >= 0:
        p.active[struck] = not p.active[struck]
    for c in range(contacts):
        if p.active[c] != own.wanted[c]:
            own.zeros[c], own.speed[c] = 1 if struck >= 0 else -1 if p.active[c] else 0, -1.0
        own.wanted[c] = p.active[c]
    return True
