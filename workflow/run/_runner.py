"""Where tasks run: threads of this process, worker processes of this machine, or the workers of a scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial

from workflow.run._cluster import connected, run_on_cluster
from workflow.run._prepare import Prepared
from workflow.run._task import Report
from workflow.run._threads import available_threads, run_on_threads

RunTasks = Callable[[Prepared, Callable[[Report], None]], None]
"""Runs the tasks that are missing; the last argument hears of each when its shard is safe."""


@dataclass(frozen=True)
class Resources:
    """Where tasks run: a number of threads, or of worker processes here, or the address of a dask scheduler."""

    threads: int | None = None
    workers: int | None = None
    scheduler: str | None = None

    @property
    def here(self) -> bool:
        """Whether they run on threads of this process."""
        return self.workers is None and self.scheduler is None

    @property
    def computing(self) -> int:
        """Threads or worker processes that compute; 0 where a scheduler has them."""
        return (self.threads or available_threads()) if self.here else (self.workers or 0)

    @property
    def words(self) -> str:
        """What computes, as stored in an archive: no addresses."""
        if self.scheduler is not None:
            return "the workers of a dask scheduler"
        kind = "thread" if self.here else "worker process"
        return f"{self.computing} {kind}{'' if self.computing == 1 else 's' if self.here else 'es'}"


@contextmanager
def runner(resources: Resources) -> Iterator[RunTasks]:
    """Give a function that runs tasks; where nothing is chosen, on a thread for each processor.

    Raises
    ------
    ValueError
        More than one place is chosen.
    ClusterError
        The workers cannot be used.
    """
    if sum(choice is not None for choice in (resources.threads, resources.workers, resources.scheduler)) > 1:
        raise ValueError("choose one of threads, workers and scheduler")
    if resources.here:
        yield partial(run_on_threads, threads=resources.computing)
    else:
        with connected(resources.workers, resources.scheduler) as client:
            yield partial(run_on_cluster, client=client)
