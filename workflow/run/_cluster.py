"""Tasks on a dask cluster: worker processes of this machine, or a scheduler that runs elsewhere.

A worker makes a run's grid once, then runs tasks of a few numbers each.
"""

from __future__ import annotations

import importlib.metadata
import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from multiprocessing import resource_tracker
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Any

from workflow.archive import ArchiveError, Command, code_revision, grid_of, read_command, study_key
from workflow.cases import WORKERS, waiting_for
from workflow.models import FACTORISING, has_cholmod, one_thread
from workflow.run._prepare import Prepared
from workflow.run._task import Job, Report, Stored, store_lost, store_task
from workflow.run._threads import MOST_TASKS, graphs
from workflow.schemes import SOLVER_VERSION
from workflow.solve import ReferenceBlock, ReferenceSolutions, Task, compute_block, tasks

_ANSWER, _FIRST_WORKER = 10.0, 60.0
"""Seconds to wait for a scheduler to answer, and for its first worker."""

_PATIENCE, _LOOK = 600.0, 2.0
"""Seconds without any worker after which a run ends, long enough to start others; how often it looks,
where no task ends meanwhile."""

_LOGGERS = ("distributed", "distributed.client", "distributed.gc", "tornado", "tornado.application", "asyncio")
"""Those to which distributed gives levels of their own."""

_BEGINNING = "import sys; sys.stdout = sys.stderr"
"""What worker processes here do first: what a scheme or a model prints is no part of what a command says."""

LOST = (
    "its worker process died whenever it computed the task that holds this case; "
    "`workflow run --retry` repeats it, --threads 1 shows what happens"
)

_GONE = (
    "the connection to the dask scheduler is lost; what is stored is kept, start the scheduler and its workers, then "
    "give the same command again"
)

_QUIETLY = "ignore:resource_tracker:UserWarning"
"""Option of Python for processes started here: one of them removes semaphores after a signal, and warned of it."""

_MOST_JOBS = 4
"""Runs whose grids a worker keeps: a cluster may serve several runs in turn."""

_MAKING = threading.Lock()


class ClusterError(Exception):
    """A cluster cannot be used for a run; the message says what is wrong and what would be right."""


@dataclass(frozen=True)
class Session:
    """What a worker must know of a run and agree with."""

    parts: str
    """Directory of the shards, which workers and the run itself share."""
    begun: int
    """Number of the run's command, as it stands there."""
    software: tuple[tuple[str, str], ...]
    """Name and version of what decides the bits of a result."""


def software() -> tuple[tuple[str, str], ...]:
    """Return name and version of what decides the bits of a result in this process."""
    packages = ((name, importlib.metadata.version(name)) for name in ("numpy", "scipy", "numba"))
    factors = ((name, importlib.metadata.version(name) if has_cholmod() else "none") for name in FACTORISING)
    return (("solver", str(SOLVER_VERSION)), ("code", code_revision()[:12]), *packages, *factors)


def join(session: Session) -> Command:
    """Check that a worker may work for a run, and return the run's command.

    Raises :class:`ClusterError` where it has other software, or does not share the directory of the shards.
    """
    differences = ", ".join(
        f"{name} {mine} instead of {expected}"
        for (name, mine), (_, expected) in zip(software(), session.software, strict=True)
        if mine != expected
    )
    if differences:
        raise ClusterError(
            f"the worker has other software than this run: {differences}; install the same version for both, "
            "start its workers anew and give the command again"
        )
    try:
        command = read_command(session.parts)
    except ArchiveError as error:
        raise ClusterError(str(error)) from None
    if command is None or command.begun != session.begun:
        raise ClusterError(
            f"the worker does not share {session.parts} with this run; put the archive (-o) on a file system that all "
            "workers see under the same path and can write to"
        )
    return command


def run_block(session: Session, block: ReferenceBlock) -> ReferenceSolutions:
    """Compute a block of solutions that tasks need."""
    with one_thread():
        return compute_block(_job(session).grid, block)


def run_task(session: Session, task: Task, *words: Any) -> list[Report]:
    """Compute a task on this worker and store it; one that came later may be refused here, see :func:`join`."""
    shards = list[Report]()
    with one_thread():
        store_task(_job(session), task, *words, stored=shards.append)
    return shards


