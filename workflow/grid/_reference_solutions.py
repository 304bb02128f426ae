"""Solutions that errors are measured against: which of them tasks need, and how they are computed."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Generic, TypeVar

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices, reads
from workflow.grid._costs import case_seconds
from workflow.grid._frequencies import fastest
from workflow.grid._operators import compile_for, judged, reduced_structure, run_batch
from workflow.grid._perturbation import cases_of
from workflow.grid._speed import timed
from workflow.grid._tasks import Batch
from workflow.grid._waiting_for import REFERENCES, waiting_for
from workflow.judges.perturbations import predictability
from workflow.judges.reasons import reason_of
from workflow.judges.trials import EXACT
from workflow.models import Array, Cases
from workflow.schemes import Results, Status
from workflow.study import CaseSettings, SchemeChoice
from workflow.variables import COMPARED

MOST_CASES = 64
"""Solutions that are computed at a time: a couple of kernel blocks, and a few milliseconds."""

HELD_BYTES = 256 * 2**20
"""Bytes of histories that are held for later tasks; what is needed after them is computed again."""

REFERENCE_RUNS = 3
"""Runs of a reference: itself, and with its gap opened and closed by a trifle."""

BASIS = frozenset({"mechanical_modes", "thermal_modes", "reduction"})
"""Settings of the reduced model, which an exact solution takes from the case."""


@dataclass(frozen=True, eq=False)
class ReferenceSolution:
    """The solution of one case.

    Attributes
    ----------
    histories
        ``(t,)`` by name, NaN where it did not end ok.
    predictability
        NaN where it was not computed.
    failure
        Why it did not end ok; empty where it did.
    """

    histories: Mapping[str, Array]
    predictability: float
    failure: str


@dataclass(frozen=True)
class Block:
    """Solutions that are computed together: references, or exact solutions of reduced models, of an outer index.

    ``inner`` are the first inner indices that have these solutions, see :func:`is_compared`.
    """

    outer: int
    is_exact: bool
    inner: tuple[int, ...]


Begun = TypeVar("Begun")

Kind = tuple[CaseSettings, bool]
"""Settings of solutions, and whether they are exact ones beside the reference."""

Solutions = Mapping[Kind, Mapping[int, ReferenceSolution]]
"""Solutions by kind and first inner index."""


def _replaced(grid: Grid) -> Mapping[str, Any]:
    """Return the settings that the reference of a study does not take from its cases, by path."""
    return {} if grid.study.reference is None else grid.study.reference.values


@lru_cache(maxsize=256)
def reference_settings(grid: Grid, outer: int) -> CaseSettings:
    """Return the settings of a reference, those that its scheme does not read the same for all."""
    chosen = grid.reference_choice(outer)
    counts = {} if chosen is None else chosen.counts
    return _only_what_is_read(grid.settings(outer, {**_replaced(grid), **counts}))


@lru_cache(maxsize=256)
def exact_settings(grid: Grid, outer: int) -> CaseSettings:
    """Return the settings of the exact solution of a case's reduced model: the reference's, with the case's basis."""
    replaced = {path: value for path, value in _replaced(grid).items() if path not in BASIS}
    settings = grid.settings(outer, replaced)
    if settings.scheme.method != EXACT:
        settings = replace(settings, scheme=SchemeChoice(EXACT, EXACT, schemes.load(EXACT).Options()))
    return _only_what_is_read(settings)


def _only_what_is_read(settings: CaseSettings) -> CaseSettings:
    """Return the settings with those of e, h and α that the scheme does not read set to 0, the same for all."""
    read = schemes.load(settings.scheme.method).READS
    unread: dict[str, Any] = {name: 0.0 for name in ("e", "h", "alpha") if name not in read}
    return replace(settings, **unread)


def needed_kinds(grid: Grid, outer: int) -> list[Kind]:
    """Return the kind of the reference of an outer index, and of the exact solution beside it unless that is it."""
    ours, theirs = reference_settings(grid, outer), exact_settings(grid, outer)
    return [(ours, False)] if theirs == ours else [(ours, False), (theirs, True)]


def is_compared(grid: Grid, settings: CaseSettings) -> Callable[[str], bool]:
    """Return what tells whether solutions of some settings differ along an axis."""
    replaced = _replaced(grid)
    return lambda path: path not in replaced and reads(settings.scheme.method, settings.scheme.label, path)


def compared_values(grid: Grid, inner: Indices) -> dict[str, Array]:
    """Return the values along which the solutions of some cases differ, each ``(case,)``, by path."""
    replaced = _replaced(grid)
    return {path: values for path, values in grid.inner_values(inner).items() if path not in replaced}


