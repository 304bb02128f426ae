"""From contact event to contact event: one case of the event-driven scheme, start to end."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.models import Array
from workflow.schemes._event_balance import COUNT, SPENT, Log, begin_phase, energy_of, let_go
from workflow.schemes._event_motion import advance, heating_rate, integral, observe, strike
from workflow.schemes._event_record import (
    CONTACT,
    HOTTEST,
    IMPULSE,
    PERIOD_HOTTEST,
    SINCE,
    Record,
    Watch,
    contact_time,
    heat_seen,
    next_due,
    see,
    write,
)
from workflow.schemes._event_response import (
    Layout,
    Load,
    Response,
    Tables,
    copy_motion,
    load_motion,
    respond,
    store_motion,
)
from workflow.schemes._event_search import ROUNDING, S0, S1, S2, SIZE, Expansion, expand
from workflow.schemes._event_step import certified_step
from workflow.schemes._kernel import part, rare, uncounted

DONE, EVENTS, STEPS, BEYOND, NOT_FINITE, FULL = range(6)
"""How a case ended: to the end, by a budget, tip beyond the gap at the start, numbers overflowed, or
with more phases than its log takes."""


class Thresholds(NamedTuple):
    """Internal tolerances, varied by tests only."""

    excursion: float
    """Impacts are taken as accumulated where the excursion they still miss, v²/(2|a|), is below
    this share of the displacement scale: the error it makes is of this size."""
    speed: float
    """… and the speed below this share of the largest impact speed: at 5e-3 the error of the heavy
    chain was 4e-10 and falls about quadratically."""
    force: float
    """A contact force below this multiple of the rounding of its terms counts as zero at entry."""


class Tip(NamedTuple):
    """Contact law, impact data and start of one case."""

    e: float
    alpha: float
    mobility: float
    """e_nᵀ M⁻¹ e_n, 1/kg: the Delassus operator of an impact."""
    shape: Array
    """φ_n, ``(mode,)``."""
    heat_shape: Array
    """χ_n, ``(thermal mode,)``."""
    distance: float
    speed: float
    """From the gap and towards it at the start, m, m/s."""


class Budget(NamedTuple):
    """Most events and certified steps of a case."""

    events: int
    steps: int


class Side(NamedTuple):
    """One of the two regimes of a case, and the memory it is worked in."""

    r: Response
    x: Expansion
    now: Array
    after: Array
    spare: Array
    coordinates: Array


IMPACTS, RELEASES, STEPPED, FASTEST, SCALE = range(5)
"""Tally of a case: counts, the largest impact speed, the displacement scale."""


SAME_TIME = 16.0 * 2.220446049250313e-16
"""Times nearer than this share of the duration are the same: a dozen roundings of sums of steps."""

LATE = 1e-9
"""Samples are due at the end up to this share of the duration, as far as it may miss their multiple."""

FIRST_STEP = 0.1
"""First step tried after an event, in times of the fastest pole; longer ones follow if it is clear."""


@rare
def _side(regime: Layout, load: Load, heat_shape: Array, firsts: int, tables: Tables) -> Any:
    """Prepare a regime for a case."""
    r = respond(regime, load, heat_shape, firsts, tables)
    x, m = Expansion(tables.sums, tables.terms, tables.derivatives), tables.motion
    return Side(r, x, m[0], m[1], m[2], tables.coordinates[0])


@part
def _change(matrix: Array, gap: float, source: Array, target: Array) -> None:
    """Fill target = [source, gap] · matrix; what cannot act has rows that are not read."""
    last = matrix.shape[0] - 1
    for i in range(target.size):
        target[i] = matrix[last, i] * gap
    for j in range(source.size):
        for i in range(target.size):
            target[i] += source[j] * matrix[j, i]


@part
def _state(flight: Side, hold: Side, holding: bool, held: Layout, gap: float, t: float) -> None:
    """Fill the flight's coordinates, the raw ones, with the present state."""
    if holding:
        store_motion(hold.r, hold.now, t, hold.coordinates)
        _change(held.leave, gap, hold.coordinates, flight.coordinates)
    else:
        store_motion(flight.r, flight.now, t, flight.coordinates)


