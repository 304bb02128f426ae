"""What one task does: its cases are solved and stored as shards."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import Layout, blank, write_shard
from workflow.grid import Grid, Segment, Task, Units, solve


@dataclass(frozen=True)
class Job:
    """What every task of a run shares."""

    grid: Grid
    units: Units
    layout: Layout
    parts: Path


@dataclass(frozen=True)
class Stored:
    """What a task tells of the results it has stored: no arrays."""

    cases: int
    failed: int


def store_task(job: Job, task: Task) -> Stored:
    """Compute a task and store it, in every place its results belong to."""
    grid, units, layout = job.grid, job.units, job.layout
    runs: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]] = []
    for segment in task.segments:
        arrays, messages = compute_segment(grid, units, layout, segment)
        runs += [(outer * units.count + segment.first, arrays, messages) for outer in grid.places[segment.outer]]
    failed = cases = 0
    for first, arrays, messages in _contiguous(sorted(runs, key=lambda run: run[0]), layout.chunk):
        write_shard(job.parts, task.number, first, arrays, messages, layout)
        cells = sum(len(layout.cells_of(unit)) for unit in range(first, first + len(arrays["status"])))
        cases, failed = cases + cells, failed + len(messages)
    return Stored(cases, failed)


def compute_segment(
    grid: Grid, units: Units, layout: Layout, segment: Segment
) -> tuple[dict[str, NDArray[Any]], dict[int, str]]:
    """Return the arrays of a segment's units, and messages by place, as a shard holds them."""
    inner, places = units.cases(segment.first, segment.units)
    solved = solve(grid, segment.outer, inner)
    arrays = blank(layout, segment.units)
    for name, values in arrays.items():
        slots = values.reshape(segment.units * units.chunk, *values.shape[2:])
        slots[places] = solved.values[name]
    return arrays, {int(places[k]): text for k, text in solved.messages.items()}


def _contiguous(
    runs: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]], chunk: int
) -> Iterator[tuple[int, dict[str, NDArray[Any]], dict[int, str]]]:
    """Join runs of units that follow each other, so that a task writes as few shards as can be."""
    group: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]] = []
    for run in runs:
        if group and group[-1][0] + len(group[-1][1]["status"]) != run[0]:
            yield _joined(group, chunk)
            group = []
        group.append(run)
    if group:
        yield _joined(group, chunk)


def _joined(
    group: list[tuple[int, dict[str, NDArray[Any]], dict[int, str]]], chunk: int
) -> tuple[int, dict[str, NDArray[Any]], dict[int, str]]:
    first = group[0][0]
    arrays = {name: np.concatenate([run[1][name] for run in group]) for name in group[0][1]}
    messages = {(start - first) * chunk + place: text for start, _, told in group for place, text in told.items()}
    return first, arrays, messages
