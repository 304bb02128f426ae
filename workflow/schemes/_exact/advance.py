"""The exact motion from state to state, with its events: what steady rubs and balances are made of."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Harmonics
from workflow.schemes._exact import outcome
from workflow.schemes._exact.batch import Batch, Operator
from workflow.schemes._exact.record import IMPACT, RELEASE, TOUCH
from workflow.schemes._interface import Sampling

KINDS = {RELEASE: "release", IMPACT: "impact", TOUCH: "touch"}
"""A contact ends; the tip flies on after an impact; a contact begins, where the tip was not at rest by an impact."""


@dataclass(frozen=True)
class States:
    """States of cases in the coordinates of the structure, ``(state, coordinate)``; the tip is last."""

    displacement: Array
    """m"""
    velocity: Array
    """m/s"""
    temperature: Array
    """K"""
    contact: NDArray[np.bool_]
    """Whether the tip is held on the casing, ``(state,)``."""


@dataclass(frozen=True)
class Events:
    """Contact events of cases, each case's in the order of time, ``(event,)``."""

    case: NDArray[np.intp]
    time: Array
    """s"""
    kind: NDArray[np.int64]
    """See :data:`KINDS`."""
    impulse: Array
    """Of an impact, N s."""
    after: States
    """States after the events."""


def start_of(cases: Cases) -> States:
    """Return the initial states of cases, in flight."""
    return States(cases.displacement, cases.velocity, cases.temperature, np.zeros(cases.count, dtype=bool))


def advance(operator: Operator, cases: Cases, states: States, t0: float, t1: float) -> tuple[States, Events]:
    """Return the states at t1 [s] that follow from ``states`` at t0, and the events between.

    States of a case that fails are NaN.
    """
    span, basis, end = t1 - t0, operator.basis, np.zeros(cases.count, dtype=bool)
    batch = Batch(operator, _begun(cases, states, t0), Sampling(span, span, 2))
    modal, events = np.full_like(batch.modal, np.nan), [np.zeros((0, 4 + batch.modal.shape[1]))] * cases.count
    for i in np.argsort(cases.alpha, kind="stable"):
        done = batch.advance(int(i), bool(states.contact[i]))
        if done.ended == outcome.COMPLETED:
            size = done.modal.size
            modal[i, :size], modal[i, size:], end[i] = done.modal, 0.0, bool(done.tally["held"])
            events[i] = np.zeros((len(done.events), 4 + modal.shape[1]))
            events[i][:, 0], events[i][:, 1 : 4 + size] = i, done.events
    case, time, kind, impulse, *rest = np.vstack(events).T
    at = np.array(rest).T.reshape(-1, batch.modal.shape[1])

    def of(modal: Array, contact: NDArray[np.bool_]) -> States:
        """Return states in the coordinates of the structure."""
        y, v, tau = np.split(modal, [basis.tip.size, 2 * basis.tip.size], axis=1)
        shapes = basis.free.shapes.T
        return States(y @ shapes, v @ shapes, tau @ basis.free.heat_shapes.T, contact)

    return of(modal, end), Events(
        case.astype(np.intp), t0 + time, kind.astype(np.int64), impulse, of(at, kind == TOUCH)
    )


def _begun(cases: Cases, states: States, t0: float) -> Cases:
    """Return cases that begin with states at t0."""

    def later(harmonics: Harmonics) -> Harmonics:
        return replace(harmonics, phase=harmonics.phase + 2 * np.pi * harmonics.frequency * t0)

    return replace(
        cases,
        displacement=states.displacement,
        velocity=states.velocity,
        temperature=states.temperature,
        phase=cases.phase + 2 * np.pi * cases.frequency * t0,
        load_harmonics=later(cases.load_harmonics),
        casing_harmonics=later(cases.casing_harmonics),
    )
