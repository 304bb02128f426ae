"""How long a study will take on this machine: its tasks by the fixed model, at the speed that runs measured."""

from __future__ import annotations

import heapq
import os
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace

import numpy as np

from workflow.grid import _speed
from workflow.grid._ahead import kernel_variants
from workflow.grid._arrangement import Grid, Indices
from workflow.grid._compile import is_compiled
from workflow.grid._conditions import alpha_of
from workflow.grid._costs import (
    Part,
    batch_part,
    beside_part,
    compiling_part,
    compiling_parts,
    growth_part,
    handling_part,
    setup_part,
    steady_part,
)
from workflow.grid._frequencies import fastest_frequency, longest_period_count
from workflow.grid._operators import reduced, reduced_structure
from workflow.grid._reference import exact_cell, reference_cell
from workflow.grid._solve import REPEATS, SHORT
from workflow.grid._tasks import Batch, Task, steady_bytes, tasks
from workflow.grid._truth import BLOCK, distinct_shape
from workflow.models import Array
from workflow.study import Cell

REFERENCE_RUNS = 3
"""Runs of a reference: itself, and with its gap opened and closed by a trifle."""

LOADING = 0.05
"""Seconds that loading a scheme's compiled kernels takes."""

MOST_KINDS = 2000
"""Kinds of segments that are looked at one by one; each further one counts as the mean of those."""

MOST_LOOKED_AT = 20_000
"""Cases of a segment whose conditions are looked at; a longer one counts in proportion."""


@dataclass(frozen=True)
class Time:
    """How long a study will take, in seconds of wall time as ``run`` prints them.

    Attributes
    ----------
    seconds
        Wall time on ``threads`` threads, nothing compiled meanwhile.
    threads
        One for each processor that this process may use.
    core_seconds
        Processor time of all threads together.
    compiling
        Seconds that compiling takes once, beside; 0 where all is compiled.
    measured
        Whether runs on this machine have measured the schemes' speed.
    """

    seconds: float
    threads: int
    core_seconds: float
    compiling: float
    measured: bool


@contextmanager
def measured_run(grid: Grid, begun: float, here: bool) -> Iterator[None]:
    """Remember the speed of this machine at the end of a run that computes in this process, if ``here``.

    ``begun`` is the processor time at the run's beginning.
    """
    yield
    if not here:
        _speed.forget()
        return
    with suppress(Exception):  # costs of a foreign scheme, say: no run fails by it
        part = beside_part(grid.outer_count * grid.inner_count, result_bytes(grid))
        _speed.add(part.seconds, max(0.0, time.process_time() - begun - _speed.attributed()), *part.keys)
    _speed.remember()


def result_bytes(grid: Grid) -> int:
    """Return the size of a study's results before compression."""
    stored = 8 if grid.study.output.precision == "float64" else 4
    sampled = stored * len(grid.study.output.histories) * grid.sampling.count
    each = 8 * (4 * longest_period_count(grid) + 22) + sampled + steady_bytes(grid)
    return grid.outer_count * grid.inner_count * each


def estimate(grid: Grid, threads: int | None = None) -> Time:
    """Return how long a study will take; ``threads`` is one for each processor where not given."""
    threads = threads or len(os.sched_getaffinity(0))
    speeds = _speed.speeds()
    costs = _Costs(grid, speeds)
    ends = [0.0] * threads
    work = 0.0
    for _, seconds in _weighed(grid, costs):
        work += seconds
        heapq.heapreplace(ends, ends[0] + seconds)
    beside = costs.seconds(beside_part(grid.outer_count * grid.inner_count, result_bytes(grid)))
    loading, compiling = _kernels(grid, speeds, threads)
    return Time(
        seconds=max(ends) + beside + loading,
        threads=threads,
        core_seconds=work + beside + loading,
        compiling=compiling,
        measured=costs.measured,
    )


def task_seconds(grid: Grid) -> Iterator[tuple[Task, float]]:
    """Yield the tasks of a study in their order, each with the processor seconds it will take on this machine."""
    return _weighed(grid, _Costs(grid, _speed.speeds()))


def _weighed(grid: Grid, costs: _Costs) -> Iterator[tuple[Task, float]]:
    for task in tasks(grid):
        yield task, sum(costs.of(batch) for batch in task.batches)


def compiling_seconds(grid: Grid, threads: int) -> float:
    """Return the seconds that compiling a study's schemes will take, 0 where all are compiled."""
    return _kernels(grid, _speed.speeds(), threads)[1]


def _kernels(grid: Grid, speeds: _speed.Speeds, threads: int) -> tuple[float, float]:
    """Return the seconds that loading compiled kernels takes, and compiling those that are not."""
    kernels = {variant.words: (variant.method, is_compiled(variant)) for variant in kernel_variants(grid)}.values()
    loading = sum(
        speeds.ratio(f"loading {method}") or LOADING for method in {method for method, there in kernels if there}
    )
    missing = Counter(method for method, there in kernels if not there)
    parts = [
        part
        for method, number in missing.items()
        for part in compiling_parts(method).values() or [compiling_part(method, number)]
    ]
    compiling = [_measured_seconds(part, speeds) for part in parts]
    return loading, max(sum(compiling) / threads, max(compiling, default=0.0))


