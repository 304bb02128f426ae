"""The steady rubs to which transients lead, and the variables of an archive."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import eigenvalues
from workflow.models import Array, Cases, Structure
from workflow.orbits._flow import MOST_LOAD_PERIODS, Flow, analysed
from workflow.orbits._orbit import NOT_FOUND, RUNS_AWAY, Orbit, longest, newton, scale_of, without_events
from workflow.schemes.event_driven import Trajectory, growth, propagators
from workflow.variables import select

MOST_PERIODS = 1000
"""Common periods after which the search in a transient ends."""

_NEAR = 1e-8
"""Deviation from an orbit, over the motion, up to which the transient has reached it."""

_EXCESS = 1000.0
"""Quasi-static tip growth, over the length accounted for by the scene, above which the temperature runs away."""

_BALANCES, _BETWEEN = 30, 50
"""Largest number of heat balances of a transient, and periods between two of them."""

_EXPONENT_PERIODS = 400
"""Periods of the mean of the Lyapunov exponent: over fewer that of chaotic motion scatters more."""


_PER_TURN = 16
"""Samples per period of the fastest mode between which extremes are those of cubics, with an error of 1e-4 of that
mode's motion; fewer where they would be more than :data:`_MOST_SAMPLES`."""

_MOST_SAMPLES = 4096


@dataclass(frozen=True)
class Options:
    """Options of the search for steady rubs."""

    periods: int = 4
    """Largest order k."""
    samples: int = 100
    """Samples of an orbit over kT, the first at its start, the last before its end."""

    @property
    def window(self) -> int:
        """Number of last periods that are kept one by one."""
        return 2 * max(self.periods, 2)


@dataclass(frozen=True, eq=False)
class Settled:
    """Outcome of one case: its state, an index in ``STATES``, with an orbit where it settles."""

    state: int
    message: str = ""
    orbit: Orbit | None = None
    lyapunov: float = np.nan


class _StoppedError(Exception):
    """A transient ended early."""


def settle(flow: Flow, options: Options) -> Settled:
    """Return the outcome of a case after its transient."""
    if np.isnan(flow.period):
        return Settled(NOT_FOUND, f"the loads have no common period within {MOST_LOAD_PERIODS} load periods")
    X, closed, done = flow.start, flow.all_open, 0
    try:
        while done < MOST_PERIODS:
            more = min(max(done, options.window), MOST_PERIODS - done)
            motions = _periods(flow, X, closed, more, options.window)
            X, closed, found = motions[-1].X, motions[-1].closed, _found(flow, motions, options)
            if found is not None:
                return found
            done += more + options.window
    except _StoppedError as stopped:
        return Settled(NOT_FOUND, f"the transient {stopped}")
    found = _by_balance(flow, motions, options) if flow.is_heated else None
    if found is not None:
        return found
    message = f"no rub that repeats within {options.periods} periods of the loads was found in {MOST_PERIODS} of them"
    return Settled(NOT_FOUND, message, None, _exponent(flow, X, closed))


def _by_balance(flow: Flow, transient: list[Trajectory], options: Options) -> Settled | None:
    """Return the outcome of a transient whose temperatures change slowly over the periods that were run.

    Its temperatures are replaced repeatedly by those in balance with the mean contact force of some periods. The result
    is accepted where the transient itself approaches it.
    """
    motions = transient
    for _ in range(_BALANCES):
        force = np.mean([motion.tally["impulse"] for motion in motions], axis=0) / flow.period
        try:
            X = flow.balanced(motions[-1].X, force)
            motions = _periods(flow, X, motions[-1].closed, _BETWEEN, options.window)
        except _StoppedError:
            return None
        found = _found(flow, motions, options)
        if found is not None:
            return found if _leads_to(flow, transient, found.orbit) else None
    return None


def _leads_to(flow: Flow, transient: list[Trajectory], orbit: Orbit | None) -> bool:
    """Tell whether the temperatures of a transient approach those of an orbit; without one, whether they grow."""
    first, last = transient[0].start, transient[-1].X
    if orbit is None:
        return bool(flow.warmth(last).max() > flow.warmth(first).max())
    kept = flow.balanced(last, orbit.motion.tally["impulse"] / orbit.motion.span)
    away, left = (float(np.abs(flow.parts(X - kept)[2]).max()) for X in (first, last))
    return left < away


