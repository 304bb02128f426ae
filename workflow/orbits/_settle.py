"""The steady rub that a transient leads to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workflow.models import Array
from workflow.orbits._flow import MOST_LOAD_PERIODS, Flow
from workflow.orbits._options import NO_CONTACT, NOT_FOUND, PERMANENT_CONTACT, RUNS_AWAY, SETTLES, Options
from workflow.orbits._orbit import Orbit, Scale, newton, scale_of, without_events
from workflow.schemes._exact.advance import Course

MOST_PERIODS = 1000
"""Common periods by which a transient is followed beyond its duration, at most."""

_CHUNK = 50
"""Periods per march: its budget of events is for these."""

_NEAR = 1e-8
"""Deviation from an orbit, over the motion, below which the transient is there."""

_EXCESS = 1000.0
"""Quasi-static tip growth over what the scene accounts for, above which a temperature has left every bound."""

_EXPONENT_PERIODS = 100
"""Periods over which the Lyapunov exponent is taken."""


@dataclass(frozen=True, eq=False)
class Settled:
    """What becomes of one case: its state, an index in ``STATES``, with an orbit where it settles."""

    state: int
    message: str = ""
    orbit: Orbit | None = None
    lyapunov: float = np.nan


def settle(flow: Flow, duration: float, options: Options) -> Settled:
    """Return what becomes of a case after its transient over ``duration`` [s]."""
    T = flow.period
    if np.isnan(T):
        return Settled(NOT_FOUND, f"the loads have no common period within {MOST_LOAD_PERIODS} load periods")
    X, contact, failure = _followed(flow, flow.start, False, int(np.ceil(duration / T - 1e-9)))
    done, window = 0, 2 * max(options.periods, 2)
    while done < MOST_PERIODS and not failure:
        courses: list[Course] = []
        while len(courses) < window and not failure:
            courses.append(flow.march(X, contact, 0.0, T, samples=16))
            X, contact, failure = courses[-1].X, courses[-1].contact, courses[-1].failure
        if not failure:
            found = _found(flow, courses, options)
            if found is not None:
                return found
            if abs(flow.growth_by_heat(X)) > _EXCESS * flow.reach:
                return Settled(
                    RUNS_AWAY, f"the temperature of the tip is {flow.parts(X)[2][-1]:.3g} K and leaves every bound"
                )
            more = min(done, MOST_PERIODS - done - window)
            X, contact, failure = _followed(flow, X, contact, more)
            done += window + more
    if failure:
        return Settled(NOT_FOUND, f"the transient {failure}")
    message = f"nothing that repeats within {options.periods} periods was found in {MOST_PERIODS} after the transient"
    return Settled(NOT_FOUND, message, None, _exponent(flow, X, contact))


def _followed(flow: Flow, X: Array, contact: bool, periods: int) -> tuple[Array, bool, str]:
    """Return state, contact and what failed after some periods."""
    while periods > 0:
        span = min(periods, _CHUNK)
        course = flow.march(X, contact, 0.0, span * flow.period, kept=0)
        X, contact, periods = course.X, course.contact, periods - span
        if course.failure:
            return X, contact, course.failure
    return X, contact, ""


def _found(flow: Flow, courses: list[Course], options: Options) -> Settled | None:
    """Return the orbit that successive periods of a transient approach, or that they run away; ``None`` for neither."""
    scale, held = scale_of(flow, courses), courses[-1].contact
    if any(course.times.size for course in courses[-3:]):
        return None if flow.is_constant else _rub(flow, courses, options, scale)
    if held and flow.held.growth > 0 and _grows(flow, courses):
        return Settled(RUNS_AWAY, f"in permanent contact deviations grow by {flow.held.growth:.4g} 1/s")
    orbit = without_events(flow, held, scale)
    if orbit is None or orbit.growth >= 0 or not _approaches(orbit, courses[-2].start, courses[-1].X, scale):
        return None
    return (
        Settled(PERMANENT_CONTACT if held else NO_CONTACT, "", orbit) if _stays(orbit, courses[-1].X, scale) else None
    )


def _rub(flow: Flow, courses: list[Course], options: Options, scale: Scale) -> Settled | None:
    """Return the rub with contact events that a transient approaches; ``None`` where none is found."""
    X, T = courses[-1].X, flow.period
    apart = [scale.size(flow, courses[-k].start - X) for k in range(1, options.periods + 1)]
    k = int(np.argmin(apart)) + 1
    number, begin = _flight(courses[-k:])
    first = courses[number - k]
    start = flow.march(first.start, first.was_held, 0.0, begin)
    orbit = newton(flow, start.X, start.contact, begin, k, scale)
    if orbit is None or orbit.growth >= 0:
        return None
    later = flow.march(start.X, start.contact, begin, 2 * k * T, kept=0)
    if not _approaches(orbit, start.X, later.X, scale):
        return None
    for order in range(1, k):
        if k % order == 0:
            least = newton(flow, orbit.course.start, orbit.course.was_held, begin, order, scale)
            if least is not None and scale.size(flow, least.course.start - orbit.course.start) < _NEAR:
                return Settled(SETTLES, "", least)
    return Settled(SETTLES, "", orbit)


def _flight(courses: list[Course]) -> tuple[int, float]:
    """Return the number of the period, and the time in it, in the middle of the longest flight within a period."""
    best, place = -1.0, (0, 0.0)
    for number, course in enumerate(courses):
        times, held = course.stretches
        flights = np.where(held, -1.0, np.diff(times))
        longest = int(np.argmax(flights))
        if flights[longest] > best:
            best, place = float(flights[longest]), (number, 0.5 * (times[longest] + times[longest + 1]))
    return place


def _approaches(orbit: Orbit, before: Array, after: Array, scale: Scale) -> bool:
    """Tell whether a transient comes nearer to an orbit over 2kT, by about as much as its multipliers say."""
    flow, start = orbit.flow, orbit.course.start
    first, last = before - start, after - start
    away, left = scale.size(flow, first), scale.size(flow, last)
    change = orbit.D @ (orbit.D @ first) - first
    error = orbit.D @ (last - first - change)  # over one more map: what decays at once does not count
    by_rule = scale.size(flow, error) <= 0.5 * scale.size(flow, orbit.D @ change)
    return max(away, left) < _NEAR or (left < away and by_rule)


def _stays(orbit: Orbit, X: Array, scale: Scale) -> bool:
    """Tell whether a transient that decays towards an orbit without events meets none in periods ever further apart."""
    flow, course, number = orbit.flow, orbit.course, 1
    regime, deviation = flow.held if course.was_held else flow.free, X - course.start
    while scale.size(flow, deviation) > _NEAR:
        if flow.march(course.start + deviation, course.was_held, 0.0, flow.period).times.size:
            return False
        deviation = regime.propagators(np.array([number * flow.period]))[0] @ (X - course.start)
        number += 1 + number // 8
    return True


def _grows(flow: Flow, courses: list[Course]) -> bool:
    """Tell whether the tip warms more from each of the last periods to the next."""
    ends = [flow.parts(course.X)[2][-1] for course in courses[-4:]]
    warming = np.diff(ends)
    return bool(warming[0] > 0 and np.all(np.diff(warming) > 0))


def _exponent(flow: Flow, X: Array, contact: bool) -> float:
    """Return the largest Lyapunov exponent over the next periods, 1/s, the first fifth of them left out."""
    deviation, grown = np.ones(X.size), 0.0
    for number in range(_EXPONENT_PERIODS):
        course = flow.march(X, contact, 0.0, flow.period)
        deviation = flow.derivative(course) @ deviation
        size = float(np.linalg.norm(deviation))
        if not size > 0 or course.failure:
            return np.nan if course.failure else -np.inf
        X, contact, deviation = course.X, course.contact, deviation / size
        grown += np.log(size) if number >= _EXPONENT_PERIODS // 5 else 0.0
    return float(grown / (0.8 * _EXPONENT_PERIODS * flow.period))
