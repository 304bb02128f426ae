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

from workflow.kernels.compiled import by_type, of_case, part
from workflow.kernels.lemke import Complementarity, problem, solve_complementarity, solve_in_place
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
    load_mobility: Array = np.zeros(0)
    """Velocity of a contact per unit impulse of the load, w_i Ŵ⁻¹ b, 1/kg, ``(contact,)``."""
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
    """Those of :class:`~workflow.schemes._fixed.contact.Contact`."""


class YieldingStep(TipStep):
    """A step of the θ-method with contacts without mass, or on an elastic casing."""


class CentralStep(TipStep):
    """A step of central differences: half-step velocities, the impulse p_k centred on the step's beginning."""


class Coupling(NamedTuple):
    """Memory for the laws of several contacts in a lane."""

    problem: Complementarity
    impulse: Array
    """p, ``(contact,)``."""
    slope: Array
    """dp/dfree and dp/dplace of each law, ``(2, contact)``."""
    members: NDArray[np.int64]
    struck: NDArray[np.int64]
    """Contacts whose impulses change, and those that have one, ``(contact,)``."""


def coupling_of(contacts: int) -> Coupling | None:
    """Return memory for so many contacts; ``None`` for one."""
    if contacts == 1:
        return None
    members, struck = np.zeros((2, contacts), dtype=np.int64)
    return Coupling(problem(contacts), np.zeros(contacts), np.zeros((2, contacts)), members, struck)


@by_type
def count_rebound(law: Law, tip: Tip, velocity: float, force: float, act: Acting, lane: int) -> None:
    """Add a contact that has ended to the sums of ``effective_restitution``, where the scheme gives it."""
    was, presses = tip.force > 0.0, force > 0.0
    approach = act.approach[lane]
    act.approach[lane] = approach if was or not presses else tip.velocity
    ended = approach if was and not presses else 0.0
    act.approached[lane] += ended * ended
    act.separated[lane] -= ended * velocity


def count_no_rebound(law: Law, tip: Tip, velocity: float, force: float, act: Acting, lane: int) -> None:
    """Count nothing: the restitution is given."""


@part
def apply_law(law: Law, step: TipStep, act: Acting, first: int, stop: int) -> None:
    """Evaluate the law of one contact in some lanes.

    No branch but the law's own, so that the compiler can vectorise the loop.
    """
    for lane in range(first, stop):
        place, speed, free, casing = act.place[lane], act.speed[lane], act.free[lane], act.casing[lane]
        tip = Tip(place, speed, free, act.last[lane], casing, act.mobility[lane], act.sinking[lane])
        impulse, velocity, force = respond(of_case(law, lane), tip, step.h, step.theta)
        count_rebound(law, tip, velocity, force, act, lane)
        act.impulse[lane], act.after[lane], act.last[lane] = impulse, velocity, force


@part
def _ask(law: Law, step: TipStep, act: Acting, first: int, stop: int) -> None:
    """Evaluate the law of one of several contacts in some lanes, at ``deep`` and ``loose``."""
    for lane in range(first, stop):
        place, speed, free, casing = act.deep[lane], act.speed[lane], act.loose[lane], act.casing[lane]
        tip = Tip(place, speed, free, act.last[lane], casing, act.mobility[lane], act.sinking[lane])
        act.impulse[lane], act.after[lane], act.force[lane] = respond(of_case(law, lane), tip, step.h, step.theta)


@part
def couple(
    law: Law, step: TipStep, own: Own, acts: Sequence[Acting], coupling: Coupling, t: float, first: int, stop: int
) -> None:
    """Fill impulse, velocity and force of several contacts in some lanes; t is noted where they have no solution.

    Where each contact alone, and again at the velocity that the impulses of the others leave, has the same impulse,
    that is the solution; else the laws of the lane are solved together.
    """
    total = 0.0
    for c in range(len(acts)):
        for lane in range(first, stop):
            acts[c].loose[lane], acts[c].deep[lane] = acts[c].free[lane], acts[c].place[lane]
        _ask(law, step, acts[c], first, stop)
        for lane in range(first, stop):
            acts[c].alone[lane] = acts[c].impulse[lane]
            total += abs(acts[c].impulse[lane])
    if total != 0.0:
        _loosen(step, own, acts, first, stop)
        for c in range(len(acts)):
            _ask(law, step, acts[c], first, stop)
        for lane in range(first, stop):
            settled = True
            for c in range(len(acts)):
                settled &= acts[c].impulse[lane] == acts[c].alone[lane]
            if not settled and not _solve(law, step, own, acts, coupling, lane):
                _give_up(own, acts, t, lane)
    for c in range(len(acts)):
        act = acts[c]
        for lane in range(first, stop):
            tip = Tip(act.place[lane], act.speed[lane], act.free[lane], act.last[lane], act.casing[lane], 0.0, 0.0)
            count_rebound(law, tip, act.after[lane], act.force[lane], act, lane)
            act.last[lane] = act.force[lane]


