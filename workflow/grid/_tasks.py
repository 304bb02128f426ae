"""Cutting the grid in tasks: batches of cases bundled to a fair length of work."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices, decides_structure
from workflow.grid._conditions import alpha_of
from workflow.grid._costs import (
    case_seconds,
    growth_seconds,
    handling_seconds,
    modes_seconds,
    setup_seconds,
    steady_seconds,
)
from workflow.grid._frequencies import fastest, longest_period_count
from workflow.grid._operators import full_structure, reduced_structure
from workflow.kernels.lanes import PACK
from workflow.study import CaseSettings

SHORTEST, LONGEST = 0.1, 5.0
"""Seconds of work of a task but for the last ones: below, dask's cost of about 0.5 ms a task would show;
above, the end of a run waits for single tasks."""

TARGET_TASKS = 64
"""Tasks a study is cut in where that makes them neither too short nor too long, and a smaller power of
two where they would be too short: the same for any number of threads, so that an interrupted run finds
its shards again."""

UNBROKEN = 60.0
"""Seconds up to which cases that are stepped together make a task longer than it would be: fewer of them
cost as much, but a task that is lost is lost as a whole."""

LAST, SHORTEST_LAST = 4, 0.01
"""A task is at most this part of what is left of a study, down to a chunk or so many seconds: of equal
tasks the last one runs alone for most of its time, of such ones threads end together."""

TASK_BYTES = 32 * 2**20
"""Results a task holds in memory before they are written."""

MOST_ROWS = 1000
"""Runs along the innermost dimension up to which a batch ends with one, unless it ends within one."""

BATCH_SECONDS = 0.025
"""Work of a batch that is short enough for the last tasks of a run."""

MOST_LOOKED_AT = 20_000
"""Cases whose couplings are looked at."""


class Batch(NamedTuple):
    """Cases that share their operators: those of one outer index, with their inner indices, ``(case,)``."""

    outer: int
    inner: Indices


@dataclass(frozen=True, eq=False)
class Task:
    """Batches that are computed and stored together: what one dask task does.

    ``seconds`` are those of the cost model, without references.
    """

    number: int
    batches: tuple[Batch, ...]
    seconds: float
    cases: int


class Costs(NamedTuple):
    """What the outer indices that are computed cost, ``(outer,)`` each.

    ``setup`` are seconds before the first case, ``each`` those of an inner index; ``together`` is the number of cases
    that the scheme steps at once.
    """

    setup: NDArray[np.float64]
    each: NDArray[np.float64]
    together: NDArray[np.int64]


def seconds_per_case(grid: Grid, outer: int) -> float:
    """Return the seconds of one case by the cost model."""
    settings = grid.settings(outer)
    structure, periods = reduced_structure(settings), fastest(grid) * grid.sampling.duration
    return steady_seconds(grid.study, settings, structure) + case_seconds(settings, structure, grid.sampling, periods)


@lru_cache(maxsize=4)
def costs(grid: Grid) -> Costs:
    """Return the costs of a grid.

    The cost model knows scheme, step and sizes: what else an axis varies in a structure does not count.
    Structures are made for it, and kept for the run, so that one thread of BLAS makes them here as in a
    task: their last bits depend on the number of threads.
    """
    from threadpoolctl import threadpool_limits

    model = grid.study.scene.model
    kinds, kind = np.unique(grid.alike(grid.computed, lambda path: decides_cost(path, model)), return_inverse=True)
    of_structure = grid.alike(grid.computed, decides_structure)
    _, structure, sharing = np.unique(of_structure, return_inverse=True, return_counts=True)
    with threadpool_limits(limits=1, user_api="blas"):
        every = [grid.settings(outer) for outer in kinds.tolist()]
        operator = np.array([setup_seconds(reduced_structure(settings)) for settings in every])
        modes = np.array([modes_seconds(full_structure(settings)) for settings in every])
        growth = np.array([_growth_seconds_of_inner(grid, settings) for settings in every])
        each = np.array([_seconds_of_inner(grid, outer) for outer in kinds.tolist()])
    together, shared = np.array([schemes.load(one.scheme.method).TOGETHER for one in every]), sharing[structure]
    return Costs(operator[kind] + modes[kind] / shared, each[kind] + growth[kind] / shared, together[kind])


def _growth_seconds_of_inner(grid: Grid, settings: CaseSettings) -> float:
    """Return the mean over the inner indices of what the growth rates at all distinct α of a structure cost."""
    inner = np.arange(min(grid.inner_count, MOST_LOOKED_AT), dtype=np.int64)
    couplings = np.unique(alpha_of(settings, grid.inner_values(inner), inner.size)).size
    return couplings / inner.size * growth_seconds(reduced_structure(settings))


def _seconds_of_inner(grid: Grid, outer: int) -> float:
    """Return the mean over the inner indices: distinct cases are stepped, where a scheme has packs whole ones."""
    settings = grid.settings(outer)
    stepped = grid.inner_distinct(grid.is_read(settings.scheme))
    if schemes.load(settings.scheme.method).TOGETHER > 1:
        stepped = -(-stepped // PACK) * PACK
    handling = handling_seconds(grid.sampling.count, len(grid.study.output.histories))
    return stepped / grid.inner_count * seconds_per_case(grid, outer) + handling


def decides_cost(path: str, model: str) -> bool:
    """Tell whether the cost model knows of an axis."""
    return not path.startswith(f"scene.{model}.") or path == f"scene.{model}.nodes"


def bytes_per_case(grid: Grid) -> int:
    """Return the bytes of a case in memory: its results, what is derived of them, and the copy that is stored."""
    return 8 * (10 * grid.sampling.count + 8 * longest_period_count(grid) + 60) + steady_bytes(grid)


def steady_bytes(grid: Grid) -> int:
    """Return the bytes of a case's steady rubs, 0 where they are not asked for."""
    steady, branch = grid.study.output.steady, grid.study.branch
    return 0 if steady is None else 8 * (3 * steady.samples + 16) * (1 if branch is None else branch.points)


