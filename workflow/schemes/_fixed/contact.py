"""Contacts at the end of a step, in packs: where a law is asked, and what follows from its impulse.

A law (:mod:`~workflow.schemes._fixed.law`) is asked where a contact would pass the casing within the step, at its
initial velocity or in its motion without contact, and where it returned a force in the step before. Free motion stays
in packs.

Only the contact is completed here. The impulse stays in ``act.impulse``: the modes receive it as the next step begins
(:func:`~workflow.schemes._fixed.free_motion.ended`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from workflow.kernels.compiled import by_type, defines, inlined
from workflow.kernels.packs import (
    Lane,
    Pack,
    flag,
    lanes_of,
    pack,
    raised,
    shared,
    some,
    some_nonzero,
    spread,
    store,
    where,
)
from workflow.models import Cases
from workflow.schemes._fixed.law import CentralStep, Coupling, Law, TipStep, YieldingStep, apply_law, couple
from workflow.schemes._fixed.loads import (
    Drive,
    gap_ahead,
    gap_before,
    onto_casing,
    relative,
    relative_before,
    tip_after,
    tip_before,
)
from workflow.schemes._fixed.rows import Acting, Own, Tips

METRICS = {
    "effective_restitution": (
        "1",
        "speed of separation over speed of approach, least squares over all contacts that ended",
    )
}
"""Metrics of schemes without a restitution coefficient besides the common ones: unit and meaning."""


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
    holds: bool = False
    """Whether an impulse puts the tip on the casing exactly, without rounding."""
    rebounds: bool = False
    """Whether the scheme gives the metric ``effective_restitution``."""
    by_place: bool = False
    """Whether an impulse is h times the force at the step's end, as of a contact without mass that keeps its place."""
    judges_heat: bool = True
    """Whether an unstable heat step also makes cases without heat ``diverged`` (θ-method in modes, θ < 1/2)."""

    def force_weight(self, theta: float) -> float:
        """Return the weight of the force at a step's end in its impulse over h."""
        return 1.0 if self.by_place else theta


class TipInput(NamedTuple):
    """A contact at the step's end without load and contact, and its load and casing."""

    velocity: Pack
    """m/s."""
    temperature: Pack
    """K."""
    impulse: Pack
    """Impulse of the load in the step, N s."""
    load: Pack
    """The load at the step's end, N, where contacts without mass move by it."""
    gap: Pack
    """Position of the casing at the step's end, m; at its beginning for central differences."""
    drive: Drive | None
    """The motion of the casing, where it moves."""


class Approach(NamedTuple):
    """A contact in a step before its law is asked, relative to the casing where that moves."""

    near: bool
    """Whether it may be in contact in some lane."""
    place: Pack
    velocity: Pack
    """At the step's beginning, m and m/s."""
    free: Pack
    """Velocity at the end without contact, m/s."""
    gap: Pack
    """Position of the casing, m."""


class End(NamedTuple):
    """A contact at the step's end, for samples and counts."""

    engaged: bool
    """Whether some lane may be in contact or was in the step before: else no count of contact changes."""
    displacement: Pack
    velocity: Pack
    temperature: Pack
    impulse: Pack
    """Impulse of contact in the step, N s, >= 0."""
    acting: Pack
    """Impulse of contact that acts on the states, N s."""
    driven: Pack
    """The velocity that the contact law gives the contact, at which impulses do work, m/s."""


@inlined
def _is_near(place: Pack, reach: Pack, moved: Pack, gap: Pack) -> bool:
    """Tell whether some contact of a pack may act."""
    reach = where(reach > 0.0, reach, 0.0)
    reach = where(moved > reach, moved, reach)
    return some(~(place + reach < gap))  # a NaN is near


@inlined
def ask(begun: Approach, act: Acting, lane: Lane) -> None:
    """Store the arguments of the law."""
    store(act.place, lane, begun.place)
    store(act.speed, lane, begun.velocity)
    store(act.free, lane, begun.free)
    store(act.casing, lane, begun.gap)


