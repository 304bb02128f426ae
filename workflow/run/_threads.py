"""Tasks on dask threads of this process."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import Any

from workflow.grid import Task, compute_block, tasks
from workflow.run._graph import graphs
from workflow.run._prepare import Prepared
from workflow.run._task import Report, store_task


def available_threads() -> int:
    """Return the processors this process may use."""
    return len(os.sched_getaffinity(0))


def run_on_threads(prepared: Prepared, stored: Callable[[Report], None], threads: int) -> None:
    """Run the tasks that are missing; ``stored`` hears of each when its shard is safe."""
    from dask.threaded import get
    from threadpoolctl import threadpool_limits

    grid = prepared.job.grid

    def store(task: Task, *arguments: Any) -> None:
        stored(store_task(prepared.job, task, *arguments))

    cut = tasks(grid, prepared.missing, threads)
    with threadpool_limits(limits=1, user_api="blas"):
        for graph in graphs(prepared, cut, partial(compute_block, grid), store, threads):
            get(graph.nodes, list(graph.tasks), num_workers=threads)
