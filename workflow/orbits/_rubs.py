"""Steady rubs of a batch: the variables of an archive."""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases, Structure
from workflow.orbits._flow import BUDGET, Flow
from workflow.orbits._options import STATES, Options
from workflow.orbits._orbit import Orbit
from workflow.orbits._settle import Settled, settle
from workflow.schemes._exact.advance import Course
from workflow.schemes._exact.batch import make_operator
from workflow.schemes._exact.held_regime import HeldRegimes

NUMBERS = (
    *("steady_periods", "steady_residual", "floquet_multiplier", "floquet_angle", "settling_time", "lyapunov"),
    *("steady_impulse", "steady_impacts", "steady_contact", "steady_max_temperature", "steady_mean_temperature"),
    *("steady_max_displacement", "steady_min_displacement", "steady_closing"),
)
"""Variables of a steady rub beside its state and its samples."""

ORBITS = ("orbit_displacement", "orbit_velocity", "orbit_temperature")

_PER_TURN = 16
"""Samples per period of the fastest mode between which extremes are taken of cubics: their error is 1e-4 of what that
mode moves; fewer where that were more than :data:`_MOST_SAMPLES`."""

_MOST_SAMPLES = 4096


def steady_rubs(
    structure: Structure, cases: Cases, duration: float, options: Options
) -> tuple[dict[str, Array], list[str]]:
    """Return the steady rubs to which the transients of cases lead, and a message for each.

    Each transient lasts ``duration`` [s], completed to a whole number of common periods T, and at most 1 000 T more.
    Variables, ``(case,)``: ``steady_state`` (int8, index in :data:`~workflow.orbits.STATES`), ``steady_periods`` k,
    ``steady_residual``, ``floquet_multiplier`` (largest modulus), ``floquet_angle`` [rad], ``settling_time`` [s],
    ``lyapunov`` [1/s]; over kT, divided by k, ``steady_impulse`` [N s], ``steady_impacts``, ``steady_contact`` [s]
    (under constant loads per second); extremes and means over kT ``steady_max_temperature``,
    ``steady_mean_temperature`` [K], ``steady_max_displacement``, ``steady_min_displacement``, ``steady_closing`` (mean
    quasi-static growth) [m]. Of the tip at s kT/samples from the start of a period, ``(case, samples)``:
    ``orbit_displacement`` [m], ``orbit_velocity`` [m/s], ``orbit_temperature`` [K]; under constant loads all samples
    are the equilibrium. NaN where there is no steady rub. A message is '' or begins with ``steady:``.
    """
    operator, values, messages = make_operator(structure, BUDGET), blank(cases.count, options.samples), []
    regimes = HeldRegimes(operator.basis.held)
    for i in range(cases.count):
        settled = settle(Flow(operator, regimes, cases.take(slice(i, i + 1)), duration), duration, options)
        fill(values, i, settled)
        messages.append(f"steady: {settled.message}" if settled.message else "")
    return values, messages


def blank(count: int, samples: int) -> dict[str, Array]:
    """Return all variables of cases, or points, without any steady rub."""
    values: dict[str, Array] = {"steady_state": np.full(count, STATES.index("not_found"), dtype=np.int8)}
    values |= {name: np.full(count, np.nan) for name in NUMBERS}
    return values | {name: np.full((count, samples), np.nan) for name in ORBITS}


def fill(values: dict[str, Array], i: int, settled: Settled) -> None:
    """Fill in the variables of one case."""
    values["steady_state"][i], values["lyapunov"][i] = settled.state, settled.lyapunov
    if settled.orbit is not None:
        samples = values[ORBITS[0]].shape[1]
        numbers, histories = described(settled.orbit, samples)
        for name, value in numbers.items():
            values[name][i] = value
        for name, history in zip(ORBITS, histories, strict=True):
            values[name][i] = history


def described(orbit: Orbit, samples: int) -> tuple[dict[str, float], Array]:
    """Return the numbers of an orbit, and x_n, v_n and θ_n at the samples from the start of a period."""
    flow, growth, k = orbit.flow, orbit.growth, orbit.order
    course = _from_start_of_period(orbit, samples)
    largest = orbit.multipliers[0] if not flow.is_constant else np.nan
    spans = course.span if flow.is_constant else k
    mean = _mean_state(flow, course)
    closing = flow.operator.basis.closing[: mean.size]
    low, high = _extremes(flow, course)
    contact = float(course.tally["contact_time"])
    numbers = {
        "steady_periods": np.nan if flow.is_constant else k,
        "steady_residual": orbit.residual,
        "floquet_multiplier": abs(largest),
        "floquet_angle": abs(np.angle(largest)) if not flow.is_constant else np.nan,
        "settling_time": -1 / growth if growth < 0 else np.inf,
        "steady_impulse": course.tally["impulse"] / spans,
        "steady_impacts": course.tally["impacts"] / spans,
        "steady_contact": contact / spans,
        "steady_max_temperature": course.tally["max_temperature"],
        "steady_mean_temperature": flow.operator.basis.free.heat_tip[: mean.size] @ mean,
        "steady_max_displacement": high,
        "steady_min_displacement": low,
        "steady_closing": closing @ mean,
    }
    step = (course.histories.shape[1] - 1) // samples
    return numbers, course.histories[:3, :-1:step]


def _from_start_of_period(orbit: Orbit, samples: int) -> Course:
    """Return the orbit over kT from the start of a period, with a multiple of the samples."""
    flow, first = orbit.flow, orbit.course
    start, held = first.start, first.was_held
    if first.begin > 0:
        rest = flow.march(start, held, first.begin, flow.period - first.begin)
        start, held = rest.X, rest.contact
    turns = first.span * flow.operator.basis.free.frequency.max(initial=0.0) / (2 * np.pi)
    per_sample = int(np.ceil(min(max(_PER_TURN * turns, samples), _MOST_SAMPLES) / samples))
    return flow.march(start, held, 0.0, first.span, samples=per_sample * samples)


def _mean_state(flow: Flow, course: Course) -> Array:
    """Return the mean of τ over a course that repeats: heat in is heat out, µ τ = χᵀq + α χ_n λ."""
    free, size = flow.operator.basis.free, course.start.size - 2 * flow.modes
    sources = (
        free.heat_shapes.T @ flow.load.heating + flow.alpha * free.heat_tip * course.tally["impulse"] / course.span
    )
    kept = course.start[2 * flow.modes :].copy()  # of a mode that loses no heat
    np.divide(sources[:size], free.rate[:size], out=kept, where=free.rate[:size] > 0)
    return kept


def _extremes(flow: Flow, course: Course) -> tuple[float, float]:
    """Return the smallest and the largest tip displacement: of samples, events and cubics between samples."""
    x, v = course.histories[:2]
    h = course.span / (x.size - 1)
    turning = np.flatnonzero(v[:-1] * v[1:] < 0)
    turning = turning[~np.isin(turning, (course.times / h).astype(int))]
    share = v[turning] / (v[turning] - v[turning + 1])
    top = x[turning] + h * share * (v[turning] * (1 - share) ** 2 - v[turning + 1] * (1 - share) * share)
    bend = (x[turning + 1] - x[turning]) * share**2 * (3 - 2 * share)
    values = np.concatenate([x, top + bend, course.states @ flow.tip[0]])
    return float(values.min()), float(values.max())
