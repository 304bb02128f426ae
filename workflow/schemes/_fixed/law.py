"""A contact law, one scalar function, and the solution of the laws of several contacts in a step.

A contact law is a named tuple of parameters, each a number or an array ``(case,)``, and a function of it and of one
contact in one case (:func:`respond`), which :func:`~workflow.schemes._fixed.march.contact_law` compiles into the march.
Contacts that change each other's velocities are coupled by

    p_i = law(free_i - Σ_{j≠i} W_ij p_j; W_ii)   for all i,

by Newton's method in each lane where that matters; where it does not end, by Lemke's (:mod:`workflow.kernels.lemke`).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.compiled import by_type, inlined, of_case, part
from workflow.kernels.lanes import lane_rows
from workflow.kernels.lemke import Complementarity, problem, solve_complementarity
from workflow.kernels.packs import (
    Lane,
    Pack,
    fused,
    lanes_of,
    magnitude,
    pack,
    shared,
    some,
    some_nonzero,
    spread,
    store,
    where,
)
from workflow.models import Array
from workflow.schemes._fixed.rows import Acting, Own

Law = Any
"""Parameters of a contact law: a named tuple of numbers and arrays."""

Response = tuple[float, float, float]
"""Impulse of contact in a step [N s], velocity of the tip at its end [m/s], and a number that is
``Tip.force`` of the next step: positive in contact."""


class Tip(NamedTuple):
    """The tip of one case in a step, relative to the casing where that moves."""

    place: float
    """At the beginning, m."""
    velocity: float
    """At the beginning, m/s."""
    free: float
    """Its velocity at the end without contact, m/s."""
    force: float
    """The force that the law returned in the step before: positive while in contact."""
    gap: float
    """Position of the casing, m: in contact from there on."""
    mobility: float
    """W: the velocity at the end that a unit impulse of contact takes away, 1/kg; NaN where contact has no unique
    solution, so that its impulse is NaN and ends the case."""
    sinking: float = 0.0
    """Of a contact without mass, or on an elastic casing: the way that a unit impulse gives it besides, m/(N s). The
    place has all else that its residual does at the step's end."""
    level: float = np.inf
    """Force at which the coating of its casing crushes, N; infinite without one."""


@by_type
def respond(law: Law, tip: Tip, h: float, theta: float) -> Response:
    """Return the response of contact in a step h of one case.

    ``theta`` is the weight of the step's end in the tip's velocity, 1 of central differences.
    """
    raise NotImplementedError


class TipStep(NamedTuple):
    """Coefficients of the contacts in a step of the θ-method."""

    h: float
    theta: float
    """Weight of the step's end, in the load and in the velocity of a contact."""
    warming: Array
    """Temperature of contact i per unit heat at contact j, K/J, ``(contact, contact)``."""
    delassus: Array = np.zeros((3, 0, 0))
    """W_ij and what it has per -µ and per α, 1/kg, ``(3, contact, contact)``."""
    thermal_velocity: Array = np.zeros((0, 0))
    """Thermal velocity of contact i per unit heat at contact j in its step, m/(s J), likewise."""
    sinking: Array = np.zeros((3, 0, 0))
    """Way of contact i per unit impulse at j besides its motion, as W_ij, m/(N s); none of contacts with mass."""
    residual: Array = np.zeros((2, 0, 0))
    """R and R^t of contacts without mass, m/N."""
    residual_load: Array = np.zeros(0)
    """ρ, m/N, ``(contact,)``."""
    growth: Array = np.zeros((0, 0))
    """Way by the residual coupling per unit heat at contact j, r T̂⁻¹ s_j, m/J."""
    casing_flexibility: float = 0.0
    carried: float = 0.0
    """Share of the force at a step's beginning in its impulse, over that of the force at its end."""
    stiffness: float = 0.0
    holds: bool = False
    rebounds: bool = False
    """Those of :class:`~workflow.schemes._fixed.contact.Contact`."""
    compliant: bool = False
    """Whether contacts are without mass, or on an elastic casing."""


