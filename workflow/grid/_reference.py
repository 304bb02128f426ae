"""Errors of a batch against the study's reference, whole and split into those of scheme and reduced model."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from workflow.grid._arrangement import Grid, Indices
from workflow.grid._operators import run_batch
from workflow.grid._perturbation import Perturbation, cases_of
from workflow.grid._reference_solutions import (
    BASIS,
    Kind,
    ReferenceSolutions,
    Solutions,
    compared_values,
    exact_settings,
    is_compared,
    needed_kinds,
    reference_settings,
    solutions_for,
)
from workflow.grid._tasks import Batch
from workflow.judges.distances import norms, relative
from workflow.judges.trials import EXACT
from workflow.models import Array
from workflow.schemes import Status
from workflow.study import CaseSettings
from workflow.variables import COMPARED

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
        Histories ``(case, t)`` and ``status`` of the batch.
    solutions
        Those that the batch is compared with.
    """
    if grid.study.reference is None:
        return {}, {}
    compared = [_in_order(grid, kind, inner, solutions) for kind in needed_kinds(grid, outer)]
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


def _in_order(grid: Grid, kind: Kind, inner: Indices, solutions: Solutions) -> ReferenceSolutions:
    """Return the solutions of a kind for the conditions of some cases."""
    return solutions[kind].of(grid.inner_alike(inner, is_compared(grid, kind[0])))


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


def tells_basis_error(grid: Grid, outer: int) -> bool:
    """Tell whether the model's part of an error is that of the case's basis: the reference is exact and as rich."""
    if grid.study.reference is None:
        return False
    ours, theirs = reference_settings(grid, outer), exact_settings(grid, outer)
    is_as_rich = ours.mechanical_modes >= theirs.mechanical_modes and ours.thermal_modes >= theirs.thermal_modes
    return ours.scheme.method == EXACT and is_as_rich


def exact_motion(grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None = None) -> dict[str, Array]:
    """Return histories of the exact solutions of the reduced models of some cases, with their data changed if asked.

    Shape ``(case, t)`` by name, NaN in those that do not end ok.
    """
    settings = exact_settings(grid, outer)
    if perturbation is None:
        kind = needed_kinds(grid, outer)[-1]  # the reference itself where that is exact
        solutions = _in_order(grid, kind, inner, solutions_for(grid, Batch(outer, inner)))
        return dict(solutions.histories)
    settings, cases = cases_of(settings, compared_values(grid, inner), inner.size, perturbation)
    results = run_batch(settings, cases, replace(grid.sampling, balances=False))
    ended = (results.status == Status.OK)[:, None]
    return {name: np.where(ended, results.histories[name], np.nan) for name in COMPARED}


def distinct_solutions(grid: Grid) -> Iterator[tuple[CaseSettings, bool, int]]:
    """Yield the settings of the references of a study, and of the exact solutions beside them, with their numbers."""
    if grid.study.reference is None:
        return
    replaced = grid.study.reference.values
    outer = np.unique(grid.alike(grid.computed, lambda path: path in BASIS or path not in replaced))
    every = dict.fromkeys(kind for k in outer for kind in needed_kinds(grid, int(k)))
    references = {settings for settings, is_exact in every if not is_exact}
    for settings, is_exact in every:
        if not (is_exact and settings in references):
            yield settings, is_exact, grid.inner_distinct_count(is_compared(grid, settings))


def solution_counts(grid: Grid) -> tuple[int, int]:
    """Return how many references a study has, and how many exact solutions beside them split their errors."""
    counts = [0, 0]
    for _, is_exact, count in distinct_solutions(grid):
        counts[is_exact] += count
    return counts[0], counts[1]
