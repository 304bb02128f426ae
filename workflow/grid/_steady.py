"""Steady rubs that cases lead to, and branches of them, by event_driven on the structures that cases are run on."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import variables
from workflow.grid._arrangement import Grid, Indices
from workflow.grid._operators import as_run, full_structure
from workflow.grid._perturbation import Perturbation, cases_of
from workflow.judges.trials import EXACT
from workflow.models import Cases, Structure, instantaneous_growth
from workflow.study import CaseSettings, Study
from workflow.variables import Variable

Values = dict[str, NDArray[Any]]

NOT_ASKED = 6
"""Of ``steady_state``."""


def steady_of(study: Study) -> Iterator[Variable]:
    """Yield the variables of steady rubs of a study's archive, along its branch where it has one."""
    if study.branch is not None:
        axis = study.branch.axis
        yield from variables.along_branch(axis.name, axis.unit, axis.description)
    elif study.output.steady is not None:
        yield from variables.select(None, None, "steady")


def blank(study: Study, count: int) -> Values:
    """Return the variables of steady rubs of so many cases that have none."""
    steady, branch, values = study.output.steady, study.branch, Values()
    points = () if branch is None else (branch.points,)
    for about in steady_of(study):
        assert steady is not None
        shape = (count, *points, *((steady.samples,) if "phase" in about.shape else ()))
        values[about.name] = np.full(shape, np.nan)
    flags = {"steady_state": NOT_ASKED, "bifurcation": 0}
    return values | {
        name: np.full(values[name].shape, flag, dtype=np.int8) for name, flag in flags.items() if name in values
    }


def steady_values(grid: Grid, settings: CaseSettings, cases: Cases) -> tuple[Values, dict[int, str]]:
    """Return the steady rubs of cases given on the nodes, and what is said of some; nothing where none is asked for."""
    asked = grid.study.output.steady
    if asked is None or settings.scheme.method != EXACT:
        return blank(grid.study, cases.count), {}
    from workflow.orbits import Options, steady_rubs

    structure, projected = as_run(settings, cases)
    options = Options(asked.periods, asked.samples)
    values, messages = steady_rubs(structure, projected, options)
    return _with_instantaneous_growth(settings, values), {k: text for k, text in enumerate(messages) if text}


def branch_values(grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None) -> tuple[Values, str]:
    """Return the branch of one case, ``(1, point, …)``, and why it has no point, where it has none."""
    from workflow.orbits import Options, branch

    followed, asked, first = grid.study.branch, grid.study.output.steady, grid.settings(outer)
    assert followed is not None
    assert asked is not None

    def problem(value: float) -> tuple[Structure, Cases]:
        """Return structure and case at a value of the axis."""
        settings = grid.settings(outer, {followed.axis.path: value})
        return as_run(*cases_of(settings, grid.inner_values(inner), inner.size, perturbation))

    start, stop = map(float, followed.axis.values)
    options = Options(asked.periods, asked.samples)
    values, message = branch(problem, start, stop, followed.points, options)
    values = _with_instantaneous_growth(first, values)
    values[followed.axis.name] = values.pop("value")
    return {name: array[None] for name, array in values.items()}, message


def _with_instantaneous_growth(settings: CaseSettings, values: Values) -> Values:
    """Return steady rubs with the tip growth by heat loads that temperatures without heat capacity follow at once."""
    structure = full_structure(settings)
    return values | {"steady_closing": values["steady_closing"] + instantaneous_growth(structure)}
