"""Errors of a batch against a reference, each distinct reference computed once and kept a while."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Mapping
from concurrent.futures import Future
from dataclasses import dataclass, field, replace
from weakref import WeakKeyDictionary

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices, reads
from workflow.grid._conditions import conditions
from workflow.grid._operators import compile_for, run_batch, structure_of
from workflow.grid._turns import waiting
from workflow.models import Array
from workflow.schemes import Status
from workflow.study import Cell

COMPARED = {"displacement_error": "displacement", "temperature_error": "temperature", "impulse_error": "impulse"}
"""Errors of an archive and the histories they compare."""

PREDICTABILITY = "predictability"

PERTURBATION = 1e-12
"""Relative change of the gap whose effect on a reference tells how far it can be predicted."""

BLOCK = 64
"""Reference cases that are computed at a time: a couple of kernel blocks, and a few milliseconds."""

KEPT_BYTES = 256 * 2**20
"""Reference histories that are kept for the batches to come."""


def reference_names(grid: Grid) -> tuple[str, ...]:
    """Return the metrics that a study with a reference has."""
    return (*COMPARED, PREDICTABILITY) if grid.study.reference is not None else ()


@dataclass(frozen=True, eq=False)
class _Truth:
    """A block of reference cases: histories ``(case, t)`` and predictability ``(case,)``."""

    histories: dict[str, Array]
    predictability: Array


@dataclass(eq=False)
class _Kept:
    """Blocks of references of one grid, the most recently used last."""

    blocks: OrderedDict[tuple[Cell, int], Future[_Truth]] = field(default_factory=OrderedDict)
    lock: threading.Lock = field(default_factory=threading.Lock)


_KEPT: WeakKeyDictionary[Grid, _Kept] = WeakKeyDictionary()
_KEPT_LOCK = threading.Lock()


def against_reference(grid: Grid, outer: int, inner: Indices, found: Mapping[str, Array]) -> dict[str, Array]:
    """Return the errors of the histories of a batch against the study's reference, ``(case,)`` each; none without one.

    Relative L2 norms over the common samples; 0 where both are identically zero, NaN where the case
    or its reference did not end ok.
    """
    if grid.study.reference is None:
        return {}
    truth = _truth_of(grid, outer, inner)
    errors = {name: _distance(found[history], truth.histories[history]) for name, history in COMPARED.items()}
    return {**errors, PREDICTABILITY: truth.predictability}


def _distance(values: Array, truth: Array) -> Array:
    """Return the relative L2 distance of each row."""
    distance = np.sqrt(np.sum((values - truth) ** 2, axis=1))
    size = np.sqrt(np.sum(truth**2, axis=1))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(distance == 0.0, 0.0, distance / size)


def _truth_of(grid: Grid, outer: int, inner: Indices) -> _Truth:
    """Return the reference of every case, put together from blocks."""
    cell = reference_cell(grid, outer)
    shape = _reference_shape(grid, cell)
    index = np.unravel_index(inner, grid.inner_shape) if grid.inner else ()
    own = [np.minimum(i, size - 1) for i, size in zip(index, shape, strict=True)]
    number = np.ravel_multi_index(own, shape) if shape else np.zeros_like(inner)
    found = {int(block): _block(grid, cell, shape, int(block)) for block in np.unique(number // BLOCK)}
    rows = [(found[int(n) // BLOCK], int(n) % BLOCK) for n in number]
    return _Truth(
        {name: np.stack([block.histories[name][row] for block, row in rows]) for name in COMPARED.values()},
        np.array([block.predictability[row] for block, row in rows]),
    )


def reference_cell(grid: Grid, outer: int) -> Cell:
    """Return the settings of a reference, those that its scheme does not read the same for all."""
    values = dict(grid.study.reference.values) if grid.study.reference is not None else {}
    cell = grid.settings(outer, values)
    read = schemes.load(cell.scheme.method).READS
    return replace(
        cell,
        e=cell.e if "e" in read else 0.0,
        h=cell.h if "h" in read else 0.0,
        alpha=cell.alpha if "alpha" in read else 0.0,
    )


def _reference_shape(grid: Grid, cell: Cell) -> tuple[int, ...]:
    """Return the sizes of the inner dimensions, 1 for those along which the reference stays the same."""
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


def _block(grid: Grid, cell: Cell, shape: tuple[int, ...], block: int) -> _Truth:
    """Return a block of references: computed by the first who asks, waited for by all others."""
    with _KEPT_LOCK:
        kept = _KEPT.setdefault(grid, _Kept())
    with kept.lock:
        key = (cell, block)
        future = kept.blocks.get(key)
        mine = future is None
        if future is None:
            future = kept.blocks[key] = Future()
        kept.blocks.move_to_end(key)
        while len(kept.blocks) * BLOCK * grid.sampling.count * 8 * len(COMPARED) > KEPT_BYTES and len(kept.blocks) > 2:
            kept.blocks.popitem(last=False)
    if mine:
        count = int(np.prod(shape, dtype=np.int64))
        own = np.arange(block * BLOCK, min((block + 1) * BLOCK, count), dtype=np.int64)
        try:
            future.set_result(_computed_or_lost(grid, cell, shape, own))
        except BaseException as error:  # an interrupt: whoever waits must not wait for ever
            future.set_exception(error)
            raise
        return future.result()
    with waiting():
        return future.result()


def _computed_or_lost(grid: Grid, cell: Cell, shape: tuple[int, ...], own: Indices) -> _Truth:
    """Return references; one that raises is NaN, which harms neither its neighbours nor its cases."""
    try:
        return _compute(grid, cell, shape, own)
    except Exception:  # whatever a model or scheme raises
        if own.size > 1:
            alone = [_computed_or_lost(grid, cell, shape, own[k : k + 1]) for k in range(own.size)]
            names = COMPARED.values()
            histories = {name: np.concatenate([truth.histories[name] for truth in alone]) for name in names}
            return _Truth(histories, np.concatenate([truth.predictability for truth in alone]))
        lost = np.full((1, grid.sampling.count), np.nan)
        return _Truth(dict.fromkeys(COMPARED.values(), lost), np.full(1, np.nan))


def _compute(grid: Grid, cell: Cell, shape: tuple[int, ...], own: Indices) -> _Truth:
    """Run a block of references, and once more with the gap opened by a trifle."""
    inner = np.ravel_multi_index(np.unravel_index(own, shape), grid.inner_shape) if shape else own
    replaced = grid.study.reference.values if grid.study.reference is not None else {}
    varying = {path: values for path, values in grid.inner_values(inner).items() if path not in replaced}
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    cases = conditions(cell, structure, varying, own.size)
    compile_for(cell)
    sampling = replace(grid.sampling, balances=False)
    truth = run_batch(cell, cases, sampling)
    opened = run_batch(cell, replace(cases, gap=cases.gap + PERTURBATION * np.abs(cases.gap)), sampling)
    histories = {name: truth.histories[name] for name in COMPARED.values()}
    lost = truth.status != Status.OK
    for values in histories.values():
        values[lost] = np.nan
    return _Truth(histories, _distance(opened.histories["displacement"], histories["displacement"]))
