"""What one task does: its cases are solved and stored as a shard."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import STATUS, Hashes, write_shard
from workflow.cases import Grid
from workflow.plan import template
from workflow.run._outcome import status_name
from workflow.schemes import Status
from workflow.solve import (
    LONGEST,
    TASK_BYTES,
    Batch,
    ReferenceBlock,
    ReferenceSolutions,
    Solved,
    Task,
    failed,
    joined,
    solutions_of,
    solve_in_parts,
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
    """What a shard of a task holds, without arrays."""

    seconds: float
    """Their share of the task's, by the cost model."""
    cases: int
    """Cases of the study that have its results."""
    endings: Mapping[str, int]
    """Number of those that are not ok, by name of their status."""


Stored = Callable[[Report], None]
"""Hears of each shard when it is safe."""


def not_ok(status: NDArray[Any], times: int = 1) -> Counter[str]:
    """Return how many cases are not ok, by name of their status; each counts so many times."""
    values, numbers = np.unique(status[status != Status.OK], return_counts=True)
    return Counter({status_name(int(v)): times * int(n) for v, n in zip(values, numbers, strict=True)})


def store_task(
    job: Job,
    task: Task,
    hashes: Hashes,
    blocks: Sequence[ReferenceBlock],
    computed: Sequence[ReferenceSolutions],
    *,
    stored: Stored,
) -> None:
    """Compute the cases of a task, with these hashes, and store them; they are compared with what blocks hold."""
    solutions = solutions_of(job.grid, dict(zip(blocks, computed, strict=True)))

    def parts_of(batch: Batch) -> Iterator[Part]:
        return solve_in_parts(job.grid, batch.outer, batch.inner, solutions=solutions)

    _store(job, task, hashes, parts_of, 1, stored)


def store_lost(job: Job, task: Task, hashes: Hashes, text: str, stored: Stored) -> None:
    """Store a task that cannot be computed: its cases fail with the message ``text``, but for those stored before."""

    def parts_of(batch: Batch) -> Iterator[Part]:
        yield np.arange(batch.inner.size), failed(job.grid, batch.inner.size, text)

    _store(job, task, hashes, parts_of, 0, stored)


Part = tuple[NDArray[np.int64], Solved]
"""Cases that have ended, by their places in a batch."""


def _store(
    job: Job, task: Task, hashes: Hashes, parts_of: Callable[[Batch], Iterator[Part]], number: int, stored: Stored
) -> None:
    """Store cases as they end, in shards of about :data:`TASK_BYTES` or :data:`LONGEST`, numbered from there."""
    names, held, size, begun = list(map(str, job.template.data_vars)), list[Part](), 0, time.monotonic()
    count, cases, endings = 0, 0, Counter[str]()

    def write() -> None:
        places, together = np.concatenate([places for places, _ in held]), joined([solved for _, solved in held])
        name = f"{shard_name(job.begun, task.number + 1)}-{number:06d}"  # task 0 is what is taken back
        write_shard(job.parts, name, hashes[places], together.values, together.messages, job.template)
        stored(Report(task.seconds * places.size / len(hashes), cases, endings))

    for batch in task.batches:
        times = job.grid.times(batch.outer)
        for places, solved in parts_of(batch):
            kept = {name: solved.values[name] for name in names}
            held.append((count + places, Solved(kept, solved.messages)))
            cases, endings = cases + places.size * times, endings + not_ok(kept[STATUS], times)
            size += sum(values.nbytes for values in kept.values())
            if size > TASK_BYTES or time.monotonic() - begun > LONGEST:
                write()
                held, size, number, begun = [], 0, number + 1, time.monotonic()
                cases, endings = 0, Counter[str]()
        count += batch.inner.size
    if held:
        write()
