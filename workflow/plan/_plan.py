"""Plan of a study before anything runs: numbers of cases, time, size and warnings."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from workflow import schemes, solve
from workflow.cases import (
    Grid,
    arrange,
    distinct_solutions,
    full_structure,
    reduced_structure,
    reference_settings,
    solution_counts,
)
from workflow.models import MOST_BY_SUPERLU, expected_fill, has_cholmod, one_thread
from workflow.plan._coating import coating_lines
from workflow.plan._figures import Figures, figures, speed_lines
from workflow.plan._template import made_by_friction
from workflow.plan._warnings import (
    MOST_OUTER,
    choice_lines,
    coarse_tip,
    distinct_lines,
    ends_of_friction,
    looked_at,
    warnings,
)
from workflow.study import CaseSettings, ResolvedValue, StudySource, read_study, resolved_values

_STRUCTURES_SHOWN = 8

_ORDERS = {"seconds": 60.0, "minutes": 3600.0, "hours": 86400.0, "days": float("inf")}
"""Orders of time, each up to so many seconds."""


@dataclass(frozen=True)
class Plan:
    """Plan of a study: numbers, time, size and warnings."""

    study: str
    title: str
    """``study``, ``title``: its name and title."""
    dims: tuple[tuple[str, int], ...]
    """Names and sizes of the archive's dimensions, outermost first."""
    followed: tuple[tuple[str, int], ...]
    """Those of the points of each branch, and of its boundaries and theirs; none without a branch."""
    scene: tuple[ResolvedValue, ...]
    """Every value with its unit, and what was left to its default."""
    makes_alpha: bool
    """Whether friction, sliding speed and share of the heat make α."""
    cases: int
    unique: int
    points: int
    """``cases``, ``unique``, ``points``: cases of the archive, those that are computed, and how many of these follow
    each other in a line of a sweep."""
    references: int
    exact: int
    """``references``, ``exact``: reference solutions, and exact solutions of reduced models beside them, which split
    the errors."""
    batches: int
    tasks: int
    """``batches``, ``tasks``: runs of cases that share operators, and dask tasks."""
    steps: int
    """Steps of all cases together (0 for a scheme without steps)."""
    time: str
    """The order of time that it takes on all processors here: seconds, minutes, hours or days."""
    bytes: int
    """Size of the results before compression."""
    memory: int
    """Bytes of the cases that are held at once, on all processors here."""
    stored: tuple[str, ...]
    """Names of the histories that are stored, without metrics; none for metrics alone."""
    structures: tuple[Figures, ...]
    """Figures of the first distinct structures."""
    more_structures: int
    """Number of the others."""
    choices: tuple[str, ...]
    """Counts of modes that a tolerance decides, for which structures, and the error found."""
    operators: tuple[str, ...]
    """What the schemes step the distinct structures by, where there is a choice, and how many more there are; before it
    the ends of the speeds on which structures depend, and how deep loads cut a coating."""
    warnings: tuple[str, ...]
    """What to beware of, one sentence each."""


def plan_study(study: StudySource) -> Plan:
    """Return the plan of a study; runs nothing but the trials by which tolerances decide counts of modes.

    ``study`` is all that :func:`workflow.read_study` takes.
    """
    return plan(arrange(read_study(study)))


def plan(grid: Grid) -> Plan:
    """Return the plan of a study."""
    with one_thread():  # matrices are small
        return _plan(grid)


