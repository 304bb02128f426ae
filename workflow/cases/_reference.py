"""What errors are measured against: the settings of references, and of exact solutions beside them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from workflow import schemes
from workflow.cases._arrangement import Grid, Indices, reads
from workflow.judges.trials import EXACT
from workflow.models import Array
from workflow.study import CaseSettings, SchemeChoice

BASIS = frozenset({"mechanical_modes", "thermal_modes", "reduction"})
"""Settings of the reduced model, which an exact solution takes from the case."""


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


def needed_settings(grid: Grid, outer: int) -> list[CaseSettings]:
    """Return the settings of an outer index's reference, and of the exact solution beside it unless that is it."""
    if grid.study.reference is None:
        return []
    return list(dict.fromkeys((reference_settings(grid, outer), exact_settings(grid, outer))))


def is_compared(grid: Grid, settings: CaseSettings) -> Callable[[str], bool]:
    """Return a test of an axis by its path: whether solutions of some settings depend on it."""
    replaced = _replaced(grid)
    return lambda path: path not in replaced and reads(settings.scheme.method, settings.scheme.label, path)


def compared_values(grid: Grid, inner: Indices) -> dict[str, Array]:
    """Return the values along which the solutions of some cases differ, each ``(case,)``, by path."""
    replaced = _replaced(grid)
    return {path: values for path, values in grid.inner_values(inner).items() if path not in replaced}


def tells_basis_error(grid: Grid, outer: int) -> bool:
    """Tell whether the model's part of an error is that of the case's basis: the reference is exact and as rich."""
    if grid.study.reference is None:
        return False
    ours, theirs = reference_settings(grid, outer), exact_settings(grid, outer)
    is_as_rich = ours.mechanical_modes >= theirs.mechanical_modes and ours.thermal_modes >= theirs.thermal_modes
    return ours.scheme.method == EXACT and is_as_rich


def distinct_solutions(grid: Grid) -> Iterator[tuple[CaseSettings, bool, int]]:
    """Yield settings of references of a study and of the exact solutions beside them, which these are, their number."""
    replaced = _replaced(grid)
    outer = np.unique(grid.alike(grid.computed, lambda path: path in BASIS or path not in replaced))
    every: dict[CaseSettings, bool] = {}
    for k in outer.tolist():
        for is_exact, settings in enumerate(needed_settings(grid, k)):
            every[settings] = every.get(settings, True) and bool(is_exact)
    for settings, is_exact in every.items():
        yield settings, is_exact, grid.inner_distinct_count(is_compared(grid, settings))


def solution_counts(grid: Grid) -> tuple[int, int]:
    """Return how many references a study has, and how many exact solutions beside them split their errors."""
    counts = [0, 0]
    for _, is_exact, count in distinct_solutions(grid):
        counts[is_exact] += count
    return counts[0], counts[1]
