"""Periodic orbits: fixed points of the map of k periods, by Newton's method or, without events, in closed form."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import Complex, eigenvalues
from workflow.models import Array
from workflow.orbits._flow import Flow
from workflow.schemes.event_driven import Trajectory, growth

STATES = ("settles", "no_contact", "permanent_contact", "unstable", "runs_away", "not_found", "not_asked")
"""Outcomes of a rub: the names of the values of ``steady_state``. ``unstable`` occurs on branches only."""

SETTLES, NO_CONTACT, PERMANENT_CONTACT, UNSTABLE, RUNS_AWAY, NOT_FOUND, NOT_ASKED = range(7)

RESIDUAL = 1e-10
"""Largest change of x, v and θ over kT, each over its own maximum."""

_MOST = 25
"""Largest number of Newton steps."""


@dataclass(frozen=True, eq=False)
class Orbit:
    """A periodic orbit of period kT."""

    flow: Flow
    order: int
    """k"""
    motion: Trajectory
    """Motion over kT."""
    D: Array
    """Derivative of its final state with respect to its initial state."""
    residual: float

    @property
    def multipliers(self) -> Complex:
        """Floquet multipliers, the largest first."""
        values = eigenvalues(self.D)
        return np.asarray(values[np.argsort(-np.abs(values), kind="stable")])

    @cached_property
    def corner(self) -> NDArray[np.intp]:
        """Contacts that strike at once and act on each other: the map has no derivative there; none else."""
        return self.flow.corner(self.motion)

    @property
    def growth(self) -> float:
        """Rate of the slowest deviation, ln|µ|/kT or, without events, the largest real part of the poles, 1/s."""
        if self.motion.times.size == 0:
            return growth(self.flow.one.set_of(self.motion.was_closed))
        largest = float(np.abs(self.multipliers[0]))
        return float(np.log(largest) / self.motion.span) if largest > 0 else -np.inf

    @property
    def state(self) -> int:
        """Index in :data:`STATES`."""
        if not self.growth < 0:
            return UNSTABLE
        if self.motion.times.size:
            return SETTLES
        return PERMANENT_CONTACT if self.motion.was_closed.any() else NO_CONTACT


def scale_of(flow: Flow, motions: list[Trajectory]) -> Array:
    """Return the largest |x|, |v| (at least |x|/T) and |θ| of motions, at their samples, events and ends."""
    parts = flow.parts(np.vstack([np.vstack([motion.states, motion.X]) for motion in motions]))
    samples = np.abs(np.concatenate([motion.histories[:3] for motion in motions], axis=2))
    largest = np.maximum([np.abs(part).max(initial=0.0) for part in parts], np.nanmax(samples, axis=(1, 2)))
    largest[1] = max(largest[1], largest[0] / flow.period)
    return np.where(largest > 0, largest, 1.0)


def longest(motion: Trajectory, *, flights: bool = False) -> float:
    """Return the time from a motion's begin to the middle of its longest stretch between events, s.

    With ``flights`` it is one of those in which the fewest contacts are closed.
    """
    lengths, closed = np.diff(motion.ends), motion.sets.sum(axis=1)
    place = int(np.argmax(np.where(flights & (closed > closed.min()), -1.0, lengths)))
    return float(motion.ends[place] + 0.5 * lengths[place])


def newton(flow: Flow, X: Array, closed: NDArray[np.bool_], begin: float, order: int, scale: Array) -> Orbit | None:
    """Return the orbit of order k near X at ``begin`` by Newton's method; ``None`` where it does not converge.

    Below the accepted residual steps go on as long as they halve it.
    """
    last = np.inf
    for _ in range(_MOST):
        motion = flow.march(X, closed, begin, order * flow.period)
        if not motion.repeats:
            return None
        change, D = motion.X - X, flow.derivative(motion)
        error = flow.size(change, scale)
        if has_converged(error, last):
            return Orbit(flow, order, motion, D, error)
        try:
            X, last = X + np.linalg.solve(np.eye(X.size) - D, change), error
        except np.linalg.LinAlgError:
            return None
    return None


def has_converged(residual: float, last: float) -> bool:
    """Tell whether the residual of Newton's method is small enough and is no longer halved by a step."""
    return residual < 0.01 * RESIDUAL or (residual < RESIDUAL and not residual < 0.5 * last)


def without_events(flow: Flow, closed: NDArray[np.bool_], scale: Array) -> Orbit | None:
    """Return the orbit on which the same contacts stay closed; ``None`` where there is none.

    Under constant loads it is an equilibrium.
    """
    try:
        X, signals = flow.motion_in(closed).steady()
    except np.linalg.LinAlgError:
        return None
    if not (np.isfinite(X).all() and (signals > 0).all()):
        return None
    motion = flow.march(X, closed, 0.0, flow.period)
    if motion.times.size or not motion.repeats:
        return None
    D, residual = flow.derivative(motion), flow.size(motion.X - X, scale)
    return Orbit(flow, 1, motion, D, residual) if residual < RESIDUAL else None
