"""Counts of modes that tolerances decide, in words: what a plan says of them."""

from __future__ import annotations

from collections.abc import Iterator

from workflow.grid._arrangement import TOLERANCE, Grid
from workflow.grid._choice import OF_REFERENCE, ChosenModes
from workflow.grid._corners import corner_text
from workflow.grid._figures import distinct_lines, size_text
from workflow.grid._reference_solutions import reference_settings
from workflow.study import CaseSettings

_SHOWN = 8

_MISSED = "more of the modes that `auto` may choose change less than the tolerance"

_UNTRIED = (
    "a case there that ends ok and misses the tolerance says so by its own errors",
    "whether a case there that ends ok meets the tolerance only a `reference` would tell",
)
"""What corners that were left out mean for cases with a reference, and without."""


def choice_lines(grid: Grid) -> tuple[str, ...]:
    """Return a line for each count that a tolerance decides, of many the first and how many more there are."""
    return distinct_lines(
        (f"{name}: {_counts(choice)}, {_error_text(choice)}" for name, _, choice in _all(grid)), _SHOWN
    )


def choice_cautions(grid: Grid) -> Iterator[str]:
    """Yield counts of modes that miss their tolerance, that no trial confirms, or that only some corners decided."""
    for name, tolerance, choice in _all(grid):
        if choice.untried:
            yield f"{name}: {_counts(choice)} are decided {choice.untried}; {_UNTRIED[grid.study.reference is None]}"
        if not choice.is_confirmed:
            yield f"{name}: {_counts(choice)}, {choice.against}"
        elif choice.error > tolerance:
            yield f"{name}: {_counts(choice)} miss it with {choice.error:.2g}; {_MISSED}"


def _all(grid: Grid) -> Iterator[tuple[str, float, ChosenModes]]:
    """Yield what each choice is for, its tolerance, and the choice."""
    for name, choice in grid.choices.items():
        outer, reference = int(name.removeprefix(OF_REFERENCE)), grid.study.reference
        if reference is None or not name.startswith(OF_REFERENCE):
            tolerance = float(grid.value(outer, TOLERANCE))
            yield _for(grid.settings(outer), tolerance), tolerance, choice
        else:
            tolerance = float(reference.values[TOLERANCE])
            yield f"reference, {_for(reference_settings(grid, outer), tolerance)}", tolerance, choice


def _for(settings: CaseSettings, tolerance: float) -> str:
    """Return for which tolerance, basis and structure a choice is."""
    return f"tolerance {tolerance:g}, {settings.reduction}, {size_text(settings)}"


def _counts(choice: ChosenModes) -> str:
    return f"{choice.mechanical_modes} + {choice.thermal_modes} modes"


def _error_text(choice: ChosenModes) -> str:
    """Return the error of a choice, in which case, and against what."""
    if not choice.is_confirmed:
        return choice.against
    case = corner_text(choice.hardest)
    where = f"in the worst corner ({case})" if case else "in the only case"
    return f"error {choice.error:.2g} {where}, {choice.against}"
