"""Steady rubs of a batch: the variables of an archive."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from workflow.models import Array, Cases, Structure
from workflow.orbits._flow import AnalysedStructure, Flow
from workflow.orbits._orbit import Orbit
from workflow.orbits._settle import Options, Settled, settle
from workflow.schemes.event_driven import Trajectory
from workflow.variables import select

_PER_TURN = 16
"""Samples per period of the fastest mode between which extremes are those of cubics, with an error of 1e-4 of that
mode's motion; fewer where they would be more than :data:`_MOST_SAMPLES`."""

_MOST_SAMPLES = 4096


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
    shared, each = AnalysedStructure(structure), [cases.take(slice(i, i + 1)) for i in range(cases.count)]
    found = [settle(Flow(shared, case), options) for case in each]
    messages = [f"steady: {one.message}" if one.message else "" for one in found]
    return tabulated(found, options.samples, structure), messages


def tabulated(found: Sequence[Settled], samples: int, structure: Structure) -> dict[str, Array]:
    """Return the variables of the outcomes of cases, or of points of a branch; NaN where there is no steady rub."""
    sensors, contacts = structure.sensor_count, structure.contacts.count
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
    if flow.operator.sensors is not None:
        sensed = flow.operator.sensors.with_contacts(sensed[None], (x + offset[:, None])[None])[0]
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
