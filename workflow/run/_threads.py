"""Tasks on dask threads of this process."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice

from workflow.grid import Task, Turns, is_compiling, lend_turns
from workflow.run._task import Job, Stored, store_task

_GRAPH = 512
"""Tasks given to dask at a time, so that the graph of a large study is never there at once."""

_BEGUN_WHILE_COMPILING = 16
"""Tasks begun beside those that compute, while some wait for kernels that a helper process compiles."""


def available_threads() -> int:
    """Return the processors this process may use."""
    return len(os.sched_getaffinity(0))


def run_on_threads(job: Job, missing: Iterator[Task], stored: Callable[[Stored], None], threads: int) -> None:
    """Run tasks, a bounded number of them in a graph at a time; ``stored`` hears of each when its shards are safe.

    Tasks begin in their order, which dask alone would not keep: those that follow each other share
    operators and references. Beside the threads that compute there are a few more, so that others do
    while some wait for the disk or, more of them, for kernels that are compiled beside the run.
    """
    from dask.threaded import get
    from threadpoolctl import threadpool_limits

    computing = Turns(threads)
    lend_turns(computing, threads - 1)
    waiting = _BEGUN_WHILE_COMPILING if is_compiling() else min(threads - 1, 1 + threads // 8)
    next_ones: deque[Task] = deque()

    def next_one() -> None:
        stored(store_task(job, next_ones.popleft(), computing))

    with threadpool_limits(limits=1, user_api="blas"):
        try:
            while some := list(islice(missing, _GRAPH)):
                next_ones.extend(some)
                graph = {f"task-{k}": (next_one,) for k in range(len(some))}  # a tenth of the time that `delayed` takes
                get(graph, list(graph), num_workers=threads + waiting)
        finally:
            computing.end()