def _job(session: Session) -> Job:
    with _MAKING:  # threads of one worker share one grid
        return _prepared(session)


@lru_cache(maxsize=_MOST_JOBS)
def _prepared(session: Session) -> Job:
    from distributed import get_worker

    try:
        command = join(session)
    except ClusterError as error:
        raise ClusterError(f"worker {get_worker().address}: {error}") from None
    grid = grid_of(command.texts)
    if study_key(grid.study) != command.key:  # as of large files, which do not travel
        raise ClusterError(
            f"worker {get_worker().address}: files or modules that the study names are others there than when the run "
            "read them; bring them back and give the command again"
        )
    return Job(grid, Path(session.parts), command.begun)


@cache
def _first_process() -> int:
    """Return the process that first used distributed: this one, or what it was forked from, which has the threads."""
    return os.getpid()


@contextmanager
def connected(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """Give a dask client of as many worker processes here, or of the scheduler at an address.

    Worker processes of this machine end with this context, and at once if this process is killed. Raises
    :class:`ClusterError` where they cannot be started, no scheduler answers or it has no workers, or a process that
    had some was forked.
    """
    import distributed  # noqa: F401 - it gives these loggers levels, which are changed below

    if _first_process() != os.getpid():
        raise ClusterError(
            "this process was forked from one that has run on workers, and lacks the threads that served them; run on "
            "threads here, or start it by multiprocessing's `spawn`"
        )
    for name in _LOGGERS:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)  # what went wrong is reported here, once
    with _workers_here(workers) if scheduler is None else _workers_of(scheduler) as client:
        yield client


@contextmanager
def _workers_here(workers: int | None) -> Iterator[Any]:
    import distributed
    from dask import config

    if _QUIETLY not in sys.warnoptions:
        sys.warnoptions.append(_QUIETLY)
    preload = [*config.get("distributed.worker.preload", []), _BEGINNING]
    with config.set({"distributed.worker.preload": preload}), _without_interrupts(), ExitStack() as running:
        try:
            with waiting_for(WORKERS):
                cluster = distributed.LocalCluster(
                    n_workers=workers,
                    threads_per_worker=1,
                    processes=True,
                    dashboard_address="127.0.0.1:0",  # any port: there may be other runs
                    scheduler_kwargs={"dashboard": False},
                    memory_limit=0,
                    silence_logs=logging.CRITICAL,
                )
                client = running.enter_context(distributed.Client(running.enter_context(cluster)))
        except Exception as error:  # whatever the death of a process that starts becomes
            raise ClusterError(
                f"worker processes could not be started: {error}; give the command again, with fewer "
                "--workers where memory is short, or on --threads"
            ) from error
        yield client


