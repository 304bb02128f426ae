"""The exact motion of one case from any state, with its events, for the search of periodic orbits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases
from workflow.schemes._exact import outcome
from workflow.schemes._exact.batch import Operator
from workflow.schemes._exact.layout import Case, Regime, scratch, unpacked
from workflow.schemes._exact.march import march
from workflow.schemes._exact.record import TALLY, TOUCH, Record
from workflow.schemes._exact.regimes import InseparablePolesError
from workflow.schemes._exact.tables import wave
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
    """x_n, v_n, θ_n and the impulse at samples, ``(4, sample)``."""
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
        return ends, np.concatenate([[self.was_held], self.kinds == TOUCH])


class OneCase(NamedTuple):
    """A batch of one case, with its regimes as rows of :func:`~workflow.schemes._exact.layout.tabulate`."""

    free: Array
    """Without and with thermal modes, ``(2, number)``."""
    held: Array
    """``(1, number)``."""
    conditions: Case
    tip: Array
    """φ_n, ``(mode,)``."""

    @property
    def own(self) -> Case:
        """The conditions of the case."""
        first: Any = (value[0] if isinstance(value, np.ndarray) else value for value in self.conditions)
        return Case(*first)

    def regime(self, held: bool) -> Regime:
        """Return the regime of the held or the free tip."""
        return unpacked(self.held[0] if held else self.free[self.own.free])


def one_case(operator: Operator, cases: Cases, duration: float, *, heated: bool = False) -> OneCase:
    """Return a case over a time [s], with thermal states where heat acts or ``heated`` is set.

    Raises
    ------
    InseparablePolesError
        Three poles coincide.
    """
    warm = cases.heated | heated
    free, held = operator.free, operator.held.at(cases.alpha, cases.friction, warm)
    if not (free.separable[warm.astype(int)].all() and held.separable.all()):
        raise InseparablePolesError
    conditions = operator.conditions(cases, duration)._replace(free=warm.astype(np.int64))
    return OneCase(free.rows, held.rows, conditions, operator.basis.tip)


def advance(
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
        tally, events = np.zeros(1, dtype=TALLY), np.zeros((kept, 3 + X.size))
        histories = np.full((1, len(HISTORIES), due.size), np.nan)
        tally["held"] = contact
        record = Record(due, np.zeros((1, 0)), histories, np.zeros((1, 7, 0)), tally, events)
        march(case.free, case.held, given, np.zeros(1, dtype=np.int64), record, memory, ended)
        count = int(tally["events"][0])
        if count <= kept or not kept:
            break
        kept = count
    done = ended[0] == outcome.COMPLETED
    end = given.modal[0] if done else np.full(X.size, np.nan)
    failure = "" if done else outcome.failure(int(ended[0]), tally[0], conditions.budget, float(conditions.e[0]))
    times, kinds, impulses = events[:count, :3].T
    at_end, states = bool(tally["held"][0]), events[:count, 3:]
    return Trajectory(
        begin, span, X, contact, end, at_end, times, kinds, impulses, states, histories[0], tally[0], failure
    )
