"""What one task does: its cases are solved and stored as a shard."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import STATUS, Hashes, stored_status, write_shard
from workflow.grid import Batch, CaseHashes, Grid, Solutions, Solved, Task, solve, template
from workflow.run._outcome import status_name
from workflow.schemes import Status

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True, eq=False)
class Job:
    """What every task of a run shares; ``begun`` names its shards, those of a later run come after them."""

    grid: Grid
    parts: Path
    begun: int
    hashes: CaseHashes
    warnings: str = ""

    @cached_property
    def template(self) -> xr.Dataset:
        """The archive before anything has run."""
        return template(self.grid, self.warnings)


@dataclass(frozen=True)
class Stored:
    """What a task reports of what it has stored, no arrays: its number, cases, and those that are not ok by status."""

    task: int
    cases: int
    endings: Mapping[str, int]


def not_ok(status: NDArray[Any], times: int = 1) -> Counter[str]:
    """Return how many cases are not ok, by name of their status; each counts so many times."""
    values, numbers = np.unique(status[status != Status.OK], return_counts=True)
    return Counter({status_name(int(v)): times * int(n) for v, n in zip(values, numbers, strict=True)})


def store_task(job: Job, task: Task, solutions: Solutions) -> Stored:
    """Compute the cases of a task, which are compared with some solutions, and store them, of equal hashes one."""
    return _store(job, task, lambda batch: solve(job.grid, batch.outer, batch.inner, solutions=solutions))


def store_lost(job: Job, task: Task, text: str) -> Stored:
    """Store a task that cannot be computed: its cases fail with the message ``text``."""

    def lost(batch: Batch) -> Solved:
        count = batch.inner.size
        blank = job.template.isel(dict.fromkeys(job.template[STATUS].dims, 0))
        values = {str(name): np.repeat(one.values[None], count, axis=0) for name, one in blank.data_vars.items()}
        values[STATUS][...] = Status.FAILED
        return Solved(values, dict.fromkeys(range(count), text))

    return _store(job, task, lost)


def _store(job: Job, task: Task, results_of: Callable[[Batch], Solved]) -> Stored:
    """Store the results of the batches of a task in one shard: of one case for each hash.

    A shard that this very task has stored before is left as it is: repeating a task whose worker died between storing
    and reporting costs nothing.
    """
    name = f"{job.begun:020d}-{task.number:08d}"
    done = stored_status(job.parts, name)
    hashes, parts, messages = list[Hashes](), [], dict[int, str]()
    count, cases, endings = 0, 0, Counter[str]()
    for outer, inner in task.batches:
        every = job.hashes.of(outer, inner)
        # half of a hash tells the cases of a batch apart: two of 1e5 share it with a probability of 3e-10
        _, first, which = np.unique(every.view(np.uint64)[:, 0], return_index=True, return_inverse=True)
        order = np.argsort(first)
        first, which = first[order], np.argsort(order)[which]
        if done is None:
            solved = results_of(Batch(outer, inner[first]))
            messages |= {count + k: text for k, text in solved.messages.items()}
            hashes.append(every[first])
            parts.append(solved.values)
            status = solved.values[STATUS]
        else:
            status = done[count : count + first.size]
        count += first.size
        sharing = int(job.grid.sharing[outer])
        cases += inner.size * sharing
        endings.update(not_ok(status[which], sharing))
    if done is None:
        arrays = {name: np.concatenate([values[name] for values in parts]) for name in map(str, job.template.data_vars)}
        write_shard(job.parts, name, np.concatenate(hashes), arrays, messages, job.template)
    return Stored(task.number, cases, endings)
