"""How long a study will take on this machine: the cost model, times the factor that runs measured."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from workflow import schemes
from workflow.grid import _speed
from workflow.grid._ahead import kernel_variants
from workflow.grid._arrangement import Grid
from workflow.grid._compile import is_missing
from workflow.grid._conditions import alpha_of
from workflow.grid._costs import (
    LOADING,
    beside_seconds,
    case_seconds,
    compiling_seconds,
    growth_seconds,
    handling_seconds,
    modes_seconds,
    setup_seconds,
)
from workflow.grid._frequencies import fastest, longest_period_count
from workflow.grid._operators import full_structure, reduced_structure
from workflow.grid._reference import distinct_solutions
from workflow.grid._reference_solutions import REFERENCE_RUNS
from workflow.grid._tasks import Task, decides_cost, seconds_per_case, steady_bytes, tasks
from workflow.kernels.lanes import PACK

MOST_LOOKED_AT = 20_000
"""Cases whose couplings are looked at."""


@dataclass(frozen=True)
class Time:
    """How long a study will take, in seconds of wall time as ``run`` prints them.

    Attributes
    ----------
    seconds
        Wall time on ``threads`` threads, nothing compiled meanwhile.
    threads
        One for each processor that this process may use.
    core_seconds
        Processor time of all threads together.
    compiling
        Seconds that compiling takes once, beside; 0 where all is compiled.
    measured
        Whether runs on this machine have measured its speed.
    """

    seconds: float
    threads: int
    core_seconds: float
    compiling: float
    measured: bool


@contextmanager
def measured_run(here: bool) -> Iterator[None]:
    """Remember the speed of this machine at the end of a run, if it computes ``here``, in this process."""
    _speed.forget()
    yield
    if here:
        _speed.remember()


def result_bytes(grid: Grid) -> int:
    """Return the size of a study's results before compression."""
    stored = 8 if grid.study.output.precision == "float64" else 4
    sampled = stored * len(grid.study.output.histories) * grid.sampling.count
    each = 8 * (4 * longest_period_count(grid) + 22) + sampled + steady_bytes(grid)
    return grid.outer_count * grid.inner_count * each


def estimate(grid: Grid, threads: int | None = None) -> Time:
    """Return how long a study will take; ``threads`` is one for each processor where not given."""
    threads, factor = threads or len(os.sched_getaffinity(0)), _speed.factor()
    scale, seconds = factor or 1.0, [model_seconds(grid, task) for task in tasks(grid)]
    work = (sum(seconds) + beside_tasks(grid)) * scale
    beside = beside_seconds(grid.outer_count * grid.inner_count, result_bytes(grid))
    beside += LOADING * len(kernel_variants(grid))
    return Time(
        seconds=max(work / threads, max(seconds) * scale) + beside,
        threads=threads,
        core_seconds=work + beside,
        compiling=time_to_compile(grid, threads),
        measured=factor is not None,
    )


def task_seconds(grid: Grid) -> Iterator[tuple[Task, float]]:
    """Yield the tasks of a study in their order, each with the processor seconds it will take on this machine.

    What tasks share, references above all, is spread evenly over their work.
    """
    total = sum(model_seconds(grid, task) for task in tasks(grid))
    scale = (1 + beside_tasks(grid) / total) * (_speed.factor() or 1.0)
    for task in tasks(grid):
        yield task, model_seconds(grid, task) * scale


def model_seconds(grid: Grid, task: Task) -> float:
    """Return the processor seconds of a task by the cost model, without references, operators and growth rates."""
    model, seconds = grid.study.scene.model, 0.0
    for batch in task.batches:
        kind = int(grid.alike(np.array([batch.outer]), lambda path: decides_cost(path, model))[0])
        seconds += _batch_seconds(grid, kind, batch.inner.size)
    return seconds


@lru_cache(maxsize=4096)
def _batch_seconds(grid: Grid, outer: int, count: int) -> float:
    """Return model seconds of so many cases: the distinct ones are stepped, where a scheme has packs whole ones."""
    settings = grid.settings(outer)
    distinct = math.ceil(count * grid.distinct_inner(settings) / grid.inner_count)
    padded = -(-distinct // PACK) * PACK if schemes.load(settings.scheme.method).TOGETHER > 1 else distinct
    handling = handling_seconds(count, grid.sampling.count, len(grid.study.output.histories))
    return padded * seconds_per_case(grid, outer) + handling


def time_to_compile(grid: Grid, threads: int) -> float:
    """Return the seconds that compiling a study's schemes will take, 0 where all are compiled."""
    seconds = [compiling_seconds(variant.method) for variant in kernel_variants(grid) if is_missing(variant)]
    return sum(seconds) / min(threads, 2)


def beside_tasks(grid: Grid) -> float:
    """Return model seconds of what tasks share: references, operators, growth rates."""
    return _reference_seconds(grid) + _operator_seconds(grid)


def _reference_seconds(grid: Grid) -> float:
    """Return model seconds of reference solutions, and of exact solutions beside them with their operators."""
    sampling, periods = replace(grid.sampling, balances=False), fastest(grid) * grid.sampling.duration
    seconds = 0.0
    for settings, is_exact, count in distinct_solutions(grid):
        structure, runs = reduced_structure(settings), count * (1 if is_exact else REFERENCE_RUNS)
        seconds += runs * case_seconds(settings, structure, sampling, periods)
        seconds += setup_seconds(structure) + modes_seconds(full_structure(settings))
    return seconds


def _operator_seconds(grid: Grid) -> float:
    """Return model seconds of operators, and of growth rates at each distinct α of a structure."""

    def matters(path: str) -> bool:
        return path not in ("scheme", "h") and not path.startswith("schemes.")

    structures = np.unique(grid.alike(grid.computed, matters))
    kinds, counts = np.unique(
        grid.alike(structures, lambda path: matters(path) and decides_cost(path, grid.study.scene.model)),
        return_counts=True,
    )
    inner, seconds = np.arange(min(grid.inner_count, MOST_LOOKED_AT), dtype=np.int64), 0.0
    for outer, count in zip(kinds.tolist(), counts.tolist(), strict=True):
        settings = grid.settings(outer)
        structure, alpha = reduced_structure(settings), alpha_of(settings, grid.inner_values(inner), inner.size)
        operators = count * grid.computed.size / structures.size
        full = full_structure(settings)
        once = modes_seconds(full) + np.unique(alpha).size * growth_seconds(structure)
        seconds += operators * setup_seconds(structure) + count * once
    return seconds
