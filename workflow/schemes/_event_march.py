"""From contact event to contact event: one case of the event-driven scheme, start to end."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workflow.models import Array
from workflow.schemes._event_balance import FINAL, FIRST, SPENT, Ledger, begin_phase, energy_of, let_go, settle
from workflow.schemes._event_motion import ORDER, TAYLOR_SPAN, advance, heating_rate, observe, strike
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
from workflow.schemes._event_regimes import Regime
from workflow.schemes._event_response import (
    Load,
    Response,
    copy_motion,
    load_motion,
    new_motion,
    respond,
    store_motion,
)
from workflow.schemes._event_search import (
    ROUNDING,
    S0,
    S1,
    S2,
    S3,
    SIZE,
    Expansion,
    expand,
    falls_through,
    longest_clear,
    new_expansion,
    polish,
    short_flight,
)
from workflow.schemes._kernel import kernel

DONE, EVENTS, STEPS, BEYOND, NOT_FINITE = 0, 1, 2, 3, 4
"""How a case ended: to the end, by a budget, tip beyond the gap at the start, numbers overflowed."""


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
    """Contact law and impact data of one case."""

    e: float
    alpha: float
    mobility: float
    """e_nᵀ M⁻¹ e_n, 1/kg: the Delassus operator of an impact."""
    shape: Array
    """φ_n, ``(mode,)``."""
    heat_shape: Array
    """χ_n, ``(thermal mode,)``."""


@kernel
def _change(matrix: Array, per_gap: Array, gap: float, source: Array, inputs: int, outputs: int, target: Array) -> None:
    """Fill target = source · matrix + gap · per_gap."""
    for i in range(outputs):
        target[i] = per_gap[i] * gap
    for j in range(inputs):
        for i in range(outputs):
            target[i] += source[j] * matrix[j, i]


@kernel
def march(
    free: Regime,
    held: Regime,
    load: Load,
    tip: Tip,
    raw: Array,
    start_gap: float,
    start_speed: float,
    firsts: int,
    record: Record,
    closing: Array,
    max_events: int,
    max_steps: int,
    thresholds: Thresholds,
    ledger: Ledger,
) -> int:
    """Run one case and return how it ended; never raises.

    ``raw`` holds the initial [y, y', τ]; ``firsts`` is 0 where no thermal state can act.
    """
    modes = free.damping.size
    held_blocks = held.damping.size
    held_firsts = held.rate.size if firsts > 0 else 0
    free_size, held_size = 2 * modes + firsts, 2 * held_blocks + held_firsts
    r_free = respond(free, load, tip.heat_shape, firsts)
    r_held = respond(held, load, tip.heat_shape, held_firsts)
    in_flight, after_flight, spare_flight = new_motion(r_free), new_motion(r_free), new_motion(r_free)
    in_hold, after_hold, spare_hold = new_motion(r_held), new_motion(r_held), new_motion(r_held)
    x_free, x_held = new_expansion(r_free), new_expansion(r_held)
    coordinates, held_coordinates = np.zeros(free_size), np.zeros(held_size)
    derivatives = np.zeros(ORDER + 1)
    watch = Watch(np.zeros(2, dtype=np.int64), np.zeros(7))
    watch.totals[SINCE] = np.inf
    T, gap = load.duration, load.gap
    tolerance = 16.0 * 2.220446049250313e-16 * T

    t = 0.0
    load_motion(r_free, raw[:free_size], t, in_flight)
    seen = observe(r_free, in_flight, t)
    if not (np.isfinite(seen[0]) and np.isfinite(seen[1]) and np.isfinite(seen[2])):
        return NOT_FINITE
    first_seen = (start_gap, -start_speed, seen[2], 0.0)
    watch.totals[HOTTEST] = watch.totals[PERIOD_HOTTEST] = seen[2]
    write(record, watch, gap, False, 0.0, first_seen, 0.0)
    expand(r_free, in_flight, t, x_free)
    scale = abs(gap) + abs(gap - start_gap)
    touching = abs(start_gap) <= 4.0 * ROUNDING * (scale + x_free.sums[SIZE, 0])
    if start_gap < 0.0 and not touching:
        return BEYOND
    audited = ledger.totals.size > 0
    if audited:
        begin_phase(ledger, raw, 0.0)
        ledger.totals[FIRST] = energy_of(ledger, raw)
    holding = False
    zeros = 0
    event = False
    speed = 0.0
    if touching:
        zeros = 1 if start_speed < 0.0 else 2
        event = start_speed >= 0.0
        speed = start_speed
    guess = T
    fastest_impact = 0.0
    known_speed = -1.0
    impacts, releases, steps, events = 0, 0, 0, 0
    expanded = False
    warming = 0.0
    for j in range(firsts):
        warming += tip.heat_shape[j] ** 2
    ended = DONE
    while True:
        if event:
            event = False
            events += 1
            if events > max_events:
                ended = EVENTS
                break
            if audited:
                settle(ledger, holding, load, t)
            if holding:  # release
                releases += 1
                store_motion(r_held, in_hold, t, held_coordinates)
                _change(held.leave, held.leave_gap, gap, held_coordinates, held_size, free_size, coordinates)
                load_motion(r_free, coordinates, t, in_flight)
                watch.totals[CONTACT] += max(0.0, t - watch.totals[SINCE])
                watch.totals[SINCE] = np.inf
                holding = False
                zeros, expanded = 3, False
                seen = observe(r_free, in_flight, t)
            else:
                fastest_impact = max(fastest_impact, speed)
                p = (1.0 + tip.e) * speed / tip.mobility
                strike(r_free, tip.shape, in_flight, p, tip.alpha * p)
                expand(r_free, in_flight, t, x_free)
                zeros, known_speed, expanded = 1, tip.e * speed, True
                pressing = -x_free.sums[S2, modes]
                enter, rest = speed <= 0.0 or tip.e == 0.0, t
                if (
                    not enter
                    and tip.e < 1.0
                    and pressing > 0.0
                    and speed < thresholds.speed * fastest_impact
                    and speed * speed < 2.0 * pressing * thresholds.excursion * scale
                ):  # accumulated: p and what all later impacts would add is m v⁻ and the contact force
                    enter = True
                    rest = t + 2.0 * tip.e * speed / (pressing * (1.0 - tip.e))
                    more = speed / tip.mobility - p
                    strike(r_free, tip.shape, in_flight, more, tip.alpha * more)
                    p += more
                if speed > 0.0:
                    impacts += 1
                    if audited:
                        ledger.totals[SPENT] += p * (speed - 0.5 * p * tip.mobility)
                    watch.totals[IMPULSE] += p
                    seen = (0.0, known_speed, seen[2] + tip.alpha * p * warming, 0.0)
                    if firsts > 0:
                        # its rate after the jump
                        seen = (0.0, known_speed, seen[2], heating_rate(r_free, in_flight, t))
                        heat_seen(watch, seen[2])
                if enter:
                    zeros, known_speed, expanded = 2, -1.0, False
                    store_motion(r_free, in_flight, t, coordinates)
                    _change(held.enter, held.enter_gap, gap, coordinates, free_size, held_size, held_coordinates)
                    load_motion(r_held, held_coordinates, t, in_hold)
                    expand(r_held, in_hold, t, x_held)
                    force, rate = x_held.sums[S0, held_blocks], x_held.sums[S1, held_blocks]
                    nothing = thresholds.force * ROUNDING * x_held.sums[SIZE, 0]
                    if force > nothing or (force >= -nothing and rate > 0.0):
                        holding, expanded = True, True
                        zeros = 0 if force > nothing else 1
                        watch.totals[SINCE] = rest
                        seen = observe(r_held, in_hold, t)
            if audited:
                if not holding:
                    store_motion(r_free, in_flight, t, coordinates)
                begin_phase(ledger, coordinates, t)
                if holding and ledger.hidden:
                    _change(held.leave, held.leave_gap, gap, held_coordinates, held_size, free_size, ledger.final)
                    let_go(ledger, coordinates, ledger.final)
            guess = 0.1 / r_free.fastest if r_free.fastest > 0.0 else T
        if t >= T:
            break
        steps += 1
        if steps > max_steps:
            ended = STEPS
            break
        if holding:
            if not expanded:
                expand(r_held, in_hold, t, x_held)
            h, event = _step(r_held, x_held, in_hold, t, T, zeros, -1.0, guess, tolerance, spare_hold, derivatives)
            if not np.isfinite(h):
                ended = NOT_FINITE
                break
            area = advance(r_held, in_hold, t, h, after_hold, True)
            after = observe(r_held, after_hold, t + h)
            see(record, watch, r_held, True, gap, in_hold, t, h, seen, after, area, tolerance, spare_hold)
            copy_motion(after_hold, in_hold)
            watch.totals[IMPULSE] += area
        else:
            if not expanded:
                expand(r_free, in_flight, t, x_free)
            h, event = _step(
                r_free, x_free, in_flight, t, T, zeros, known_speed, guess, tolerance, spare_flight, derivatives
            )
            if not np.isfinite(h):
                ended = NOT_FINITE
                break
            advance(r_free, in_flight, t, h, after_flight, False)
            after = observe(r_free, after_flight, t + h)
            see(record, watch, r_free, False, gap, in_flight, t, h, seen, after, 0.0, tolerance, spare_flight)
            copy_motion(after_flight, in_flight)
            scale = max(scale, abs(gap - after[0]))
            if event:
                speed = -after[1]
                event = speed > 0.0
        seen = after
        t = T if h >= T - t else t + h
        zeros, known_speed, expanded = 0, -1.0, False
        guess = 2.0 * h
        if audited:
            if holding:
                store_motion(r_held, in_hold, t, held_coordinates)
                _change(held.leave, held.leave_gap, gap, held_coordinates, held_size, free_size, coordinates)
            else:
                store_motion(r_free, in_flight, t, coordinates)
            energy_of(ledger, coordinates)
    # what falls due at the end, after any event there
    if ended == DONE:
        while next_due(record, watch) <= T * (1.0 + 1e-9):
            write(record, watch, gap, holding, T, seen, watch.totals[IMPULSE])
        if holding:
            store_motion(r_held, in_hold, t, held_coordinates)
            _change(held.leave, held.leave_gap, gap, held_coordinates, held_size, free_size, coordinates)
        else:
            store_motion(r_free, in_flight, t, coordinates)
        if audited:
            settle(ledger, holding, load, t)
            ledger.totals[FINAL] = energy_of(ledger, coordinates)
            ledger.final[:] = coordinates
        grown = 0.0
        for j in range(firsts):
            grown += closing[j] * coordinates[2 * modes + j]
        record.counts[0] = impacts
        record.counts[1] = contact_time(watch, T)
        record.counts[2] = watch.totals[HOTTEST]
        record.counts[3] = grown
    else:
        record.counts[0], record.counts[1] = impacts, fastest_impact if impacts == 0 else speed
    record.counts[4] = steps
    record.counts[5] = releases
    record.counts[6] = t
    return ended


@kernel
def _step(
    r: Response,
    x: Expansion,
    motion: Array,
    t: float,
    T: float,
    zeros: int,
    known_speed: float,
    guess: float,
    tolerance: float,
    scratch: Array,
    derivatives: Array,
) -> tuple[float, bool]:
    """Return a step on which the signal certainly has no zero, or one that ends at its first zero.

    ``x`` is the expansion at t and may be used up.

    ``known_speed`` is the rate with which it starts from zero where that is known (negative: not).
    """
    n = r.blocks
    left = T - t
    if not np.isfinite(x.sums[SIZE, 0]):
        return np.nan, False
    if known_speed >= 0.0:
        x.sums[S1, n] = known_speed
    leading = x.sums[S1, n] if zeros == 1 else x.sums[S2, n] if zeros == 2 else x.sums[S3, n]
    if zeros > 0 and leading <= 0.0:
        zeros = 0
    if zeros == 0 and x.sums[S0, n] <= 0.0 and x.sums[S1, n] < 0.0:
        return 0.0, True
    around, end = falls_through(r, x, zeros, left)
    if end > 0.0:
        if zeros == 1 and r.fastest * end <= TAYLOR_SPAN:
            h = short_flight(r, motion, t, x.sums[S1, n], around, x, derivatives)
        else:
            h = polish(r, motion, t, around, end, scratch, x)
        return (left, False) if h > left + tolerance else (min(h, left), True)
    h = longest_clear(r, x, zeros, guess, left)
    return (h, False) if h > 0.0 else (np.nan, False)
