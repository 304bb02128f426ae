"""An orbit through its events: the unknowns are the state at a section and the times of the events of a period.

Between events the set S of closed contacts is fixed and X obeys its linear equations; at the times t_i the conditions

    gap, or contact force, of the contact of event i at t_i = 0,   X(kT) = X(0)

hold, and impacts are X⁺ = X⁻ + J_c u, u = w_c y' - d_c' the approach speed. All of it is smooth in states, times and
numbers of the scene, also where u is 0 (a grazing) or negative, which no motion has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from workflow.models import Array
from workflow.orbits._flow import Flow
from workflow.schemes.event_driven import Trajectory

_CHATTERS = 1e-6
"""Impulse, over the largest, below which an impact is one of a series that its times do not tell apart."""

_LATER = 1e-6
"""Difference of times of events, over the span, from which they are other events."""


IMPACT, BEGINS, LEAVES = range(3)
"""Kinds of events of a contact: an impact with a flight after it, one after which it stays closed, the end of that."""


class Word(NamedTuple):
    """The events of an orbit in their order."""

    closed: tuple[tuple[bool, ...], ...]
    """Contacts closed in each stretch, the first and the last around the section, ``(event + 1,)``."""
    contact: tuple[int, ...]
    kind: tuple[int, ...]
    """:data:`IMPACT`, :data:`BEGINS` or :data:`LEAVES`."""

    def without(self, i: int) -> Word:
        """Return the word without an impact."""
        closed, contact, kind = self
        return Word(closed[:i] + closed[i + 1 :], contact[:i] + contact[i + 1 :], kind[:i] + kind[i + 1 :])

    def with_impact(self, i: int, contact: int) -> Word:
        """Return the word with an impact of a contact before event ``i``."""
        closed, contacts, kind = self
        more = (*contacts[:i], contact, *contacts[i:]), (*kind[:i], IMPACT, *kind[i:])
        return Word((*closed[: i + 1], *closed[i:]), *more)

    def turned(self, i: int) -> Word:
        """Return the word from a section between events ``i - 1`` and ``i``."""
        closed, contact, kind = self
        return Word((*closed[i:-1], *closed[: i + 1]), contact[i:] + contact[:i], kind[i:] + kind[:i])


def word_of(motion: Trajectory) -> Word | None:
    """Return the word of a motion over whole periods; ``None`` where several contacts meet or leave at an instant."""
    events = [_event(motion, k) for k in range(motion.times.size)]
    closed = tuple(tuple(each) for each in motion.sets.tolist())
    known = [event for event in events if event is not None]
    contacts, kinds = zip(*known, strict=True) if known else ((), ())
    return Word(closed, contacts, kinds) if len(known) == len(events) else None


def _event(motion: Trajectory, k: int) -> tuple[int, int] | None:
    """Return contact and kind of an event of one contact that meets or leaves its casing; ``None`` of another."""
    before, after = motion.sets[k : k + 2]
    meets = (motion.impulses[k] > 0) & ~before
    acting = np.flatnonzero(meets | (before != after))
    if acting.size != 1:
        return None
    c = int(acting[0])
    return (c, BEGINS if after[c] else IMPACT) if meets[c] else (c, LEAVES) if before[c] else None


def tells_apart(motion: Trajectory) -> bool:
    """Tell whether impacts are so strong that their times are told apart: those of a series of bounces are not."""
    impulses = motion.impulses[motion.impulses > 0]
    return bool(np.all(impulses > _CHATTERS * impulses.max(initial=0.0)))


@dataclass(frozen=True, eq=False)
class Shot:
    """The motion from X over given times of events, and its derivatives per (X, times)."""

    flow: Flow
    word: Word
    begin: float
    span: float
    times: Array
    """Over the span."""
    X: Array
    """At the end, ``(N,)``."""
    signals: Array
    """Gaps or forces at the events, ``(event,)``."""
    approach: Array
    """u at the events, m/s, ``(event,)``."""
    states: Array
    """X after the start and after each event, ``(event + 1, N)``."""
    X_slope: Array
    signals_slope: Array
    approach_slope: Array
    """Each ``(…, N + event)``."""

    @property
    def derivative(self) -> Array:
        """Derivative of the end per X, with the times at which the signals are 0."""
        N, by_X, by_time = self.X.size, self.signals_slope[:, : self.X.size], self.signals_slope[:, self.X.size :]
        later = np.linalg.lstsq(by_time, by_X, rcond=np.finfo(float).eps)[0]
        return np.asarray(self.X_slope[:, :N] - self.X_slope[:, N:] @ later)

    def at(self, time: float, stretch: int) -> Array:
        """Return X at a time, over the span, of the motion in a stretch."""
        own, before = self.flow.motion_in(self.word.closed[stretch]), float(self.times[stretch - 1]) if stretch else 0.0
        factor, forced = own.over((time - before) * self.span)
        Z = factor @ own.leave.T @ self.states[stretch] + forced @ self.flow.sources(self.begin + before * self.span)
        return np.asarray(own.leave @ Z + own.place @ self.flow.sources(self.begin + time * self.span))

    def flight(self, time: float, stretch: int, contact: int) -> tuple[float, float]:
        """Return gap and approach speed of a contact at a time, over the span, in a stretch."""
        n, m, normal = self.flow.modes, self.flow.contacts, self.flow.one.basis.normal[contact]
        X, w = self.at(time, stretch), self.flow.sources(self.begin + time * self.span)
        place, speed = self.flow.inputs[[contact - 3 * m, contact - 2 * m]] @ w
        return float(place - normal @ X[:n]), float(normal @ X[n : 2 * n] - speed)

    def is_motion(self, motion: Trajectory, grazing: int | None = None) -> bool:
        """Tell whether the exact motion from here has these events at these times, with approach speeds above 0.

        The impact ``grazing`` may or may not be among them.
        """
        word, times = self.word, self.times
        if grazing is not None and motion.times.size < times.size:
            word, times = word.without(grazing), np.delete(times, grazing)
        same = motion.repeats and word_of(motion) == word and self.slowest(grazing) > 0
        return bool(same and np.all(np.abs(motion.times / self.span - times) < _LATER))

    def slowest(self, grazing: int | None = None) -> float:
        """Return the least approach speed at which a contact meets its casing, but for ``grazing``, m/s."""
        kinds = enumerate(self.word.kind)
        return min((float(self.approach[i]) for i, kind in kinds if kind != LEAVES and i != grazing), default=np.inf)

    def new_impact(self, motion: Trajectory) -> tuple[int, int, float] | None:
        """Return stretch, contact and time of the least gap at the first event of the exact motion that is new.

        ``None`` where it is no impact.
        """
        k = 0
        while k < min(motion.times.size, self.times.size) and abs(motion.times[k] / self.span - self.times[k]) < _LATER:
            k += 1
        event = _event(motion, k) if k < motion.times.size else None
        if event is None or event[1] == LEAVES or self.word.closed[k][event[0]]:
            return None
        contact, first, size = event[0], float(motion.times[k]) / self.span, 1e-4
        end = float(self.times[k]) if k < self.times.size else 1.0
        while first + size < end and self.flight(first + size, k, contact)[1] > 0:
            size *= 2
        ends = first, min(first + size, end)
        speeds = [self.flight(time, k, contact)[1] for time in ends]
        if not speeds[1] < 0 < speeds[0]:
            return None
        return k, contact, float(brentq(lambda time: self.flight(time, k, contact)[1], *ends))


def _jump(flow: Flow, closed: tuple[bool, ...], contact: int, kind: int) -> Array:
    """Return the jump of X per approach speed at an event: 0 of contacts without mass, and where one ends."""
    if kind == LEAVES or flow.structure.contacts.is_compliant:
        return np.zeros(flow.start.size)
    acting = np.array([i for i in range(flow.contacts) if closed[i] or i == contact])
    law = 1.0 + (flow.e if kind != BEGINS else 0.0)
    p = np.linalg.solve(flow.delassus[np.ix_(acting, acting)], law * (acting == contact))
    return np.asarray(p @ flow.struck[acting])


def shoot(flow: Flow, word: Word, X: Array, begin: float, span: float, fractions: Array) -> Shot:
    """Return the motion of a case from X at ``begin`` over ``span`` [s], with events at fractions of it."""
    N, E, velocities = X.size, fractions.size, slice(flow.modes, 2 * flow.modes)
    slope, states, before = np.eye(N, N + E), [X], 0.0
    signals, approach = np.zeros(E), np.zeros(E)
    signals_slope, approach_slope = np.zeros((E, N + E)), np.zeros((E, N + E))
    for i in range(E + 1):
        own, end = flow.motion_in(word.closed[i]), float(fractions[i]) if i < E else 1.0
        w, w1 = flow.sources(begin + before * span), flow.sources(begin + end * span)
        factor, forced = own.over((end - before) * span)
        Z0 = own.leave.T @ X
        Z = factor @ Z0 + forced @ w
        moved = factor @ own.leave.T @ slope
        if i > 0:
            moved[:, N + i - 1] -= span * (factor @ (own.A @ Z0 + own.B @ w))
        rate, turned = own.A @ Z + own.B @ w1, flow.turn @ w1
        X, slope = own.leave @ Z + own.place @ w1, own.leave @ moved
        if i == E:
            break
        c, at = word.contact[i], N + i
        normal, casing = flow.one.basis.normal[c], flow.inputs[c - 2 * flow.contacts]  # casing: d' per w
        slope[:, at] += span * (own.leave @ rate + own.place @ turned)
        signals[i] = own.signals[c] @ Z + own.signal_inputs[c] @ w1
        signals_slope[i] = own.signals[c] @ moved
        signals_slope[i, at] += span * (own.signals[c] @ rate + own.signal_inputs[c] @ turned)
        approach[i] = normal @ X[velocities] - casing @ w1
        approach_slope[i] = normal @ slope[velocities]
        approach_slope[i, at] -= span * (casing @ turned)
        jump = _jump(flow, word.closed[i], c, word.kind[i])
        X, slope = X + jump * approach[i], slope + np.outer(jump, approach_slope[i])
        states.append(X)
        before = end
    events = begin, span, fractions
    return Shot(flow, word, *events, X, signals, approach, np.array(states), slope, signals_slope, approach_slope)
