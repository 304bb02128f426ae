"""Running a study: tasks on dask, shards while they come in, one archive in the end."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    ArchiveError,
    Layout,
    Shards,
    archive_key,
    blank,
    describe,
    find_shards,
    gather,
    holding,
    open_archive,
    parts_of,
    remove_parts,
    start_parts,
    study_key,
    write_shard,
)
from workflow.grid import Grid, Segment, Task, Units, arrange, solve, tasks, units_of
from workflow.schemes import Status
from workflow.study import Study

if TYPE_CHECKING:
    import xarray as xr

Progress = Callable[[int, int, int], None]
"""Told ``(cases stored, cases that are not ok, all cases)`` as a run goes on."""

_GRAPH = 512
"""Tasks given to dask at a time, so that the graph of a large study is never there at once."""


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    archive
        Where the archive is.
    counts
        Number of cases by name of their status.
    failures
        Labels and message of the first cases that are not ok, at most :data:`SHOWN`.
    seconds
        Wall time of this run.
    resumed
        Cases that an earlier, interrupted run had stored; all of them where there was nothing to do.
    """

    archive: Path
    counts: dict[str, int]
    failures: tuple[tuple[str, str], ...]
    seconds: float
    resumed: int

    @property
    def ok(self) -> bool:
        """Whether every case is ok."""
        return set(self.counts) <= {Status.OK.name.lower()}


SHOWN = 10
"""Failed cases that a summary names."""


def available_threads() -> int:
    """Return the processors this process may use."""
    return len(os.sched_getaffinity(0))


def run_study(study: Study, archive: Path, threads: int | None = None, progress: Progress | None = None) -> Outcome:
    """Run what is missing of a study and leave its archive.

    Parameters
    ----------
    study
        From :func:`workflow.study.read_study`.
    archive
        Where the archive goes; an interrupted run of the same study goes on where it stopped.
    threads
        Threads of dask; as many as there are processors where not given.
    progress
        Called whenever a task is stored.

    Raises
    ------
    ArchiveError
        Another study's archive is there, another run has it, or it cannot be written.
    """
    from threadpoolctl import threadpool_limits

    begun = time.perf_counter()
    parts = parts_of(archive)
    if archive.exists():
        if archive_key(archive) != study_key(study):
            raise ArchiveError(
                f"{archive}: holds another study, or this one with other values or another solver version; "
                "choose another archive with -o, or move this one away"
            )
        if parts.exists():  # of a run that was killed between its last two steps
            with holding(parts):
                remove_parts(parts)
        return summarise(archive, time.perf_counter() - begun, None)
    grid = arrange(study)
    units = units_of(grid)
    layout = describe(study, grid, units)
    with holding(parts), threadpool_limits(limits=1, user_api="blas"):
        start_parts(parts, layout)
        done = find_shards(parts, layout)
        before = int(sum(len(layout.cells_of(unit)) for first, stop in done.present for unit in range(first, stop)))
        _run_missing(grid, units, layout, parts, done, threads or available_threads(), before, progress)
        gather(layout, parts, archive)
    return summarise(archive, time.perf_counter() - begun, before)


def _run_missing(
    grid: Grid,
    units: Units,
    layout: Layout,
    parts: Path,
    done: Shards,
    threads: int,
    before: int,
    progress: Progress | None,
) -> None:
    """Run every task of which a unit is missing, a bounded number of them in a graph at a time."""
    from dask.base import compute
    from dask.delayed import delayed

    stored, failed = before, sum(len(shard.messages) for shard in done.files)

    def count(cases: int, bad: int) -> None:
        nonlocal stored, failed
        stored, failed = stored + cases, failed + bad
        if progress is not None:
            progress(stored, failed, layout.cells)

    if progress is not None:
        progress(stored, failed, layout.cells)
    missing = (task for task in tasks(grid, units) if _is_missing(task, grid, units, done))
    one = delayed(_store, pure=False, traverse=False)
    while some := list(islice(missing, _GRAPH)):
        graph = [one(grid, units, layout, parts, task, count) for task in some]
        compute(*graph, scheduler="threads", num_workers=threads)