class CentralStep(TipStep):
    """A step of central differences: half-step velocities, the impulse p_k centred on the step's beginning."""


class Coupling(NamedTuple):
    """Memory for the laws of several contacts."""

    problem: Complementarity
    impulse: Array
    """p of a lane, ``(contact,)``."""
    slope: Array
    """dp/dfree and dp/dplace of each law in a lane, ``(2, contact)``."""
    members: NDArray[np.int64]
    """Contacts whose impulses change, ``(contact,)``."""
    matrix: Array
    """Newton's equations of each lane, ``(contact, contact + 1, lane)``."""
    tries: Array
    """State of each lane, ``(lane,)``."""
    scale: Array
    probe: Array
    """Largest velocity of each lane, and the difference by which slopes are found, m/s, ``(lane,)``."""


RUNS, SOLVED, LOST, STUCK = 0.0, 1.0, 2.0, 3.0
"""States of a lane in Newton's method: it goes on, has ended, has numbers that are not finite, has no next step."""


def coupling_of(contacts: int) -> Coupling | None:
    """Return memory for so many contacts; ``None`` for one."""
    if contacts == 1:
        return None
    rows, members = np.zeros((3, contacts)), np.zeros(contacts, dtype=np.int64)
    matrix = lane_rows(contacts, contacts + 1)
    return Coupling(problem(contacts), rows[0], rows[1:], members, matrix, *lane_rows(3))


@inlined
def count_rebound(act: Acting, lane: Lane) -> None:
    """Add a contact that has ended to the sums of ``effective_restitution``."""
    was, presses, approach = pack(act.force, lane) > 0.0, pack(act.force_end, lane) > 0.0, pack(act.approach, lane)
    ended = where(was & ~presses, approach, 0.0)
    store(act.approach, lane, where(presses & ~was, pack(act.speed, lane), approach))
    store(act.approached, lane, pack(act.approached, lane) + ended * ended)
    store(act.separated, lane, pack(act.separated, lane) - ended * pack(act.speed_end, lane))


@inlined
def _response(law: Law, step: TipStep, act: Acting, lane: int, place: float, free: float) -> Response:
    """Return the response of a contact at a place and with a velocity without contact."""
    force, casing, speed = act.force[lane], act.casing[lane], act.speed[lane]
    tip = Tip(place, speed, free, force, casing, act.mobility[lane], act.sinking[lane], act.level[lane])
    return respond(of_case(law, lane), tip, step.h, step.theta)


@inlined
def _place(step: TipStep, act: Acting, coupled: bool, lane: int) -> float:
    """Return the place that a law is given: that at the step's beginning, of compliant contacts without impulses.

    Where contacts are ``coupled`` it is less what others take; so is the velocity.
    """
    if step.compliant:
        return float(act.place_coupled[lane] if coupled else act.place_free[lane])
    return float(act.place[lane])


@inlined
def _speed(act: Acting, coupled: bool, lane: int) -> float:
    return float(act.speed_coupled[lane] if coupled else act.speed_free[lane])


@part
def ask(law: Law, step: TipStep, act: Acting, coupled: bool, lane: Lane) -> None:
    """Evaluate the law of a contact in some lanes.

    No branch but the law's own, so that the compiler can vectorise the loop.
    """
    for k in range(*lanes_of(lane)):
        place, free = _place(step, act, coupled, k), _speed(act, coupled, k)
        act.impulse[k], act.speed_end[k], act.force_end[k] = _response(law, step, act, k, place, free)


@part
def _ask_coupled(law: Law, step: TipStep, own: Own, acts: Sequence[Acting], lane: Lane) -> None:
    """Evaluate the laws of all contacts, less what others take by ``impulse_coupled``."""
    _couple(step, own, acts, lane)
    for act in acts:
        ask(law, step, act, True, lane)