@part
def _loosen(step: TipStep, own: Own, acts: Sequence[Acting], first: int, stop: int) -> None:
    """Take from velocity and place of each contact what the impulses of the others alone take."""
    yields = step.sinking.shape[1] > 0
    for j in range(len(acts)):
        total = 0.0
        for lane in range(first, stop):
            total += abs(acts[j].alone[lane])
        for i in range(len(acts) if total != 0.0 else 0):
            if i != j:
                cold, slid, warm = step.delassus[0, i, j], step.delassus[1, i, j], step.delassus[2, i, j]
                for lane in range(first, stop):
                    w = cold + own.alpha[lane] * warm - own.friction[lane] * slid
                    acts[i].loose[lane] -= w * acts[j].alone[lane]
            if i != j and yields:
                cold, slid, warm = step.sinking[0, i, j], step.sinking[1, i, j], step.sinking[2, i, j]
                for lane in range(first, stop):
                    way = cold + own.alpha[lane] * warm - own.friction[lane] * slid
                    acts[i].deep[lane] -= way * acts[j].alone[lane]


@part
def _give_up(own: Own, acts: Sequence[Acting], t: float, lane: int) -> None:
    """End a case whose laws have no solution, or whose state is not finite."""
    finite = True
    for c in range(len(acts)):
        finite &= np.isfinite(acts[c].free[lane]) and np.isfinite(acts[c].place[lane])
        acts[c].impulse[lane] = acts[c].after[lane] = acts[c].force[lane] = np.nan
    if finite:
        own.unsolved[lane] = t


MOST_TRIES = 30
"""Steps of Newton's method after which Lemke's is tried: two are usual, five were the most of 7 000 random problems."""

_PROBE = 1e-6
"""Difference of velocities, over the largest velocity, by which slopes of a law are found; exact where it is affine."""


@part
def _response(law: Law, step: TipStep, act: Acting, lane: int, place: float, free: float) -> Response:
    """Return the response of a contact at another place and velocity without contact."""
    speed, last, casing = act.speed[lane], act.last[lane], act.casing[lane]
    tip = Tip(place, speed, free, last, casing, act.mobility[lane], act.sinking[lane])
    return respond(of_case(law, lane), tip, step.h, step.theta)


@part
def _taken(step: TipStep, own: Own, i: int, j: int, lane: int) -> tuple[float, float]:
    """Return what a unit impulse of contact j takes from velocity and place of contact i."""
    alpha, friction, way = own.alpha[lane], own.friction[lane], 0.0
    w = step.delassus[0, i, j] + alpha * step.delassus[2, i, j] - friction * step.delassus[1, i, j]
    if step.sinking.shape[1] > 0:
        way = step.sinking[0, i, j] + alpha * step.sinking[2, i, j] - friction * step.sinking[1, i, j]
    return w, way


@part
def _respond_less_others(
    law: Law, step: TipStep, own: Own, act: Acting, i: int, c: Coupling, struck: int, lane: int
) -> Response:
    """Return the response of contact ``i`` less what the impulses of the first contacts ``struck`` take."""
    place, free = act.place[lane], act.free[lane]
    for k in range(struck):
        j = c.struck[k]
        if j != i:
            w, way = _taken(step, own, i, j, lane)
            place -= way * c.impulse[j]
            free -= w * c.impulse[j]
    act.deep[lane], act.loose[lane] = place, free
    return _response(law, step, act, lane, place, free)


@part
def _find_struck(c: Coupling) -> int:
    """List the contacts with an impulse; return how many they are."""
    count = 0
    for i in range(c.impulse.size):
        if c.impulse[i] != 0.0:
            c.struck[count] = i
            count += 1
    return count


@part
def _couplings(step: TipStep, own: Own, c: Coupling, i: int, j: int, lane: int) -> float:
    """Return what a unit impulse of contact j takes from the impulse of contact i, by the slopes of its law."""
    w, way = _taken(step, own, i, j, lane)
    return float(c.slope[0, i] * w + c.slope[1, i] * way)


