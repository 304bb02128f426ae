"""Tasks on dask threads of this process."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from functools import partial
from itertools import islice

from workflow.grid import Block, References, ReferenceSolution, Task, compute_block, model_seconds, solutions_of, timed
from workflow.run._task import Job, Stored, store_task

_GRAPH = 512
"""Tasks given to dask at a time, so that the graph of a large study is never there at once."""


def available_threads() -> int:
    """Return the processors this process may use."""
    return len(os.sched_getaffinity(0))


def run_on_threads(job: Job, missing: Iterator[Task], stored: Callable[[Stored], None], threads: int) -> None:
    """Run tasks, a bounded number of them in a graph at a time; ``stored`` hears of each when its shards are safe.

    Tasks begin in their order, which dask alone would not keep: those that follow each other share operators and
    references. The blocks of reference solutions that a task needs begin before it.
    """
    from dask.threaded import get
    from threadpoolctl import threadpool_limits

    references, due = References(job.grid), deque[Callable[[], None]]()
    solved: dict[Block, Future[list[ReferenceSolution]]] = {}

    def solve_block(block: Block, solution: Future[list[ReferenceSolution]]) -> None:
        solution.set_result(compute_block(job.grid, block))

    def run_task(task: Task, blocks: dict[Block, Future[list[ReferenceSolution]]]) -> None:
        known = solutions_of(job.grid, [(block, solution.result()) for block, solution in blocks.items()])
        with timed(model_seconds(job.grid, task)):
            result = store_task(job, task, known)
        stored(result)

    def plan(task: Task) -> None:
        blocks = references.blocks_of(task.batches)
        for block in blocks:
            if block not in solved:
                solved[block] = Future()
                due.append(partial(solve_block, block, solved[block]))
        due.append(partial(run_task, task, {block: solved[block] for block in blocks}))
        for block in [block for block in solved if not references.holds(block)]:
            del solved[block]

    def next_one() -> None:
        due.popleft()()

    with threadpool_limits(limits=1, user_api="blas"):
        while some := list(islice(missing, _GRAPH)):
            for task in some:
                plan(task)
            graph = {f"task-{k}": (next_one,) for k in range(len(due))}  # a tenth of the time that `delayed` takes
            get(graph, list(graph), num_workers=threads)
