"""The exact motion of one case from any state, with its events, for the search of periodic orbits."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array
from workflow.schemes._exact import outcome
from workflow.schemes._exact.batch import MarchInput
from workflow.schemes._exact.march import march
from workflow.schemes._exact.record import TALLY, TOUCH, Record
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


def advance(
    march_input: MarchInput, X: Array, contact: bool, begin: float, span: float, kept: int = 64, samples: int = 1
) -> Trajectory:
    """Return the exact motion from X at ``begin`` [s] over ``span`` [s].

    ``kept`` is a guess of the number of events; 0 leaves them out.
    """
    free, held, case, memories, tip = march_input
    waves = case.load.waves.copy()
    omega, phase, _, amplitude = case.load.waves.T
    waves[:, 1] = turn = phase + begin * omega
    apart = case.load.gap + np.sin(turn) @ amplitude - tip @ X[: tip.size]
    speed = tip @ X[tip.size : 2 * tip.size] - np.cos(turn) @ (omega * amplitude)
    moving = case.tip._replace(distance=float(apart), speed=float(speed))
    case = case._replace(load=case.load._replace(waves=waves, duration=span), tip=moving, modal=X.copy())
    due = np.linspace(0.0, span, samples + 1)
    while True:
        tally, events = np.zeros(1, dtype=TALLY)[0], np.zeros((kept, 3 + X.size))
        histories = np.full((len(HISTORIES), due.size), np.nan)
        tally["held"] = contact
        record = Record(due, np.zeros(0), histories, np.zeros((7, 0)), tally, events)
        ended = int(march(free, held, case, record, memories))
        count = int(tally["events"])
        if count <= kept or not kept:
            break
        kept = count
    done = ended == outcome.COMPLETED
    end = memories[0].modal[: X.size].copy() if done else np.full(X.size, np.nan)
    failure = "" if done else outcome.failure(ended, tally, case.budget, case.tip.e)
    times, kinds, impulses = events[:count, :3].T
    at_end, states = bool(tally["held"]), events[:count, 3:]
    return Trajectory(begin, span, X, contact, end, at_end, times, kinds, impulses, states, histories, tally, failure)
