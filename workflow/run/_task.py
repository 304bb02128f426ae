"""What one task does: its cases are solved and stored as shards."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import STATUS, Layout, StoredCells, blank, find_shard, stored_status, write_shard
from workflow.grid import Grid, Segment, Solutions, Task, Units, solve
from workflow.run._outcome import status_name
from workflow.schemes import Status

Arrays = dict[str, NDArray[Any]]
Indices = NDArray[np.int64]

_NONE: Solutions = MappingProxyType({})


@dataclass(frozen=True)
class Job:
    """What every task of a run shares; ``stored_cells`` are the cases that are copied from an earlier archive."""

    grid: Grid
    units: Units
    layout: Layout
    parts: Path
    stored_cells: StoredCells | None = None


@dataclass(frozen=True)
class Stored:
    """What a task reports of what it has stored, no arrays: its number, cases, and those that are not ok by status."""

    task: int
    cases: int
    endings: Mapping[str, int]


def not_ok(layout: Layout, first: int, status: NDArray[Any]) -> Counter[str]:
    """Return how many cases of some units are not ok, by name of their status.

    Parameters
    ----------
    layout, first
        Of the archive, and its first unit that is meant.
    status
        As a shard holds it, ``(unit, place)``; what pads a row's last unit does not count.
    """
    endings: Counter[str] = Counter()
    for unit, row in enumerate(status, first):
        values, numbers = np.unique(row[: len(layout.cells_of(unit))], return_counts=True)
        endings.update({status_name(int(v)): int(n) for v, n in zip(values, numbers, strict=True) if v != Status.OK})
    return endings


def store_task(job: Job, task: Task, known: Solutions = _NONE) -> Stored:
    """Compute a task and store it, in every place its results belong to.

    A shard that this very task has stored before is left as it is: repeating a task whose worker died
    between storing and reporting does no harm and costs nothing. ``known`` are solutions that errors are measured
    against and that are computed already.
    """
    solved: dict[Segment, tuple[Arrays, dict[int, str]]] = {}
    cases, endings = 0, Counter[str]()
    for group in _groups(job, task):
        first, stop = group[0][0], group[-1][0] + group[-1][1].units
        shard = find_shard(job.parts, task.number, first, stop, job.layout)
        if shard is not None:
            status = stored_status(shard, job.layout)
        else:
            for _, segment in group:
                if segment not in solved:
                    solved[segment] = compute_segment(job, segment, known)
            arrays, messages = _joined(group, solved, job.layout.chunk)
            write_shard(job.parts, task.number, first, arrays, messages, job.layout)
            status = arrays[STATUS]
        cases += _cells(job.layout, first, stop)
        endings.update(not_ok(job.layout, first, status))
    return Stored(task.number, cases, endings)


def store_lost(job: Job, task: Task, text: str) -> Stored:
    """Store a task that cannot be computed: its cases fail with the message ``text``, but for stored ones."""

    def failing(inner: Indices) -> tuple[Arrays, dict[int, str]]:
        layout = job.layout
        lost = {v.name: np.full((inner.size, *layout.shape_of(v, 1)[2:]), v.fill, v.dtype) for v in layout.variables}
        lost["status"][...] = Status.FAILED
        return lost, dict.fromkeys(range(inner.size), text)

    cases, endings = 0, Counter[str]()
    for group in _groups(job, task):
        first, stop = group[0][0], group[-1][0] + group[-1][1].units
        segments = {segment: _filled(job, segment, failing) for _, segment in group}
        arrays, messages = _joined(group, segments, job.layout.chunk)
        write_shard(job.parts, task.number, first, arrays, messages, job.layout)
        cases += _cells(job.layout, first, stop)
        endings.update(not_ok(job.layout, first, arrays[STATUS]))
    return Stored(task.number, cases, endings)


def compute_segment(job: Job, segment: Segment, known: Solutions = _NONE) -> tuple[Arrays, dict[int, str]]:
    """Return the arrays of a segment's units, and messages by place, as a shard holds them."""

    def solved(inner: Indices) -> tuple[Arrays, dict[int, str]]:
        results = solve(job.grid, segment.outer, inner, known=known)
        return results.values, results.messages

    return _filled(job, segment, solved)


def _filled(
    job: Job, segment: Segment, fresh_ones: Callable[[Indices], tuple[Arrays, dict[int, str]]]
) -> tuple[Arrays, dict[int, str]]:
    """Return a segment's arrays and messages: stored cases as they are, the others from ``fresh_ones``."""
    grid, units, layout = job.grid, job.units, job.layout
    inner, places = units.cases(segment.first, segment.units)
    cells = segment.outer * grid.inner_count + inner
    fresh = np.ones(inner.size, dtype=bool) if job.stored_cells is None else job.stored_cells.cells[cells] < 0
    arrays = blank(layout, segment.units)
    messages: dict[int, str] = {}

    def fill(where: NDArray[np.bool_], values: Arrays, texts: dict[int, str]) -> None:
        into = places[where]
        for name, array in arrays.items():
            array.reshape(segment.units * units.chunk, *array.shape[2:])[into] = values[name]
        messages.update({int(into[k]): text for k, text in texts.items()})

    if fresh.any():
        fill(fresh, *fresh_ones(inner[fresh]))
    if job.stored_cells is not None and not fresh.all():
        fill(~fresh, *job.stored_cells.take(layout, cells[~fresh]))
    return arrays, messages


def fresh_cases(job: Job, task: Task) -> Iterator[tuple[int, Indices]]:
    """Yield the cases of a task's segments that no earlier archive holds: outer and inner indices."""
    for segment in task.segments:
        inner, _ = job.units.cases(segment.first, segment.units)
        cells = segment.outer * job.grid.inner_count + inner
        fresh = inner if job.stored_cells is None else inner[job.stored_cells.cells[cells] < 0]
        yield segment.outer, fresh


def fresh_share(job: Job, task: Task) -> float:
    """Return the share of a task's cases that no earlier archive holds."""
    if job.stored_cells is None:
        return 1.0
    fresh = sum(inner.size for _, inner in fresh_cases(job, task))
    return fresh / sum(job.units.cases(segment.first, segment.units)[0].size for segment in task.segments)


def _cells(layout: Layout, first: int, stop: int) -> int:
    """Return the number of cells of units ``first`` to ``stop - 1``."""
    return sum(len(layout.cells_of(unit)) for unit in range(first, stop))


def _groups(job: Job, task: Task) -> Iterator[list[tuple[int, Segment]]]:
    """Yield runs of units that follow each other, so that a task writes as few shards as can be.

    Each is a list of first units and the segments whose results belong there.
    """
    units, places = job.units, job.grid.places
    runs = [(outer * units.count + s.first, s) for s in task.segments for outer in places[s.outer]]
    group: list[tuple[int, Segment]] = []
    for first, segment in sorted(runs, key=lambda run: run[0]):
        if group and group[-1][0] + group[-1][1].units != first:
            yield group
            group = []
        group.append((first, segment))
    yield group


def _joined(
    group: list[tuple[int, Segment]], solved: dict[Segment, tuple[Arrays, dict[int, str]]], chunk: int
) -> tuple[Arrays, dict[int, str]]:
    """Return arrays and messages of a run of units, put together from its segments."""
    first = group[0][0]
    runs = [(start, *solved[segment]) for start, segment in group]
    arrays = {name: np.concatenate([run[1][name] for run in runs]) for name in runs[0][1]}
    messages = {(start - first) * chunk + place: text for start, _, texts in runs for place, text in texts.items()}
    return arrays, messages
