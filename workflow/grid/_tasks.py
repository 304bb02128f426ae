"""Cutting the grid in tasks: units of storage bundled to a fair length of work."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices
from workflow.grid._operators import reduced_structure
from workflow.grid._solve import longest_period_count

SHORTEST, LONGEST = 0.1, 5.0
"""Seconds of work of a task: below, dask's cost of about 0.5 ms a task would show; above, the end
of a run waits for single tasks."""

TASKS_WANTED = 64
"""Tasks a study is cut in where that makes them neither too short nor too long: the same for any
number of threads, so that an interrupted run finds its shards again."""

TASK_BYTES = 64 * 2**20
"""Results a task holds in memory before they are written."""

CHUNK_BYTES = 4 * 2**20
"""Bytes of one history in a chunk of the archive, before compression."""


@dataclass(frozen=True)
class Segment:
    """A run of units of one outer index; ``first`` counts within that outer index."""

    outer: int
    first: int
    units: int


@dataclass(frozen=True)
class Task:
    """What one dask task computes and stores."""

    number: int
    segments: tuple[Segment, ...]
    seconds: float
    cases: int


@dataclass(frozen=True, eq=False)
class Units:
    """How the cases of one outer index are cut in units: runs of ``chunk`` along the innermost."""

    rows: int
    inner: int
    chunk: int

    @property
    def per_row(self) -> int:
        """Units of a row."""
        return -(-self.inner // self.chunk)

    @property
    def count(self) -> int:
        """Units of an outer index."""
        return self.rows * self.per_row

    def cases(self, first: int, units: int) -> tuple[Indices, Indices]:
        """Return the inner indices of some units, and their places in ``units * chunk`` slots."""
        found, places = [], []
        for k, unit in enumerate(range(first, first + units)):
            row, c = divmod(unit, self.per_row)
            inside = np.arange(c * self.chunk, min((c + 1) * self.chunk, self.inner), dtype=np.int64)
            found.append(row * self.inner + inside)
            places.append(k * self.chunk + inside - c * self.chunk)
        return np.concatenate(found), np.concatenate(places)


def seconds_per_case(grid: Grid, outer: int) -> float:
    """Return the estimated seconds of one case, from the scheme's fixed cost model."""
    cell = grid.settings(outer)
    scheme = schemes.load(cell.scheme.method)
    return scheme.cost(reduced_structure(cell), cell.h, cell.scheme.options, grid.sampling)


def bytes_per_case(grid: Grid) -> int:
    """Return the bytes of a case's results in memory."""
    return 8 * (5 * grid.sampling.count + 4 * longest_period_count(grid) + 20)


def units_of(grid: Grid) -> Units:
    """Cut the innermost dimension so that a chunk is neither large nor long to compute."""
    inner = grid.inner_shape[-1] if grid.inner else 1
    slowest = max((seconds_per_case(grid, outer) for outer in grid.places), default=0.0)
    by_size = CHUNK_BYTES // (8 * grid.sampling.count)
    by_time = int(LONGEST / slowest) if slowest > 0 else inner
    return Units(grid.inner_count // inner, inner, max(1, min(inner, by_size, by_time)))


def tasks(grid: Grid, units: Units) -> Iterator[Task]:
    """Yield the tasks of a study in archive order, one at a time; only distinct results are computed."""
    seconds = {outer: seconds_per_case(grid, outer) for outer in grid.places}
    total = sum(seconds.values()) * grid.inner_count
    wanted = min(max(total / TASKS_WANTED, SHORTEST), LONGEST)
    most_cases = max(units.chunk, TASK_BYTES // bytes_per_case(grid))
    number, gathered, work, cases = 0, [], 0.0, 0
    for outer, each in seconds.items():
        first = 0
        while first < units.count:
            room = min((wanted - work) / (each * units.chunk), (most_cases - cases) / units.chunk)
            taken = min(units.count - first, max(1, int(room)))
            gathered.append(Segment(outer, first, taken))
            size = units.cases(first, taken)[0].size
            work, cases, first = work + size * each, cases + size, first + taken
            if work >= 0.9 * wanted or cases + units.chunk > most_cases:
                yield Task(number, tuple(gathered), work, cases)
                number, gathered, work, cases = number + 1, [], 0.0, 0
    if gathered:
        yield Task(number, tuple(gathered), work, cases)
