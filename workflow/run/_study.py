"""Running a study: what is missing is computed as shards, and one archive comes of them."""

from __future__ import annotations

import json
import time
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    Layout,
    Shards,
    archive_origin,
    find_shards,
    gather,
    holding,
    parts_of,
    provenance,
    remove_parts,
    require_whole,
    statuses,
    stored_status,
    study_key,
)
from workflow.grid import (
    CASES,
    GATHERING,
    Task,
    arrange,
    compiled_ahead,
    kernel_variants,
    measured_run,
    tasks,
    waiting_for,
)
from workflow.run._earlier import Reuse, begun_texts, cells_there, check_name, is_unfinished, stored_choices
from workflow.run._notebook import in_notebook, notebook_line
from workflow.run._outcome import Outcome, summarise
from workflow.run._prepare import CaseHashes, Prepared, prepare
from workflow.run._progress import Progress, Tally, work_of
from workflow.run._runner import RunTasks, Where, runner
from workflow.run._task import Job, Stored, not_ok
from workflow.run._worker import ClusterError
from workflow.schemes import Status
from workflow.study import Study, StudySource, read_study


class ReuseOptions(TypedDict, total=False):
    """Options of :func:`run_study` on cases that are stored already, all false by default: see :class:`Reuse`."""

    retry: bool
    recompute: bool
    drop: bool


def run_study(
    study: StudySource,
    archive: str | Path | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    **reuse: Unpack[ReuseOptions],
) -> Outcome:
    """Run what is missing of a study and leave its archive.

    An archive of an earlier version of the study is extended: cases it holds are taken from it, bit for
    bit, the others are run. It stays under its name until the new one is complete.

    Parameters
    ----------
    study
        All that :func:`workflow.read_study` takes.
    archive
        Where the archive goes, ``NAME.nc`` here where left out, NAME being the study's; an interrupted run of the same
        study goes on where it stopped.
    threads
        Threads of dask; as many as there are processors where not given.
    progress
        Called when the run begins to compute and whenever a task is stored. Where it is left out a notebook shows a
        line with a bar, and nothing is shown elsewhere; ``False`` shows nothing anywhere.
    workers
        Worker processes of dask on this machine, instead of threads.
    scheduler
        Address of a dask scheduler whose workers share the archive's directory, instead of threads.
    retry, recompute, drop
        What is done with cases that are stored already, see :class:`Reuse`.

    Raises
    ------
    ArchiveError
        Another study's archive is there, or one with cases that the study no longer asks for and ``drop`` is false;
        it is damaged, another run has it, or it cannot be written.
    ClusterError
        The workers cannot be used.
    """
    study = read_study(study)
    archive = Path(f"{study.name}.nc" if archive is None else archive)
    if progress is None and in_notebook():
        with notebook_line(archive.name) as line:
            outcome = run_study(study, archive, threads, line, workers=workers, scheduler=scheduler, **reuse)
            line.end(outcome)
            return outcome
    where, chosen = Where(threads, workers, scheduler), Reuse(**reuse)
    tell = progress if callable(progress) else None
    if chosen.retry and parts_of(archive).exists():  # an unfinished run ends first
        _run(study, archive, where, Reuse(drop=chosen.drop), tell)
    return _run(study, archive, where, chosen, tell)


def _run(study: Study, archive: Path, where: Where, reuse: Reuse, progress: Progress | None) -> Outcome:
    """Run what is missing of a study, as :func:`run_study`."""
    begun = time.perf_counter()
    parts = parts_of(archive)
    if archive.exists() and not _has_work(study, archive, reuse):
        if parts.exists():  # of a run that was killed between its last two steps
            with holding(parts):
                remove_parts(parts)
        return replace(summarise(archive, None), seconds=time.perf_counter() - begun)
    grid = arrange(study, stored_choices(begun_texts(study, parts)))
    with (
        CaseHashes(grid) as hashes,
        runner(where) as run_tasks,
        holding(parts),
        compiled_ahead(kernel_variants(grid) if where.here and where.computing > 1 else []),
        measured_run(where.here),
    ):
        prepared = prepare(grid, archive, hashes, reuse, where.here)
        tally = None if progress is None else _tally(prepared, where.computing, begun, progress)
        with waiting_for(CASES):
            _run_missing(prepared, run_tasks, hashes, tally)
        layout = _with_record(prepared, where, time.perf_counter() - begun)
        with waiting_for(GATHERING):
            gather(layout, parts, archive, hashes.result(), prepared.job.stored_cells)
        remove_parts(parts)
    return replace(summarise(archive, prepared.resumed), seconds=time.perf_counter() - begun)