@part
def _ask_beside(law: Law, step: TipStep, act: Acting, probe: Array, first: int, stop: int) -> None:
    """Find the slopes of a law by its impulse a little faster, and a little deeper where that differs."""
    for k in range(first, stop):
        place, free = _place(step, act, True, k), act.speed_coupled[k]
        faster, _, _ = _response(law, step, act, k, place, free + probe[k])
        act.slope[k] = (faster - act.impulse[k]) / probe[k]
    if step.compliant:
        for k in range(first, stop):
            place, free = act.place_coupled[k] + step.h * probe[k], act.speed_coupled[k]
            deeper, _, _ = _response(law, step, act, k, place, free)
            act.slope_of_place[k] = (deeper - act.impulse[k]) / (step.h * probe[k])


@part
def _couple(step: TipStep, own: Own, acts: Sequence[Acting], lane: Lane) -> None:
    """Take from velocity and place of each contact what ``impulse_coupled`` of the others take."""
    for i in range(len(acts)):
        store(acts[i].speed_coupled, lane, pack(acts[i].speed_free, lane))
        if step.compliant:
            store(acts[i].place_coupled, lane, pack(acts[i].place_free, lane))
    for j in range(len(acts)):
        p = pack(acts[j].impulse_coupled, lane)
        if some_nonzero(p):
            warms, slides = pack(own.alpha, lane) * p, pack(own.friction, lane) * p
            for i in range(len(acts)):
                if i != j:
                    taken = _taken(step.delassus, i, j, p, warms, slides, lane)
                    store(acts[i].speed_coupled, lane, pack(acts[i].speed_coupled, lane) - taken)
                    if step.compliant:
                        taken = _taken(step.sinking, i, j, p, warms, slides, lane)
                        store(acts[i].place_coupled, lane, pack(acts[i].place_coupled, lane) - taken)


@inlined
def _taken(table: Array, i: int, j: int, p: Pack, warms: Pack, slides: Pack, lane: Lane) -> Pack:
    """Return what the impulse p of contact j takes from contact i, with α p and µ p."""
    cold, slid, warm = shared(table, (0, i, j), lane), shared(table, (1, i, j), lane), shared(table, (2, i, j), lane)
    return fused(cold, p, fused(warm, warms, -(slid * slides)))


@part
def respond_together(
    law: Law, step: TipStep, own: Own, acts: Sequence[Acting], coupling: Coupling, t: float, lane: Lane
) -> None:
    """Fill impulse, velocity and force of several contacts; t is noted where they have no solution."""
    total = zero = spread(0.0, lane)
    for act in acts:
        store(act.impulse_coupled, lane, zero)
    _ask_coupled(law, step, own, acts, lane)
    for act in acts:
        total += magnitude(pack(act.impulse, lane))
        store(act.impulse_coupled, lane, pack(act.impulse, lane))
    if some(~(total <= 0.0)):  # a NaN too
        _ask_coupled(law, step, own, acts, lane)
        _solve(law, step, own, acts, coupling, lane)
        for k in range(*lanes_of(lane)):
            state = coupling.tries[k]
            if state == LOST or (state != SOLVED and not _settle(law, step, own, acts, coupling, k)):
                _give_up(own, acts, t, k)


@part
def _give_up(own: Own, acts: Sequence[Acting], t: float, lane: int) -> None:
    """End a case whose laws have no solution, or whose state is not finite."""
    finite = True
    for c in range(len(acts)):
        finite &= np.isfinite(acts[c].speed_free[lane]) and np.isfinite(acts[c].place[lane])
        acts[c].impulse[lane] = acts[c].speed_end[lane] = acts[c].force_end[lane] = np.nan
    if finite:
        own.unsolved[lane] = t


MOST_TRIES = 30
"""Steps of Newton's method after which Lemke's is tried: two are usual, five were the most of 7 000 random problems."""

_PROBE = 1e-6
"""Difference of velocities, over the largest velocity, by which slopes of a law are found; exact where it is affine."""


@inlined
def _largest(one: Pack, other: Pack) -> Pack:
    return where(one > other, one, other)


@part
def _store_scale(step: TipStep, acts: Sequence[Acting], row: Array, lane: Lane) -> None:
    """Store the largest velocity: of contacts, and that by which they reach their casings in a step."""
    scale = spread(0.0, lane)
    for act in acts:
        scale = _largest(magnitude(pack(act.speed_free, lane)) + magnitude(pack(act.speed, lane)), scale)
        way = pack(act.place_free if step.compliant else act.place, lane) - pack(act.casing, lane)
        scale = _largest(magnitude(way) * (1.0 / step.h), scale)
    store(row, lane, scale)


