"""The exact motion of one case from any state, and its linear motion while the tip stays free or held.

Periodic orbits are searched with both: X' = A X + B w has propagators and a steady response.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import block_diagonal
from workflow.models import Array, Cases
from workflow.poles import oscillations
from workflow.schemes._exact.batch import ExactOperator, InseparablePolesError, conditions_of, failure_text
from workflow.schemes._exact.event_loop import COMPLETED, run_cases
from workflow.schemes._exact.layout import Case, Regime, unpacked
from workflow.schemes._exact.modal_system import ModalSystem, signal_inputs, state_space
from workflow.schemes._exact.motion import scratch
from workflow.schemes._exact.record import EVENT, TALLY, TOUCHES, Asked, Record
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
    """A batch of one case, with its regimes as rows of :func:`~workflow.schemes._exact.layout.unpacked`."""

    free: Array
    """Without and with thermal modes, ``(2, number)``."""
    held: Array
    """``(1, number)``."""
    conditions: Case
    tip: Array
    """φ_n, ``(mode,)``."""
    sensors: Array
    """Rows of sensors in modes, ``(sensor, mode + thermal mode)``."""

    @property
    def own(self) -> Case:
        """The conditions of the case."""
        first: Any = (value[0] if isinstance(value, np.ndarray) else value for value in self.conditions)
        return Case(*first)

    def regime(self, held: bool) -> Regime:
        """Return the regime of the held or the free tip."""
        return unpacked(self.held[0] if held else self.free[self.own.free])


def one_case(operator: ExactOperator, cases: Cases, duration: float, *, heated: bool = False) -> OneCase:
    """Return a case over a time [s], with thermal states where heat acts or ``heated`` is set.

    Raises
    ------
    InseparablePolesError
        Three poles coincide.
    """
    warm = cases.heated | heated
    free, held = operator.free(duration), operator.held.at(cases.alpha, cases.friction, warm, duration)
    if not (free.separable[warm.astype(int)].all() and held.separable.all()):
        raise InseparablePolesError
    conditions = conditions_of(operator, cases, duration)._replace(free=warm.astype(np.int64))
    return OneCase(free.rows, held.rows, conditions, operator.basis.tip, operator.basis.sensors)


def trajectory(
    case: OneCase, X: Array, contact: bool, begin: float, span: float, kept: int = 64, samples: int = 1
) -> Trajectory:
    """Return the exact motion from X at ``begin`` [s] over ``span`` [s].

    ``kept`` is a guess of the number of events; 0 leaves them out.
    """
    conditions, tip = case.conditions, case.tip
    waves = conditions.waves.copy()
    omega, phase, _, amplitude = conditions.waves[0].T
    waves[0, :, wave.PHASE] = turn = phase + begin * omega
    apart = conditions.gap + np.sin(turn) @ amplitude - tip @ X[: tip.size]
    speed = tip @ X[tip.size : 2 * tip.size] - np.cos(turn) @ (omega * amplitude)
    memory = scratch(X.size, waves.shape[1])
    due, ended = np.linspace(0.0, span, samples + 1), np.zeros(1, dtype=np.int64)
    while True:
        moving: dict[str, Any] = {"distance": apart, "speed": np.array([speed]), "modal": X[None].copy()}
        given = conditions._replace(waves=waves, duration=float(span), **moving)
        tally, events = np.zeros(1, dtype=TALLY), np.zeros((1, kept, len(EVENT)))
        histories = np.full((1, len(HISTORIES), due.size), np.nan)
        tally["held"] = contact
        sensed, states = np.full((1, len(case.sensors), due.size), np.nan), np.zeros((1, kept, X.size))
        asked = Asked(case.sensors, sensed, events, states)
        record = Record(due, np.zeros((1, 0)), histories, np.zeros((1, 7, 0)), tally, asked)
        run_cases(case.free, case.held, given, np.zeros(1, dtype=np.int64), record, memory, ended)
        count = int(tally["events"][0])
        if count <= kept or not kept:
            break
        kept = count
    done = ended[0] == COMPLETED
    end = given.modal[0] if done else np.full(X.size, np.nan)
    failure = "" if done else failure_text(int(ended[0]), tally[0], conditions.budget, float(conditions.e[0]))
    (times, kinds, impulses), shown = events[0, :count, :3].T, np.vstack([histories[0], sensed[0]])
    listed = times, kinds, impulses, states[0, :count]
    return Trajectory(begin, span, X, contact, end, bool(tally["held"][0]), *listed, shown, tally[0], failure)


def growth(regime: Regime) -> float:
    """Return the largest real part of the poles of a regime, 1/s."""
    half, w2 = 0.5 * regime.block[block.DAMPING, : regime.blocks], regime.block[block.STIFFNESS, : regime.blocks]
    poles = np.append((np.sqrt(half**2 - w2 + 0j) - half).real, -regime.first[first.RATE, : regime.firsts])
    return float(poles.max(initial=-np.inf))


def propagators(regime: Regime, spans: Array) -> Array:
    """Return the propagators of X, of the free tip, over each of some spans [s], ``(span, N, N)``."""
    n, t = regime.blocks, spans[:, None]
    half, w2 = 0.5 * regime.block[block.DAMPING, :n], regime.block[block.STIFFNESS, :n]
    C, S = (each[:, None] for each in oscillations(half, half**2 - w2, spans))
    eta, u, xi = np.split(regime.inward[:, : len(regime.inward)], [n, 2 * n], axis=1)
    decay = np.exp(-regime.first[first.RATE, : regime.firsts] * t)[:, None]
    moved = [eta * (C + half * S) + u * S, u * (C - half * S) - eta * (w2 * S), xi * decay]
    inner = np.concatenate(moved, axis=2) @ regime.outward
    heats = len(regime.inward) - 2 * regime.entry.shape[1]
    changes = _twice(regime.entry, heats) @ inner @ _twice(regime.exit, heats)
    return np.asarray(changes.swapaxes(1, 2))


@dataclass(frozen=True, eq=False)
class Linear:
    """A regime, free or held, in its modes Z = [z, z', τ], and the transform to X = [y, y', τ] of the free tip."""

    A: Array
    B: Array
    """Z' per w = [f̄, q, F, d, d', d'']."""
    signal: Array
    signal_inputs: Array
    """Signal, the gap or the contact force, per Z and w: see :class:`ModalSystem`."""
    exit: Array
    """X per Z …"""
    place: Array
    """… and per d and d' of the casing, ``(N, 2)``."""

    def steady(self, case: Case, t: float) -> tuple[Array, float]:
        """Return X and the signal of the steady response to the loads at t.

        Raises
        ------
        numpy.linalg.LinAlgError
            There is none: a pole is that of a load.
        """
        sources = [(0.0, np.concatenate([case.steady, case.heating, [case.mean, case.gap, 0.0, 0.0]]), 1.0 + 0.0j)]
        still = np.zeros(case.steady.size + case.heating.size)
        for omega, phase, force, casing in case.waves:
            rates = casing * np.array([1.0, 1j * omega, -(omega**2)])
            sources.append((omega, np.concatenate([still, [force], rates]), -1j * np.exp(1j * (omega * t + phase))))
        Z, w = np.zeros(self.A.shape[0]), np.zeros(still.size + 4)
        for omega, inputs, turn in sources:
            Z += (np.linalg.solve(1j * omega * np.eye(Z.size) - self.A, self.B @ inputs) * turn).real
            w += (inputs * turn).real
        X = self.exit @ Z + self.place @ w[-3:-1]
        return np.asarray(X), float(self.signal @ Z + self.signal_inputs @ w)


@lru_cache(maxsize=8)
def linear(system: ModalSystem, alpha: float) -> Linear:
    """Return a regime at α."""
    A, row, B = state_space(system, alpha)
    heats, n = system.rate.size, system.entry.shape[0] - 1
    place = np.zeros((2 * n + heats, 2))
    place[:n, 0] = place[n : 2 * n, 1] = system.exit[-1]
    return Linear(A, B, row, signal_inputs(system), _twice(system.exit, heats).T, place)


def _twice(rows: Array, heats: int) -> Array:
    """Return the transform of displacements, velocities and temperatures, by rows of modes and one of the gap."""
    return block_diagonal(rows[:-1], rows[:-1], np.eye(heats))
