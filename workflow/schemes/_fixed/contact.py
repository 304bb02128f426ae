"""Contact at the end of a step: a contact law, which is one scalar function, and the two steps that call it.

A contact law is a named tuple of parameters, each a number or an array ``(case,)``, and a function of it and of the tip
in one case (:func:`respond`), which :func:`~workflow.schemes._fixed.march.contact_law` compiles into the march. It is
called where the tip would pass the casing within the step, at its initial velocity or in its motion without contact,
and where the law returned a force in the step before. Free motion stays in packs.

Only the tip is completed here. The impulse stays in ``own.impulse``: the modes receive it as the next step begins
(:func:`~workflow.schemes._fixed.free_motion.ended`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

from workflow.kernels.compiled import by_type, defines, inlined, of_case, part
from workflow.kernels.packs import (
    Lane,
    Pack,
    flag,
    lanes_of,
    pack,
    raised,
    some,
    some_nonzero,
    spread,
    store,
    where,
)
from workflow.models import Cases
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
from workflow.schemes._fixed.rows import Own, Tips

METRICS = {
    "effective_restitution": (
        "1",
        "speed of separation over speed of approach, least squares over all contacts that ended",
    )
}
"""Metrics of schemes without a restitution coefficient besides the common ones: unit and meaning."""

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


@by_type
def respond(law: Law, tip: Tip, h: float, theta: float) -> Response:
    """Return the response of contact in a step h of one case.

    ``theta`` is the weight of the step's end in the tip's velocity, 1 of central differences.
    """
    raise NotImplementedError


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
    judges_heat: bool = True
    """Whether an unstable heat step also makes cases without heat ``diverged`` (θ-method in modes, θ < 1/2)."""


class TipStep(NamedTuple):
    """Coefficients of the tip in a step of the θ-method."""

    h: float
    theta: float
    """Weight of the step's end, in the load and in the tip's velocity."""
    warming: float
    """Tip temperature per unit heat, K/J."""
    load_mobility: float = 0.0
    """Tip velocity per unit impulse of the load, e_nᵀ Ŵ⁻¹ b, 1/kg."""
    stiffness: float = 0.0
    holds: bool = False
    """Those of :class:`Contact`."""


class CentralStep(TipStep):
    """A step of central differences: half-step velocities, the impulse p_k centred on the step's beginning."""


class TipInput(NamedTuple):
    """The tip at the step's end without load and contact, and its load and casing."""

    velocity: Pack
    """m/s."""
    temperature: Pack
    """K."""
    impulse: Pack
    """Impulse of the load in the step, N s."""
    gap: Pack
    """Position of the casing at the step's end, m; at its beginning for central differences."""
    drive: Drive | None
    """The motion of the casing, where it moves."""


class End(NamedTuple):
    """The tip at the step's end, for samples and counts."""

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
    """The velocity that the contact law gives the tip, at which impulses do work, m/s."""


@by_type
def count_rebound(law: Law, tip: Tip, velocity: float, force: float, own: Own, lane: int) -> None:
    """Add a contact that has ended to the sums of ``effective_restitution``, where the scheme gives it."""
    was, presses = tip.force > 0.0, force > 0.0
    approach = own.approach[lane]
    own.approach[lane] = approach if was or not presses else tip.velocity
    ended = approach if was and not presses else 0.0
    own.approached[lane] += ended * ended
    own.separated[lane] -= ended * velocity


def count_no_rebound(law: Law, tip: Tip, velocity: float, force: float, own: Own, lane: int) -> None:
    """Count nothing: the restitution is given."""


@part
def _apply_law(law: Law, step: TipStep, own: Own, first: int, stop: int) -> None:
    """Evaluate the law in some lanes; no branch but the law's own, so that the compiler can vectorise the loop."""
    for lane in range(first, stop):
        place, speed, free, casing = own.place[lane], own.speed[lane], own.free[lane], own.casing[lane]
        tip = Tip(place, speed, free, own.last[lane], casing, own.mobility[lane])
        impulse, velocity, force = respond(of_case(law, lane), tip, step.h, step.theta)
        count_rebound(law, tip, velocity, force, own, lane)
        own.impulse[lane], own.after[lane], own.last[lane] = impulse, velocity, force


@inlined
def _is_near(place: Pack, reach: Pack, moved: Pack, gap: Pack, own: Own, lane: Lane) -> bool:
    """Tell whether some tip of a pack may be in contact, or was in the step before."""
    reach = where(reach > 0.0, reach, 0.0)
    reach = where(moved > reach, moved, reach)
    return some(~(place + reach < gap)) or was_pressed(own, lane)  # a NaN is near


@inlined
def _contact(
    law: Law, step: TipStep, place: Pack, speed: Pack, free: Pack, gap: Pack, own: Own, lane: Lane
) -> tuple[Pack, Pack, Pack]:
    """Return impulse and heat of contact in a step, and the tip's velocity at its end, relative to the casing.

    Stores the impulse in ``own``, and in ``own.pressed`` whether an impulse or a force may be nonzero.
    """
    store(own.place, lane, place)
    store(own.speed, lane, speed)
    store(own.free, lane, free)
    store(own.casing, lane, gap)
    first, stop = lanes_of(lane)
    before = some_nonzero(pack(own.last, lane))
    _apply_law(law, step, own, first, stop)
    p, force = pack(own.impulse, lane), pack(own.last, lane)
    # also in the next step, in which the modes receive the impulse
    flag(own.pressed, lane, before or some_nonzero(p) or some_nonzero(force))
    return p, friction_heat(own, lane), pack(own.after, lane)


@inlined
def friction_heat(own: Own, lane: Lane) -> Pack:
    """Return the friction heat α p of the last step, J."""
    return pack(own.alpha, lane) * pack(own.impulse, lane)


