"""Tasks on dask threads of this process."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from itertools import islice

from workflow.grid import Block, References, ReferenceSolution, Task, compute_block, solutions_of, timed
from workflow.run._task import Job, Report, store_task

_GRAPH = 512
"""Tasks given to dask at a time, so that the graph of a large study is never there at once."""


def available_threads() -> int:
    """Return the processors this process may use."""
    return len(os.sched_getaffinity(0))


def run_on_threads(job: Job, missing: Iterator[Task], stored: Callable[[Report], None], threads: int) -> None:
    """Run tasks, a bounded number of them in a graph at a time; ``stored`` hears of each when its shards are safe.

    Tasks begin in their order, which dask alone would not keep: those that follow each other share operators and
    references. The blocks of reference solutions that a task needs begin before it.
    """
    from dask.threaded import get
    from threadpoolctl import threadpool_limits

    due = deque[Callable[[], None]]()

    def begin(block: Block) -> Future[list[ReferenceSolution]]:
        solutions = Future[list[ReferenceSolution]]()
        due.append(lambda: solutions.set_result(compute_block(job.grid, block)))
        return solutions

    def run_task(task: Task, needed: dict[Block, Future[list[ReferenceSolution]]]) -> None:
        solutions = solutions_of(job.grid, {block: begun.result() for block, begun in needed.items()})
        with timed(task.seconds):
            result = store_task(job, task, solutions)
        stored(result)

    def next_one() -> None:
        due.popleft()()

    references = References(job.grid, begin)
    with threadpool_limits(limits=1, user_api="blas"):
        while some := list(islice(missing, _GRAPH)):
            for task in some:
                needed = references.of(task.batches)
                due.append(partial(run_task, task, needed))
            graph = {f"task-{k}": (next_one,) for k in range(len(due))}  # a tenth of the time that `delayed` takes
            get(graph, list(graph), num_workers=threads)
