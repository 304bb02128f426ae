"""Tasks and the references that they need as graphs of dask, and their threads in this process.

The graphs are the same for threads and for the workers of a cluster.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import count, islice
from typing import Any

from workflow.models import one_thread
from workflow.run._prepare import Prepared
from workflow.run._task import Stored, store_task
from workflow.solve import ReferenceBlock, References, Task, compute_block, tasks

MOST_TASKS = 4096
"""Tasks of a graph, so that the graph of a large study is never there at once; 8 for each of 500 threads."""


@dataclass(frozen=True, eq=False)
class Graph:
    """A graph as dask takes it, each node a function and its arguments by key, and which of them are tasks."""

    nodes: Mapping[str, tuple[Any, ...]]
    tasks: Mapping[str, Task]


def graphs(
    prepared: Prepared,
    tasks: Iterator[Task],
    compute: Callable[[ReferenceBlock], Any],
    store: Callable[..., Any],
    threads: int,
    name: str = "",
    most: int = MOST_TASKS,
) -> Iterator[Graph]:
    """Yield graphs of so many tasks at most, and of the blocks of reference solutions that these need.

    Of tasks that could begin dask takes those first whose key is last by name: the longest, in archive order where they
    are as long up to a factor of two. Solutions go when the last task that needs them has ended.

    Parameters
    ----------
    compute
        Computes a block.
    store
        Called with a task, the hashes of its cases, its blocks and their solutions.
    threads
        Those that share the tasks.
    name
        What keys begin with.
    """
    numbers = count()
    while some := sorted(islice(tasks, most), key=lambda task: -math.frexp(task.seconds)[1]):
        nodes: dict[str, tuple[Any, ...]] = {}

        def begin(block: ReferenceBlock, nodes: dict[str, tuple[Any, ...]] = nodes) -> str:
            key = f"{name}reference-{next(numbers)}"
            nodes[key] = (compute, block)
            return key

        batches, named = (batch for task in some for batch in task.batches), dict[str, Task]()
        references = References(prepared.job.grid, batches, begin, threads)
        for place, task in enumerate(some):
            needed, key = references.of(task.batches), f"{name}task-{most - place:06d}-{task.number}"
            nodes[key] = (store, task, prepared.hashes_of(task), list(needed), list(needed.values()))
            named[key] = task
        yield Graph(nodes, named)


def available_threads() -> int:
    """Return the processors this process may use."""
    return len(os.sched_getaffinity(0))


def run_on_threads(prepared: Prepared, stored: Stored, threads: int) -> None:
    """Run the tasks that are missing; ``stored`` hears of their shards."""
    from dask.threaded import get

    grid = prepared.job.grid

    def store(task: Task, *arguments: Any) -> None:
        store_task(prepared.job, task, *arguments, stored=stored)

    cut = tasks(grid, prepared.missing, threads)
    with one_thread(), ThreadPoolExecutor(threads) as pool:  # its own: dask keeps its threads, which a fork has not
        for graph in graphs(prepared, cut, partial(compute_block, grid), store, threads):
            get(graph.nodes, list(graph.tasks), pool=pool)