def _plan(grid: Grid) -> Plan:
    model, unique, steps = grid.study.scene.model, 0, 0
    kinds = np.unique(grid.alike(grid.computed, lambda path: path in ("scheme", "h")), return_counts=True)
    for outer, count in zip(*kinds, strict=True):
        settings = grid.settings(int(outer))
        distinct = int(count) * grid.inner_distinct_count(grid.is_read(settings.scheme))
        unique += distinct
        steps += distinct * grid.sampling.steps(settings.h) if "h" in schemes.load(settings.scheme.method).READS else 0
    structures = grid.kinds(lambda path: path.startswith(f"scene.{model}."))
    shown = [grid.settings(outer) for outer in structures[:_STRUCTURES_SHOWN]]
    threads = len(os.sched_getaffinity(0))
    batches = [len(task.batches) for task in solve.tasks(grid, threads=threads)]
    cases = grid.outer_count * grid.inner_count
    references, exact = solution_counts(grid)
    alpha = tuple(np.unique(made_by_friction(grid)[1]).tolist()) if grid.study.scene.makes_alpha else ()
    return Plan(
        study=grid.study.name,
        title=grid.study.title,
        dims=grid.dims,
        followed=tuple(
            (name, n) for name, n in solve.lengths(grid).items() if name in ("point", "curve", "curve_point")
        ),
        scene=resolved_values(grid.study, grid.settings(0), alpha),
        makes_alpha=grid.study.scene.makes_alpha,
        cases=cases,
        unique=unique,
        points=grid.points,
        references=references,
        exact=exact,
        batches=sum(batches),
        tasks=len(batches),
        steps=steps,
        time=order_of_time(
            solve.costs(grid).preparing + (solve.model_seconds(grid) + _reference_seconds(grid)) / threads
        ),
        bytes=cases * solve.stored_bytes(grid),
        memory=solve.memory_needed(grid, threads),
        stored=tuple(grid.study.output.sampled),
        structures=tuple(figures(settings, *ends_of_friction(grid, settings)) for settings in shown),
        more_structures=len(structures) - len(shown),
        choices=choice_lines(grid),
        operators=(
            *speed_lines(grid),
            *coating_lines(grid),
            *distinct_lines(_operators(grid), _STRUCTURES_SHOWN),
            *_factors(shown),
        ),
        warnings=(*coarse_tip(grid), *warnings(grid)),
    )


def order_of_time(seconds: float) -> str:
    """Return the unit in which so many seconds are counted."""
    return next(name for name, most in _ORDERS.items() if seconds < most)


def _reference_seconds(grid: Grid) -> float:
    """Return model seconds of reference solutions, and of exact solutions beside them, of many by a regular choice."""
    every = list(distinct_solutions(grid))
    some = every[:: 1 + len(every) // MOST_OUTER]
    seconds = sum(count * solve.solution_seconds(grid, settings, is_exact) for settings, is_exact, count in some)
    return seconds * len(every) / max(len(some), 1)


def _operators(grid: Grid) -> Iterator[str]:
    """Yield what structures and those of references are stepped by, where a scheme has a choice."""
    names, model = ("scheme", "reduction", "mechanical_modes", "thermal_modes"), grid.study.scene.model
    for outer in looked_at(grid.kinds(lambda path: path in names or path.startswith(f"scene.{model}."))):
        own, truth = grid.settings(outer), grid.study.reference is not None
        for settings in (own, reference_settings(grid, outer)) if truth else (own,):
            scheme = schemes.load(settings.scheme.method)
            structure, parts = reduced_structure(settings), []
            if scheme.operator_name is not None:
                parts.append(scheme.operator_name(structure))
            if scheme.contact_stiffness_of is not None and not scheme.refusal(structure, settings.scheme.options):
                stiffness = scheme.contact_stiffness_of(structure, settings.scheme.options)
                parts.append(f"contact stiffness {stiffness:.4g} N/m")
            if any(parts):
                yield f"{settings.scheme.method}: {', '.join(filter(None, parts))}"


def _factors(every: list[CaseSettings]) -> Iterator[str]:
    """Yield what factorising the first distinct structures takes."""
    for settings in every:
        structure = full_structure(settings)
        if structure.is_sparse:
            for pair, kind in ((structure.mechanical, "displacements"), (structure.thermal, "temperatures")):
                if pair.size > MOST_BY_SUPERLU:
                    by = "CHOLMOD" if has_cholmod() else "SuperLU"
                    fill = expected_fill(pair.stiffness, has_cholmod())
                    yield f"{pair.size} {kind}: {fill} each factorisation by {by}"