def _periods(flow: Flow, X: Array, closed: NDArray[np.bool_], passed: int, count: int) -> list[Trajectory]:
    """Return ``count`` periods of the motion from X at the start of a period, after ``passed`` others."""
    motions: deque[Trajectory] = deque(maxlen=count)
    for _ in range(passed + count):
        motion = flow.march(X, closed, 0.0, flow.period, samples=16)
        if motion.failure:
            raise _StoppedError(motion.failure)
        motions.append(motion)
        X, closed = motion.X, motion.closed
    return list(motions)


def _found(flow: Flow, motions: list[Trajectory], options: Options) -> Settled | None:
    """Return the orbit that the periods of a transient approach, or that it runs away; ``None`` for neither."""
    scale, closed, X = scale_of(flow, motions), motions[-1].closed, motions[-1].X
    if any(motion.times.size for motion in motions[-3:]):
        found = None if flow.is_constant else _rub(flow, motions, options, scale)
        if found is not None:
            return found
    elif closed.any() and (rate := growth(flow.one.set_of(closed))) > 0:
        if _grows_in_contact(flow, X, closed):
            return Settled(RUNS_AWAY, f"in permanent contact deviations grow by {rate:.4g} 1/s")
    else:
        orbit = without_events(flow, closed, scale)
        if orbit is not None and _comes_to(orbit, X, scale):
            return Settled(orbit.state, "", orbit)
    if np.abs(flow.growth_by_heat(X)).max() > _EXCESS * flow.reach:
        return Settled(RUNS_AWAY, "the temperature of the tip grows without bound")
    return None


def _rub(flow: Flow, motions: list[Trajectory], options: Options, scale: Array) -> Settled | None:
    """Return the rub with contact events that a transient approaches; ``None`` where none is found."""
    apart = [flow.size(motions[-k].start - motions[-1].X, scale) for k in range(1, options.periods + 1)]
    k = int(np.argmin(apart)) + 1
    last = flow.march(motions[-k].start, motions[-k].was_closed, 0.0, k * flow.period)
    begin = longest(last, flights=True)
    start = flow.march(last.start, last.was_closed, 0.0, begin)
    orbit = newton(flow, start.X, start.closed, begin, k, scale)
    if orbit is None:
        return None
    if not _comes_to(orbit, start.X, scale):
        return None
    for order in range(1, k):
        at = orbit.motion.start, orbit.motion.was_closed, begin
        least = newton(flow, *at, order, scale) if k % order == 0 else None
        if least is not None and flow.size(least.motion.start - orbit.motion.start, scale) < _NEAR:
            orbit = least
            break
    return Settled(orbit.state, _without_multipliers(orbit), orbit)


def _without_multipliers(orbit: Orbit) -> str:
    """Return why an orbit has no multipliers; empty where it has."""
    names = ", ".join(np.array(orbit.flow.structure.contacts.labels)[orbit.corner])
    at_once = "strike at the same instant and act on each other: the rub has no Floquet multipliers"
    return f"contacts {names} {at_once}" if names else ""