@part
def _solve(law: Law, step: TipStep, own: Own, acts: Sequence[Acting], c: Coupling, lane: Lane) -> None:
    """Solve the laws of the contacts together, from impulses ``impulse_coupled`` at which they were asked.

    Newton's method on p_i = law(free_i - Σ_{j≠i} W_ij p_j; W_ii), with slopes by a difference. What is kept is what the
    laws return at the last p: an impulse below rounding whose law says 0 is 0.
    """
    (first, stop), zero = lanes_of(lane), spread(0.0, lane)
    store(c.tries, lane, zero)
    for _ in range(MOST_TRIES):
        change, largest, finite, size = zero, zero, zero, 0
        for i in range(len(acts)):
            act = acts[i]
            p, q = pack(act.impulse_coupled, lane), pack(act.impulse, lane)
            change, largest = _largest(magnitude(q - p), change), _largest(magnitude(q), largest)
            finite += 0.0 * (q + pack(act.speed_end, lane))
            if some(magnitude(p) + magnitude(q) > 0.0):  # else it has no slope
                c.members[size] = i
                size += 1
        states = pack(c.tries, lane)
        ended = where(change <= (4e-16 * len(acts)) * largest, SOLVED, states)
        states = where(states > RUNS, states, where(magnitude(finite) <= 0.0, ended, LOST))
        store(c.tries, lane, states)
        if not some(states <= RUNS):
            return
        _store_scale(step, acts, c.scale, lane)
        store(c.probe, lane, _PROBE * pack(c.scale, lane))
        for k in range(size):
            _ask_beside(law, step, acts[c.members[k]], c.probe, first, stop)
        _eliminate(step, own, acts, c, size, lane)
        _ask_coupled(law, step, own, acts, lane)


@part
def _eliminate(step: TipStep, own: Own, acts: Sequence[Acting], c: Coupling, size: int, lane: Lane) -> None:
    """Do a step of Newton's method: of a lane whose equations are singular there is none."""
    a, members, states = c.matrix, c.members, pack(c.tries, lane)
    one, alpha, friction = spread(1.0, lane), pack(own.alpha, lane), pack(own.friction, lane)
    for k in range(size):
        act, i = acts[members[k]], members[k]
        p, q = pack(act.impulse_coupled, lane), pack(act.impulse, lane)
        slope, of_place = pack(act.slope, lane), pack(act.slope_of_place, lane)
        strikes = magnitude(p) + magnitude(q) > 0.0
        slope, of_place = where(strikes, slope, 0.0), where(strikes, of_place, 0.0)
        for n in range(size):
            entry = one
            if n != k:
                entry = slope * _taken(step.delassus, i, members[n], one, alpha, friction, lane)
                if step.compliant:
                    entry = fused(of_place, _taken(step.sinking, i, members[n], one, alpha, friction, lane), entry)
            store(a, (k, n, lane), entry)
        store(a, (k, size, lane), q - p)
    for k in range(size):
        for r in range(k + 1, size):
            share = pack(a, (r, k, lane)) / pack(a, (k, k, lane))
            for n in range(k + 1, size + 1):
                store(a, (r, n, lane), pack(a, (r, n, lane)) - share * pack(a, (k, n, lane)))
    for k in range(size - 1, -1, -1):
        change = pack(a, (k, size, lane))
        for n in range(k + 1, size):
            change -= pack(a, (k, n, lane)) * pack(a, (n, size, lane))
        change /= pack(a, (k, k, lane))
        store(a, (k, size, lane), change)
        states = where(states > RUNS, states, where(magnitude(0.0 * change) <= 0.0, states, STUCK))
    store(c.tries, lane, states)
    for k in range(size):
        row = acts[members[k]].impulse_coupled
        store(row, lane, pack(row, lane) + where(states > RUNS, 0.0, pack(a, (k, size, lane))))


