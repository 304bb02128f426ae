"""The exact motion of one case from any state, and its linear motion while a set of its contacts stays closed.

Periodic orbits are searched with both.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import block_diagonal
from workflow.models import Array, Cases, ContactBasis, ContactSystem, contact_system
from workflow.poles import oscillations
from workflow.schemes._exact.batch import (
    ExactOperator,
    InseparablePolesError,
    conditions_of,
    failure_text,
    march,
    unheated,
)
from workflow.schemes._exact.closed_sets import ClosedSet
from workflow.schemes._exact.event_loop import PROGRESS, Outcome
from workflow.schemes._exact.events import COMPLETED
from workflow.schemes._exact.record import EVENT, IMPACTS, TALLY, TOUCHES, Asked, Record
from workflow.schemes._exact.set_motion import Case
from workflow.schemes._exact.set_tables import SetTable
from workflow.schemes._exact.tables import block, first, wave
from workflow.schemes._interface import HISTORIES


@dataclass(frozen=True, eq=False)
class Trajectory:
    """The exact motion from a state X = [y, y', τ], in the modes of the free tip, over a time span."""

    begin: float
    """s"""
    span: float
    """s"""
    start: Array
    """X at ``begin``."""
    was_closed: NDArray[np.bool_]
    """Contacts that are closed at ``begin``, ``(contact,)``."""
    X: Array
    """State at the end; NaN where the motion ended early."""
    closed: NDArray[np.bool_]
    """Contacts that are closed at the end, ``(contact,)``."""
    times: Array
    """Times of events after ``begin``, those of all contacts at an instant as one, s, ``(event,)``."""
    impulses: Array
    """Impulses of impacts, N s, ``(event, contact)``."""
    approaches: Array
    """Speeds at which contacts meet their casing, 0 for those that do not, m/s, ``(event, contact)``."""
    closed_after: NDArray[np.bool_]
    """Contacts that are closed after the events, ``(event, contact)``."""
    states: Array
    """X after the events, ``(event, N)``."""
    histories: Array
    """x, v, θ and impulse of each contact at samples, ``(4, contact, sample)``."""
    sensed: Array
    """What sensors show at samples, without what contacts without mass add, ``(sensor, sample)``."""
    tally: Any
    """Array of :data:`~workflow.schemes._exact.record.TALLY`, ``(contact,)``."""
    failure: str
    """Why the motion ended early, or ''."""

    @property
    def repeats(self) -> bool:
        """Whether it ends with the contacts closed with which it began."""
        return np.array_equal(self.closed, self.was_closed) and bool(np.isfinite(self.X).all())

    @property
    def ends(self) -> Array:
        """Ends of the stretches between events after ``begin``, 0 first, s, ``(event + 2,)``."""
        return np.concatenate([[0.0], self.times, [self.span]])

    @property
    def sets(self) -> NDArray[np.bool_]:
        """Contacts that are closed in each stretch, ``(event + 1, contact)``."""
        return np.vstack([self.was_closed, self.closed_after])

    @property
    def begins(self) -> NDArray[np.int64]:
        """How often each contact is closed, ``(contact,)``."""
        return np.asarray(np.sum(self.sets[1:] & ~self.sets[:-1], axis=0))


class OneCase(NamedTuple):
    """A batch of one case, and the sets of its contacts."""

    operator: ExactOperator
    table: SetTable
    basis: ContactBasis
    """With thermal modes where heat acts or they were asked for."""
    conditions: Case

    @property
    def contacts(self) -> int:
        """Number of contacts."""
        return self.basis.contacts.count

    @property
    def own(self) -> Case:
        """The conditions of the case."""
        first: Any = (value[0] if isinstance(value, np.ndarray) else value for value in self.conditions)
        return Case(*first)

    def set_of(self, closed: NDArray[np.bool_]) -> ClosedSet:
        """Return a set.

        Raises
        ------
        InseparablePolesError
            Three poles coincide.
        """
        found = self.table.find(closed.astype(np.int8), float(self.conditions.alpha[0]))
        if found is None:
            raise InseparablePolesError
        return found

    def system(self, closed: NDArray[np.bool_]) -> ContactSystem:
        """Return the linear system of a set."""
        alpha, friction = float(self.conditions.alpha[0]), self.table.shared.friction
        return _system(self.basis, tuple(closed.tolist()), alpha, friction)


def one_case(operator: ExactOperator, cases: Cases, duration: float, *, heated: bool = False) -> OneCase:
    """Return a case over a time [s], with thermal states where heat acts or ``heated`` is set.

    Raises
    ------
    InseparablePolesError
        Three poles coincide.
    """
    warm, conditions = bool(cases.heated[0]) or heated, conditions_of(operator, cases, duration)
    table = operator.sets(warm, float(cases.friction[0]), duration)
    if not warm:
        conditions = unheated(conditions, operator.basis.frequency.size, operator.basis.rate.size)
    one = OneCase(operator, table, operator.bases[warm], conditions)
    one.set_of(np.zeros(one.contacts, dtype=np.bool_))
    return one


def trajectory(
    case: OneCase,
    X: Array,
    closed: NDArray[np.bool_],
    begin: float,
    span: float,
    kept: int = 64,
    samples: int = 1,
) -> Trajectory:
    """Return the exact motion from X at ``begin`` [s] over ``span`` [s], with contacts that are ``closed`` there.

    ``kept`` is a guess of the number of events of all contacts; 0 leaves them out.
    """
    conditions, sensors, m = case.conditions, case.basis.sensors, case.contacts
    waves = conditions.waves.copy()
    waves[0, :, wave.PHASE] += begin * waves[0, :, wave.OMEGA]
    due = np.linspace(0.0, span, samples + 1)
    while True:
        given = conditions._replace(waves=waves, duration=float(span), modal=X[None].copy())
        tally, events = np.zeros((1, m), dtype=TALLY), np.zeros((1, kept, len(EVENT)))
        histories = np.full((1, len(HISTORIES), m, due.size), np.nan)
        tally["held"] = closed
        sensed, states = np.full((1, len(sensors), due.size), np.nan), np.zeros((1, kept, X.size))
        record = Record(
            due, np.zeros((1, 0)), histories, np.zeros((1, 7, m, 0)), tally, Asked(sensors, sensed, events, states)
        )
        outcome = Outcome(record, np.zeros(1, dtype=PROGRESS), np.zeros(1, dtype=np.int64))
        march(case.table, given, np.zeros(1, dtype=np.int64), outcome)
        count = int(outcome.progress["listed"][0])
        if count <= kept or not kept:
            break
        kept = count
    done = outcome.ended[0] == COMPLETED
    end = given.modal[0] if done else np.full(X.size, np.nan)
    values = outcome.progress[0], tally[0], float(conditions.e[0]), 0.0
    failure = "" if done else failure_text(case.operator, int(outcome.ended[0]), *values)
    listed = _events(events[0, : min(count, kept)], states[0], closed)
    last = tally["held"][0] != 0
    return Trajectory(begin, span, X, closed, end, last, *listed, histories[0], sensed[0], tally[0], failure)


def _events(rows: Array, states: Array, closed: NDArray[np.bool_]) -> tuple[Array, Array, Array, Any, Array]:
    """Return times, impulses, approaches, closed contacts and states of events from the rows of single contacts."""
    which = np.flatnonzero(np.diff(rows[:, 0], append=np.inf) > 0)  # the last row of each instant
    impulses, approaches = np.zeros((2, which.size, closed.size))
    after, now, begin = np.zeros(impulses.shape, dtype=np.bool_), closed.copy(), 0
    for event, end in enumerate(which.tolist()):
        for _, kind, impulse, approach, contact in rows[begin : end + 1]:
            c = int(contact)
            impulses[event, c] += impulse
            approaches[event, c] = approach
            now[c] = kind == TOUCHES if kind != IMPACTS else now[c]
        begin, after[event] = end + 1, now
    return rows[which, 0], impulses, approaches, after, states[which]


def growth(s: ClosedSet) -> float:
    """Return the largest real part of the poles of a set, 1/s."""
    half, w2 = 0.5 * s.block[block.DAMPING, : s.blocks], s.block[block.STIFFNESS, : s.blocks]
    poles = np.append((np.sqrt(half**2 - w2 + 0j) - half).real, -s.first[first.RATE, : s.firsts])
    return float(poles.max(initial=-np.inf))


def propagators(s: ClosedSet, spans: Array) -> Array:
    """Return the propagators of X, the state with the contacts open, over each of some spans [s], ``(span, N, N)``."""
    n, t = s.blocks, spans[:, None]
    half, w2 = 0.5 * s.block[block.DAMPING, :n], s.block[block.STIFFNESS, :n]
    C, S = (each[:, None] for each in oscillations(half, half**2 - w2, spans))
    eta, u, xi = np.split(s.inward, [n, 2 * n], axis=1)
    decay = np.exp(-s.first[first.RATE, : s.firsts] * t)[:, None]
    moved = [eta * (C + half * S) + u * S, u * (C - half * S) - eta * (w2 * S), xi * decay]
    inner = np.concatenate(moved, axis=2) @ s.outward
    heats = np.eye(len(s.inward) - 2 * s.null.shape[1])
    changes = block_diagonal(s.null, s.null, heats) @ inner @ block_diagonal(s.null.T, s.null.T, heats)
    return np.asarray(changes.swapaxes(1, 2))


@lru_cache(maxsize=64)
def _system(basis: ContactBasis, closed: tuple[bool, ...], alpha: float, friction: float) -> ContactSystem:
    """Return the system of a set of closed contacts."""
    system = contact_system(basis, np.array(closed), alpha, friction)
    if system is None:
        raise InseparablePolesError
    return system
