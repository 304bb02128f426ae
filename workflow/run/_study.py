"""Running a study: what is missing is computed as shards, and one archive comes of them."""

from __future__ import annotations

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    COPIED,
    SOFTWARE,
    ArchiveError,
    Known,
    Layout,
    Shards,
    clear_parts,
    describe,
    find_known,
    find_shards,
    gather,
    holding,
    is_kept,
    keep_known,
    made_by,
    parts_of,
    provenance,
    remove_parts,
    start_parts,
    statuses,
    study_key,
)
from workflow.grid import Task, arrange, case_hashes, compiling, tasks, units_of
from workflow.run._outcome import Outcome, summarise
from workflow.run._runner import runner
from workflow.run._task import Job, Stored
from workflow.run._threads import available_threads
from workflow.run._worker import ClusterError
from workflow.schemes import SOLVER_VERSION, Status
from workflow.study import Study

Progress = Callable[[int, int, int], None]
"""Told ``(cases stored, cases that are not ok, all cases)`` as a run goes on."""

_HASHED_ASIDE = 100_000
"""Cases that are hashed while tasks run; of more, both at once would hold more memory than either."""


def run_study(
    study: Study,
    archive: Path,
    threads: int | None = None,
    progress: Progress | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    recompute: bool = False,
) -> Outcome:
    """Run what is missing of a study and leave its archive.

    An archive of an earlier version of the study is extended: cases it holds are taken from it, bit for
    bit, the others are run, those the study no longer has are left out. It stays under its name until
    the new one is complete.

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
    retry
        Run the cases again that are not ok.
    recompute
        Run all cases again, and take none from an archive, whatever version of the solver made it.

    Raises
    ------
    ArchiveError
        Another study's archive is there, another run has it, or it cannot be written.
    ClusterError
        The workers cannot be used.
    """
    begun = time.perf_counter()
    parts = parts_of(archive)
    if retry and not archive.exists() and parts.exists():  # an unfinished run ends first
        run_study(study, archive, threads, progress, workers=workers, scheduler=scheduler)
    if archive.exists() and _is_current(study, archive) and not recompute and not (retry and _has_failures(archive)):
        if parts.exists():  # of a run that was killed between its last two steps
            with holding(parts):
                remove_parts(parts)
        return replace(summarise(archive, None), seconds=time.perf_counter() - begun)
    grid = arrange(study)
    units = units_of(grid)
    layout = describe(study, grid, units)
    helpers = (threads or available_threads()) - 1 if workers is None and scheduler is None else 0
    with (
        ThreadPoolExecutor(1) as aside,
        runner(threads, workers, scheduler) as run_tasks,
        holding(parts),
        compiling(grid, helpers),
    ):
        hashed: list[Future[NDArray[np.uint8]]] = []
        once = Lock()

        def hashing() -> Future[NDArray[np.uint8]]:
            with once:
                if not hashed:
                    hashed.append(aside.submit(case_hashes, grid))
            return hashed[0]

        if layout.cells > _HASHED_ASIDE:
            hashing().result()
        known = _known(archive, layout, hashing().result(), retry, recompute) if archive.exists() else None
        if known is not None and np.any(known.cells >= 0):
            layout = replace(layout, provenance={**layout.provenance, **_made_elsewhere(archive, layout)})
        start_parts(parts, layout)
        if known is not None and (retry or recompute) and not is_kept(parts, known):
            clear_parts(parts)  # of a run that took other cases, or was killed when its archive was in place
            start_parts(parts, layout)
        keep_known(parts, known)
        done = find_shards(parts, layout)
        there = done.owner >= 0
        if known is not None:
            there |= known.copies(layout) >= 0
        before = int(np.sum(_cells_there(layout, there)))
        job = Job(grid, units, layout, parts, known)
        resumed = before if known is None else int(np.sum(_cells_there(layout, there) | (known.cells >= 0)))
        missing = (task for task in tasks(grid, units) if _is_missing(task, job, there))
        count = _counting(job, before, done, progress)

        def stored(told: Stored) -> None:
            hashing()  # not before: it would keep the first kernels from beginning
            count(told)

        try:
            run_tasks(job, missing, stored)
        except ClusterError:  # a worker may have stored what it died before telling of
            if progress is not None:
                done = find_shards(parts, layout)
                there |= done.owner >= 0
                unwell = sum(len(shard.messages) for shard in done.files)
                progress(int(np.sum(_cells_there(layout, there))), unwell, layout.cells)
            raise
        gather(layout, parts, archive, hashing().result(), known)
        remove_parts(parts)
    return replace(summarise(archive, resumed), seconds=time.perf_counter() - begun)


def _is_current(study: Study, archive: Path) -> bool:
    """Tell whether an archive holds a study as it is, its title included; refuse another study's."""
    texts = provenance(archive)
    name, title, _ = made_by(archive, texts)
    if name != study.name:
        raise ArchiveError(
            f"{archive}: holds another study, {name!r} and not {study.name!r}; "
            "choose another archive with -o, or move this one away"
        )
    return texts.get("key") == study_key(study) and title == study.title


def _has_failures(archive: Path) -> bool:
    return bool(np.any(statuses(archive) != Status.OK))


def _known(archive: Path, layout: Layout, hashes: NDArray[np.uint8], retry: bool, recompute: bool) -> Known:
    """Return which cases the archive under the target's name holds already.

    Raises
    ------
    ArchiveError
        Another version of the solver made it, or it has nothing that this study could take from it.
    """
    if recompute:
        return Known(archive, np.full(layout.cells, -1, dtype=np.int64))
    _, _, version = made_by(archive, provenance(archive))
    if version != str(SOLVER_VERSION):
        raise ArchiveError(
            f"{archive}: made by version {version} of the solver, this is {SOLVER_VERSION}, whose results differ and "
            "are not mixed with them; --recompute runs all cases again, -o chooses another archive"
        )
    known = find_known(archive, layout, hashes)
    return known.without_failures() if retry else known


def _made_elsewhere(archive: Path, layout: Layout) -> dict[str, str]:
    """Return what tells, as :data:`COPIED`, that cases of an archive were run by other software or elsewhere."""
    texts = provenance(archive)
    same = all(texts.get(name) == layout.provenance[name] for name in SOFTWARE)
    return {} if same and COPIED not in texts else {COPIED: "cases that other software or another processor ran"}


def _cells_there(layout: Layout, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each cell whether its unit is stored."""
    found = np.zeros(layout.cells, dtype=bool)
    for unit in np.flatnonzero(there).tolist():
        cells = layout.cells_of(unit)
        found[cells.start : cells.stop] = True
    return found


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
