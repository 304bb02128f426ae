"""Running a study: what is missing is computed as shards, and one archive comes of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from workflow.archive import (
    ArchiveError,
    Shards,
    archive_key,
    describe,
    find_shards,
    gather,
    holding,
    parts_of,
    remove_parts,
    start_parts,
    study_key,
)
from workflow.grid import Task, arrange, tasks, units_of
from workflow.run._outcome import Outcome, summarise
from workflow.run._runner import runner
from workflow.run._task import Job, Stored
from workflow.study import Study

Progress = Callable[[int, int, int], None]
"""Told ``(cases stored, cases that are not ok, all cases)`` as a run goes on."""


def run_study(
    study: Study,
    archive: Path,
    threads: int | None = None,
    progress: Progress | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Outcome:
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
    workers
        Worker processes of dask on this machine, instead of threads.
    scheduler
        Address of a dask scheduler whose workers share the archive's directory, instead of threads.

    Raises
    ------
    ArchiveError
        Another study's archive is there, another run has it, or it cannot be written.
    ClusterError
        The workers cannot be used.
    """
    begun = time.perf_counter()
    parts = parts_of(archive)
    again = retry or recompute
    if archive.exists() and not _to_be_replaced(study, archive, retry, recompute):
        if parts.exists():  # of a run that was killed between its last two steps
            with holding(parts):
                remove_parts(parts)
        return summarise(archive, time.perf_counter() - begun, None)
    grid = arrange(study)
    units = units_of(grid)
    layout = describe(study, grid, units)
    hashes = case_hashes(grid)
    with runner(threads, workers, scheduler) as run_tasks, holding(parts):
        known = _known(archive, layout, hashes, retry, recompute) if archive.exists() else None
        if known is not None and parts.exists() and not _same(known, read_known(parts)):
            remove_parts(parts)
        start_parts(parts, layout)
        keep_known(parts, known)
        done = find_shards(parts, layout)
        there = done.owner >= 0
        if known is not None:
            there |= known.copies(layout) >= 0
        before = sum(len(layout.cells_of(unit)) for unit in np.flatnonzero(there).tolist())
        job = Job(grid, units, layout, parts, known)
        missing = (task for task in tasks(grid, units) if _is_missing(task, job, there))
        run_tasks(job, missing, _counting(job, before, done, progress))
        gather(layout, parts, archive, hashes, known)
    return summarise(archive, time.perf_counter() - begun, before)


def _counting(job: Job, before: int, done: Shards, progress: Progress | None) -> Callable[[Stored], None]:
    """Return what keeps count of the cases stored and tells the progress."""
    counted, failed = before, sum(len(shard.messages) for shard in done.files)

    def count(stored: Stored) -> None:
        nonlocal counted, failed
        counted, failed = counted + stored.cases, failed + stored.failed
        if progress is not None:
            progress(counted, failed, job.layout.cells)

    count(Stored(0, 0))
    return count


def _is_missing(task: Task, job: Job, there: NDArray[np.bool_]) -> bool:
    """Tell whether a unit of a task, in any place its results belong to, is not stored."""
    for segment in task.segments:
        for outer in job.grid.places[segment.outer]:
            first = outer * job.units.count + segment.first
            if not np.all(there[first : first + segment.units]):
                return True
    return False
