"""One batch through models, reduction and scheme: every variable of the archive for its cases."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices, values_along
from workflow.grid._conditions import conditions
from workflow.grid._operators import compile_for, run_batch, runaway_of, structure_of
from workflow.grid._reference import against_reference
from workflow.models import Array, Cases
from workflow.schemes import Results, Sampling, Status, complete_periods
from workflow.study import Cell, Study

SHORT, REPEATS = 2e-3, 3
"""A batch that took less, in seconds, is run up to so many times in all and the least time counts."""


@dataclass(frozen=True, eq=False)
class Solved:
    """All variables of a batch, by name, each ``(case, …)``, and what failed cases have to say."""

    values: dict[str, NDArray[Any]]
    messages: dict[int, str]


def solve(grid: Grid, outer: int, inner: Indices) -> Solved:
    """Run the cases ``inner`` of one outer index.

    Cases that differ only in axes their scheme does not read are run once; the reference may read
    them, so each has its own errors. What raises becomes cases of status ``failed``; it harms no
    neighbour, which then run one by one.
    """
    cell = grid.settings(outer)
    canonical, place = np.unique(grid.canonical_inner(cell, inner), return_inverse=True)
    solved = _solve_or_tell(grid, outer, canonical)
    where = place.ravel()
    values = {name: found[where] for name, found in solved.values.items()}
    with np.errstate(all="ignore"):
        values |= against_reference(grid, outer, inner, values)
    return Solved(
        values,
        {k: solved.messages[int(source)] for k, source in enumerate(where) if int(source) in solved.messages},
    )


def _solve_or_tell(grid: Grid, outer: int, inner: Indices) -> Solved:
    """Run distinct cases; where something raises one by one, and what then raises tells."""
    try:
        with np.errstate(all="ignore"):  # a case that leaves the numbers says so by its status
            return _solve_distinct(grid, outer, inner)
    except Exception as error:  # whatever a model or scheme raises is that case's result
        if inner.size == 1:
            return _failed(grid, f"{type(error).__name__}: {error}")
        return _joined([_solve_or_tell(grid, outer, inner[k : k + 1]) for k in range(inner.size)])


def _joined(parts: list[Solved]) -> Solved:
    """Put batches of one case each together."""
    names = parts[0].values
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in names}
    return Solved(values, {k: part.messages[0] for k, part in enumerate(parts) if part.messages})


def _solve_distinct(grid: Grid, outer: int, inner: Indices) -> Solved:
    cell = grid.settings(outer)
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    cases = conditions(cell, structure, grid.inner_values(inner), inner.size)
    compile_for(cell)
    results, seconds = _timed(grid, cell, cases)
    distinct, where = np.unique(cases.alpha, return_inverse=True)
    critical, growth = np.transpose([runaway_of(cell, float(alpha)) for alpha in distinct])[:, where]
    values: dict[str, NDArray[Any]] = {
        **results.histories,
        **{name: np.full(inner.size, np.nan) for name in scheme_metrics(grid.study)},
        **results.metrics,
        **_contact(results, cases, grid),
        "critical_alpha": critical,
        "growth_rate": growth,
        "wall_time": np.full(inner.size, seconds / inner.size),
        "status": results.status,
        "runaway": ((cases.alpha > 0) & (cases.alpha >= critical)).astype(np.int8),
    }
    return Solved(values, dict(results.messages))


def _timed(grid: Grid, cell: Cell, cases: Cases) -> tuple[Results, float]:
    """Run a batch and return its seconds; a short one is repeated where time is weighed against error."""
    seconds: list[float] = []
    while True:
        begun = time.perf_counter()
        results = run_batch(cell, cases, grid.sampling)
        seconds.append(time.perf_counter() - begun)
        if grid.study.reference is None or sum(seconds) > SHORT or len(seconds) == REPEATS:
            return results, min(seconds)


def _contact(results: Results, cases: Cases, grid: Grid) -> dict[str, Array]:
    """Return contact force and impulses, all from the sampled running sum of the impulse."""
    interval, periods = grid.sampling.interval, longest_period_count(grid)
    impulse = results.histories["impulse"]
    force = np.zeros_like(impulse)
    force[:, 1:] = np.diff(impulse, axis=1) / interval

    def widened(values: Array) -> Array:
        wide = np.full((values.shape[0], periods), np.nan)
        wide[:, : values.shape[1]] = values
        return wide

    return {
        "contact_force": force,
        "contact_impulse": impulse[:, -1].copy(),
        "period_impulse": widened(results.period_impulse),
        "period_force": _largest_per_period(force[:, 1:], cases.frequency, grid.sampling, periods),
        "period_temperature": widened(results.period_temperature),
        "period_contact": widened(results.period_contact),
    }


def _largest_per_period(force: Array, frequency: Array, sampling: Sampling, periods: int) -> Array:
    """Return the largest force of the output intervals whose middle lies in each load period.

    A period shorter than an interval takes the interval that holds its own middle.
    """
    largest = np.full((force.shape[0], periods), np.nan)
    count, interval = force.shape[1], sampling.interval
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
            largest[rows, k] = force[rows, first:stop].max(axis=1)
    return largest


def longest_period_count(grid: Grid) -> int:
    """Return the size of the dimension ``period``: the most complete load periods any case has."""
    values = values_along(grid, "scene.load.frequency", grid.study.scene.load.frequency)
    return int(complete_periods(np.array(values), grid.sampling).max())


def scheme_metrics(study: Study) -> dict[str, tuple[str, str]]:
    """Return the metrics that only some of a study's schemes give: name to unit and meaning."""
    methods = sorted({scheme.method for scheme in study.schemes.values()})
    return {name: about for method in methods for name, about in schemes.metrics(method).items()}


def _failed(grid: Grid, text: str) -> Solved:
    """Return one case that raised: NaN everywhere, flags told."""
    nan, periods = np.full(1, np.nan), longest_period_count(grid)
    names = ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing", "steps")
    balances = ("energy_residual", "heat_residual") if grid.sampling.balances else ()
    derived = ("contact_impulse", "critical_alpha", "growth_rate", "wall_time")
    histories = (*schemes.HISTORIES, "contact_force")
    per_period = ("period_impulse", "period_force", "period_temperature", "period_contact")
    return Solved(
        {
            **{name: np.full((1, grid.sampling.count), np.nan) for name in histories},
            **dict.fromkeys((*names, *scheme_metrics(grid.study), *derived, *balances), nan),
            **{name: np.full((1, periods), np.nan) for name in per_period},
            "status": np.full(1, Status.FAILED, dtype=np.int8),
            "runaway": np.zeros(1, dtype=np.int8),
        },
        {0: text},
    )
