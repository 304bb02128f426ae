"""Contacts at the end of a step, in packs: where a law is asked, and what follows from its impulse.

A law (:mod:`~workflow.schemes._fixed.law`) is asked where a contact would pass the casing within the step, at its
initial velocity or in its motion without contact, and where it returned a force in the step before. Its impulse enters
the states at once (:func:`~workflow.schemes._fixed.free_motion.strike`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from workflow.kernels.compiled import by_type, defines, inlined
from workflow.kernels.packs import (
    Lane,
    Pack,
    flag,
    pack,
    raised,
    shared,
    some,
    some_nonzero,
    spread,
    store,
    where,
)
from workflow.models import Array, Cases
from workflow.schemes._fixed.law import (
    CentralStep,
    Coupling,
    Law,
    TipStep,
    ask,
    count_rebound,
    respond_together,
)
from workflow.schemes._fixed.loads import Drive
from workflow.schemes._fixed.rows import Acting, Own

METRICS = {
    "effective_restitution": (
        "1",
        "speed of separation over speed of approach, least squares over all contacts that ended",
    )
}
"""Metrics of schemes without a restitution coefficient besides the common ones: unit and meaning."""


def effective_restitution(approached: Array, separated: Array) -> dict[str, Array]:
    """Return -Σ v⁺v⁻ / Σ (v⁻)² of each case; NaN where no contact has ended or a sum is not finite."""
    met = (approached > 0) & np.isfinite(approached) & np.isfinite(separated)
    return {"effective_restitution": np.where(met, separated / np.where(met, approached, 1.0), np.nan)}


@dataclass(frozen=True, eq=False)
class Contact:
    """Contact of a scheme, for any structure."""

    law: Callable[[Cases], Law]
    """``law(cases)``: the parameters of a contact law."""
    factor: Callable[[float, Any], Any] = lambda h, w: w
    name: str = "W"
    """``factor``, ``name``: ``factor(h, w)``: the divisor of the contact law, which has one solution where it is
    positive; its name in messages."""
    stiffness: float = 0.0
    """κ of a contact spring, N/m, whose energy is not lost; 0 where there is none."""
    damping: float = 0.0
    """c of a damper beside it, N s/m."""
    holds: bool = False
    """Whether an impulse puts the tip on the casing exactly, without rounding."""
    rebounds: bool = False
    """Whether the scheme gives the metric ``effective_restitution``."""
    by_place: bool = False
    """Whether an impulse is h times the force at the step's end, as of a contact without mass that keeps its place."""

    def force(self, depth: Array, speed: Array) -> Array:
        """Return the force of spring and damper, N: max(0, κ δ + c u) where the depth δ > 0."""
        return np.where(depth > 0, np.fmax(0.0, self.stiffness * depth + self.damping * speed), 0.0)

    def force_weight(self, theta: float) -> float:
        """Return the weight of the force at a step's end in its impulse over h."""
        return 1.0 if self.by_place else theta


class Meeting(NamedTuple):
    """What the contacts of a pack meet in a step."""

    own: Own
    acts: Sequence[Acting]
    drive: Drive | None
    load: Pack
    """The load at the step's end, N, where contacts without mass move by it."""
    first: bool
    """Whether it is the step of central differences at t = 0."""


class End(NamedTuple):
    """A contact at the step's end."""

    displacement: Pack
    velocity: Pack
    depth: Pack
    impulse: Pack
    """What it shows: place and velocity, the depth beyond the casing, and the impulse in the step, N s, >= 0."""
    place: Pack
    speed: Pack
    """Those with which the next step begins, relative to the origin."""
    acting: Pack
    """Impulse of contact that acts on the states, N s."""
    driven: Pack
    """The velocity that the contact law gives the contact, at which impulses do work, m/s."""


