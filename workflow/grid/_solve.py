"""One batch through models, reduction and scheme: every variable of the archive for its cases."""

from __future__ import annotations

import time
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import models, schemes
from workflow.grid._arrangement import Grid, Indices, values_along
from workflow.grid._conditions import conditions
from workflow.models import Array, Cases, Structure, critical_alpha, growth_rate
from workflow.reduction import Reduction, reduce_structure
from workflow.schemes import Results, Sampling, Status
from workflow.study import Cell

_OPERATORS_KEPT = 16
"""Operators kept per process; tasks run through them in order, so few are alive at a time."""

_LARGE = 300
"""States above which the growth rate is taken from a reduced structure: the dense eigenvalue
problem of a few hundred states takes tens of milliseconds and grows with the cube."""

_ENOUGH_MODES = 80
"""Modes of that reduced structure; 3 + 12 modes already give the rate to 0.2 % on the blade."""


@lru_cache(maxsize=_OPERATORS_KEPT)
def structure_of(model: str, parameters: Any) -> Structure:
    """Return the full structure of a model."""
    return models.load(model).assemble(parameters)


@lru_cache(maxsize=_OPERATORS_KEPT)
def reduction_of(model: str, parameters: Any, mechanical_modes: int, thermal_modes: int) -> Reduction | None:
    """Return the reduction of a model, ``None`` where all modes are kept and nothing is to be done."""
    structure = structure_of(model, parameters)
    if mechanical_modes == structure.mechanical_size - 1 and thermal_modes == structure.thermal_size - 1:
        return None
    return reduce_structure(structure, mechanical_modes, thermal_modes)


def reduced_structure(cell: Cell) -> Structure:
    """Return the structure that a case is run on."""
    scene = cell.scene
    reduction = reduction_of(scene.model, scene.parameters, cell.mechanical_modes, cell.thermal_modes)
    return structure_of(scene.model, scene.parameters) if reduction is None else reduction.structure


@lru_cache(maxsize=_OPERATORS_KEPT)
def _operator(model: str, parameters: Any, modes: tuple[int, int], method: str, options: Any, h: float) -> Any:
    reduction = reduction_of(model, parameters, *modes)
    structure = structure_of(model, parameters) if reduction is None else reduction.structure
    return schemes.load(method).init(structure, h, options)


@lru_cache(maxsize=4096)
def _growth_rate(model: str, parameters: Any, modes: tuple[int, int], alpha: float) -> float:
    reduction = reduction_of(model, parameters, *modes)
    structure = structure_of(model, parameters) if reduction is None else reduction.structure
    if 2 * structure.mechanical_size + structure.thermal_size > _LARGE:
        kept = (min(_ENOUGH_MODES, structure.mechanical_size - 1), min(_ENOUGH_MODES, structure.thermal_size - 1))
        structure = reduce_structure(structure, *kept).structure
    return growth_rate(structure, alpha)


@lru_cache(maxsize=_OPERATORS_KEPT)
def _critical_alpha(model: str, parameters: Any, modes: tuple[int, int]) -> float:
    reduction = reduction_of(model, parameters, *modes)
    return critical_alpha(structure_of(model, parameters) if reduction is None else reduction.structure)


@cache
def _compile(method: str) -> None:
    """Run a scheme once on the smallest structure, so that no case's wall time holds compilation."""
    chain = models.load("chain")
    structure = chain.assemble(chain.Parameters(nodes=1, mass=1.0, stiffness=1.0, heat_capacity=1.0))
    scheme = schemes.load(method)
    one, node = np.zeros(1), np.zeros((1, 1))
    cases = Cases(one, one, one + 1, one, one, one, one, node, node, node, node, node)
    scheme.compute(scheme.init(structure, 0.5, scheme.Options()), cases, Sampling(1.0, 0.5, 3))


@dataclass(frozen=True, eq=False)
class Solved:
    """All variables of a batch, by name, each ``(case, …)``, and what failed cases have to say."""

    values: dict[str, NDArray[Any]]
    messages: dict[int, str]


def solve(grid: Grid, outer: int, inner: Indices) -> Solved:
    """Run the cases ``inner`` of one outer index.

    Cases that differ only in axes their scheme does not read are run once. What raises becomes
    cases of status ``failed``; it harms no neighbour, which then run one by one.
    """
    cell = grid.settings(outer)
    canonical, place = np.unique(grid.canonical_inner(cell, inner), return_inverse=True)
    try:
        solved = _solve_distinct(grid, cell, canonical)
    except Exception as error:  # whatever a model or scheme raises is that case's result
        if canonical.size > 1:
            solved = _joined([solve(grid, outer, canonical[k : k + 1]) for k in range(canonical.size)])
        else:
            solved = _failed(grid, f"{type(error).__name__}: {error}")
    where = place.ravel()
    return Solved(
        {name: values[where] for name, values in solved.values.items()},
        {k: solved.messages[int(source)] for k, source in enumerate(where) if int(source) in solved.messages},
    )