@contextmanager
def _workers_of(scheduler: str) -> Iterator[Any]:
    import distributed

    class Client(distributed.Client):
        def start(self, **how: Any) -> None:
            """Wait no longer for the first word than for the connection: what listens there may be no scheduler."""
            super().start(callback_timeout=2 * _ANSWER, **how)  # type: ignore[no-untyped-call]

    try:
        # not the default of this process: one that fails would stay it, and what dask computes next would wait for it
        client = Client(scheduler, timeout=_ANSWER, set_as_default=False)  # type: ignore[no-untyped-call]
    except (OSError, ValueError, TypeError) as error:
        why = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
        raise ClusterError(
            f"{scheduler}: no dask scheduler answers there ({why}); start one with `dask scheduler` and give the "
            "address it prints, e.g. tcp://127.0.0.1:8786"
        ) from None
    with _while_it_lives(scheduler), client:
        try:
            client.wait_for_workers(1, timeout=_FIRST_WORKER)
        except TimeoutError:
            raise ClusterError(
                f"{scheduler}: the scheduler has no workers; start some with `dask worker {scheduler}` and give "
                "the command again"
            ) from None
        yield client


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Keep SIGINT from this thread and from all threads and processes that it starts.

    A terminal's Ctrl-C reaches worker processes too, from their first instruction on; their parent ends them.
    """
    resource_tracker.ensure_running()  # as it begins it lets the signal through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _while_it_lives(scheduler: str) -> Iterator[None]:
    """Raise for a broken connection that the scheduler is gone; errors of files, which have a number, pass."""
    try:
        yield
    except OSError as error:
        if error.errno is not None and not isinstance(error, ConnectionError | TimeoutError):
            raise
        raise ClusterError(f"{scheduler}: {_GONE}") from None


def run_on_cluster(prepared: Prepared, stored: Stored, client: Any) -> None:
    """Run the tasks that are missing; ``stored`` hears of the shards of each when it has ended.

    dask blames a worker's death on every task that the worker had been given. A task that has been
    blamed too often is therefore tried again alone, when all others are done; one that then kills its
    workers too becomes failed cases. Raises :class:`ClusterError` where no worker may work for it, or all have left.
    """
    if not prepared.missing.any():
        return
    job, session = prepared.job, _opened(prepared.job, client)
    suspects, threads = [], sum(client.nthreads().values())
    cut = tasks(job.grid, prepared.missing, threads)
    for task, result in _results(client, session, prepared, cut, threads, MOST_TASKS):
        if result is None:
            suspects.append(task)
        for report in result or []:
            stored(report)
    for task, result in _results(client, session, prepared, iter(suspects), threads, 1):
        if result is None:
            store_lost(job, task, prepared.hashes_of(task), LOST, stored)
        for report in result or []:
            stored(report)


def _results(
    client: Any, session: Session, prepared: Prepared, cut: Iterator[Task], threads: int, most: int
) -> Iterator[tuple[Task, list[Report] | None]]:
    """Yield tasks as they end, with ``None`` where dask has given up; their futures are let go.

    They are handed over in graphs of so many, the next when half of one is done.
    """
    from dask import config

    ended: SimpleQueue[Any] = SimpleQueue()
    under_way: dict[str, Task] = {}
    name = f"workflow-{session.begun}-{'alone' if most == 1 else 'all'}-"  # a task that is tried again has another
    pieces = graphs(prepared, cut, partial(run_block, session), partial(run_task, session), threads, name, most)
    while True:
        if len(under_way) <= most // 2 and (graph := next(pieces, None)) is not None:
            under_way |= graph.tasks
            with config.set({"distributed.admin.large-graph-warning-threshold": 2**40}):
                for future in client.get(graph.nodes, list(graph.tasks), sync=False):
                    future.add_done_callback(ended.put)
        if not under_way:
            return
        future = _patiently(lambda seconds: ended.get(timeout=seconds), client)
        result = _result(future, client)
        future.release()
        yield under_way.pop(future.key), result


def _patiently(wait: Callable[[float], Any], client: Any) -> Any:
    """Return what ``wait`` returns, called with a few seconds again and again as long as there are workers."""
    last_seen = time.monotonic()
    while True:
        try:
            return wait(min(_LOOK, _PATIENCE))
        except (TimeoutError, Empty):
            if _has_workers(client):
                last_seen = time.monotonic()
            elif time.monotonic() - last_seen > _PATIENCE:
                raise ClusterError(
                    f"{client.scheduler.address}: all workers of the scheduler have left, and for {_PATIENCE:g} s none "
                    f"has come; start some with `dask worker {client.scheduler.address}`, then give the same command "
                    "again, it goes on from what is stored"
                ) from None


def _has_workers(client: Any) -> bool:
    try:
        return bool(client.nthreads())
    except OSError:  # no connection: should it not come back, all futures are cancelled
        return True


def _result(future: Any, client: Any) -> list[Report] | None:
    """Return what a task that has ended returned; with a worker that died in between it is not there any more."""
    from distributed import CancelledError, KilledWorker

    try:
        result: list[Report] = _patiently(lambda seconds: future.result(timeout=seconds), client)
        return result
    except KilledWorker:
        return None
    except CancelledError:
        raise ClusterError(_GONE) from None


def _opened(job: Job, client: Any) -> Session:
    """Return the session of a run, after all workers there are have shown that they may work for it."""
    session = Session(str(job.parts.resolve()), job.begun, software())
    for address, answer in sorted(client.run(join, session, on_error="return").items()):
        if isinstance(answer, ClusterError):
            raise ClusterError(f"worker {address}: {answer}")
        if not isinstance(answer, Command):
            raise ClusterError(
                f"worker {address}: cannot load this version of rotor-stator-workflow ({answer}); install it there "
                "and start the worker anew"
            )
    return session