def _measured_seconds(part: Part, speeds: _speed.Speeds) -> float:
    """Return the seconds of a part at the speed of this machine."""
    ratio = speeds.ratio(*part.keys)
    return part.seconds * (1.0 if ratio is None else ratio)


@dataclass
class _Costs:
    """Seconds of batches, those that are alike looked at once; references and growth rates count once."""

    grid: Grid
    speeds: _speed.Speeds
    measured: bool = False
    _kinds: dict[tuple[int, int, int], tuple[float, int]] = field(default_factory=dict)
    _kind: dict[int, int] = field(default_factory=dict)
    _blocks: set[tuple[int, int]] = field(default_factory=set)
    _grown: set[tuple[object, float]] = field(default_factory=set)

    def __post_init__(self) -> None:
        computed, model = self.grid.places.computed, self.grid.study.scene.model
        matters = self.grid.alike(
            computed, lambda path: not path.startswith(f"scene.{model}.") or path == f"scene.{model}.nodes"
        )
        self._kind = dict(zip(computed.tolist(), matters.tolist(), strict=True))

    def seconds(self, part: Part) -> float:
        """Return the seconds of a part at the speed of this machine."""
        return _measured_seconds(part, self.speeds)

    def of(self, batch: Batch) -> float:
        """Return the seconds of a batch, with its references and growth rates if they are new, and its handling."""
        kind = (self._kind[batch.outer], int(batch.inner[0]), batch.inner.size)
        if kind not in self._kinds:
            if len(self._kinds) >= MOST_KINDS:
                mean = sum(s for s, _ in self._kinds.values()) / sum(n for _, n in self._kinds.values())
                return mean * batch.inner.size
            self._kinds[kind] = self._batch(batch.outer, batch.inner), batch.inner.size
        seconds = self._kinds[kind][0]
        if self.grid.study.reference is not None:
            seconds += self._references(batch)
        return seconds

    def _batch(self, outer: int, inner: Indices) -> float:
        grid, cell = self.grid, self.grid.settings(outer)
        structure = reduced_structure(cell)
        distinct = np.unique(grid.canonical_inner(cell, inner))
        part = batch_part(cell, structure, grid.sampling, distinct.size, self._periods(cell, distinct))
        once = self.seconds(part)
        self.measured |= any(key in self.speeds.sums for key in part.keys)
        repeats = min(REPEATS, 1 + int(SHORT / max(once, 1e-9))) if grid.study.reference is not None else 1
        histories = len(grid.study.output.histories)
        places = sum(1 for _ in grid.places[outer])
        handling = handling_part(inner.size * places, places, grid.sampling.count, histories)
        steady = self.seconds(steady_part(grid.study, cell, structure, distinct.size))
        seconds = (
            repeats * once + steady + self.seconds(handling) + self.seconds(setup_part(cell.scheme.method, structure))
        )
        new = {(hash(reduced(cell)), float(alpha)) for alpha in np.unique(self._alpha(cell, distinct))} - self._grown
        self._grown |= new
        return seconds + len(new) * self.seconds(growth_part(structure))

    def _alpha(self, cell: Cell, inner: Indices) -> Array:
        """Return α of some cases, of very many those of a part."""
        looked_at = inner[:: -(-inner.size // MOST_LOOKED_AT)]
        return alpha_of(cell, self.grid.inner_values(looked_at), looked_at.size)

    def _periods(self, cell: Cell, inner: Indices) -> float:
        """Return the most periods of load and casing that any of some cases has."""
        looked_at = inner[:: -(-inner.size // MOST_LOOKED_AT)]
        frequency = fastest_frequency(cell.scene, self.grid.inner_values(looked_at), looked_at.size)
        return float(frequency.max()) * self.grid.sampling.duration

    def _references(self, batch: Batch) -> float:
        """Return the seconds of the references and exact solutions that a batch is the first to ask for."""
        ours, theirs = reference_cell(self.grid, batch.outer), exact_cell(self.grid, batch.outer)
        seconds = self._solutions(batch, ours, REFERENCE_RUNS)
        return seconds if theirs == ours else seconds + self._solutions(batch, theirs, 1)

    def _solutions(self, batch: Batch, cell: Cell, runs: int) -> float:
        """Return the seconds of the blocks of solutions of some settings that are new, each run so many times."""
        grid, shape, key = self.grid, distinct_shape(self.grid, cell), hash(cell)
        index = np.unravel_index(batch.inner, grid.inner_shape) if grid.inner else ()
        own = [np.minimum(i, size - 1) for i, size in zip(index, shape, strict=True)]
        number = np.unique(np.ravel_multi_index(own, shape)) if shape else np.zeros(1, dtype=np.int64)
        new = {(key, int(block)) for block in np.unique(number // BLOCK)} - self._blocks
        self._blocks |= new
        if not new:
            return 0.0
        rows = number[np.isin(number // BLOCK, [block for _, block in new])]
        places = np.ravel_multi_index(np.unravel_index(rows, shape), grid.inner_shape) if shape else rows
        sampling = replace(grid.sampling, balances=False)
        part = batch_part(cell, reduced_structure(cell), sampling, places.size, self._periods(cell, places))
        return runs * self.seconds(part)
