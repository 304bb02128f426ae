"""Quantities of load periods from sampled histories."""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases
from workflow.schemes import SECTIONS, Results, Sampling, complete_periods


def contact_force(impulse: Array, interval: float) -> Array:
    """Return the mean contact force over the interval before each sample, N, from the impulse's running sum."""
    force = np.zeros_like(impulse)
    force[..., 1:] = np.diff(impulse, axis=-1) / interval
    return force


def widened(values: Array, periods: int) -> Array:
    """Return values padded with NaN to ``periods`` load periods, ``(case, …, period)``."""
    wide = np.full((*values.shape[:-1], periods), np.nan)
    wide[..., : values.shape[-1]] = values
    return wide


SETTLED, FEWEST = 0.05, 8
"""Change of the mean impulse up to which a rub has settled, and the load periods below which that is not judged."""


def change_of_impulse(impulse: Array) -> Array:
    """Return the change of the mean impulse of a load period from the third quarter of the periods to the last.

    A quarter is cut to a multiple of 12 periods, a shorter one of 6 or of 2: whole repetitions over 2, 3, 4 and 6.
    |p₄ - p₃|/max(p₄, p₃), ``(…)``, of impulses ``(…, period)`` that are NaN behind a case's last period; 0 without
    contact, NaN of fewer than :data:`FEWEST` periods. A rub has settled where no contact exceeds :data:`SETTLED`.
    """
    count = np.isfinite(impulse).sum(axis=-1, keepdims=True)
    ago, quarter = count - np.arange(impulse.shape[-1]), count // 4  # 1 of the last period
    quarter -= quarter % np.select([quarter >= 12, quarter >= 6], [12, 6], 2)
    last, before = (
        np.where((ago > k * quarter) & (ago <= (k + 1) * quarter), impulse, 0.0).sum(axis=-1) for k in range(2)
    )
    larger = np.maximum(last, before)
    change = np.divide(np.abs(last - before), larger, out=np.zeros_like(larger), where=larger > 0)
    return np.where(count[..., 0] >= FEWEST, change, np.nan)


def largest_per_period(force: Array, frequency: Array, sampling: Sampling, periods: int) -> Array:
    """Return the largest force of the output intervals with their middle in each load period.

    A period without one takes the interval that contains its own middle. ``(case, …, period)``.
    """
    largest = np.full((*force.shape[:-1], periods), np.nan)
    count, interval = force.shape[-1], sampling.interval
    middle = (np.arange(count) + 0.5) * interval
    for value in np.unique(frequency[frequency > 0]):
        rows = np.flatnonzero(frequency == value)
        edges = np.searchsorted(middle * value, np.arange(periods + 1))
        complete = int(complete_periods(np.array([value]), sampling)[0])
        for k in range(min(periods, complete)):
            first, stop = int(edges[k]), int(edges[k + 1])
            if first == stop:
                first = min(int((k + 0.5) / value / interval), count - 1)
                stop = first + 1
            largest[rows, ..., k] = force[rows, ..., first:stop].max(axis=-1)
    return largest


def sections(results: Results, cases: Cases, sampling: Sampling, periods: int) -> dict[str, Array]:
    """Return the Poincaré sections of load periods and the extremes of the displacement; NaN where there are none."""
    x = results.histories["displacement"]
    blank = np.full((*x.shape[:-1], periods), np.nan)
    values = {name: blank.copy() for name in SECTIONS}
    values |= {name: widened(section, periods) for name, section in results.sections.items()}
    starts, largest, smallest = values["section_displacement"], blank.copy(), blank.copy()
    counts = complete_periods(cases.period_frequency, sampling)
    for case, frequency in enumerate(cases.period_frequency):
        position, number = sampling.times * frequency, np.arange(counts[case])
        first = np.searchsorted(position, number * (1 - 1e-12))
        stop = np.searchsorted(position, (number + 1) * (1 + 1e-12), side="right")
        for k in number:
            within = np.concatenate([x[case, ..., first[k] : stop[k]], starts[case, ..., k : k + 2]], axis=-1)
            largest[case, ..., k], smallest[case, ..., k] = (of.reduce(within, axis=-1) for of in (np.fmax, np.fmin))
    return {**values, "period_displacement": largest, "period_displacement_min": smallest}