def _has_work(study: Study, archive: Path, reuse: Reuse) -> bool:
    """Tell whether a run changes an archive that may hold the study as it is: some cases are run again, or were."""
    if not _is_current(study, archive, reuse.recompute) or reuse.recompute or is_unfinished(study, archive):
        return True
    return reuse.retry and bool(np.any(statuses(archive) != Status.OK))


def _with_record(prepared: Prepared, where: Where, seconds: float) -> Layout:
    """Return an archive's layout whose provenance says how long its last run took, for how many cases, and where."""
    layout = prepared.job.layout
    record = {"seconds": round(seconds, 3), "cases": layout.cells - prepared.stored, "where": where.words}
    return replace(layout, provenance={**layout.provenance, "run": json.dumps(record)})


def _tally(prepared: Prepared, computing: int, begun: float, progress: Progress) -> Tally:
    """Return the count of stored cases that ``progress`` is called with, from those that are stored already.

    Parameters
    ----------
    computing
        Threads or workers, 0 where a scheduler has them.
    begun
        When the run began, on the clock of :func:`time.perf_counter`.
    """
    job = prepared.job
    work = work_of(job, lambda task: _is_missing(task, job, prepared.there), computing)
    tally = Tally(job.layout.cells, work, begun, progress)
    tally.set(prepared.stored, _endings(prepared.done, job.layout))
    return tally


def _run_missing(prepared: Prepared, run_tasks: RunTasks, hashes: CaseHashes, tally: Tally | None) -> None:
    """Run the tasks whose results are not stored yet.

    Raises
    ------
    ClusterError
        The workers are gone.
    """
    job = prepared.job
    missing = (task for task in tasks(job.grid, job.units) if _is_missing(task, job, prepared.there))

    def stored(result: Stored) -> None:
        hashes.begin()  # not before: it would keep the first kernels from beginning
        if tally is not None:
            tally.add(result)

    try:
        run_tasks(job, missing, stored)
    except ClusterError:  # a worker may have stored what it died before it could say so
        if tally is not None:
            done = find_shards(job.parts, job.layout)
            cells = cells_there(job.layout, prepared.there | (done.owner >= 0))
            tally.set(int(np.sum(cells)), _endings(done, job.layout))
        raise


def _is_current(study: Study, archive: Path, recompute: bool) -> bool:
    """Tell whether an archive holds a study as it is, title and licence included; refuse another study's."""
    if not recompute:
        require_whole(archive)
    texts = provenance(archive)
    check_name(study, archive, texts)
    origin = archive_origin(archive, texts)
    return texts.get("key") == study_key(study) and (origin.title, origin.license) == (study.title, study.license)


def _endings(done: Shards, layout: Layout) -> Counter[str]:
    """Return how many cases of shards are not ok, by name of their status."""
    endings: Counter[str] = Counter()
    for shard in done.files:
        endings.update(not_ok(layout, shard.first, stored_status(shard, layout)))
    return endings


def _is_missing(task: Task, job: Job, there: NDArray[np.bool_]) -> bool:
    """Tell whether a unit of a task, in any place its results belong to, is not stored."""
    for segment in task.segments:
        for outer in job.grid.places[segment.outer]:
            first = outer * job.units.count + segment.first
            if not np.all(there[first : first + segment.units]):
                return True
    return False
