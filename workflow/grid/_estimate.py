"""How long a study will take on this machine: the cost model, times the factor that runs measured."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from workflow.grid import _speed
from workflow.grid._ahead import kernel_variants
from workflow.grid._arrangement import Grid
from workflow.grid._compile import is_missing
from workflow.grid._costs import LOADING, beside_seconds, compiling_seconds, modes_seconds, setup_seconds
from workflow.grid._frequencies import longest_period_count
from workflow.grid._operators import full_structure, reduced_structure
from workflow.grid._reference import distinct_solutions
from workflow.grid._reference_solutions import solution_seconds
from workflow.grid._tasks import MOST_KINDS, model_seconds, steady_bytes, tasks


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
    sampled = stored * len(grid.study.output.sampled) * grid.sampling.count
    each = 8 * (4 * longest_period_count(grid) + 22) + sampled + steady_bytes(grid)
    return grid.outer_count * grid.inner_count * each


def estimate(grid: Grid, threads: int | None = None) -> Time:
    """Return how long a study will take; ``threads`` is one for each processor where not given."""
    threads, factor = threads or len(os.sched_getaffinity(0)), _speed.factor()
    scale, longest = factor or 1.0, max(task.seconds for task in tasks(grid, threads=threads))
    work = (model_seconds(grid) + reference_seconds(grid)) * scale
    beside = beside_seconds(grid.outer_count * grid.inner_count, result_bytes(grid))
    beside += LOADING * len(kernel_variants(grid))
    return Time(
        seconds=max(work / threads, longest * scale) + beside,
        threads=threads,
        core_seconds=work + beside,
        compiling=time_to_compile(grid, threads),
        measured=factor is not None,
    )


def machine_factor(grid: Grid, seconds: float) -> float:
    """Return processor seconds here over those of the model; references are spread evenly over the cases."""
    return (1 + reference_seconds(grid) / seconds) * (_speed.factor() or 1.0)


def time_to_compile(grid: Grid, threads: int) -> float:
    """Return the seconds that compiling a study's schemes will take, 0 where all are compiled."""
    seconds = [compiling_seconds(variant.method) for variant in kernel_variants(grid) if is_missing(variant)]
    return sum(seconds) / min(threads, 2)


def reference_seconds(grid: Grid) -> float:
    """Return model seconds of reference solutions, and of exact solutions beside them, with their operators."""
    seconds, every = 0.0, list(distinct_solutions(grid))
    some = every[:: 1 + len(every) // MOST_KINDS]
    for settings, is_exact, count in some:
        seconds += count * solution_seconds(grid, settings, is_exact)
        seconds += setup_seconds(reduced_structure(settings)) + modes_seconds(full_structure(settings))
    return seconds * len(every) / max(len(some), 1)
