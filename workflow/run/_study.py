"""Running a study: what is missing is computed as shards, and one archive comes of them."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from importlib import import_module
from pathlib import Path
from threading import Thread
from typing import cast

import numpy as np

from workflow import archive
from workflow.cases import CASES, GATHERING, arrange, read_choices, waiting_for
from workflow.kernels.compiled import Deferred
from workflow.kernels.lemke import solve_one
from workflow.models import one_thread
from workflow.run._cluster import ClusterError, connected, run_on_cluster
from workflow.run._outcome import Outcome, summarise
from workflow.run._prepare import Prepared, Reuse, check_name, prepare
from workflow.run._progress import Progress, ProgressCounter, in_notebook, notebook_line
from workflow.run._task import Stored
from workflow.run._threads import available_threads, run_on_threads
from workflow.schemes import Status
from workflow.solve import compiled_ahead, kernel_variants, model_seconds, require_memory
from workflow.study import Study, StudySource, read_study

RunTasks = Callable[[Prepared, Stored], None]
"""Runs the tasks that are missing."""


@dataclass(frozen=True)
class Resources:
    """Where tasks run: a number of threads, or of worker processes here, or the address of a dask scheduler."""

    threads: int | None = None
    workers: int | None = None
    scheduler: str | None = None

    def __post_init__(self) -> None:
        if sum(choice is not None for choice in (self.threads, self.workers, self.scheduler)) > 1:
            raise ValueError("choose one of threads, workers and scheduler")

    @property
    def here(self) -> bool:
        """Whether they run on threads of this process."""
        return self.workers is None and self.scheduler is None

    @property
    def computing(self) -> int:
        """Threads or worker processes that compute, a thread for each processor if not chosen; 0 of a scheduler."""
        return (self.threads or available_threads()) if self.here else (self.workers or 0)

    @property
    def words(self) -> str:
        """What computes, as stored in an archive: no addresses."""
        if self.scheduler is not None:
            return "the workers of a dask scheduler"
        kind = "thread" if self.here else "worker process"
        return f"{self.computing} {kind}{'' if self.computing == 1 else 's' if self.here else 'es'}"


@contextmanager
def _runner(resources: Resources) -> Iterator[RunTasks]:
    if resources.here:
        yield partial(run_on_threads, threads=resources.computing)
    else:
        with connected(resources.workers, resources.scheduler) as client:
            yield partial(run_on_cluster, client=client)


def run_study(
    study: StudySource,
    archive: str | Path | None = None,
    threads: int | None = None,
    progress: Progress | bool | None = None,
    *,
    workers: int | None = None,
    scheduler: str | None = None,
    retry: bool = False,
    recompute: bool = False,
    drop: bool = False,
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
        Called when the run begins to compute and whenever results are stored. Where it is left out a notebook shows a
        line with a bar, and nothing is shown elsewhere; ``False`` shows nothing anywhere.
    workers
        Worker processes of dask on this machine, instead of threads.
    scheduler
        Address of a dask scheduler whose workers share the archive's directory, instead of threads.
    retry, recompute, drop
        Run cases again that are stored and not ok, or all cases; leave out stored cases that the study no longer asks
        for.

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
    resources, reuse = Resources(threads, workers, scheduler), Reuse(retry, recompute, drop)
    if progress is None and in_notebook():
        with notebook_line(archive.name) as line:
            outcome = _run(study, archive, resources, reuse, line)
            line.end(outcome)
            return outcome
    return _run(study, archive, resources, reuse, progress if callable(progress) else lambda advance: None)


def _run(study: Study, path: Path, resources: Resources, reuse: Reuse, progress: Progress) -> Outcome:
    """Run what is missing of a study, as :func:`run_study`."""
    begun = time.perf_counter()
    parts = archive.parts_of(path)
    if path.exists() and not _has_work(study, path, reuse):
        return replace(summarise(path, None), seconds=time.perf_counter() - begun)
    archive.replaceable(path)
    _ = cast(Deferred, solve_one).dispatcher  # what stops numba stops every case
    earlier = archive.read_command(parts)
    same = earlier if earlier is not None and earlier.key == archive.study_key(study) else None
    grid = arrange(study, None if same is None else read_choices(same.texts.get("choices", "{}")))
    require_memory(grid, resources.computing)
    with (
        _runner(resources) as run_tasks,
        archive.run_lock(parts),
        compiled_ahead(kernel_variants(grid) if resources.here and resources.computing > 1 else []),
    ):
        prepared = prepare(grid, path, reuse, resources.here)
        job, missing = prepared.job, prepared.missing
        counter = _counter(prepared, begun, progress)
        Thread(target=import_module, args=("xarray",), daemon=True).start()  # what comes after cases begins beside them
        with waiting_for(CASES):
            try:
                run_tasks(prepared, counter.add)
            except ClusterError:  # a worker may have stored what it died before it could say so
                counter.set(*prepared.count(prepared.stored()))
                raise
        record = {
            "seconds": round(time.perf_counter() - begun, 3),
            "cases": int(np.sum(missing)),
            "where": resources.words,
        }
        with waiting_for(GATHERING):
            texts = {**prepared.texts, "run": json.dumps(record)}
            archive.gather(job.template, texts, parts, path, prepared.hashes, prepared.stored())
        archive.remove_parts(parts)
    return replace(summarise(path, int(np.sum(~missing))), seconds=time.perf_counter() - begun)


def _has_work(study: Study, path: Path, reuse: Reuse) -> bool:
    """Tell whether a run changes an archive: it holds another state of the study, or some cases are run again."""
    if not reuse.recompute:
        archive.require_whole(path)
    texts = archive.provenance(path)
    held = check_name(study, path, texts)
    if reuse.recompute or archive.parts_of(path).exists() or texts.get("key") != archive.study_key(study):
        return True
    if (held.get("title"), held.get("license", "")) != (study.title, study.license):
        return True
    return reuse.retry and bool(np.any(archive.statuses(path) != Status.OK))


def _counter(prepared: Prepared, begun: float, progress: Progress) -> ProgressCounter:
    """Return the count of stored cases that ``progress`` is called with, from those that are stored already.

    The run began at ``begun`` on the clock of :func:`time.perf_counter`.
    """
    grid = prepared.job.grid
    with one_thread():  # structures are made here as tasks make them
        every, missing = model_seconds(grid), model_seconds(grid, prepared.missing)
    counter = ProgressCounter(prepared.missing.size, missing, every - missing, begun, progress)
    counter.set(*prepared.count(prepared.before))
    return counter
