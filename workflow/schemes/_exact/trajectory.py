"""The exact motion of one case of one contact from any state, and its linear motion while the tip stays free or held.

Periodic orbits are searched with both: X' = A X + B w has propagators and a steady response.
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
from workflow.schemes._exact.record import EVENT, TALLY, TOUCHES, Asked, Record
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
    was_held: bool
    """Whether it begins in contact."""
    X: Array
    """State at the end; NaN where the motion ended early."""
    contact: bool
    """Whether it ends in contact."""
    times: Array
    """Times of events after ``begin``, s, ``(event,)``."""
    kinds: Array
    """A contact ends, an impact, or a contact begins: see :mod:`workflow.schemes._exact.record`."""
    impulses: Array
    """Impulses of impacts, N s, ``(event,)``."""
    states: Array
    """X after the events, ``(event, N)``."""
    histories: Array
    """x_n, v_n, θ_n, the impulse and what sensors show at samples, ``(4 + sensor, sample)``."""
    tally: Any
    """One element of an array of :data:`~workflow.schemes._exact.record.TALLY`."""
    failure: str
    """Why the motion ended early, or ''."""

    @property
    def repeats(self) -> bool:
        """Whether it ends as it began, in flight or in contact."""
        return self.contact == self.was_held and bool(np.isfinite(self.X).all())

    @property
    def stretches(self) -> tuple[Array, NDArray[np.bool_]]:
        """Ends of flights and contacts after ``begin``, 0 first, s, and which are contacts."""
        ends = np.concatenate([[0.0], self.times, [self.span]])
        return ends, np.concatenate([[self.was_held], self.kinds == TOUCHES])


class OneCase(NamedTuple):
    """A batch of one case, and the sets of its contact."""

    operator: ExactOperator
    table: SetTable
    basis: ContactBasis
    """With thermal modes where heat acts or they were asked for."""
    conditions: Case

    @property
    def own(self) -> Case:
        """The conditions of the case."""
        first: Any = (value[0] if isinstance(value, np.ndarray) else value for value in self.conditions)
        return Case(*first)

    def set_of(self, held: bool) -> ClosedSet:
        """Return the set of the held or the free tip.

        Raises
        ------
        InseparablePolesError
            Three poles coincide.
        """
        found = self.table.find(np.array([held], dtype=np.int8), float(self.conditions.alpha[0]))
        if found is None:
            raise InseparablePolesError
        return found

    def linear(self, held: bool) -> Linear:
        """Return the motion of the held or the free tip."""
        return _linear(self.basis, held, float(self.conditions.alpha[0]), float(self.conditions.friction[0]))


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
    for held in (False, True):
        one.set_of(held)
    return one


def trajectory(
    case: OneCase, X: Array, contact: bool, begin: float, span: float, kept: int = 64, samples: int = 1
) -> Trajectory:
    """Return the exact motion from X at ``begin`` [s] over ``span`` [s].

    ``kept`` is a guess of the number of events; 0 leaves them out.
    """
    conditions, sensors = case.conditions, case.basis.sensors
    waves = conditions.waves.copy()
    waves[0, :, wave.PHASE] += begin * waves[0, :, wave.OMEGA]
    due = np.linspace(0.0, span, samples + 1)
    while True:
        given = conditions._replace(waves=waves, duration=float(span), modal=X[None].copy())
        tally, events = np.zeros((1, 1), dtype=TALLY), np.zeros((1, kept, len(EVENT)))
        histories = np.full((1, len(HISTORIES), 1, due.size), np.nan)
        tally["held"] = contact
        sensed, states = np.full((1, len(sensors), due.size), np.nan), np.zeros((1, kept, X.size))
        record = Record(
            due, np.zeros((1, 0)), histories, np.zeros((1, 7, 1, 0)), tally, Asked(sensors, sensed, events, states)
        )
        outcome = Outcome(record, np.zeros(1, dtype=PROGRESS), np.zeros(1, dtype=np.int64))
        march(case.table, given, np.zeros(1, dtype=np.int64), outcome)
        count = int(outcome.progress["listed"][0])
        if count <= kept or not kept:
            break
        kept = count
    done = outcome.ended[0] == COMPLETED
    end = given.modal[0] if done else np.full(X.size, np.nan)
    told = outcome.progress[0], tally[0], float(conditions.e[0]), 0.0
    failure = "" if done else failure_text(case.operator, int(outcome.ended[0]), *told)
    (times, kinds, impulses), shown = events[0, :count, :3].T, np.vstack([histories[0, :, 0], sensed[0]])
    listed = times, kinds, impulses, states[0, :count]
    return Trajectory(begin, span, X, contact, end, bool(tally["held"][0, 0]), *listed, shown, tally[0, 0], failure)


def growth(s: ClosedSet) -> float:
    """Return the largest real part of the poles of a set, 1/s."""
    half, w2 = 0.5 * s.block[block.DAMPING, : s.blocks], s.block[block.STIFFNESS, : s.blocks]
    poles = np.append((np.sqrt(half**2 - w2 + 0j) - half).real, -s.first[first.RATE, : s.firsts])
    return float(poles.max(initial=-np.inf))


def propagators(s: ClosedSet, spans: Array) -> Array:
    """Return the propagators of X, of the contacts open, over each of some spans [s], ``(span, N, N)``."""
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


@dataclass(frozen=True, eq=False)
class Linear:
    """The motion with the tip free or held in its modes Z = [z, z', τ], and the transform to X = [y, y', τ]."""

    system: ContactSystem

    def steady(self, case: Case, t: float) -> tuple[Array, float]:
        """Return X and the signal, the gap or the contact force, of the steady response to the loads at t.

        Raises
        ------
        numpy.linalg.LinAlgError
            There is none: a pole is that of a load.
        """
        own = self.system
        sources = [(0.0, case.constant.astype(complex))]
        for (omega, phase, force, _), (cos, sin) in zip(case.waves, case.casing[..., 0], strict=True):
            inputs = np.zeros(case.constant.size, dtype=complex)
            inputs[-4:] = -1j * force, *((cos - 1j * sin) * (1j * omega) ** np.arange(3))
            sources.append((omega, inputs * np.exp(1j * (omega * t + phase))))
        Z, w = np.zeros(own.A.shape[0]), np.zeros(case.constant.size)
        for omega, inputs in sources:
            Z += np.linalg.solve(1j * omega * np.eye(Z.size) - own.A, own.B @ inputs).real
            w += inputs.real
        z, u, tau = np.split(Z, [own.null.shape[1], 2 * own.null.shape[1]])
        X = [own.null @ z + w[-3] * own.place[0], own.null @ u + w[-2] * own.place[0], tau]
        return np.concatenate(X), float(own.signals[0] @ Z + own.inputs[0] @ w)


@lru_cache(maxsize=8)
def _linear(basis: ContactBasis, held: bool, alpha: float, friction: float) -> Linear:
    """Return the motion of the held or the free tip."""
    system = contact_system(basis, np.array([held]), alpha, friction)
    if system is None:
        raise InseparablePolesError
    return Linear(system)