@part
def _impact(
    flight: Side, tip: Tip, thresholds: Thresholds, tally: Array, watch: Watch, log: Log, t: float, speed: float
) -> tuple[bool, float]:
    """Strike with a speed; return whether the tip stays, and since when it rests if it does."""
    n = flight.r.blocks
    p = (1.0 + tip.e) * speed / tip.mobility
    tally[FASTEST] = max(tally[FASTEST], speed)
    strike(flight.r, tip.shape, flight.now, p, tip.alpha * p)
    expand(flight.r, flight.now, t, flight.x)
    pressing = -flight.x.sums[S2, n]
    stays, rest = speed <= 0.0 or tip.e == 0.0, t
    if (
        not stays
        and tip.e < 1.0
        and pressing > 0.0
        and speed < thresholds.speed * tally[FASTEST]
        and speed * speed < 2.0 * pressing * thresholds.excursion * tally[SCALE]
    ):  # accumulated: p and what all later impacts would add is m v⁻ and the contact force
        stays = True
        rest = t + 2.0 * tip.e * speed / (pressing * (1.0 - tip.e))
        more = speed / tip.mobility - p
        strike(flight.r, tip.shape, flight.now, more, tip.alpha * more)
        p += more
    if speed > 0.0:
        tally[IMPACTS] += 1.0
        watch.totals[IMPULSE] += p
        if log.held.size > 0:
            log.totals[SPENT] += p * (speed - 0.5 * p * tip.mobility)
    return stays, rest


@part
def _enter(flight: Side, hold: Side, held: Layout, gap: float, share: float, t: float) -> int:
    """Take the state over into contact; return the zeros of its force at t, or -1 where nothing presses."""
    n = hold.r.blocks
    store_motion(flight.r, flight.now, t, flight.coordinates)
    _change(held.enter, gap, flight.coordinates, hold.coordinates)
    load_motion(hold.r, hold.coordinates, t, hold.now)
    expand(hold.r, hold.now, t, hold.x)
    force, rate = hold.x.sums[S0, n], hold.x.sums[S1, n]
    nothing = share * ROUNDING * hold.x.sums[SIZE, 0]
    if force > nothing:
        return 0
    return 1 if force >= -nothing and rate > 0.0 else -1


@part
def _release(flight: Side, hold: Side, held: Layout, gap: float, tally: Array, watch: Watch, t: float) -> None:
    """Take the state over into flight."""
    tally[RELEASES] += 1.0
    _state(flight, hold, True, held, gap, t)
    load_motion(flight.r, flight.coordinates, t, flight.now)
    watch.totals[CONTACT] += max(0.0, t - watch.totals[SINCE])
    watch.totals[SINCE] = np.inf


@rare
def _begin(flight: Side, hold: Side, holding: bool, held: Layout, gap: float, log: Log, t: float) -> bool:
    """Log the phase that begins; return whether there was room for it."""
    if log.totals[COUNT] >= log.held.size:
        return False
    if holding and log.hidden:
        begin_phase(log, flight.coordinates, t, True)
        _change(held.leave, gap, hold.coordinates, log.final)
        let_go(log, flight.coordinates, log.final)
    elif holding:
        begin_phase(log, flight.coordinates, t, True)
    else:
        _state(flight, hold, False, held, gap, t)
        begin_phase(log, flight.coordinates, t, False)
    return True


@part
def _move(
    side: Side,
    holding: bool,
    record: Record,
    watch: Watch,
    gap: float,
    t: float,
    T: float,
    zeros: int,
    known_speed: float,
    expanded: bool,
    guess: float,
    seen: tuple[float, float, float, float],
) -> tuple[float, bool, tuple[float, float, float, float]]:
    """Take a certified step; return its length (NaN if there is none), whether an event ends it, what is seen."""
    tolerance = SAME_TIME * T
    if not expanded:
        expand(side.r, side.now, t, side.x)
    h, event = certified_step(side.r, side.x, side.now, t, T, zeros, known_speed, guess, tolerance, side.spare)
    if not np.isfinite(h):
        return h, False, seen
    advance(side.r, side.now, t, h, side.after)
    area = integral(side.r, side.now, side.after, t, h) if holding else 0.0
    after = observe(side.r, side.after, t + h)
    see(record, watch, side.r, holding, gap, side.now, t, h, seen, after, tolerance, side.spare)
    copy_motion(side.after, side.now)
    watch.totals[IMPULSE] += area
    return h, event, after


@rare
def _finish(
    record: Record,
    watch: Watch,
    gap: float,
    holding: bool,
    T: float,
    seen: tuple[float, float, float, float],
    closing: Array,
    state: Array,
) -> None:
    """Write what falls due at the end, after any event there."""
    while next_due(record, watch) <= T * (1.0 + LATE):
        write(record, watch, gap, holding, T, seen, watch.totals[IMPULSE])
    grown = 0.0
    for j in range(closing.size):
        grown += closing[j] * state[state.size - closing.size + j]
    record.counts[1] = contact_time(watch, T)
    record.counts[2] = watch.totals[HOTTEST]
    record.counts[3] = grown