def _is_missing(task: Task, grid: Grid, units: Units, done: Shards) -> bool:
    """Tell whether a unit of a task, in any place its results belong to, has no sound shard."""
    for segment in task.segments:
        for outer in grid.places[segment.outer]:
            first = outer * units.count + segment.first
            if np.any(done.owner[first : first + segment.units] < 0):
                return True
    return False


def _store(
    grid: Grid, units: Units, layout: Layout, parts: Path, task: Task, count: Callable[[int, int], None]
) -> None:
    """Compute a task and store it, in every place its results belong to."""
    runs: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]] = []
    for segment in task.segments:
        arrays, messages = compute_segment(grid, units, layout, segment)
        runs += [(outer * units.count + segment.first, arrays, messages) for outer in grid.places[segment.outer]]
    bad = cases = 0
    for first, arrays, messages in _contiguous(sorted(runs, key=lambda run: run[0]), layout.chunk):
        write_shard(parts, task.number, first, arrays, messages, layout)
        cells = sum(len(layout.cells_of(unit)) for unit in range(first, first + len(arrays["status"])))
        cases, bad = cases + cells, bad + len(messages)
    count(cases, bad)


def compute_segment(
    grid: Grid, units: Units, layout: Layout, segment: Segment
) -> tuple[dict[str, NDArray[Any]], dict[int, str]]:
    """Return the arrays of a segment's units, and messages by place, as a shard holds them."""
    inner, places = units.cases(segment.first, segment.units)
    solved = solve(grid, segment.outer, inner)
    arrays = blank(layout, segment.units)
    for name, values in arrays.items():
        slots = values.reshape(segment.units * units.chunk, *values.shape[2:])
        slots[places] = solved.values[name]
    return arrays, {int(places[k]): text for k, text in solved.messages.items()}


def _contiguous(
    runs: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]], chunk: int
) -> Iterator[tuple[int, dict[str, NDArray[Any]], dict[int, str]]]:
    """Join runs of units that follow each other, so that a task writes as few shards as can be."""
    group: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]] = []
    for run in runs:
        if group and group[-1][0] + len(group[-1][1]["status"]) != run[0]:
            yield _joined(group, chunk)
            group = []
        group.append(run)
    if group:
        yield _joined(group, chunk)


def _joined(
    group: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]], chunk: int
) -> tuple[int, dict[str, NDArray[Any]], dict[int, str]]:
    first = group[0][0]
    arrays = {name: np.concatenate([run[1][name] for run in group]) for name in group[0][1]}
    messages = {(start - first) * chunk + place: text for start, _, told in group for place, text in told.items()}
    return first, arrays, messages


def status_counts(dataset: xr.Dataset) -> dict[str, int]:
    """Return the number of cases by name of their status."""
    values, number = np.unique(np.asarray(dataset["status"].values), return_counts=True)
    return {Status(int(value)).name.lower(): int(n) for value, n in zip(values, number, strict=True)}


def summarise(archive: Path, seconds: float, resumed: int | None) -> Outcome:
    """Read from an archive how its cases ended."""
    with open_archive(archive) as dataset:
        status = np.asarray(dataset["status"].values)
        counts = status_counts(dataset)
        failures = []
        for index in np.argwhere(status != Status.OK)[:SHOWN]:
            case = dataset.isel(dict(zip(dataset["status"].dims, map(int, index), strict=True)))
            labels = ", ".join(
                f"{name} = {case[name].item()}"
                for dim in dataset["status"].dims
                for name in dataset.coords
                if dataset[name].dims == (dim,)
            )
            failures.append((labels or "the case", str(case["message"].item())))
    return Outcome(archive, counts, tuple(failures), seconds, status.size if resumed is None else resumed)