def _joined(parts: list[Solved]) -> Solved:
    """Put batches of one case each together."""
    names = parts[0].values
    values = {name: np.concatenate([part.values[name] for part in parts]) for name in names}
    return Solved(values, {k: part.messages[0] for k, part in enumerate(parts) if part.messages})


def _solve_distinct(grid: Grid, cell: Cell, inner: Indices) -> Solved:
    scene, method = cell.scene, cell.scheme.method
    modes = (cell.mechanical_modes, cell.thermal_modes)
    structure = structure_of(scene.model, scene.parameters)
    reduction = reduction_of(scene.model, scene.parameters, *modes)
    cases = conditions(cell, structure, grid.inner_values(inner), inner.size)
    operator = _operator(scene.model, scene.parameters, modes, method, cell.scheme.options, cell.h)
    _compile(method)
    begun = time.perf_counter()
    results = schemes.load(method).compute(
        operator, cases if reduction is None else reduction.project(cases), grid.sampling
    )
    taken = (time.perf_counter() - begun) / inner.size
    critical = _critical_alpha(scene.model, scene.parameters, modes)
    growth = np.array([_growth_rate(scene.model, scene.parameters, modes, float(a)) for a in cases.alpha])
    values: dict[str, NDArray[Any]] = {
        **results.histories,
        **results.metrics,
        **_contact(results, cases, grid),
        "critical_alpha": np.full(inner.size, critical),
        "growth_rate": growth,
        "wall_time": np.full(inner.size, taken),
        "status": results.status,
        "runaway": ((cases.alpha > 0) & (cases.alpha >= critical)).astype(np.int8),
    }
    return Solved(values, dict(results.messages))


def _contact(results: Results, cases: Cases, grid: Grid) -> dict[str, Array]:
    """Return contact force and impulses, all from the sampled running sum of the impulse."""
    interval, periods = grid.sampling.interval, longest_period_count(grid)
    impulse = results.histories["impulse"]
    force = np.zeros_like(impulse)
    force[:, 1:] = np.diff(impulse, axis=1) / interval

    def widened(values: Array) -> Array:
        wide = np.full((values.shape[0], periods), np.nan)
        wide[:, : values.shape[1]] = values
        return wide

    return {
        "contact_force": force,
        "contact_impulse": impulse[:, -1].copy(),
        "period_impulse": widened(results.period_impulse),
        "period_force": _largest_per_period(force[:, 1:], cases.frequency, interval, periods),
        "period_temperature": widened(results.period_temperature),
        "period_contact": widened(results.period_contact),
    }


def _largest_per_period(force: Array, frequency: Array, interval: float, periods: int) -> Array:
    """Return the largest force of the output intervals whose middle lies in each load period.

    A period shorter than an interval takes the interval that holds its own middle.
    """
    largest = np.full((force.shape[0], periods), np.nan)
    count = force.shape[1]
    middle = (np.arange(count) + 0.5) * interval
    for value in np.unique(frequency[frequency > 0]):
        rows = np.flatnonzero(frequency == value)
        edges = np.searchsorted(middle * value, np.arange(periods + 1))
        complete = int(np.floor(count * interval * value * (1 + 1e-12) + 1e-9))  # as workflow.schemes counts
        for k in range(min(periods, complete)):
            first, stop = int(edges[k]), int(edges[k + 1])
            if first == stop:
                first = min(int((k + 0.5) / value / interval), count - 1)
                stop = first + 1
            largest[rows, k] = force[rows, first:stop].max(axis=1)
    return largest


def longest_period_count(grid: Grid) -> int:
    """Return the size of the dimension ``period``: the most complete load periods any case has."""
    values = values_along(grid, "scene.load.frequency", grid.study.scene.load.frequency)
    return int(np.floor(grid.sampling.duration * max(values) * (1 + 1e-12) + 1e-9))


def _failed(grid: Grid, text: str) -> Solved:
    """Return one case that raised: NaN everywhere, flags told."""
    nan, periods = np.full(1, np.nan), longest_period_count(grid)
    names = ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing", "steps")
    derived = ("contact_impulse", "critical_alpha", "growth_rate", "wall_time")
    histories = (*schemes.HISTORIES, "contact_force")
    per_period = ("period_impulse", "period_force", "period_temperature", "period_contact")
    return Solved(
        {
            **{name: np.full((1, grid.sampling.count), np.nan) for name in histories},
            **dict.fromkeys((*names, *derived), nan),
            **{name: np.full((1, periods), np.nan) for name in per_period},
            "status": np.full(1, Status.FAILED, dtype=np.int8),
            "runaway": np.zeros(1, dtype=np.int8),
        },
        {0: text},
    )