@inlined
def was_pressed(own: Own, lane: Lane) -> bool:
    """Tell whether some lane of a pack was in contact in the last step."""
    return raised(own.pressed, lane)


@inlined
def _weighed(theta: float, after: Pack, before: Pack) -> Pack:
    """Return θ ``after`` + (1-θ) ``before``: ``after`` alone where θ is 1."""
    return after if theta == 1.0 else theta * after + (1.0 - theta) * before


@by_type
def contact_step(step: TipStep, law: Law, free: TipInput, own: Own, tip: Tips, lane: Lane) -> End:
    """Complete a step by load and contact; store the impulses of both in ``own``."""
    raise NotImplementedError


@defines(contact_step, TipStep)
def _contact_by_theta(step: TipStep, law: Law, free: TipInput, own: Own, tip: Tips, lane: Lane) -> End:
    x, v, gap = tip_before(free.drive, tip, free.gap, lane)
    p, temperature = spread(0.0, lane), free.temperature
    after = relative(free.drive, free.velocity + step.load_mobility * free.impulse, lane)
    moved = step.h * _weighed(step.theta, after, v)
    engaged = _is_near(x, step.h * v, moved, gap, own, lane)
    if engaged:
        p, heat, after = _contact(law, step, x, v, after, gap, own, lane)
        moved = step.h * _weighed(step.theta, after, v)
        temperature += step.warming * heat
    store(own.load, lane, free.impulse)
    x += moved
    if step.holds:
        x = where(p > 0.0, gap, x)
    x, v = tip_after(free.drive, x, after, free.gap, lane)
    return End(engaged, x, v, temperature, p, p, v)


@defines(contact_step, CentralStep)
def _contact_centrally(step: TipStep, law: Law, free: TipInput, own: Own, tip: Tips, lane: Lane) -> End:
    """Return the tip at t_k and the impulse centred on it, and complete the step from t_k with p_k."""
    x, before, temperature = pack(own.ahead, lane), pack(own.half, lane), free.temperature
    after, p, about = free.velocity + step.load_mobility * free.impulse, spread(0.0, lane), spread(0.0, lane)
    approach, leaving = relative_before(free.drive, before, lane), relative(free.drive, after, lane)
    ahead = x + step.h * after
    driven = after
    engaged = _is_near(x, spread(0.0, lane), step.h * leaving, free.gap, own, lane)
    if engaged:
        p, heat, leaving = _contact(law, step, x, approach, leaving, free.gap, own, lane)
        about = 0.5 * (pack(own.before, lane) + p)
        store(own.before, lane, p)
        after = onto_casing(free.drive, leaving, lane)
        temperature += 0.5 * step.warming * heat
        ahead = x + step.h * after
        driven = after
        if step.holds:
            ahead = where(p > 0.0, gap_ahead(free.drive, free.gap, step.h, lane), ahead)
            driven = where(p > 0.0, (ahead - x) * (1.0 / step.h), after)
    store(own.ahead, lane, ahead)
    store(own.half, lane, after)
    store(own.load, lane, free.impulse)
    return End(engaged, x, 0.5 * (before + after), temperature, about, p, driven)


@by_type
def contact_gain(step: TipStep, end: End, free: TipInput, own: Own, tip: Tips, lane: Lane) -> Pack:
    """Return the energy that contact creates in a step, J, besides the work of its impulse at the mean velocity.

    Of a contact spring that is the gain of its energy less the work done on it; ``tip`` is the tip at the step's
    beginning.
    """
    raise NotImplementedError


@defines(contact_gain, TipStep)
def _gain_by_theta(step: TipStep, end: End, free: TipInput, own: Own, tip: Tips, lane: Lane) -> Pack:
    """Return Δ(κ δ²/2) - h κ δ_θ (v + v')/2 with the depths δ, 0 where the tip is not beyond the casing.

    Velocities are relative to the casing where that moves.
    """
    drive = free.drive
    begins = pack(tip.displacement, lane) - gap_before(drive, free.gap, lane)
    ended = end.displacement - free.gap
    if step.stiffness == 0.0 or not (some(begins > 0.0) or some(ended > 0.0)):
        return spread(0.0, lane)
    before, after = where(begins > 0.0, begins, 0.0), where(ended > 0.0, ended, 0.0)
    speeds = relative_before(drive, pack(tip.velocity, lane), lane) + relative(drive, end.velocity, lane)
    worked = (step.theta * after + (1.0 - step.theta) * before) * (0.5 * step.h * speeds)
    return step.stiffness * (0.5 * (after * after - before * before) - worked)


@defines(contact_gain, CentralStep)
def _gain_centrally(step: TipStep, end: End, free: TipInput, own: Own, tip: Tips, lane: Lane) -> Pack:
    """Return κ δ_k (s_k+1 - s_k-1)/2, with the depth δ and the distance s from the casing.

    That is the change of κ δ_k δ_k+1 / 2 less the work of κ δ_k over (x_k+1 - x_k-1)/2: 0 while contact lasts.
    """
    depth = end.displacement - free.gap
    if step.stiffness == 0.0 or not some(depth > 0.0):
        return spread(0.0, lane)
    ahead = pack(own.ahead, lane) - gap_ahead(free.drive, free.gap, step.h, lane)
    moved = relative(free.drive, end.velocity, lane) + relative_before(free.drive, end.velocity, lane)
    behind = ahead - step.h * moved
    parted = where(behind < 0.0, behind, 0.0) - where(ahead < 0.0, ahead, 0.0)
    return 0.5 * step.stiffness * where(depth > 0.0, depth, 0.0) * parted