@part
def _solve(law: Law, step: TipStep, own: Own, acts: Sequence[Acting], c: Coupling, lane: int) -> bool:
    """Solve the laws of the contacts of a lane together; return whether they have a solution.

    Newton's method on p_i = law(free_i - Σ_{j≠i} W_ij p_j; W_ii), with slopes by a difference. What is kept is what the
    laws return at the last p: an impulse below rounding whose law says 0 is 0.
    """
    m, scale, a = len(acts), 0.0, c.problem.tableau
    for i in range(m):
        c.impulse[i] = acts[i].impulse[lane]
        scale = max(scale, abs(acts[i].free[lane]) + abs(acts[i].speed[lane]))
        scale = max(scale, abs(acts[i].place[lane] - acts[i].casing[lane]) / step.h)
    probe = _PROBE * scale
    for _ in range(MOST_TRIES):
        change, largest, size, struck = 0.0, 0.0, 0, _find_struck(c)
        for i in range(m):
            act = acts[i]
            q, velocity, force = _respond_less_others(law, step, own, act, i, c, struck, lane)
            faster = deeper = q
            if q != 0.0 or c.impulse[i] != 0.0:  # else it has no slope
                faster, _, _ = _response(law, step, act, lane, act.deep[lane], act.loose[lane] + probe)
                if step.sinking.shape[1] > 0:
                    deeper, _, _ = _response(law, step, act, lane, act.deep[lane] + step.h * probe, act.loose[lane])
            act.impulse[lane], act.after[lane], act.force[lane] = q, velocity, force
            if not np.isfinite(q + velocity):
                return False
            change, largest = max(change, abs(q - c.impulse[i])), max(largest, abs(q))
            c.slope[0, i], c.slope[1, i] = (faster - q) / probe, (deeper - q) / (step.h * probe)
            if faster != q or deeper != q or q != c.impulse[i]:
                c.members[size] = i
                size += 1
        if change <= 4e-16 * m * largest:
            return True
        for k in range(size):
            i = c.members[k]
            for n in range(size):
                j = c.members[n]
                a[k, n] = 1.0 if j == i else _couplings(step, own, c, i, j, lane)
            a[k, size] = acts[i].impulse[lane] - c.impulse[i]
        if not solve_in_place(a, size):
            break
        for k in range(size):
            c.impulse[c.members[k]] += a[k, size]
    return _pivot(law, step, own, acts, c, lane, 1e3 * scale)


@part
def _pivot(law: Law, step: TipStep, own: Own, acts: Sequence[Acting], c: Coupling, lane: int, far: float) -> bool:
    """Solve the laws of the contacts of a lane by Lemke's method, as Newton's does not end.

    p = p_0 + max(0, a + s free + r place), with a, s and r found where free and place are ``far`` inside the casing,
    m/s, and p_0 as far outside.
    """
    p, size, yields, way = c.problem, 0, step.sinking.shape[1] > 0, step.h * far
    way = way if yields else 0.0  # no contact with mass is near because others push it
    for i in range(len(acts)):
        act, place, free = acts[i], acts[i].place[lane], acts[i].free[lane]
        least, _, _ = _response(law, step, act, lane, place - way, free - far)
        inside, _, _ = _response(law, step, act, lane, place + way, free + far)
        faster, _, _ = _response(law, step, act, lane, place + way, free + 2.0 * far)
        deeper, _, _ = _response(law, step, act, lane, place + 2.0 * way, free + far)
        c.impulse[i], c.slope[0, i] = least, (faster - inside) / far
        c.slope[1, i] = (deeper - inside) / way if yields else 0.0
        if c.slope[0, i] != 0.0 or c.slope[1, i] != 0.0:
            p.constant[size], p.active[size], c.members[size] = faster + deeper - 3.0 * inside + least, False, i
            size += 1
    for k in range(size):
        i = c.members[k]
        for j in range(len(acts)):
            if j != i:
                p.constant[k] += _couplings(step, own, c, i, j, lane) * c.impulse[j]
        for n in range(size):
            j = c.members[n]
            p.matrix[k, n] = 1.0 if n == k else _couplings(step, own, c, i, j, lane)
    if not solve_complementarity(p, size):
        return False
    for k in range(size):
        c.impulse[c.members[k]] += p.solution[k]
    struck = _find_struck(c)
    for i in range(len(acts)):
        q, velocity, force = _respond_less_others(law, step, own, acts[i], i, c, struck, lane)
        acts[i].impulse[lane], acts[i].after[lane], acts[i].force[lane] = q, velocity, force
    return True