@inlined
def respond_in(
    law: Law, step: TipStep, own: Own, acts: Sequence[Acting], coupling: Coupling | None, t: float, lane: Lane
) -> None:
    """Store impulse, velocity and force of each contact, and whether an impulse or a force may be nonzero."""
    first, stop = lanes_of(lane)
    pressed = False
    for c in range(count_of(coupling, acts)):
        pressed |= some_nonzero(pack(acts[c].last, lane))
    if coupling is None:
        apply_law(law, step, acts[0], first, stop)
    else:
        couple(law, step, own, acts, coupling, t, first, stop)
    for c in range(count_of(coupling, acts)):
        pressed |= some_nonzero(pack(acts[c].impulse, lane)) or some_nonzero(pack(acts[c].last, lane))
    flag(own.pressed, lane, pressed)  # also in the next step, in which the modes receive the impulse


@inlined
def count_of(coupling: Coupling | None, acts: Sequence[Acting]) -> int:
    """Return the number of contacts, a constant of the compiled kernel where it is 1."""
    return 1 if coupling is None else len(acts)


@inlined
def was_pressed(own: Own, lane: Lane) -> bool:
    """Tell whether some lane of a pack was in contact in the last step."""
    return raised(own.pressed, lane)


@inlined
def friction_heat(own: Own, act: Acting, lane: Lane) -> Pack:
    """Return the friction heat α p of a contact in the last step, J."""
    return pack(own.alpha, lane) * pack(act.impulse, lane)


@inlined
def _weighed(theta: float, after: Pack, before: Pack) -> Pack:
    """Return θ ``after`` + (1-θ) ``before``: ``after`` alone where θ is 1."""
    return after if theta == 1.0 else theta * after + (1.0 - theta) * before


@inlined
def _warmed(
    step: TipStep,
    free: TipInput,
    own: Own,
    acts: Sequence[Acting],
    coupling: Coupling | None,
    c: int,
    share: float,
    lane: Lane,
) -> Pack:
    """Return the temperature of contact ``c`` with a share of the heat of all impulses."""
    temperature = free.temperature
    for j in range(count_of(coupling, acts)):
        temperature += share * shared(step.warming, (c, j), lane) * friction_heat(own, acts[j], lane)
    return temperature


@by_type
def approach(
    step: TipStep, free: TipInput, own: Own, acts: Sequence[Acting], tip: Tips, c: int, lane: Lane
) -> Approach:
    """Return contact ``c`` before its law is asked."""
    raise NotImplementedError


@defines(approach, TipStep)
def _approach_by_theta(
    step: TipStep, free: TipInput, own: Own, acts: Sequence[Acting], tip: Tips, c: int, lane: Lane
) -> Approach:
    x, v, gap = tip_before(free.drive, c, tip, free.gap, lane)
    after = relative(free.drive, c, free.velocity + shared(step.load_mobility, (c,), lane) * free.impulse, lane)
    moved = step.h * _weighed(step.theta, after, v)
    return Approach(_is_near(x, step.h * v, moved, gap), x, v, after, gap)


@defines(approach, CentralStep)
def _approach_centrally(
    step: TipStep, free: TipInput, own: Own, acts: Sequence[Acting], tip: Tips, c: int, lane: Lane
) -> Approach:
    x, before = pack(acts[c].ahead, lane), relative_before(free.drive, c, pack(acts[c].half, lane), lane)
    after = relative(free.drive, c, free.velocity + shared(step.load_mobility, (c,), lane) * free.impulse, lane)
    return Approach(_is_near(x, spread(0.0, lane), step.h * after, free.gap), x, before, after, free.gap)


