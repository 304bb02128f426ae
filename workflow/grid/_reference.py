"""Errors of a batch against the study's reference, whole and split into those of scheme and reduced model."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices
from workflow.grid._conditions import conditions
from workflow.grid._operators import run_batch, structure_of
from workflow.grid._perturbation import Perturbation
from workflow.grid._truth import Truth, distinct_shape, only_what_is_read, truths
from workflow.judges.distances import norms, relative
from workflow.judges.trials import EXACT
from workflow.models import Array
from workflow.schemes import Status
from workflow.study import Cell, SchemeChoice
from workflow.variables import COMPARED

REFERENCE = "reference: "
"""What the message begins with of a case that is ok and has an error that cannot be formed."""

PARTS = "scheme and model error: "
"""What the message begins with of a case whose error cannot be split."""


_BASIS = frozenset({"mechanical_modes", "thermal_modes", "reduction"})
"""Settings of the reduced model, which an exact solution takes from the case."""


def against_reference(
    grid: Grid, outer: int, inner: Indices, results: Mapping[str, Array]
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
    """
    if grid.study.reference is None:
        return {}, {}
    ours, theirs = reference_cell(grid, outer), exact_cell(grid, outer)
    truth = truths(grid, ours, inner, perturbed=True)
    exact = truth if theirs == ours else truths(grid, theirs, inner, perturbed=False)
    errors: dict[str, Array] = {"predictability": truth.predictability}
    chosen = grid.reference_choice(outer)
    if chosen is not None:
        errors["reference_basis_error"] = np.full(inner.size, chosen.error)
    for name in COMPARED:
        size = norms(truth.histories[name])
        errors[f"{name}_error"] = relative(norms(results[name] - truth.histories[name]), size)
        errors[f"{name}_scheme_error"] = relative(norms(results[name] - exact.histories[name]), size)
        errors[f"{name}_model_error"] = relative(norms(exact.histories[name] - truth.histories[name]), size)
    return errors, _messages(truth, exact, errors, results["status"] == Status.OK)


def _messages(truth: Truth, exact: Truth, errors: Mapping[str, Array], ok: Array) -> dict[int, str]:
    """Say of each ok case which errors cannot be formed, and why."""
    remarks: dict[int, str] = {}
    for case in map(int, np.flatnonzero(ok)):
        zero = [name for name in COMPARED if np.isnan(errors[f"{name}_error"][case])]
        if case in truth.failures:
            remarks[case] = f"{REFERENCE}{truth.failures[case]}"
        elif zero:
            remarks[case] = f"{REFERENCE}its {' and '.join(zero)} is identically zero, that of the case is not"
        elif case in exact.failures:
            remarks[case] = f"{PARTS}{EXACT} on the reduced model of the case: {exact.failures[case]}"
    return remarks


def reference_cell(grid: Grid, outer: int) -> Cell:
    """Return the settings of a reference, those that its scheme does not read the same for all."""
    values = dict(grid.study.reference.values) if grid.study.reference is not None else {}
    chosen = grid.reference_choice(outer)
    counts = {} if chosen is None else chosen.counts
    return only_what_is_read(grid.settings(outer, {**values, **counts}))


def exact_cell(grid: Grid, outer: int) -> Cell:
    """Return the settings of the exact solution of a case's reduced model: the reference's, with the case's basis."""
    values = dict(grid.study.reference.values) if grid.study.reference is not None else {}
    cell = grid.settings(outer, {path: value for path, value in values.items() if path not in _BASIS})
    if cell.scheme.method != EXACT:
        cell = replace(cell, scheme=SchemeChoice(EXACT, EXACT, schemes.load(EXACT).Options()))
    return only_what_is_read(cell)


def tells_basis_error(grid: Grid, outer: int) -> bool:
    """Tell whether the model's part of an error is that of the case's basis: the reference is exact and as rich."""
    if grid.study.reference is None:
        return False
    ours, theirs = reference_cell(grid, outer), exact_cell(grid, outer)
    is_as_rich = ours.mechanical_modes >= theirs.mechanical_modes and ours.thermal_modes >= theirs.thermal_modes
    return ours.scheme.method == EXACT and is_as_rich


def exact_motion(grid: Grid, outer: int, inner: Indices, perturbation: Perturbation | None = None) -> dict[str, Array]:
    """Return histories of the exact solutions of the reduced models of some cases, with their data changed if asked.

    Shape ``(case, t)`` by name, NaN in those that do not end ok.
    """
    cell = exact_cell(grid, outer)
    if perturbation is None:
        return truths(grid, cell, inner, perturbed=False).histories
    replaced = grid.study.reference.values if grid.study.reference is not None else {}
    cell = perturbation.cell(cell)
    varying = {path: values for path, values in grid.inner_values(inner).items() if path not in replaced}
    cases = conditions(cell, structure_of(cell.scene.model, cell.scene.parameters), varying, inner.size)
    results = run_batch(cell, perturbation.cases(cases), replace(grid.sampling, balances=False))
    ended = (results.status == Status.OK)[:, None]
    return {name: np.where(ended, results.histories[name], np.nan) for name in COMPARED}


def solution_counts(grid: Grid) -> tuple[int, int]:
    """Return how many references a study has, and how many exact solutions beside them split their errors."""
    if grid.study.reference is None:
        return 0, 0
    replaced = grid.study.reference.values
    outer = np.unique(grid.alike(grid.places.computed, lambda path: path in _BASIS or path not in replaced))
    references = {reference_cell(grid, int(k)) for k in outer}
    exact = {exact_cell(grid, int(k)) for k in outer} - references
    return _distinct(grid, references), _distinct(grid, exact)


def _distinct(grid: Grid, cells: set[Cell]) -> int:
    return sum(int(np.prod(distinct_shape(grid, cell), dtype=np.int64)) for cell in cells)