@inlined
def respond_in(
    law: Law, step: TipStep, own: Own, acts: Sequence[Acting], coupling: Coupling | None, t: float, lane: Lane
) -> None:
    """Store impulse, velocity and force of each contact, and whether some lane is or was in contact.

    An impulse of central differences is shown in the next step too.
    """
    pressed, count = False, count_of(coupling, acts)
    for c in range(count):
        pressed |= some_nonzero(pack(acts[c].force, lane))
    if coupling is None:
        ask(law, step, acts[0], False, lane)
    else:
        respond_together(law, step, own, acts, coupling, t, lane)
    for c in range(count):
        act = acts[c]
        if step.rebounds:
            count_rebound(act, lane)
        store(act.force, lane, pack(act.force_end, lane))
        pressed |= some_nonzero(pack(act.impulse, lane)) or some_nonzero(pack(act.force, lane))
    flag(own.pressed, lane, pressed)


@inlined
def count_of(coupling: Coupling | None, acts: Sequence[Acting]) -> int:
    """Return the number of contacts, a constant of the compiled kernel where it is 1."""
    return 1 if coupling is None else len(acts)


@inlined
def was_pressed(own: Own, lane: Lane) -> bool:
    """Tell whether some lane of a pack was in contact in the last step or the one before."""
    return raised(own.pressed, lane)


@inlined
def _absolute(drive: Drive | None, row: Array, numbers: Pack, lane: Lane) -> Pack:
    """Return places or velocities relative to an origin as absolute ones: the same where it is at rest in 0."""
    return numbers if drive is None else pack(row, lane) + numbers


@inlined
def approach(step: TipStep, met: Meeting, c: int, free: Pack, lane: Lane) -> bool:
    """Tell whether contact ``c``, ``free`` the velocity at its end, may act in some lane.

    Where it is compliant, store its place without impulses.
    """
    act = met.acts[c]
    place, speed = pack(act.place, lane), pack(act.speed, lane)
    if step.compliant:
        place += shared(step.residual_load, (c,), lane) * met.load - pack(act.expansion, lane)
        place += step.carried * _pressed_by(step, met, c, lane)  # by the force of the beginning: none at the end
        store(act.place_free, lane, place)
    fastest = _fastest(step, speed, free)
    reach = step.h * where(fastest > 0.0, fastest, 0.0)
    return some(~(place + reach < pack(act.casing, lane)))  # a NaN is near


@by_type
def _fastest(step: TipStep, speed: Pack, free: Pack) -> Pack:
    """Return the velocity that a contact does not exceed in a step without impulses."""
    return where(free > speed, free, speed)


@defines(_fastest, CentralStep)
def _fastest_centrally(step: TipStep, speed: Pack, free: Pack) -> Pack:
    return free


@inlined
def _pressed_by(step: TipStep, met: Meeting, i: int, lane: Lane) -> Pack:
    """Return the way by which the residual of contact i gives to all forces, Σ (R_ij - µ R^t_ij) λ_j."""
    friction, way = pack(met.own.friction, lane), spread(0.0, lane)
    for j in range(len(met.acts)):
        flexibility = shared(step.residual, (0, i, j), lane) - friction * shared(step.residual, (1, i, j), lane)
        way += flexibility * pack(met.acts[j].force, lane)
    return way


@by_type
def leave(step: TipStep, met: Meeting, c: int, free: Pack, engaged: bool, lane: Lane) -> End:
    """Complete a step of contact ``c``, by the impulses of all where some contact is ``engaged``.

    ``free`` is its velocity at the end without them.
    """
    raise NotImplementedError


@defines(leave, TipStep)
def _leave_by_theta(step: TipStep, met: Meeting, c: int, free: Pack, engaged: bool, lane: Lane) -> End:
    act, casing = met.acts[c], pack(met.acts[c].casing, lane)
    p, speed = spread(0.0, lane), free
    if engaged:
        p, speed = pack(act.impulse, lane), pack(act.speed_end, lane)
    moved = step.h * step.theta * speed + step.h * (1.0 - step.theta) * pack(act.speed, lane)
    place = pack(act.place, lane) + moved
    if step.holds and not step.compliant:
        place = where(p > 0.0, casing, place)
    shown, depth = place, place - casing
    if step.compliant:
        depth = _depth_of_residual(step, met, c, place, p, lane)
        shown = casing + depth
    x, v = _absolute(met.drive, act.origin, shown, lane), _absolute(met.drive, act.origin_speed, speed, lane)
    return End(x, v, depth, p, place, speed, p, v)