@inlined
def _aside(step: TipStep, free: TipInput, act: Acting, c: int, lane: Lane) -> Pack:
    """Return the way that the residual of a contact gives at the step's end, but for contact."""
    return shared(step.residual_load, (c,), lane) * free.load - pack(act.expansion, lane)


@inlined
def _flexibility(step: TipStep, own: Own, i: int, j: int, lane: Lane) -> Pack:
    """Return R_ij - µ R^t_ij of the residual."""
    return shared(step.residual, (0, i, j), lane) - pack(own.friction, lane) * shared(step.residual, (1, i, j), lane)


@defines(approach, YieldingStep)
def _approach_yielding(
    step: TipStep, free: TipInput, own: Own, acts: Sequence[Acting], tip: Tips, c: int, lane: Lane
) -> Approach:
    """Return the place with all that the residual gives at the step's end but for its impulses.

    Of a force that weighs at both ends of a step the share of the beginning is no force at the end.
    """
    r, v, gap = tip_before(free.drive, c, tip, free.gap, lane)
    after = relative(free.drive, c, free.velocity + shared(step.load_mobility, (c,), lane) * free.impulse, lane)
    place = r + _aside(step, free, acts[c], c, lane)
    for j in range(len(acts)):
        place += step.carried * _flexibility(step, own, c, j, lane) * pack(acts[j].last, lane)
    return Approach(True, place, v, after, gap)


@by_type
def leave(
    step: TipStep,
    begun: Approach,
    engaged: bool,
    free: TipInput,
    own: Own,
    acts: Sequence[Acting],
    coupling: Coupling | None,
    tip: Tips,
    c: int,
    lane: Lane,
) -> End:
    """Complete a step of contact ``c``, by the impulses in ``acts`` where some contact is ``engaged``."""
    raise NotImplementedError


@defines(leave, TipStep)
def _leave_by_theta(
    step: TipStep,
    begun: Approach,
    engaged: bool,
    free: TipInput,
    own: Own,
    acts: Sequence[Acting],
    coupling: Coupling | None,
    tip: Tips,
    c: int,
    lane: Lane,
) -> End:
    p, temperature, after = spread(0.0, lane), free.temperature, begun.free
    if engaged:
        p, after = pack(acts[c].impulse, lane), pack(acts[c].after, lane)
        temperature = _warmed(step, free, own, acts, coupling, c, 1.0, lane)
    x = begun.place + step.h * _weighed(step.theta, after, begun.velocity)
    if step.holds:
        x = where(p > 0.0, begun.gap, x)
    x, v = tip_after(free.drive, c, x, after, free.gap, lane)
    return End(engaged, x, v, temperature, p, p, v)


@defines(leave, YieldingStep)
def _leave_yielding(
    step: TipStep,
    begun: Approach,
    engaged: bool,
    free: TipInput,
    own: Own,
    acts: Sequence[Acting],
    coupling: Coupling | None,
    tip: Tips,
    c: int,
    lane: Lane,
) -> End:
    """Return the contact at its place with the residual's; what presses a casing by its place is on it exactly."""
    p, after = pack(acts[c].impulse, lane), pack(acts[c].after, lane)
    r, v, _ = tip_before(free.drive, c, tip, free.gap, lane)
    r += step.h * _weighed(step.theta, after, v)
    depth = r + _aside(step, free, acts[c], c, lane)
    for j in range(len(acts)):
        depth -= shared(step.growth, (c, j), lane) * friction_heat(own, acts[j], lane)
        depth -= _flexibility(step, own, c, j, lane) * pack(acts[j].last, lane)
    if step.holds:
        depth = where(p > 0.0, step.casing_flexibility * pack(acts[c].last, lane), depth)
    _, v = tip_after(free.drive, c, r, after, free.gap, lane)
    temperature = _warmed(step, free, own, acts, coupling, c, 1.0, lane)
    return End(True, free.gap + depth, v, temperature, p, p, v)


