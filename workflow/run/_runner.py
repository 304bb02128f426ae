"""Where tasks run: threads of this process, worker processes of this machine, or the workers of a scheduler."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial

from workflow.grid import Task
from workflow.run._cluster import connected, run_on_cluster
from workflow.run._task import Job, Stored
from workflow.run._threads import available_threads, run_on_threads

RunTasks = Callable[[Job, Iterator[Task], Callable[[Stored], None]], None]
"""Runs tasks; the last argument hears of each when its shards are safe."""


@contextmanager
def runner(threads: int | None, workers: int | None, scheduler: str | None) -> Iterator[RunTasks]:
    """Give what runs tasks; where nothing is chosen, a thread for each processor.

    Raises
    ------
    ValueError
        More than one is chosen.
    ClusterError
        The workers cannot be used.
    """
    if sum(choice is not None for choice in (threads, workers, scheduler)) > 1:
        raise ValueError("choose one of threads, workers and scheduler")
    if workers is None and scheduler is None:
        yield partial(run_on_threads, threads=threads or available_threads())
    else:
        with connected(workers, scheduler) as client:
            yield partial(run_on_cluster, client=client)
