"""The periodic rub that a transient leads to, by Newton's method on the map of whole periods."""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction
from math import lcm

import numpy as np

from workflow.kernels.algebra import Complex, eigenvalues
from workflow.models import Array, Cases, Structure
from workflow.orbits._flow import Flow, after, derivative, flow_of, states_of, vector_of
from workflow.schemes._exact.advance import Events, States, start_of
from workflow.schemes._exact.batch import Operator

SETTLES, NO_CONTACT, PERMANENT_CONTACT, UNSTABLE, RUNS_AWAY, NOT_FOUND = range(6)
"""What becomes of a rub."""

MOST_LOAD_PERIODS = 64
"""Periods of the load in the least common period of all sinusoids, at most."""


@dataclass(frozen=True)
class Options:
    """What is looked for."""

    periods: int = 4
    """Largest order k."""
    transient: int = 1000
    """Most periods of the transient."""
    residual: float = 1e-10
    """Of x, v and θ over a period, each over its own maximum."""


@dataclass(frozen=True, eq=False)
class Rub:
    """A steady rub; numbers are NaN where there is none."""

    state: int
    period: float = np.nan
    """kT, s; inf under constant loads."""
    order: int = 0
    """k"""
    residual: float = np.nan
    multipliers: Complex | None = None
    """Floquet multipliers, the largest first; none under constant loads."""
    settling_time: float = np.nan
    """-kT/ln|µ|, s; under constant loads -1/(largest real part of the eigenvalues)."""
    start: States | None = None
    """At the start of a period."""
    events: Events | None = None
    """Over kT."""
    message: str = ""


def common_period(cases: Cases) -> float:
    """Return the least common period of all sinusoids that act, s; inf without any, NaN where there is none."""
    acts = [(cases.amplitude[:, None], cases.frequency[:, None])]
    acts += [(each.amplitude, each.frequency) for each in (cases.load_harmonics, cases.casing_harmonics)]
    frequencies = np.unique(np.concatenate([f[0][(a[0] != 0) & (f[0] != 0)] for a, f in acts]))
    if frequencies.size == 0:
        return np.inf
    base = float(cases.period_frequency[0]) or float(frequencies[0])
    ratios = [Fraction(f / base).limit_denominator(MOST_LOAD_PERIODS) for f in frequencies]
    if any(abs(float(ratio) * base / f - 1) > 1e-9 for ratio, f in zip(ratios, frequencies, strict=True)):
        return np.nan
    count = lcm(*(ratio.denominator for ratio in ratios))
    return count / base if count <= MOST_LOAD_PERIODS else np.nan


def steady_rub(
    structure: Structure, operator: Operator, cases: Cases, start: States | None = None, options: Options | None = None
) -> Rub:
    """Return the steady rub that the transient of one case leads to, from ``start`` at the start of a period."""
    flow, options, T = flow_of(structure, operator, cases), options or Options(), common_period(cases)
    if np.isnan(T):
        return Rub(NOT_FOUND, message=f"no common period within {MOST_LOAD_PERIODS} load periods")
    constant = np.isinf(T)
    if constant:
        T = 2 * np.pi / np.abs(np.linalg.eigvals(flow.free)).max()
    begin = start_of(cases) if start is None else start
    X, contact = vector_of(flow, begin), bool(begin.contact[0])
    done, more = 0, 3
    largest = np.abs(X)
    while done < options.transient:
        for _ in range(more):
            X, contact, events = after(flow, X, contact, T)
            if not np.all(np.isfinite(X)):
                return Rub(RUNS_AWAY, message="the transient leaves every bound")
            largest = np.maximum(largest, np.abs(X))
        done += more
        scale = _scale(flow, largest)
        for k in range(1, options.periods + 1):
            rub = _newton(flow, X, contact, k, T, scale, options)
            if rub is not None and _is_approached(flow, X, contact, rub, k, T, scale):
                return _named(flow, rub, constant)
        if contact and events.time.size == 0 and _growth(flow) > 0:
            return Rub(RUNS_AWAY, message="a whole period in contact, in which perturbations grow")
        more = min(done, options.transient - done)
    return Rub(NOT_FOUND, message=f"nothing periodic within {options.transient} periods")


def _growth(flow: Flow) -> float:
    """Return the largest real part of the poles of the held tip, whose own place and velocity are no states, 1/s."""
    others = np.setdiff1d(np.arange(flow.held.shape[0]), flow.tip)
    return float(eigenvalues(flow.held[np.ix_(others, others)]).real.max(initial=-np.inf))


def _scale(flow: Flow, largest: Array) -> Array:
    """Return the maximum of x, v and θ for each of X."""
    n = flow.mechanical
    parts = [largest[:n], largest[n : 2 * n], largest[2 * n :]]
    return np.concatenate([np.full(part.size, part.max(initial=0.0) or 1.0) for part in parts])


def _newton(flow: Flow, X: Array, contact: bool, k: int, T: float, scale: Array, options: Options) -> Rub | None:
    """Return the rub of order k near X by damped steps of Newton's method, ``None`` where they do not converge."""
    size, best = X.size, np.inf
    step: Array = np.zeros(size)
    trial = X
    for _ in range(40):
        end, held, events = after(flow, trial, contact, k * T)
        error = np.abs((end - trial) / scale).max() if held == contact and np.all(np.isfinite(end)) else np.inf
        if error < best or best == np.inf:
            if error == np.inf:
                return None
            X, best = trial, error
            D = derivative(flow, contact, events, k * T)
            if best < options.residual:
                multipliers = eigenvalues(D)
                multipliers = multipliers[np.argsort(-np.abs(multipliers), kind="stable")]
                return _rub(flow, X, contact, k, T, best, multipliers, events)
            step = np.asarray(np.linalg.solve(np.eye(size) - D, end - X), dtype=np.float64)
        else:
            step = step / 2
            if np.abs(step / scale).max() < options.residual:
                return None
        trial = X + step
    return None


def _rub(
    flow: Flow, X: Array, contact: bool, k: int, T: float, residual: float, multipliers: Complex, events: Events
) -> Rub:
    """Return a periodic rub with its stability."""
    largest = float(np.abs(multipliers[0]))
    settles = largest < 1
    return Rub(
        SETTLES if settles else UNSTABLE,
        k * T,
        k,
        float(residual),
        multipliers,
        -k * T / np.log(largest) if settles and largest > 0 else np.inf,
        states_of(flow, X, contact),
        events,
    )


def _is_approached(flow: Flow, X: Array, contact: bool, rub: Rub, k: int, T: float, scale: Array) -> bool:
    """Tell whether two more periods of the transient bring it nearer to a rub, or it is there."""
    if rub.state != SETTLES or rub.start is None:
        return False
    aim = vector_of(flow, rub.start)
    first = np.abs((X - aim) / scale).max()
    for _ in range(2):
        X, contact, _ = after(flow, X, contact, k * T)
    return bool(np.abs((X - aim) / scale).max() < max(first, 1e-8))


def _named(flow: Flow, rub: Rub, constant: bool) -> Rub:
    """Return a rub that settles with the name of its contact, and as an equilibrium under constant loads."""
    events, start = rub.events, rub.start
    assert events is not None
    assert start is not None
    values = {name: getattr(rub, name) for name in rub.__dataclass_fields__}
    if events.time.size == 0:
        values["state"] = PERMANENT_CONTACT if start.contact[0] else NO_CONTACT
    if constant:
        growth = _growth(flow) if start.contact[0] else float(eigenvalues(flow.free).real.max())
        values |= {"period": np.inf, "multipliers": None, "settling_time": -1 / growth}
    return Rub(**values)