class References(Generic[Begun]):
    """Blocks of solutions that batches are compared with, each begun when the first of them needs it.

    Parameters
    ----------
    begin
        Begins to compute a block, and returns what its solutions will be had from. The latest blocks are held, one
        that is needed again later is begun again.
    """

    def __init__(self, grid: Grid, begin: Callable[[Block], Begun]) -> None:
        self._grid, self._begin = grid, begin
        self._held: OrderedDict[Block, Begun] = OrderedDict()
        self._block_of: dict[Kind, dict[int, Block]] = {}
        self._most = max(1, HELD_BYTES // (8 * grid.sampling.count * len(COMPARED)))

    def of(self, batches: Iterable[Batch]) -> dict[Block, Begun]:
        """Return the blocks that the cases of some batches are compared with."""
        if self._grid.study.reference is None:
            return {}
        needed = dict.fromkeys(block for batch in batches for block in self._blocks_of(batch))
        for block in needed:
            self._held.move_to_end(block)
        count = sum(len(block.inner) for block in self._held)
        while count > self._most and (oldest := next(iter(self._held))) not in needed:
            del self._held[oldest]
            for inner in oldest.inner:
                del self._block_of[_kind_of(self._grid, oldest)][inner]
            count -= len(oldest.inner)
        return {block: self._held[block] for block in needed}

    def _blocks_of(self, batch: Batch) -> Iterator[Block]:
        """Yield the blocks of a batch, after new ones are begun where none is held."""
        for kind in needed_kinds(self._grid, batch.outer):
            held = self._block_of.setdefault(kind, {})
            first_alike = np.unique(self._grid.inner_alike(batch.inner, is_compared(self._grid, kind[0]))).tolist()
            new = [inner for inner in first_alike if inner not in held]
            for first in range(0, len(new), MOST_CASES):
                block = Block(batch.outer, kind[1], tuple(new[first : first + MOST_CASES]))
                self._held[block] = self._begin(block)
                held.update(dict.fromkeys(block.inner, block))
            yield from (held[inner] for inner in first_alike)


def solutions_for(grid: Grid, batch: Batch) -> Solutions:
    """Compute the solutions that a batch is compared with."""
    return solutions_of(grid, References(grid, lambda block: compute_block(grid, block)).of([batch]))


def solutions_of(grid: Grid, computed: Mapping[Block, Sequence[ReferenceSolution]]) -> Solutions:
    """Return what blocks hold by kind and first inner index."""
    solutions: dict[Kind, dict[int, ReferenceSolution]] = {}
    for block, each in computed.items():
        solutions.setdefault(_kind_of(grid, block), {}).update(zip(block.inner, each, strict=True))
    return solutions


def _kind_of(grid: Grid, block: Block) -> Kind:
    settings = exact_settings(grid, block.outer) if block.is_exact else reference_settings(grid, block.outer)
    return settings, block.is_exact


def compute_block(grid: Grid, block: Block) -> list[ReferenceSolution]:
    """Return the solutions of a block."""
    settings, _ = _kind_of(grid, block)
    with timed(len(block.inner) * solution_seconds(grid, settings, block.is_exact)):
        return _computed_or_lost(grid, settings, np.array(block.inner, dtype=np.int64), is_exact=block.is_exact)


def solution_seconds(grid: Grid, settings: CaseSettings, is_exact: bool) -> float:
    """Return model seconds of a solution; a reference is run three times for its predictability."""
    sampling, periods = replace(grid.sampling, balances=False), fastest(grid) * grid.sampling.duration
    return (1 if is_exact else REFERENCE_RUNS) * case_seconds(settings, reduced_structure(settings), sampling, periods)


def _computed_or_lost(grid: Grid, settings: CaseSettings, inner: Indices, *, is_exact: bool) -> list[ReferenceSolution]:
    """Return solutions, references with their predictability.

    One that raises is NaN, which harms neither its neighbours nor its cases.
    """
    try:
        with waiting_for(REFERENCES), np.errstate(all="ignore"):
            return _computed(grid, settings, inner, is_exact)
    except (Exception, SystemExit) as error:  # whatever a model or scheme raises
        if inner.size > 1:
            return [one for k in inner for one in _computed_or_lost(grid, settings, np.array([k]), is_exact=is_exact)]
        lost = np.full(grid.sampling.count, np.nan)
        return [ReferenceSolution(dict.fromkeys(COMPARED, lost), np.nan, reason_of(error))]


def _computed(grid: Grid, settings: CaseSettings, inner: Indices, is_exact: bool) -> list[ReferenceSolution]:
    _, cases = cases_of(settings, compared_values(grid, inner), inner.size)
    compile_for(settings, balances=False)
    sampling = replace(grid.sampling, balances=False)

    def run(some: Cases) -> Results:
        return judged(settings, some, run_batch(settings, some, sampling), sampling.duration)

    results = run(cases)
    ok = results.status == Status.OK
    histories = {name: np.where(ok[:, None], results.histories[name], np.nan) for name in COMPARED}
    change, sound = np.full(inner.size, np.nan), np.flatnonzero(ok)
    if not is_exact and sound.size:
        displacement, is_static = histories["displacement"][sound], settings.scene.initial == "static"
        change[sound] = predictability(run, cases.take(sound), displacement, is_static=is_static)
    failures = ["" if ok[k] else results.messages.get(k, "it did not end ok") for k in range(inner.size)]
    return [
        ReferenceSolution({name: values[k] for name, values in histories.items()}, float(change[k]), failures[k])
        for k in range(inner.size)
    ]
