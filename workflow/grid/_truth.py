"""Solutions that errors are measured against, in blocks: each computed once and kept a while."""

from __future__ import annotations

import threading
from collections import OrderedDict
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices, reads
from workflow.grid._conditions import conditions
from workflow.grid._operators import compile_for, judged, run_batch, structure_of
from workflow.grid._turns import waiting
from workflow.grid._waiting_for import REFERENCES, waiting_for
from workflow.judges.perturbations import predictability
from workflow.judges.reasons import reason_of
from workflow.models import Array, Cases
from workflow.schemes import Results, Status
from workflow.study import Cell
from workflow.variables import COMPARED

BLOCK = 64
"""Cases that are computed at a time: a couple of kernel blocks, and a few milliseconds."""

CACHE_BYTES = 256 * 2**20
"""Bytes of histories that stay in memory for later batches of the grid."""


@dataclass(frozen=True, eq=False)
class Truth:
    """Solutions of some cases.

    Attributes
    ----------
    histories
        ``(case, t)`` by name, NaN in cases that did not end ok.
    predictability
        ``(case,)``, NaN where it was not computed.
    failures
        Why a case did not end ok, by position.
    """

    histories: dict[str, Array]
    predictability: Array
    failures: dict[int, str]


@dataclass(eq=False)
class _Cache:
    """Blocks of solutions of one grid, the most recently used last."""

    blocks: OrderedDict[tuple[Cell, bool, int], Future[Truth]] = field(default_factory=OrderedDict)
    lock: threading.Lock = field(default_factory=threading.Lock)


_CACHES: WeakKeyDictionary[Grid, _Cache] = WeakKeyDictionary()
_CACHES_LOCK = threading.Lock()


def truths(grid: Grid, cell: Cell, inner: Indices, perturbed: bool) -> Truth:
    """Return the solutions of the settings ``cell`` for the conditions of some cases, put together from blocks.

    ``perturbed`` asks for their predictability too.
    """
    shape = distinct_shape(grid, cell)
    index = np.unravel_index(inner, grid.inner_shape) if grid.inner else ()
    own = [np.minimum(i, size - 1) for i, size in zip(index, shape, strict=True)]
    number = np.ravel_multi_index(own, shape) if shape else np.zeros_like(inner)
    blocks = {int(block): _block(grid, cell, shape, int(block), perturbed) for block in np.unique(number // BLOCK)}
    rows = [(blocks[int(n) // BLOCK], int(n) % BLOCK) for n in number]
    return Truth(
        {name: np.stack([block.histories[name][row] for block, row in rows]) for name in COMPARED},
        np.array([block.predictability[row] for block, row in rows]),
        {k: block.failures[row] for k, (block, row) in enumerate(rows) if row in block.failures},
    )


def distinct_shape(grid: Grid, cell: Cell) -> tuple[int, ...]:
    """Return the sizes of the inner dimensions, 1 for those along which a solution stays the same."""
    replaced = grid.study.reference.values if grid.study.reference is not None else {}
    return tuple(
        dimension.size
        if any(
            axis.path not in replaced and reads(cell.scheme.method, cell.scheme.label, axis.path)
            for axis in dimension.axes
        )
        else 1
        for dimension in grid.inner
    )


def only_what_is_read(cell: Cell) -> Cell:
    """Return the settings with those of e, h and α that the scheme does not read set to 0, the same for all."""
    read = schemes.load(cell.scheme.method).READS
    return replace(
        cell,
        e=cell.e if "e" in read else 0.0,
        h=cell.h if "h" in read else 0.0,
        alpha=cell.alpha if "alpha" in read else 0.0,
    )


def _block(grid: Grid, cell: Cell, shape: tuple[int, ...], block: int, perturbed: bool) -> Truth:
    """Return a block of solutions: computed by the first who asks, waited for by all others."""
    with _CACHES_LOCK:
        cache = _CACHES.setdefault(grid, _Cache())
    with cache.lock:
        key = (cell, perturbed, block)
        future = cache.blocks.get(key)
        mine = future is None
        if future is None:
            future = cache.blocks[key] = Future()
        cache.blocks.move_to_end(key)
        while (
            len(cache.blocks) * BLOCK * grid.sampling.count * 8 * len(COMPARED) > CACHE_BYTES and len(cache.blocks) > 2
        ):
            cache.blocks.popitem(last=False)
    if mine:
        count = int(np.prod(shape, dtype=np.int64))
        own = np.arange(block * BLOCK, min((block + 1) * BLOCK, count), dtype=np.int64)
        try:
            future.set_result(_computed_or_lost(grid, cell, shape, own, perturbed))
        except BaseException as error:  # an interrupt: whoever waits must not wait for ever
            future.set_exception(error)
            raise
        return future.result()
    with waiting():
        return future.result()


def _computed_or_lost(grid: Grid, cell: Cell, shape: tuple[int, ...], own: Indices, perturbed: bool) -> Truth:
    """Return solutions; one that raises is NaN, which harms neither its neighbours nor its cases."""
    try:
        with waiting_for(REFERENCES):
            return _compute(grid, cell, shape, own, perturbed)
    except (Exception, SystemExit) as error:  # whatever a model or scheme raises
        if own.size > 1:
            return _joined([_computed_or_lost(grid, cell, shape, own[k : k + 1], perturbed) for k in range(own.size)])
        lost = np.full((1, grid.sampling.count), np.nan)
        return Truth(dict.fromkeys(COMPARED, lost), np.full(1, np.nan), {0: reason_of(error)})


def _joined(alone: list[Truth]) -> Truth:
    """Put solutions of one case each together."""
    return Truth(
        {name: np.concatenate([truth.histories[name] for truth in alone]) for name in COMPARED},
        np.concatenate([truth.predictability for truth in alone]),
        {k: truth.failures[0] for k, truth in enumerate(alone) if truth.failures},
    )


def _compute(grid: Grid, cell: Cell, shape: tuple[int, ...], own: Indices, perturbed: bool) -> Truth:
    """Run a block of cases; where ``perturbed``, run it again with the gap changed by a trifle."""
    inner = np.ravel_multi_index(np.unravel_index(own, shape), grid.inner_shape) if shape else own
    replaced = grid.study.reference.values if grid.study.reference is not None else {}
    varying = {path: values for path, values in grid.inner_values(inner).items() if path not in replaced}
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    cases = conditions(cell, structure, varying, own.size)
    compile_for(cell, balances=False)
    sampling = replace(grid.sampling, balances=False)

    def run(some: Cases) -> Results:
        return judged(cell, some, run_batch(cell, some, sampling), sampling.duration)

    results = run(cases)
    histories = {name: results.histories[name] for name in COMPARED}
    lost = results.status != Status.OK
    for values in histories.values():
        values[lost] = np.nan
    change = np.full(own.size, np.nan)
    sound = np.flatnonzero(~lost)
    if perturbed and sound.size:
        displacement, is_static = histories["displacement"][sound], cell.scene.initial == "static"
        change[sound] = predictability(run, cases.take(sound), displacement, is_static=is_static)
    failures = {int(k): results.messages.get(int(k), "it did not end ok") for k in np.flatnonzero(lost)}
    return Truth(histories, change, failures)
