"""Errors of a batch against the study's reference, whole and split into those of scheme and reduced model.

Solutions that errors are measured against are computed in blocks, each of about a task's cost; the solutions of a block
serve all cases that are compared with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from workflow import schemes
from workflow.cases import (
    REFERENCES,
    Grid,
    Indices,
    Perturbation,
    cases_of,
    compared_values,
    exact_settings,
    is_compared,
    needed_settings,
    reduced_structure,
    waiting_for,
)
from workflow.judges.distances import norms, predictability, relative
from workflow.judges.trials import EXACT, reason_of
from workflow.kernels.compiled import CompilerError
from workflow.models import Array, Cases
from workflow.schemes import Results, Status
from workflow.solve._operators import compile_for, judged, run_batch
from workflow.solve._tasks import TASK_BYTES, Batch, case_seconds, fair_seconds, unit
from workflow.study import CaseSettings
from workflow.variables import COMPARED

HELD_BYTES = 256 * 2**20
"""Bytes of histories that are held for later tasks; what is needed after them is computed again."""

REFERENCE_RUNS = 3
"""Runs of a reference: itself, and with its gap opened and closed by a trifle."""


@dataclass(frozen=True, eq=False)
class ReferenceSolutions:
    """The solutions of some cases."""

    inner: Indices
    """First inner indices that have them, ascending, ``(case,)``."""
    histories: Mapping[str, Array]
    """``(case, t)`` or ``(case, contact, t)`` by name, NaN where one did not end ok."""
    predictability: Array
    """``(case,)``, NaN where it was not computed, as of several contacts."""
    failures: Mapping[int, str]
    """Why those did not end ok that did not, by position."""

    def of(self, inner: Indices) -> ReferenceSolutions:
        """Return the solutions of these inner indices, in their order; some may be there more than once."""
        if not np.isin(inner, self.inner).all():
            raise RuntimeError(f"of the cases {inner.tolist()} only {self.inner.tolist()} have solutions")
        rows = np.searchsorted(self.inner, inner)
        histories = {name: values[rows] for name, values in self.histories.items()}
        return ReferenceSolutions(inner, histories, self.predictability[rows], texts_of(self.failures, rows))


def texts_of(texts: Mapping[int, str], rows: Indices) -> dict[int, str]:
    """Return what is said of rows by their place among some, which have or repeat them."""
    said = np.flatnonzero(np.isin(rows, list(texts))).tolist() if texts else []
    return {k: texts[int(rows[k])] for k in said}


def _together(parts: Iterable[ReferenceSolutions]) -> ReferenceSolutions:
    """Return the solutions of parts between whose inner indices no other part has any."""
    parts = sorted(parts, key=lambda part: int(part.inner[0]))
    first = np.cumsum([0, *(part.inner.size for part in parts)]).tolist()
    inner = np.concatenate([part.inner for part in parts])
    histories = {name: np.concatenate([part.histories[name] for part in parts]) for name in COMPARED}
    failures = {first[n] + k: text for n, part in enumerate(parts) for k, text in part.failures.items()}
    return ReferenceSolutions(inner, histories, np.concatenate([part.predictability for part in parts]), failures)


@dataclass(frozen=True, eq=False)
class ReferenceBlock:
    """Solutions that are computed together: the study's references, or with ``is_exact`` those of reduced models.

    Cases that differ only along axes that a solution does not read share it: ``inner`` holds the first inner index of
    each such group, ascending.
    """

    outer: int
    is_exact: bool
    inner: Indices

    def settings(self, grid: Grid) -> CaseSettings:
        """Return the settings of its solutions."""
        return needed_settings(grid, self.outer)[self.is_exact]


Begun = TypeVar("Begun")
"""What computing a block returns at once: its solutions, or the key of a task that will have them."""

Solutions = Mapping[CaseSettings, ReferenceSolutions]
"""Solutions by their settings."""


class References(Generic[Begun]):
    """The solutions that some batches are compared with, in blocks, each begun when the first batch needs it.

    Blocks are cut as tasks are: to the same cost, with packs whole and within the same memory.

    Parameters
    ----------
    batches
        All of them.
    begin
        Begins to compute a block, and returns what its solutions will be had from. The latest blocks are held, one
        that is needed again later is begun again.
    threads
        Those that share the blocks.
    """

    def __init__(
        self, grid: Grid, batches: Iterable[Batch], begin: Callable[[ReferenceBlock], Begun], threads: int = 1
    ) -> None:
        self._grid, self._begin, self._held = grid, begin, dict[ReferenceBlock, Begun]()
        wanted: dict[CaseSettings, tuple[int, bool, list[Indices]]] = {}
        for batch in batches:
            for k, settings in enumerate(needed_settings(grid, batch.outer)):
                *_, some = wanted.setdefault(settings, (batch.outer, k > 0, []))
                some.append(_first_alike(grid, settings, batch.inner))
        every = {settings: np.unique(np.concatenate(some)) for settings, (*_, some) in wanted.items()}
        each = {settings: solution_seconds(grid, settings, wanted[settings][1]) for settings in every}
        fair = fair_seconds(sum(each[settings] * inner.size for settings, inner in every.items()), threads)
        self._blocks = {
            settings: [
                ReferenceBlock(*wanted[settings][:2], part)
                for part in _cut(grid, settings, inner, each[settings], fair)
            ]
            for settings, inner in every.items()
        }

    def of(self, batches: Iterable[Batch]) -> dict[ReferenceBlock, Begun]:
        """Return the blocks that the cases of some batches are compared with."""
        needed = dict.fromkeys(block for batch in batches for block in self._blocks_of(batch))
        for block in needed:
            begun = self._held.pop(block) if block in self._held else self._begin(block)
            self._held[block] = begun  # the latest come last
        held, most = sum(block.inner.size for block in self._held), HELD_BYTES // _bytes_of_solution(self._grid)
        for block in list(self._held):
            if held <= most or block in needed:
                break
            del self._held[block]
            held -= block.inner.size
        return {block: self._held[block] for block in needed}

    def _blocks_of(self, batch: Batch) -> Iterator[ReferenceBlock]:
        for settings in needed_settings(self._grid, batch.outer):
            blocks, first = self._blocks[settings], _first_alike(self._grid, settings, batch.inner)
            after = np.searchsorted([block.inner[0] for block in blocks], first, side="right")
            yield from (blocks[k - 1] for k in np.unique(after).tolist())


def _first_alike(grid: Grid, settings: CaseSettings, inner: Indices) -> Indices:
    """Return the inner indices that have the solutions of some settings for cases, see :func:`is_compared`."""
    return grid.inner_alike(inner, is_compared(grid, settings))


def _cut(grid: Grid, settings: CaseSettings, inner: Indices, each: float, fair: float) -> list[Indices]:
    """Return inner indices in parts that take about ``fair`` seconds, ``each`` of them so many."""
    most = max(1, TASK_BYTES // _bytes_of_solution(grid))
    least = min(most, unit(grid, each, schemes.load(settings.scheme.method).TOGETHER))
    parts = max(1, round(inner.size * each / fair))
    length = least * min(most // least, -(-inner.size // (parts * least)))
    return [inner[first : first + length] for first in range(0, inner.size, length)]


def _bytes_of_solution(grid: Grid) -> int:
    return 8 * grid.sampling.count * len(COMPARED) * math.prod(grid.study.contact_shape)


def solutions_for(grid: Grid, batch: Batch) -> Solutions:
    """Compute the solutions that a batch is compared with."""
    return solutions_of(grid, References(grid, [batch], lambda block: compute_block(grid, block)).of([batch]))


def solutions_of(grid: Grid, computed: Mapping[ReferenceBlock, ReferenceSolutions]) -> Solutions:
    """Return what blocks hold, by the settings of their solutions."""
    parts: dict[CaseSettings, list[ReferenceSolutions]] = {}
    for block, solutions in computed.items():
        parts.setdefault(block.settings(grid), []).append(solutions)
    return {settings: _together(some) for settings, some in parts.items()}


def compute_block(grid: Grid, block: ReferenceBlock) -> ReferenceSolutions:
    """Return the solutions of a block, references with their predictability.

    One that raises is NaN, which harms neither its neighbours nor its cases.
    """
    settings = block.settings(grid)
    try:
        with waiting_for(REFERENCES), np.errstate(all="ignore"):
            return _computed(grid, settings, block.inner, block.is_exact)
    except CompilerError:
        raise
    except (Exception, SystemExit) as error:  # whatever a model or scheme raises
        if block.inner.size > 1:
            return _together([compute_block(grid, replace(block, inner=np.array([k]))) for k in block.inner])
        lost = np.full((1, *grid.study.contact_shape, grid.sampling.count), np.nan)
        return ReferenceSolutions(block.inner, dict.fromkeys(COMPARED, lost), np.full(1, np.nan), {0: reason_of(error)})


def solution_seconds(grid: Grid, settings: CaseSettings, is_exact: bool) -> float:
    """Return model seconds of a solution; a reference is run three times for its predictability."""
    sampling, periods = replace(grid.sampling, balances=False), grid.fastest * grid.sampling.duration
    return (1 if is_exact else REFERENCE_RUNS) * case_seconds(settings, reduced_structure(settings), sampling, periods)


def _computed(grid: Grid, settings: CaseSettings, inner: Indices, is_exact: bool) -> ReferenceSolutions:
    _, cases = cases_of(settings, compared_values(grid, inner), inner.size)
    compile_for(settings, balances=False)
    sampling = replace(grid.sampling, balances=False)

    def run(some: Cases) -> Results:
        return judged(settings, some, run_batch(settings, some, sampling), sampling.duration)

    results = run(cases)
    ok, histories = results.status == Status.OK, _compared(results)
    change, sound = np.full(inner.size, np.nan), np.flatnonzero(ok)
    if not is_exact and sound.size:
        displacement, is_static = histories["displacement"][sound], settings.scene.initial == "static"
        change[sound] = predictability(run, cases.take(sound), displacement, is_static=is_static)
    failures = {k: results.messages.get(k, "it did not end ok") for k in np.flatnonzero(~ok).tolist()}
    return ReferenceSolutions(inner, histories, change, failures)


def _compared(results: Results) -> dict[str, Array]:
    """Return the histories that are compared, NaN in cases that did not end ok."""
    lost = np.flatnonzero(results.status != Status.OK)
    histories = {name: results.histories[name].copy() for name in COMPARED}
    for values in histories.values():
        values[lost] = np.nan
    return histories


REFERENCE = "reference: "
"""What the message begins with of a case that is ok and has an error that cannot be formed."""

PARTS = "scheme and model error: "
"""What the message begins with of a case whose error cannot be split."""


def against_reference(
    grid: Grid, outer: int, inner: Indices, results: Mapping[str, Array], solutions: Solutions
) -> tuple[dict[str, Array], dict[int, str]]:
    """Return the errors of a batch against the study's reference, ``(case,)`` each, and what cannot be formed.

    Errors are relative L2 norms over the common samples; 0 where both are identically zero. The scheme's part is
    the distance from the exact solution of the case's own reduced model, the model's part the distance of that from
    the reference, all over the reference's norm, so that total <= scheme + model. NaN where a solution did not end
    ok, or the reference is identically zero and the case is not. Messages are by position, of ok cases only.

    Parameters
    ----------
    results
        Histories ``(case, …, t)`` and ``status`` of the batch.
    solutions
        Those that the batch is compared with.
    """
    if grid.study.reference is None:
        return {}, {}
    compared = [
        solutions[settings].of(_first_alike(grid, settings, inner)) for settings in needed_settings(grid, outer)
    ]
    references, exact = compared[0], compared[-1]
    errors: dict[str, Array] = {"predictability": references.predictability}
    chosen = grid.reference_choice(outer)
    if chosen is not None:
        errors["reference_basis_error"] = np.full(inner.size, chosen.error)
    for name in COMPARED:
        truth, reduced = references.histories[name], exact.histories[name]
        size = norms(truth)
        errors[f"{name}_error"] = relative(norms(results[name] - truth), size)
        errors[f"{name}_scheme_error"] = relative(norms(results[name] - reduced), size)
        errors[f"{name}_model_error"] = relative(norms(reduced - truth), size)
    return errors, _messages(references, exact, errors, results["status"] == Status.OK)


def _messages(
    references: ReferenceSolutions, exact: ReferenceSolutions, errors: Mapping[str, Array], ok: NDArray[np.bool_]
) -> dict[int, str]:
    """Say of each ok case which errors cannot be formed, and why."""
    remarks: dict[int, str] = {}
    formed = [np.isfinite(errors[f"{name}_{part}"]) for name in COMPARED for part in ("error", "scheme_error")]
    for case in np.flatnonzero(ok & ~np.all(formed, axis=0)).tolist():
        zero = [name for name in COMPARED if np.isnan(errors[f"{name}_error"][case])]
        if case in references.failures:
            remarks[case] = f"{REFERENCE}{references.failures[case]}"
        elif zero:
            remarks[case] = f"{REFERENCE}its {' and '.join(zero)} is identically zero, that of the case is not"
        elif case in exact.failures:
            remarks[case] = f"{PARTS}{EXACT} on the reduced model of the case: {exact.failures[case]}"
    return remarks


def exact_motion(grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None = None) -> dict[str, Array]:
    """Return histories of the exact solutions of the reduced models of some cases, with their data changed if asked.

    Shape ``(case, …, t)`` by name, NaN in those that do not end ok.
    """
    settings = exact_settings(grid, outer)
    if perturbation is None:
        settings = needed_settings(grid, outer)[-1]  # the reference itself where that is exact
        solutions = solutions_for(grid, Batch(outer, inner))[settings]
        return dict(solutions.of(_first_alike(grid, settings, inner)).histories)
    settings, cases = cases_of(settings, compared_values(grid, inner), inner.size, perturbation)
    return _compared(run_batch(settings, cases, replace(grid.sampling, balances=False)))