@inlined
def _depth_of_residual(step: TipStep, met: Meeting, c: int, place: Pack, p: Pack, lane: Lane) -> Pack:
    """Return the depth of a contact whose modes are at ``place``; what presses by its place is on the casing exactly.

    What crushes a coating is as much deeper as it wears.
    """
    act = met.acts[c]
    depth = place + shared(step.residual_load, (c,), lane) * met.load - pack(act.expansion, lane)
    depth -= _pressed_by(step, met, c, lane) + pack(act.casing, lane)
    if step.holds:
        force = pack(act.force, lane)
        held = pack(act.worn, lane) + step.casing_flexibility * force
        crushes = (force >= pack(act.level, lane)) & (depth > held)
        depth = where((p > 0.0) & ~crushes, held, depth)
    return depth


@defines(leave, CentralStep)
def _leave_centrally(step: TipStep, met: Meeting, c: int, free: Pack, engaged: bool, lane: Lane) -> End:
    """Return the contact at t_k and the impulse centred on it, and complete the step from t_k with p_k.

    p_0 spans half a step, that of a spring a whole: it counts as the impulse of a whole one.
    """
    act, casing = met.acts[c], pack(met.acts[c].casing, lane)
    place, p, about, speed = pack(act.place, lane), spread(0.0, lane), spread(0.0, lane), free
    if engaged:
        p, speed = pack(act.impulse, lane), pack(act.speed_end, lane)
        about = 0.5 * (pack(act.impulse_before, lane) + p)
        store(act.impulse_before, lane, 2.0 * p if met.first and step.stiffness == 0.0 else p)
    after = place + step.h * speed
    if step.holds:
        after = where(p > 0.0, casing, after)
    before = _absolute(met.drive, act.origin_speed_begin, pack(act.speed, lane), lane)
    x, v = _absolute(met.drive, act.origin, place, lane), _absolute(met.drive, act.origin_speed, speed, lane)
    driven = v
    if step.holds:
        moved = _absolute(met.drive, act.origin_speed, (after - place) * (1.0 / step.h), lane)
        driven = where(p > 0.0, moved, v)
    return End(x, 0.5 * (before + v), place - casing, about, after, speed, p, driven)


@by_type
def contact_gain(step: TipStep, end: End, act: Acting, lane: Lane) -> Pack:
    """Return the energy that contact creates in a step, J, besides the work of its impulse at the mean velocity.

    Of a contact spring that is the gain of its energy less the work done on it; ``act`` has the step's beginning.
    """
    return spread(0.0, lane)


@defines(contact_gain, TipStep)
def _gain_by_theta(step: TipStep, end: End, act: Acting, lane: Lane) -> Pack:
    """Return Δ(κ δ²/2) - h κ δ_θ (v + v')/2 with the depths δ, 0 where the tip is not beyond the casing.

    Velocities are relative to the casing where that moves.
    """
    begins, depth = pack(act.place, lane) - pack(act.casing, lane), end.depth
    if step.stiffness == 0.0 or not (some(begins > 0.0) or some(depth > 0.0)):
        return spread(0.0, lane)
    before, after = where(begins > 0.0, begins, 0.0), where(depth > 0.0, depth, 0.0)
    moved = 0.5 * step.h * (pack(act.speed, lane) + end.speed)
    worked = (step.theta * after + (1.0 - step.theta) * before) * moved
    return step.stiffness * (0.5 * (after * after - before * before) - worked)


@defines(contact_gain, CentralStep)
def _gain_centrally(step: TipStep, end: End, act: Acting, lane: Lane) -> Pack:
    """Return κ δ_k (s_k+1 - s_k-1)/2, with the depth δ and the distance s from the casing.

    That is the change of κ δ_k δ_k+1 / 2 less the work of κ δ_k over (x_k+1 - x_k-1)/2: 0 while contact lasts.
    """
    depth = end.depth
    if step.stiffness == 0.0 or not some(depth > 0.0):
        return spread(0.0, lane)
    after = end.place - pack(act.casing, lane)
    before = after - step.h * (pack(act.speed, lane) + end.speed)
    beyond = where(before < 0.0, before, 0.0) - where(after < 0.0, after, 0.0)
    return 0.5 * step.stiffness * where(depth > 0.0, depth, 0.0) * beyond