def _grain(grid: Grid) -> int:
    """Return of how many cases a batch is a multiple, so that a task is no longer than a fair share of the study.

    Cases that are stepped together may make it longer.
    """
    if grid.study.branch is not None:
        return 1
    _, seconds, at_once = costs(grid)
    share = min(max(float(seconds.sum()) * grid.inner_count / TARGET_TASKS, BATCH_SECONDS), LONGEST)
    most = _power_of_two_below(float(np.min(np.maximum(share, np.minimum(UNBROKEN, at_once * seconds)) / seconds)))
    row = grid.inner_shape[-1] if grid.inner else 1
    return min(most, row if grid.outer_count * grid.inner_count <= MOST_ROWS * row else grid.inner_count)


def tasks(grid: Grid) -> Iterator[Task]:
    """Yield the tasks of a study in archive order, one at a time; only distinct results are computed.

    Cases that are stepped together stay together: fewer would cost as much.
    """
    setup, seconds, at_once = costs(grid)
    total = float(seconds.sum()) * grid.inner_count + float(setup.sum())
    target = max(_power_of_two_below(min(total / SHORTEST, TARGET_TASKS)), math.ceil(total / LONGEST))
    most_cases, grain = max(1, TASK_BYTES // bytes_per_case(grid)), _grain(grid)
    grain = min(grain, most_cases)
    gathered: list[Batch] = []
    number, work, cases, assigned = 0, 0.0, 0, 0.0

    def finished() -> Task:
        return Task(number, tuple(gathered), work, cases)

    least_cases = -(-at_once // grain) * grain
    for outer, once, each, least in zip(
        grid.computed.tolist(), setup.tolist(), seconds.tolist(), least_cases.tolist(), strict=True
    ):
        first = 0
        while first < grid.inner_count:
            left, most_together = total - assigned, max(grain, int(UNBROKEN / each))
            few = min(least, grid.inner_count - first, most_together)
            fair = min(left / max(1, target - number), max(left / LAST, SHORTEST_LAST), LONGEST)
            begin = once if first == 0 else 0.0
            room, fitting = (fair - work - begin) / each, most_cases - cases
            if gathered and (work >= 0.9 * fair or room < 0.5 * few or fitting < min(few, grid.inner_count - first)):
                yield finished()
                number, gathered, work, cases, assigned = number + 1, [], 0.0, 0, assigned + work
                continue
            count = few * max(1, round(min(room, grid.inner_count) / few))
            count = min(grid.inner_count - first, count, max(few, fitting // grain * grain))
            gathered.append(Batch(outer, np.arange(first, first + count, dtype=np.int64)))
            work, cases, first = work + begin + count * each, cases + count, first + count
    if gathered:
        yield finished()


def _power_of_two_below(value: float) -> int:
    return 1 << max(0, int(value).bit_length() - 1)