@part
def _entry(own: Own, table: Array, i: int, j: int, lane: int) -> float:
    """Return what a unit impulse of contact j takes from contact i in a lane."""
    return float(table[0, i, j] + own.alpha[lane] * table[2, i, j] - own.friction[lane] * table[1, i, j])


@part
def _by_slopes(step: TipStep, own: Own, c: Coupling, i: int, j: int, lane: int) -> float:
    """Return what a unit impulse of contact j takes from the impulse of contact i, by the slopes of its law."""
    taken = c.slope[0, i] * _entry(own, step.delassus, i, j, lane)
    if step.compliant:
        taken += c.slope[1, i] * _entry(own, step.sinking, i, j, lane)
    return float(taken)


@part
def _pivot(law: Law, step: TipStep, own: Own, acts: Sequence[Acting], c: Coupling, lane: int) -> None:
    """Find the impulses of the contacts of a lane by Lemke's method, for laws of two branches; p_0 without a solution.

    p = p_0 + max(0, a + s free + r place), with a, s and r found far inside the casing, and p_0 as far outside.
    """
    p, size, m = c.problem, 0, len(acts)
    far = 1e3 * c.scale[lane]
    way = step.h * far if step.compliant else 0.0  # no contact with mass is near because others push it
    for i in range(m):
        act, place, free = acts[i], _place(step, acts[i], False, lane), acts[i].speed_free[lane]
        least, _, _ = _response(law, step, act, lane, place - way, free - far)
        inside, _, _ = _response(law, step, act, lane, place + way, free + far)
        faster, _, _ = _response(law, step, act, lane, place + way, free + 2.0 * far)
        deeper, _, _ = _response(law, step, act, lane, place + 2.0 * way, free + far)
        c.impulse[i], c.slope[0, i] = least, (faster - inside) / far
        c.slope[1, i] = (deeper - inside) / way if step.compliant else 0.0
        if c.slope[0, i] != 0.0 or c.slope[1, i] != 0.0:
            p.constant[size], p.active[size], c.members[size] = faster + deeper - 3.0 * inside + least, False, i
            size += 1
    for k in range(size):
        for j in range(m):
            if j != c.members[k]:
                p.constant[k] += _by_slopes(step, own, c, c.members[k], j, lane) * c.impulse[j]
        for n in range(size):
            p.matrix[k, n] = 1.0 if n == k else _by_slopes(step, own, c, c.members[k], c.members[n], lane)
    if solve_complementarity(p, size):
        for k in range(size):
            c.impulse[c.members[k]] += p.solution[k]


MOST_SWEEPS = 10_000
"""Times that the laws of a lane are taken one after another. Of contacts that press each other nearly as much as
themselves a sweep leaves 0.99 of an error, so that some 3 000 reach rounding."""


@part
def _settle(law: Law, step: TipStep, own: Own, acts: Sequence[Acting], c: Coupling, lane: int) -> bool:
    """Solve the laws of a lane one after another, from Lemke's solution, as Newton's method does not end.

    Laws of two branches have it. Others, as that of a coating, grow with the depth: where W is symmetric each lowers
    the same convex function, so that p tends to the solution.
    """
    m = len(acts)
    _pivot(law, step, own, acts, c, lane)
    for _ in range(MOST_SWEEPS):
        change = total = 0.0
        for i in range(m):
            place, free = _place(step, acts[i], False, lane), acts[i].speed_free[lane]
            for j in range(m):
                if j != i:
                    free -= _entry(own, step.delassus, i, j, lane) * c.impulse[j]
                    if step.compliant:
                        place -= _entry(own, step.sinking, i, j, lane) * c.impulse[j]
            q, velocity, force = _response(law, step, acts[i], lane, place, free)
            change, total = change + abs(q - c.impulse[i]), total + abs(q)
            acts[i].impulse[lane], acts[i].speed_end[lane], acts[i].force_end[lane] = q, velocity, force
            c.impulse[i] = q
        if change <= 1e-13 * total:  # some roundings of Lemke's method
            return total < np.inf
    return False
