"""A coating between events: the sector of the casing that each contact is in, and what becomes of it at an event.

A contact is open, elastic, or it crushes its coating, with the force g (x - d) + f:

    open      g = 0               f = 0                 ends where d + w - x falls through zero
    elastic   g = 1/c             f = -w/c              where λ does, or F_y + H w - λ
    crushing  g = H/(1 + H c)     f = F_y/(1 + H c)     where the rate of w does

In flight the depths of several sectors ahead are bounded by the least of them, so that most borders are passed without
a look. At a border, as at the start, velocities stay and forces may jump: contacts take them together, and what is
pressed too hard is crushed at once. After each event their rates decide, a moment later, in which state contacts are.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workflow.kernels.compiled import inlined, part
from workflow.kernels.lemke import solve_complementarity
from workflow.models import AT_BORDER
from workflow.schemes._exact.between import Between
from workflow.schemes._exact.motion import OUTPUTS, PLACE, SIGNAL
from workflow.schemes._exact.record import Record
from workflow.schemes._exact.set_motion import (
    EVERY,
    FLEXIBILITY,
    HARDENING,
    HELD,
    PUSH,
    SECTORS,
    SPEED,
    YIELD_FORCE,
    Case,
    Coat,
    Memory,
    SetMotion,
    travel,
    yield_level,
)

START, BORDER = -1, -2
"""What :attr:`PROGRESS.struck` is where no signal fell through zero: the start, or a contact is at a border."""


@part
def begin_on(coat: Coat | None, at: Any, own: Memory) -> None:
    """Find the sectors at the start, where all contacts are open so far."""
    if coat is None:
        return
    for c in range(own.contacts.size):
        each = own.contacts[c]
        each.sector = np.int64(np.floor(coat.law[SECTORS] * coat.turns[c] + AT_BORDER))
        each.worn = each.shift = coat.worn[c, each.sector % np.int64(coat.law[SECTORS])]
        each.crushes, each.pressed, each.until = False, 0.0, np.inf
    at.until = np.inf


@part
def refill(coat: Coat | None, own: Memory, place: int) -> None:
    """Have the tables of a motion filled anew: with a coating they hold depths that have changed."""
    if coat is not None and own.slots[place] >= 0:
        own.slots[place] = -2 - own.slots[place]


@part
def leave_idle(coat: Coat | None, own: Memory) -> None:
    """Certify the signals that do not end the state of their contact."""
    if coat is not None:
        for c in range(own.contacts.size):
            if own.contacts[c].crushes:
                own.watched[c].certified = np.inf
            elif own.contacts[c].closed == 0:
                own.watched[own.contacts.size + c].certified = np.inf


@part
def fly_on(coat: Coat | None, motion: SetMotion, at: Any, own: Memory) -> bool:
    """Look further ahead; return whether no contact changes at the border or the bound of depths that was reached."""
    if coat is None:
        return False
    passes = bool(at.struck != START)
    for c in range(own.contacts.size):
        each, arrives = own.contacts[c], at.struck == BORDER and own.contacts[c].until <= at.time
        is_open = each.closed == 0 and not each.crushes
        if arrives:
            each.sector = each.ahead
        elif at.struck != START:
            _locate(coat, each, at.time, c)
        depth = coat.worn[c, each.sector % np.int64(coat.law[SECTORS])]
        apart, bound = each.signal - each.shift + depth, each.shift
        if is_open and (arrives or (at.struck == c and depth > bound)) and apart > 0.0:
            _look_ahead(coat, own, c, apart)
            motion.m.outputs[OUTPUTS * c + SIGNAL] += each.shift - bound
            motion.m.outputs[OUTPUTS * c + PLACE] += each.shift - bound
            own.watched[c].certified, at.expanded = -1.0, -1
        elif arrives or (at.struck >= 0 and at.struck % own.contacts.size == c):
            passes = False
    if passes:
        at.events -= at.struck >= 0
        _next_border(coat, at, own)
    return passes


@part
def _locate(coat: Coat, each: Any, t: float, c: int) -> None:
    """Find the sector that a contact is in, between borders at which no other w counts."""
    if each.until < np.inf:
        now = np.int64(np.floor(coat.law[SECTORS] * (coat.turns[c] + coat.law[SPEED] * t)))
        each.sector = max(each.sector, min(now, each.ahead - 1))
    elif coat.law[SECTORS] > 1.0:
        each.sector = np.int64(np.floor(coat.law[SECTORS] * (coat.turns[c] + coat.law[SPEED] * t)))


@part
def _look_ahead(coat: Coat, own: Memory, c: int, apart: float) -> None:
    """Find the next border at which another w counts, for an open contact one that takes half of its distance."""
    each, sectors = own.contacts[c], np.int64(coat.law[SECTORS])
    is_open = each.closed == 0 and not each.crushes
    each.worn, each.until = coat.worn[c, each.sector % sectors], np.inf
    least, bound = min(each.worn, each.worn - 0.5 * apart), each.worn
    if is_open and least <= 0.0:
        bound = 0.0
    elif sectors > 1:
        for k in range(1, sectors + 1):
            w = coat.worn[c, (each.sector + k) % sectors]
            if each.crushes or (w < least if is_open else w != each.worn):
                each.ahead = each.sector + k
                each.until = (each.ahead / coat.law[SECTORS] - coat.turns[c]) / coat.law[SPEED]
                break
            bound = min(bound, w)
    each.shift = bound if is_open else 0.0 if each.crushes else each.worn


@part
def _next_border(coat: Coat, at: Any, own: Memory) -> None:
    """Fill the time at which a step ends at the latest: the next border, or row of the map while a contact crushes."""
    at.until = np.inf
    for c in range(own.contacts.size):
        at.until = min(at.until, own.contacts[c].until)
        if own.contacts[c].crushes and at.mapped < coat.map.shape[1]:
            at.until = min(at.until, coat.law[EVERY] * (at.mapped + 1.0) / coat.law[SPEED])


@inlined
def wear(coat: Coat | None, at: Any, own: Memory, t: float) -> None:
    """Wear the sectors of contacts that crush up to t, the end of a step; fill the rows of the map."""
    if coat is not None:
        wears = at.mapped < coat.map.shape[1]
        for c in range(own.contacts.size):
            wears = wears or own.contacts[c].crushes
        if wears:
            _wear(coat, at, own, t)


@part
def _wear(coat: Coat, at: Any, own: Memory, t: float) -> None:
    first, flexibility, sectors = coat.law[YIELD_FORCE], coat.law[FLEXIBILITY], np.int64(coat.law[SECTORS])
    for c in range(own.contacts.size):
        each = own.contacts[c]
        if each.crushes:
            depth = travel(coat) * each.signal
            crushed = (depth - flexibility * first) / (1.0 + flexibility * coat.law[HARDENING])
            each.worn = max(each.worn, crushed)
            coat.worn[c, each.sector % sectors] = each.worn
            coat.deepest[c] = max(coat.deepest[c], depth)
    while at.mapped < coat.map.shape[1] and coat.law[SPEED] * t + AT_BORDER >= coat.law[EVERY] * (at.mapped + 1.0):
        for c in range(own.contacts.size):
            for k in range(sectors):
                coat.map[c, at.mapped, k] = coat.worn[c, k]
        at.mapped += 1


@part
def distance_from_coat(coat: Coat | None, own: Memory, c: int) -> None:
    """Correct what a decision knows of a contact: d + w - x without its force and the force, and their rates."""
    if coat is None:
        return
    each = own.contacts[c]
    if each.crushes:
        hardening = coat.law[HARDENING]
        rate = own.signals[HELD + 1, c] if each.closed != 0 else own.signals[PUSH + 1, c]
        grows = travel(coat) * rate / (1.0 + coat.law[FLEXIBILITY] * hardening)
        own.signals[HELD, c], own.signals[HELD + 1, c] = yield_level(coat, each.worn, False), hardening * grows
        own.signals[PUSH, c], own.signals[PUSH + 1, c] = 0.0, -grows
    elif each.closed == 0:
        own.signals[PUSH, c] += each.worn - each.shift


@part
def next_states(coat: Coat, between: Between, case: Case, record: Record, at: Any, own: Memory, moment: float) -> bool:
    """Fill in which states contacts are from now on; return whether their forces have a solution."""
    p, contacts, same, struck = own.problem, own.contacts.size, True, at.struck
    for c in range(contacts):
        p.active[c] = own.contacts[c].closed != 0 or own.contacts[c].crushes
        p.active[contacts + c] = own.contacts[c].crushes
    if struck >= 0:
        p.active[struck] = not p.active[struck]
    elif not _meet(coat, between, case, at, own):
        return False
    if not _solve(coat, between, case, own, moment):
        return False
    for c in range(contacts):
        each = own.contacts[c]
        same = same and p.active[contacts + c] == each.crushes
        same = same and p.active[c] == (each.closed != 0 or each.crushes)
    if same and struck >= 0:
        p.active[struck] = not p.active[struck]
    for c in range(contacts):
        _enter(coat, between, case, record.tally[c], own, c, struck >= 0)
    _next_border(coat, at, own)
    return True


@part
def _meet(coat: Coat, between: Between, case: Case, at: Any, own: Memory) -> bool:
    """Give contacts the w of their sectors and the forces that follow at once; return whether there are such."""
    p, contacts, sectors = own.problem, own.contacts.size, np.int64(coat.law[SECTORS])
    for c in range(contacts):
        w = coat.worn[c, own.contacts[c].sector % sectors]
        own.signals[PUSH, c] += w - own.contacts[c].worn
        own.contacts[c].worn = w
    if not _solve(coat, between, case, own, 0.0):
        return False
    for c in range(contacts):
        each, before, after = own.contacts[c], own.signals[HELD, c], p.solution[c]
        grown = coat.law[FLEXIBILITY] * p.solution[contacts + c]
        work = (yield_level(coat, each.worn, False) + 0.5 * coat.law[HARDENING] * grown) * grown
        for i in range(contacts if at.struck == BORDER else 0):
            work += 0.5 * (before + after) * between.pairs[c, i].mobility * (p.solution[i] - own.signals[HELD, i])
        coat.border_work[c] += work
    for c in range(contacts):
        grown = coat.law[FLEXIBILITY] * p.solution[contacts + c]
        own.signals[PUSH, c] += grown
        own.contacts[c].worn += grown
        coat.worn[c, own.contacts[c].sector % sectors] = own.contacts[c].worn
        coat.deepest[c] = max(coat.deepest[c], own.contacts[c].worn + coat.law[FLEXIBILITY] * p.solution[c])
    return True


@part
def _solve(coat: Coat, between: Between, case: Case, own: Memory, moment: float) -> bool:
    """Solve the problem of :func:`~workflow.models.coated_forces` a moment later; return whether it has a solution."""
    p, contacts, c = own.problem, own.contacts.size, coat.law[FLEXIBILITY]
    for i in range(contacts):
        for j in range(contacts):
            p.matrix[i, j] = between.pairs[i, j].mobility / c
            p.matrix[i, contacts + j] = p.matrix[contacts + i, j] = p.matrix[contacts + i, contacts + j] = 0.0
        p.matrix[i, contacts + i], p.matrix[contacts + i, i] = 1.0, -1.0
        p.matrix[contacts + i, contacts + i] = coat.law[HARDENING] * c
        p.constant[i] = (own.signals[PUSH, i] + moment * own.signals[PUSH + 1, i]) / c
        beyond = moment > 0.0 and not own.contacts[i].crushes
        p.constant[contacts + i] = yield_level(coat, own.contacts[i].worn, beyond)
    return solve_complementarity(p, 2 * contacts)


@part
def _enter(coat: Coat, between: Between, case: Case, tally: Any, own: Memory, c: int, is_continuous: bool) -> None:
    """Put a contact into the state that was decided; where forces are continuous signals begin at zero."""
    p, each, contacts, apart = own.problem, own.contacts[c], own.contacts.size, own.signals[PUSH, c]
    touches, crushes = p.active[c], p.active[contacts + c]
    if touches != (each.closed != 0 or each.crushes):
        own.watched[c].zeros, own.watched[c].speed = 1 if is_continuous else -1 if touches else 0, -1.0
    for i in range(contacts):
        apart += between.pairs[c, i].mobility * p.solution[i]
    each.wanted, each.crushes, each.pressed = 1 if touches else 0, crushes, 0.0
    own.watched[c].still, tally.casing_flexibility = False, coat.law[FLEXIBILITY]
    if crushes:
        each.wanted = 2 if coat.law[HARDENING] > 0.0 else 0
        each.pressed = coat.law[YIELD_FORCE] / (1.0 + coat.law[FLEXIBILITY] * coat.law[HARDENING])
        tally.casing_flexibility = travel(coat)
    each.closed = each.wanted
    _look_ahead(coat, own, c, apart)
