"""What steps of several contacts show: samples, load periods and counts of each contact, and how cases end.

Steps are linear between their ends; the end itself is taken exactly.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.compiled import inlined, part
from workflow.schemes._exact.record import Record

PLACE, SPEED, TEMPERATURE, DEPTH = range(4)
"""Rows of what is shown: x_i [m], x_i' [m/s], θ_i [K] and x_i - d_i [m]."""


SUMS = np.dtype(
    [
        ("first_energy", "f8"),  # J
        ("last_energy", "f8"),
        ("largest_energy", "f8"),
        ("dissipated", "f8"),  # less the work of loads and contact, J
        ("lost", "f8"),  # heat, J
        ("turned_over", "f8"),  # sum of |lost| over the steps, J
        ("friction_heat", "f8"),  # J
        ("gained", "f8"),  # heat content at the end less that at t = 0, J
        ("approached", "f8"),  # sums of effective_restitution, (m/s)²
        ("separated", "f8"),
    ]
)
"""Sums of a case."""


class Balancing(NamedTuple):
    """Whether balances are counted, and the heat content per thermal mode, J/K."""

    counts: bool
    content: Array


class Ending(NamedTuple):
    """How cases ended, ``(case,)``, the largest penetration, m, ``(case, contact)``, and :data:`SUMS` of each.

    ``state`` is [y, y', τ] at the end, ``(case, number)``.
    """

    ended: NDArray[np.int64]
    penetration: Array
    sums: Any
    balancing: Balancing
    state: Array


class Marks(NamedTuple):
    """Number of steps, and those in which a sample or the end of a load period is due, with its fraction of the step.

    Those of load periods are of a case ``(period,)``, or of all cases ``(case, period)``.
    """

    steps: int
    sample_due: NDArray[np.int64]
    sample_weight: Array
    period_due: NDArray[np.int64]
    period_weight: Array


class Shown(NamedTuple):
    """What the contacts show."""

    before: Array
    after: Array
    """At the beginning and the end of a step, ``(4, contact)``."""
    impulse: Array
    """Impulse in the step, N s, ``(contact,)``."""
    deepest: Array
    """Largest penetration so far, m, ``(contact,)``."""
    sensed: Array
    """What sensors show at the beginning and the end of a step, ``(2, sensor)``."""


@inlined
def between(before: float, after: float, share: float) -> float:
    """Interpolate at a fraction of a step; the step's end itself is exact."""
    return after if share == 1.0 else before + share * (after - before)


@part
def record_end(step: int, h: float, has_impacts: bool, record: Record, marks: Marks, shown: Shown) -> None:
    """Write the samples and load periods that are due within a step, and count its end."""
    first = record.tally[0]
    while first.next_sample < marks.sample_due.size and marks.sample_due[first.next_sample] == step:
        _sample(first.next_sample, marks.sample_weight[first.next_sample], record, shown)
        first.next_sample += 1
    while first.next_period < marks.period_due.size and marks.period_due[first.next_period] == step:
        _close_period(first.next_period, marks.period_weight[first.next_period], h, has_impacts, record, shown)
        first.next_period += 1
    share = marks.sample_weight[-1] if step == marks.steps else 1.0
    for i in range(shown.impulse.size):
        tally, pressed = record.tally[i], shown.impulse[i] > 0.0
        for k in range(4):
            shown.after[k, i] = between(shown.before[k, i], shown.after[k, i], share)
        tally.max_temperature = max(tally.max_temperature, shown.after[TEMPERATURE, i])
        tally.period_temperature = max(tally.period_temperature, shown.after[TEMPERATURE, i])
        shown.deepest[i] = max(shown.deepest[i], shown.after[DEPTH, i])
        if pressed:
            tally.impacts += has_impacts and not tally.held
            tally.contact_time += share * h
            tally.impulse += share * shown.impulse[i]
        tally.held = pressed


@part
def _sample(k: int, share: float, record: Record, shown: Shown) -> None:
    """Write sample k at a fraction of the step."""
    for i in range(shown.impulse.size):
        for row in range(3):
            record.histories[row, i, k] = between(shown.before[row, i], shown.after[row, i], share)
        impulse = record.tally[i].impulse
        record.histories[3, i, k] = between(impulse, impulse + shown.impulse[i], share)
    for s in range(shown.sensed.shape[1]):
        record.asked.sensed[s, k] = between(shown.sensed[0, s], shown.sensed[1, s], share)


@part
def _close_period(k: int, share: float, h: float, has_impacts: bool, record: Record, shown: Shown) -> None:
    """Write load period k, which ends at a fraction of the step, and begin the next one."""
    for i in range(shown.impulse.size):
        tally, pressed = record.tally[i], shown.impulse[i] > 0.0
        impulse = between(tally.impulse, tally.impulse + shown.impulse[i], share)
        contact = tally.contact_time + (share * h if pressed else 0.0)
        impacts = tally.impacts + (1 if pressed and has_impacts and not tally.held else 0)
        for row in range(3):
            record.periods[3 + row, i, k] = between(shown.before[row, i], shown.after[row, i], share)
        reached = record.periods[3 + TEMPERATURE, i, k]
        record.periods[0, i, k] = impulse - tally.period_impulse
        record.periods[1, i, k] = max(tally.period_temperature, reached)
        record.periods[2, i, k] = contact - tally.period_contact
        record.periods[6, i, k] = impacts - tally.period_impacts
        tally.max_temperature = max(tally.max_temperature, reached)
        tally.period_impulse, tally.period_contact = impulse, contact
        tally.period_temperature, tally.period_impacts = reached, impacts