def _comes_to(orbit: Orbit, X: Array, scale: Array) -> bool:
    """Tell whether a transient in X comes to a stable orbit: the one place where an orbit is accepted.

    At growing distances along the decay D^n (X - X*) that the orbit predicts, kT of the motion must change a deviation
    by about as much as D, and must have no events where the orbit has none.
    """
    flow, motion, number = orbit.flow, orbit.motion, 0
    deviation = X - motion.start
    if not orbit.growth < 0:
        return False
    while flow.size(deviation, scale) > _NEAR:
        after = flow.march(motion.start + deviation, motion.was_closed, motion.begin, motion.span)
        change = orbit.D @ deviation - deviation
        error = orbit.D @ (after.X - motion.start - deviation - change)  # after one more map: fast decays do not count
        if not flow.size(error, scale) <= 0.5 * flow.size(orbit.D @ change, scale):
            return False
        if after.times.size and not motion.times.size:
            return False
        deviation = np.linalg.matrix_power(orbit.D, 1 + number // 8) @ deviation
        number += 1 + number // 8
    return True


def _grows_in_contact(flow: Flow, X: Array, closed: NDArray[np.bool_]) -> bool:
    """Tell whether contacts stay closed, in periods at growing distances, until they have left every bound.

    The fastest growth must be real: a flutter lifts the tip.
    """
    poles = eigenvalues(flow.motion_in(closed).A)
    if poles[np.argmax(poles.real)].imag != 0:
        return False
    try:
        rest, _ = flow.motion_in(closed).steady()
    except np.linalg.LinAlgError:
        return False
    number, deviation = 1, X - rest
    while np.abs(flow.growth_by_heat(rest + deviation)).max() < _EXCESS * flow.reach:
        motion = flow.march(rest + deviation, closed, 0.0, flow.period)
        if motion.times.size or motion.failure:
            return False
        deviation = propagators(flow.one.set_of(closed), np.array([number * flow.period]))[0] @ (X - rest)
        number += 1 + number // 8
    return True


def _exponent(flow: Flow, X: Array, closed: NDArray[np.bool_]) -> float:
    """Return the largest Lyapunov exponent over the next periods without their first fifth, 1/s."""
    deviation, grown = np.ones(X.size), 0.0
    for number in range(_EXPONENT_PERIODS):
        motion = flow.march(X, closed, 0.0, flow.period)
        deviation = flow.derivative(motion) @ deviation
        size = float(np.linalg.norm(deviation))
        if not size > 0 or motion.failure:
            return np.nan if motion.failure else -np.inf
        X, closed, deviation = motion.X, motion.closed, deviation / size
        grown += np.log(size) if number >= _EXPONENT_PERIODS // 5 else 0.0
    return float(grown / (0.8 * _EXPONENT_PERIODS * flow.period))


def steady_rubs(structure: Structure, cases: Cases, options: Options) -> tuple[dict[str, Array], list[str]]:
    """Return the steady rubs to which the transients of cases lead, and a message for each.

    Each transient is followed over at most 1 000 common periods T of its loads.
    Variables, ``(case,)``: ``steady_state`` (int8, index in :data:`~workflow.orbits.STATES`), ``steady_periods`` k,
    ``steady_residual``, ``floquet_multiplier`` (largest modulus), ``floquet_angle`` [rad], ``settling_time`` [s],
    ``lyapunov`` [1/s]; over kT, divided by k, ``steady_impulse`` [N s], ``steady_impacts``, ``steady_contact`` [s]
    (under constant loads per second); extremes and means over kT ``steady_max_temperature``,
    ``steady_mean_temperature`` [K], ``steady_max_displacement``, ``steady_min_displacement``, ``steady_closing`` (mean
    quasi-static growth, of several contacts the largest) [m]. Of the contact at s kT/samples from the start of a
    period, ``(case, samples)``: ``orbit_displacement`` [m], ``orbit_velocity`` [m/s], ``orbit_temperature`` [K]; under
    constant loads all samples are the equilibrium. Impulses, impacts, times in contact, temperatures, displacements and
    orbits of several contacts have ``contact`` after the case. NaN where there is no steady rub; multipliers and
    settling time too where contacts strike at once that act on each other. A message is '' or begins with ``steady:``.
    """
    shared, each = analysed(structure), [cases.take(slice(i, i + 1)) for i in range(cases.count)]
    found = [settle(Flow(shared, case), options) for case in each]
    messages = [f"steady: {one.message}" if one.message else "" for one in found]
    return tabulated(found, options.samples, structure), messages


def tabulated(found: Sequence[Settled], samples: int, structure: Structure) -> dict[str, Array]:
    """Return the variables of the outcomes of cases, or of points of a branch; NaN where there is no steady rub."""
    sensors, contacts = 0 if structure.sensors is None else len(structure.sensors.shares), structure.contacts.count
    values: dict[str, Array] = {}
    for about in select(None, None, "steady", "steady sensors" if sensors else "steady"):
        own = (sensors,) if about.is_of_sensor else (contacts,) if about.is_of_contact and contacts > 1 else ()
        values[about.name] = np.full((len(found), *own, *((samples,) if about.shape == "phase" else ())), np.nan)
    values["steady_state"] = np.array([one.state for one in found], dtype=np.int8)
    for i, one in enumerate(found):
        values["lyapunov"][i] = one.lyapunov
        for name, value in _described(one.orbit, samples).items() if one.orbit is not None else ():
            if name in values:
                values[name][i] = np.reshape(value, values[name].shape[1:])
    return values


def _described(orbit: Orbit, samples: int) -> dict[str, float | Array]:
    """Return the variables of an orbit, of all contacts along their first axis."""
    flow, growth, motion = orbit.flow, orbit.growth, _from_start_of_period(orbit, samples)
    k, largest = (np.nan, np.nan) if flow.is_constant else (orbit.order, orbit.multipliers[0])
    settling = -1 / growth if growth < 0 else np.inf
    if orbit.corner.size:
        largest, settling = np.nan, np.nan
    spans = motion.span if flow.is_constant else k
    mean = flow.balanced(motion.start, motion.tally["impulse"] / motion.span)
    x, v, temperature, _ = motion.histories
    sensed, offset = motion.sensed, flow.cases.offset[0]
    if flow.operator.structure.sensors is not None:
        sensed = flow.operator.structure.sensors.with_contacts(sensed[None], (x + offset[:, None])[None])[0]
    low, high = np.transpose([_extremes(flow, motion, contact) for contact in range(flow.contacts)])
    at = slice(None, -1, (x.shape[1] - 1) // samples)
    return {
        "steady_periods": k,
        "steady_residual": orbit.residual,
        "floquet_multiplier": abs(largest),
        "floquet_angle": abs(np.angle(largest)),
        "settling_time": settling,
        "steady_impulse": motion.tally["impulse"] / spans,
        "steady_impacts": motion.tally["impacts"] / spans,
        "steady_contact": motion.tally["contact_time"] / spans,
        "steady_max_temperature": motion.tally["max_temperature"],
        "steady_mean_temperature": flow.warmth(mean),
        "steady_max_displacement": high + offset,
        "steady_min_displacement": low + offset,
        "steady_closing": flow.growth_by_heat(mean).max(),
        "steady_sensor_max": sensed.max(axis=1),
        "steady_sensor_min": sensed.min(axis=1),
        "orbit_sensor": sensed[:, at],
        "orbit_displacement": x[:, at] + offset[:, None],
        "orbit_velocity": v[:, at],
        "orbit_temperature": temperature[:, at],
    }


def _from_start_of_period(orbit: Orbit, samples: int) -> Trajectory:
    """Return the orbit over kT from the start of a period, with a multiple of ``samples``."""
    flow, first = orbit.flow, orbit.motion
    start, closed, rest = first.start, first.was_closed, -first.begin % flow.period
    if rest > 0:
        later = flow.march(start, closed, first.begin, rest)
        start, closed = later.X, later.closed
    turns = first.span * flow.operator.basis.frequency.max(initial=0.0) / (2 * np.pi)
    per_sample = int(np.ceil(min(max(_PER_TURN * turns, samples), _MOST_SAMPLES) / samples))
    return flow.march(start, closed, 0.0, first.span, samples=per_sample * samples)


def _extremes(flow: Flow, motion: Trajectory, contact: int) -> tuple[float, float]:
    """Return the smallest and the largest displacement of a contact.

    Of samples, of its events, at which it is on its casing, and of cubics between samples.
    """
    x, v = motion.histories[:2, contact]
    h = motion.span / (x.size - 1)
    turning = np.flatnonzero(v[:-1] * v[1:] < 0)
    turning = turning[~np.isin(turning, (motion.times / h).astype(int))]
    share = v[turning] / (v[turning] - v[turning + 1])
    top = x[turning] + h * share * (v[turning] * (1 - share) ** 2 - v[turning + 1] * (1 - share) * share)
    bend = (x[turning + 1] - x[turning]) * share**2 * (3 - 2 * share)
    acts = (motion.impulses[:, contact] > 0) | np.diff(motion.sets[:, contact])
    values = np.concatenate([x, top + bend, flow.place_of(contact, motion.begin + motion.times[acts])])
    return float(values.min()), float(values.max())