@uncounted
def march(
    free: Layout,
    held: Layout,
    load: Load,
    tip: Tip,
    raw: Array,
    record: Record,
    watch: Watch,
    closing: Array,
    budget: Budget,
    thresholds: Thresholds,
    flying: Tables,
    resting: Tables,
    log: Log,
) -> int:
    """Run one case and return how it ended; never raises.

    ``raw`` holds the initial [y, y', τ], with no τ where no heat can act.
    """
    firsts = flying.coordinates.shape[1] - 2 * free.block.shape[1]
    held_firsts = resting.coordinates.shape[1] - 2 * held.block.shape[1]
    flight = _side(free, load, tip.heat_shape, firsts, flying)
    hold = _side(held, load, tip.heat_shape, held_firsts, resting)
    audited = log.held.size > 0
    tally = watch.tally
    T, gap, t = load.duration, load.gap, 0.0
    load_motion(flight.r, raw, t, flight.now)
    seen = observe(flight.r, flight.now, t)
    if not (np.isfinite(seen[0]) and np.isfinite(seen[1]) and np.isfinite(seen[2])):
        return NOT_FINITE
    watch.totals[SINCE] = np.inf
    watch.totals[HOTTEST] = watch.totals[PERIOD_HOTTEST] = seen[2]
    write(record, watch, gap, False, 0.0, (tip.distance, -tip.speed, seen[2], 0.0), 0.0)
    expand(flight.r, flight.now, t, flight.x)
    tally[SCALE] = abs(gap) + abs(gap - tip.distance)
    touching = abs(tip.distance) <= 4.0 * ROUNDING * (tally[SCALE] + flight.x.sums[SIZE, 0])
    if tip.distance < 0.0 and not touching:
        return BEYOND
    if audited:
        begin_phase(log, raw, 0.0, False)
    holding, expanded, event, zeros, speed = False, False, False, 0, 0.0
    if touching:
        event, speed = tip.speed >= 0.0, tip.speed
        zeros = 2 if event else 1
    guess, known_speed = T, -1.0
    events = 0
    warming = 0.0
    for j in range(firsts):
        warming += tip.heat_shape[j] ** 2
    ended = DONE
    side = flight
    while True:
        if event:
            event = False
            events += 1
            if events > budget.events:
                ended = EVENTS
                break
            if holding:
                _release(flight, hold, held, gap, tally, watch, t)
                side, holding, zeros, expanded = flight, False, 3, False
                seen = observe(flight.r, flight.now, t)
            else:
                before = watch.totals[IMPULSE]
                stays, rest = _impact(flight, tip, thresholds, tally, watch, log, t, speed)
                zeros, known_speed, expanded = 1, tip.e * speed, True
                if speed > 0.0:
                    seen = (0.0, known_speed, seen[2], 0.0)
                    if firsts > 0:
                        p = watch.totals[IMPULSE] - before
                        seen = (0.0, known_speed, seen[2] + tip.alpha * p * warming, heating_rate(flight.r, flight.now))
                        heat_seen(watch, seen[2])
                if stays:
                    pressed = _enter(flight, hold, held, gap, thresholds.force, t)
                    holding = pressed >= 0
                    zeros, known_speed, expanded = pressed if holding else 2, -1.0, holding
                    if holding:
                        side = hold
                        watch.totals[SINCE] = rest
                        seen = observe(hold.r, hold.now, t)
            if audited and not _begin(flight, hold, holding, held, gap, log, t):
                ended = FULL
                break
            guess = FIRST_STEP / flight.r.fastest if flight.r.fastest > 0.0 else T
        if t >= T:
            break
        tally[STEPPED] += 1.0
        if tally[STEPPED] > budget.steps:
            ended = STEPS
            break
        h, event, seen = _move(side, holding, record, watch, gap, t, T, zeros, known_speed, expanded, guess, seen)
        if not holding:
            tally[SCALE] = max(tally[SCALE], abs(gap - seen[0]))
            if event:
                speed = -seen[1]
                event = speed > 0.0
        if not np.isfinite(h):
            ended = NOT_FINITE
            break
        t = T if h >= T - t else t + h
        zeros, known_speed, expanded = 0, -1.0, False
        guess = 2.0 * h
        if audited:
            _state(flight, hold, holding, held, gap, t)
            energy_of(log, flight.coordinates)
    record.counts[0] = tally[IMPACTS]
    if ended == DONE:
        _state(flight, hold, holding, held, gap, t)
        for i in range(log.final.size):
            log.final[i] = flight.coordinates[i]
        _finish(record, watch, gap, holding, T, seen, closing, flight.coordinates)
    else:
        record.counts[1] = tally[FASTEST] if tally[IMPACTS] == 0.0 else speed
    record.counts[4] = tally[STEPPED]
    record.counts[5] = tally[RELEASES]
    record.counts[6] = t
    return ended