@defines(leave, CentralStep)
def _leave_centrally(
    step: TipStep,
    begun: Approach,
    engaged: bool,
    free: TipInput,
    own: Own,
    acts: Sequence[Acting],
    coupling: Coupling | None,
    tip: Tips,
    c: int,
    lane: Lane,
) -> End:
    """Return the contact at t_k and the impulse centred on it, and complete the step from t_k with p_k."""
    act, x, before, temperature = acts[c], begun.place, pack(acts[c].half, lane), free.temperature
    p, about = spread(0.0, lane), spread(0.0, lane)
    after = onto_casing(free.drive, c, begun.free, lane)
    ahead = x + step.h * after
    driven = after
    if engaged:
        p = pack(act.impulse, lane)
        about = 0.5 * (pack(act.before, lane) + p)
        store(act.before, lane, p)
        after = onto_casing(free.drive, c, pack(act.after, lane), lane)
        temperature = _warmed(step, free, own, acts, coupling, c, 0.5, lane)
        ahead = x + step.h * after
        driven = after
        if step.holds:
            ahead = where(p > 0.0, gap_ahead(free.drive, c, free.gap, step.h, lane), ahead)
            driven = where(p > 0.0, (ahead - x) * (1.0 / step.h), after)
    store(act.ahead, lane, ahead)
    store(act.half, lane, after)
    return End(engaged, x, 0.5 * (before + after), temperature, about, p, driven)


@by_type
def contact_gain(step: TipStep, end: End, free: TipInput, act: Acting, tip: Tips, c: int, lane: Lane) -> Pack:
    """Return the energy that contact creates in a step, J, besides the work of its impulse at the mean velocity.

    Of a contact spring that is the gain of its energy less the work done on it; ``tip`` is the tip at the step's
    beginning.
    """
    return spread(0.0, lane)


@defines(contact_gain, TipStep)
def _gain_by_theta(step: TipStep, end: End, free: TipInput, act: Acting, tip: Tips, c: int, lane: Lane) -> Pack:
    """Return Δ(κ δ²/2) - h κ δ_θ (v + v')/2 with the depths δ, 0 where the tip is not beyond the casing.

    Velocities are relative to the casing where that moves.
    """
    drive = free.drive
    begins = pack(tip.displacement, lane) - gap_before(drive, c, free.gap, lane)
    ended = end.displacement - free.gap
    if step.stiffness == 0.0 or not (some(begins > 0.0) or some(ended > 0.0)):
        return spread(0.0, lane)
    before, after = where(begins > 0.0, begins, 0.0), where(ended > 0.0, ended, 0.0)
    speeds = relative_before(drive, c, pack(tip.velocity, lane), lane) + relative(drive, c, end.velocity, lane)
    worked = (step.theta * after + (1.0 - step.theta) * before) * (0.5 * step.h * speeds)
    return step.stiffness * (0.5 * (after * after - before * before) - worked)


@defines(contact_gain, CentralStep)
def _gain_centrally(step: TipStep, end: End, free: TipInput, act: Acting, tip: Tips, c: int, lane: Lane) -> Pack:
    """Return κ δ_k (s_k+1 - s_k-1)/2, with the depth δ and the distance s from the casing.

    That is the change of κ δ_k δ_k+1 / 2 less the work of κ δ_k over (x_k+1 - x_k-1)/2: 0 while contact lasts.
    """
    depth = end.displacement - free.gap
    if step.stiffness == 0.0 or not some(depth > 0.0):
        return spread(0.0, lane)
    ahead = pack(act.ahead, lane) - gap_ahead(free.drive, c, free.gap, step.h, lane)
    moved = relative(free.drive, c, end.velocity, lane) + relative_before(free.drive, c, end.velocity, lane)
    behind = ahead - step.h * moved
    parted = where(behind < 0.0, behind, 0.0) - where(ahead < 0.0, ahead, 0.0)
    return 0.5 * step.stiffness * where(depth > 0.0, depth, 0.0) * parted
