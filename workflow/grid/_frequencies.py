"""Frequencies of a study's loads and casing: how many load periods a case has, and how fast its scene changes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import lru_cache

import numpy as np

from workflow.grid._arrangement import Grid, Indices
from workflow.grid._conditions import harmonics_of, load_harmonics_of
from workflow.models import Array, period_frequency
from workflow.schemes import complete_periods
from workflow.study import CaseSettings

_OF_HARMONICS = ("scene.speed", *(f"scene.load.{name}" for name in ("amplitude", "frequency")))
_OF_HARMONICS += ("scene.load.harmonics.", "scene.casing.harmonics.")
"""Beginnings of the axes that decide frequencies where a scene has harmonics."""


@lru_cache(maxsize=2)
def longest_period_count(grid: Grid) -> int:
    """Return the size of the dimension ``period``: the most complete load periods any case has."""
    most = 0
    for settings, varying, inner in _distinct(grid):
        scene, count = settings.scene, inner.size
        load, casing = load_harmonics_of(scene, varying, count), harmonics_of(scene, "casing", varying, count)
        periods = complete_periods(period_frequency(load, casing), grid.sampling)
        most = max(most, int(periods.max()))
    return most


@lru_cache(maxsize=2)
def fastest(grid: Grid) -> float:
    """Return the largest frequency of load and casing in any case, Hz."""
    largest = 0.0
    for settings, varying, inner in _distinct(grid):
        scene, count = settings.scene, inner.size
        load, casing = load_harmonics_of(scene, varying, count), harmonics_of(scene, "casing", varying, count)
        largest = max(largest, float(load.joined(casing).frequency.max()))
    return largest


def _distinct(grid: Grid) -> Iterator[tuple[CaseSettings, Mapping[str, Array], Indices]]:
    """Yield settings and conditions of one case for each combination of what decides frequencies."""
    scene = grid.study.scene
    deciding = _OF_HARMONICS if scene.load.harmonics or scene.casing.harmonics else ("scene.load.frequency",)

    def matters(path: str) -> bool:
        return path.startswith(deciding)

    inner = grid.inner_distinct(matters)
    varying = grid.inner_values(inner)
    for outer in np.unique(grid.alike(np.arange(grid.outer_count, dtype=np.int64), matters)).tolist():
        yield grid.settings(outer), varying, inner
