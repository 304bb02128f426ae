"""The variables of a study's archive: which it has, their dimensions beyond the cases, and a case without results."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import schemes, variables
from workflow.cases import Grid
from workflow.models import set_text
from workflow.schemes import HISTORIES, Status
from workflow.study import Study
from workflow.variables import Condition, Variable

Values = dict[str, NDArray[Any]]

MOST_CURVES = 8
"""Size of the dimension ``curve``, that of :mod:`workflow.orbits`."""

NOT_ASKED = 6
"""Of ``steady_state``."""


def steady_of(study: Study) -> Iterator[Variable]:
    """Yield the variables of steady rubs of a study's archive, along its branch where it has one."""
    sensors: tuple[Condition, ...] = ("steady sensors",) if study.output.sensors else ()
    if study.branch is not None:
        axis, boundary = study.branch.axis, study.boundary
        beside: list[Condition] = [*(("uncertain",) if study.uncertain else ()), *(("boundary",) if boundary else ())]
        yield from variables.along_branch(axis.name, axis.unit, axis.description, *sensors, beside=beside)
        for along in () if boundary is None else (axis, boundary.axis):
            about: Any = {"shape": "curve curve_point", "signed": True, "may_be_undefined": True}
            yield Variable(f"boundary_{along.name}", along.unit, f"{along.description}, along a boundary", **about)
    elif study.output.steady is not None:
        yield from variables.select(None, None, "steady", *sensors)


def _conditions_of(study: Study) -> Iterator[Condition]:
    """Yield what a study asks of its archive, but for steady rubs; of branches what their basis has."""
    output, reference, is_branch = study.output, study.reference, study.branch is not None
    asked: dict[Condition, object] = {
        "always": not is_branch,
        "branch": is_branch,
        "contacts": study.contacts and not is_branch,
        "auto": study.is_auto,
        "depth": output.temperature_depth,
        "balances": output.balances,
        "sections": output.sections,
        "sensors": output.sensors and not is_branch,
        "events": output.events,
        "coating": study.scene.casing.coating is not None,
        "wear": output.wear is not None,
        "reference": reference is not None,
        "auto reference": reference is not None and reference.is_auto,
    }
    return (condition for condition, there in asked.items() if there)


def metrics_of(study: Study) -> tuple[Variable, ...]:
    """Return metrics and texts of a study's archive but those of steady rubs; of branches those of the basis."""
    methods = sorted({scheme.method for scheme in study.schemes.values()}) if study.branch is None else ()
    own = {about.name: about for method in methods for about in schemes.metrics(method)}
    there = [*_conditions_of(study)]
    return (*variables.select("metric", None, *there), *variables.select("text", None, *there), *own.values())


def variables_of(grid: Grid) -> Iterator[Variable]:
    """Yield the variables of a study's archive: histories, all else, flags."""
    study, periods = grid.study, variables.select("period", None, *_conditions_of(grid.study))
    yield from (variables.BY_NAME[name] for name in study.output.sampled)
    others = [*metrics_of(study), *(periods if "period" in lengths(grid) else ()), *steady_of(study)]
    others += variables.select("event") if study.output.events else ()
    others += variables.select("sector", None, *_conditions_of(study))
    others += variables.select("revolution sector", None, *_conditions_of(study))
    others += (variables.BY_NAME[name] for name in ("status", *(() if study.branch else ("runaway",))))
    yield from sorted(others, key=lambda about: about.name in FLAGS)


def dims_of(about: Variable, lengths: Mapping[str, int]) -> tuple[str, ...]:
    """Return a variable's dimensions beyond the cases: sensors, or contacts if there are several, then its shape's."""
    contact = ("contact",) if about.is_of_contact and "contact" in lengths else ()
    tails = {"metric": "", "flag": "", "text": f"{about.name}_length", "history": "t"}
    return (*(("sensor",) if about.is_of_sensor else contact), *tails.get(about.shape, about.shape).split())


def lengths(grid: Grid) -> dict[str, int]:
    """Return the lengths of the dimensions beyond the cases, those that there are."""
    steady, branch, boundary = grid.study.output.steady, grid.study.branch, grid.study.boundary
    every = {
        "contact": len(grid.study.contacts),
        "sensor": len(grid.study.output.sensors),
        "event": grid.study.output.events or 0,
        "revolution": grid.revolutions.size,
        "sector": grid.most_sectors,
        "t": grid.sampling.count,
        "period": grid.longest_period_count if branch is None else 0,
        "point": 0 if branch is None else branch.points,
        "phase": 0 if steady is None else steady.samples,
        "uncertain": len(grid.study.uncertain),
        "curve": 0 if boundary is None else MOST_CURVES,
        "curve_point": 0 if boundary is None else boundary.points,
        **dict.fromkeys(("critical_set_length", "growth_set_length"), len(set_text(grid.study.contacts).encode())),
    }
    return {name: size for name, size in every.items() if size}


FLAGS = {"status": Status.NOT_RUN, "runaway": 0, "event_kind": -1, "steady_state": NOT_ASKED, "bifurcation": 0}
FLAGS |= {"boundary_kind": 0, "boundary_end": 0}
"""Variables whose numbers stand for words, and their number in a case without results."""


def unset(about: Variable) -> Any:
    """Return what a variable is in a case without results: NaN, of flags and indices a number that says so."""
    numbers = {**FLAGS, "event_contact": -1}
    if about.shape == "text":
        return np.bytes_()
    return np.int8(numbers[about.name]) if about.name in numbers else np.float64(np.nan)


def blank(grid: Grid, count: int) -> Values:
    """Return all variables of so many cases without results, each one value that is repeated, ``(case, …)``."""
    sizes, every = lengths(grid), {about.name: about for about in variables_of(grid)}
    if grid.study.branch is None:  # errors are of histories that need not be stored
        every |= {name: variables.BY_NAME[name] for name in HISTORIES}
    shapes = {name: (count, *(sizes.get(dim, 0) for dim in dims_of(about, sizes))) for name, about in every.items()}
    texts = {name: np.full(count, "") for name, about in every.items() if about.shape == "text"}
    return {name: np.broadcast_to(unset(about), shapes[name]) for name, about in every.items()} | texts
