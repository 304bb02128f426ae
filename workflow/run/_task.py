"""What one task does: its cases are solved and stored as a shard; tasks and their references as graphs of dask.

They are the same for threads of this process and for the workers of a cluster.
"""

from __future__ import annotations

import math
import os
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import count, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import STATUS, Hashes, write_shard
from workflow.cases import Grid
from workflow.models import one_thread
from workflow.plan import template
from workflow.run._outcome import status_name
from workflow.run._prepare import Prepared
from workflow.schemes import Status
from workflow.solve import (
    Batch,
    ReferenceBlock,
    References,
    ReferenceSolutions,
    Solved,
    Task,
    compute_block,
    solutions_of,
    solve,
    tasks,
)

if TYPE_CHECKING:
    import xarray as xr


_DIGITS = 20
"""Of the number of a command, with which the names of its shards begin."""


def shard_name(begun: int, number: int | None = None) -> str:
    """Return the name of a shard of a command, or how their names begin; those of earlier commands sort before them."""
    return f"{begun:0{_DIGITS}d}-" + ("" if number is None else f"{number:08d}")


def next_command(parts: Path) -> int:
    """Return the number of a command that begins: larger than those of all shards there are.

    It is the time in ns, by which workers tell commands apart, unless the clock was set back since.
    """
    stored = [path.name[:_DIGITS] for path in parts.glob("*.shard")]
    return max(time.time_ns(), 1, *(int(number) + 1 for number in stored if number.isdecimal()))


@dataclass(frozen=True, eq=False)
class Job:
    """What every task of a run shares; names of its shards begin with ``begun``, the number of the command."""

    grid: Grid
    parts: Path
    begun: int
    warnings: str = ""

    @cached_property
    def template(self) -> xr.Dataset:
        """The archive before anything has run."""
        return template(self.grid, self.warnings)


@dataclass(frozen=True)
class Report:
    """What a task has stored, without arrays."""

    seconds: float
    """Those of the task, by the cost model."""
    cases: int
    """Cases of the study that have its results."""
    endings: Mapping[str, int]
    """Number of those that are not ok, by name of their status."""


def not_ok(status: NDArray[Any], times: int = 1) -> Counter[str]:
    """Return how many cases are not ok, by name of their status; each counts so many times."""
    values, numbers = np.unique(status[status != Status.OK], return_counts=True)
    return Counter({status_name(int(v)): times * int(n) for v, n in zip(values, numbers, strict=True)})


def store_task(
    job: Job, task: Task, hashes: Hashes, blocks: Sequence[ReferenceBlock], computed: Sequence[ReferenceSolutions]
) -> Report:
    """Compute the cases of a task, with these hashes, and store them; they are compared with what blocks hold."""
    solutions = solutions_of(job.grid, dict(zip(blocks, computed, strict=True)))
    return _store(job, task, hashes, lambda batch: solve(job.grid, batch.outer, batch.inner, solutions=solutions))


def store_lost(job: Job, task: Task, hashes: Hashes, text: str) -> Report:
    """Store a task that cannot be computed: its cases fail with the message ``text``."""

    def lost(batch: Batch) -> Solved:
        count = batch.inner.size
        blank = job.template.isel(dict.fromkeys(job.template[STATUS].dims, 0))
        values = {str(name): np.repeat(one.values[None], count, axis=0) for name, one in blank.data_vars.items()}
        values[STATUS][...] = Status.FAILED
        return Solved(values, dict.fromkeys(range(count), text))

    return _store(job, task, hashes, lost)


def _store(job: Job, task: Task, hashes: Hashes, results_of: Callable[[Batch], Solved]) -> Report:
    """Store the results of the batches of a task in one shard."""
    parts, messages = [], dict[int, str]()
    count, cases, endings = 0, 0, Counter[str]()
    for batch in task.batches:
        solved = results_of(batch)
        messages |= {count + k: text for k, text in solved.messages.items()}
        parts.append(solved.values)
        times = job.grid.times(batch.outer)
        count, cases = count + batch.inner.size, cases + batch.inner.size * times
        endings += not_ok(solved.values[STATUS], times)
    arrays = {name: np.concatenate([values[name] for values in parts]) for name in map(str, job.template.data_vars)}
    name = shard_name(job.begun, task.number + 1)  # 0 is the shard of what is taken back
    write_shard(job.parts, name, hashes, arrays, messages, job.template)
    return Report(task.seconds, cases, endings)


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


def run_on_threads(prepared: Prepared, stored: Callable[[Report], None], threads: int) -> None:
    """Run the tasks that are missing; ``stored`` hears of each when its shard is safe."""
    from dask.threaded import get

    grid = prepared.job.grid

    def store(task: Task, *arguments: Any) -> None:
        stored(store_task(prepared.job, task, *arguments))

    cut = tasks(grid, prepared.missing, threads)
    with one_thread():
        for graph in graphs(prepared, cut, partial(compute_block, grid), store, threads):
            get(graph.nodes, list(graph.tasks), num_workers=threads)
