"""What one task does: its cases are solved and stored as a shard."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import STATUS, Hashes, Layout, write_shard
from workflow.grid import Batch, CaseHashes, Grid, Solutions, Task, solve
from workflow.run._outcome import status_name
from workflow.schemes import Status

Results = tuple[dict[str, NDArray[Any]], dict[int, str]]
"""Arrays of some cases, ``(case, …)`` by name, and messages by position."""

_NONE: Solutions = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class Job:
    """What every task of a run shares; ``begun`` names its shards, those of a later run come after them."""

    grid: Grid
    layout: Layout
    parts: Path
    begun: int
    hashes: CaseHashes


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


def store_task(job: Job, task: Task, known: Solutions = _NONE) -> Stored:
    """Compute the cases of a task and store them, of equal hashes one.

    ``known`` are solutions that errors are measured against and that are computed already.
    """
    return _store(job, task, [compute_batch(job, distinct(job, batch)[0], known) for batch in task.batches])


def store_lost(job: Job, task: Task, text: str) -> Stored:
    """Store a task that cannot be computed: its cases fail with the message ``text``."""
    layout, lost = job.layout, []
    for batch in task.batches:
        count = distinct(job, batch)[0].inner.size
        values = {v.name: np.full((count, *layout.tail_shape(v)), v.fill, v.dtype) for v in layout.variables}
        values[STATUS][...] = Status.FAILED
        lost.append((values, dict.fromkeys(range(count), text)))
    return _store(job, task, lost)


def compute_batch(job: Job, batch: Batch, known: Solutions = _NONE) -> Results:
    """Return the results of a batch."""
    solved = solve(job.grid, batch.outer, batch.inner, known=known)
    return solved.values, solved.messages


def distinct(job: Job, batch: Batch) -> tuple[Batch, Hashes, NDArray[np.intp]]:
    """Return one case of a batch for each hash, their hashes, and which of them each case is."""
    hashes = job.hashes.of(batch.outer, batch.inner)
    _, first, which = np.unique(hashes.view("V16").ravel(), return_index=True, return_inverse=True)
    order = np.argsort(first)
    return Batch(batch.outer, batch.inner[first[order]]), hashes[first[order]], np.argsort(order)[which]


def _store(job: Job, task: Task, solved: list[Results]) -> Stored:
    messages, hashes, count = dict[int, str](), [], 0
    cases, endings = 0, Counter[str]()
    for batch, (values, texts) in zip(task.batches, solved, strict=True):
        own, its_hashes, which = distinct(job, batch)
        messages |= {count + k: text for k, text in texts.items()}
        hashes.append(its_hashes)
        count += own.inner.size
        places = len(job.grid.places[batch.outer])
        cases += which.size * places
        endings.update(not_ok(values[STATUS][which], places))
    arrays = {v.name: np.concatenate([values[v.name] for values, _ in solved]) for v in job.layout.variables}
    name = f"{job.begun:020d}-{task.number:08d}"
    write_shard(job.parts, name, np.concatenate(hashes), arrays, messages, job.layout)
    return Stored(task.number, cases, endings)
