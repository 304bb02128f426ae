"""Counts of modes that tolerances decide, in words: what a plan says of them."""

from __future__ import annotations

from collections.abc import Iterator

from workflow import models
from workflow.grid._arrangement import TOLERANCE, Grid
from workflow.grid._choice import Choice

_SHOWN = 8


def choice_lines(grid: Grid) -> tuple[str, ...]:
    """Return a line for each count that a tolerance decides, of many the first and how many more there are."""
    lines = [f"{_for(grid, outer)}: {_counts(choice)}, {_found(choice)}" for outer, choice in grid.choices.items()]
    more = (f"and {len(lines) - _SHOWN} more",) if len(lines) > _SHOWN else ()
    return (*lines[:_SHOWN], *more)


def choice_cautions(grid: Grid) -> Iterator[str]:
    """Yield the counts with which a tolerance is missed, or with which nobody knows."""
    for outer, choice in grid.choices.items():
        tolerance = float(grid.value(outer, TOLERANCE))
        if not choice.is_confirmed:
            yield f"{_for(grid, outer)}: {_counts(choice)} as transfer functions ask for, {choice.against}"
        elif choice.error > tolerance:
            why = "more of the modes that `auto` may choose change less than the tolerance"
            yield f"{_for(grid, outer)}: {_counts(choice)} miss it with {choice.error:.2g}; {why}"


def _for(grid: Grid, outer: int) -> str:
    """Return for which tolerance, basis and structure a choice is."""
    cell, tolerance = grid.settings(outer), float(grid.value(outer, TOLERANCE))
    size = models.sizes(cell.scene.model, cell.scene.parameters)[0]
    return f"tolerance {tolerance:g}, {cell.reduction}, {size} nodes"


def _counts(choice: Choice) -> str:
    return f"{choice.mechanical_modes} + {choice.thermal_modes} modes"


def _found(choice: Choice) -> str:
    """Return the error of a choice, in which case, and against what."""
    if not choice.is_confirmed:
        return choice.against
    case = ", ".join(f"{path.removeprefix('scene.')} = {value:.6g}" for path, value in choice.hardest)
    where = f"in the worst corner ({case})" if case else "in the only case"
    return f"error {choice.error:.2g} {where}, {choice.against}"
