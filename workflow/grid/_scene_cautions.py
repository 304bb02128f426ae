"""What to beware of in a scene, whatever the scheme: a tip that stays clear, springs and bases."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid, Indices
from workflow.grid._conditions import at_rest, conditions
from workflow.grid._operators import on_basis, projection_residual_of, reduced_structure, structure_of
from workflow.models import (
    Array,
    Cases,
    Chain,
    NoEquilibriumError,
    Sparse,
    Structure,
    critical_friction,
    free_reach,
    rounding_of_flexibility,
    static_tip_growth,
    tip_flexibility,
)
from workflow.reduction import DEFAULT
from workflow.study import Cell

LOST = 1e-3
"""Share of initial states and constant loads that a basis may lose without a word, see ``projection_residual``."""

ROUNDED = 1e-6
"""Share of the tip's stiffness that roundings of a file's entries may change without a word."""

_CANCELLED = 1e-9
"""Share of the largest term below which a sum of terms of both signs is rounding."""

MOST_CASES, MOST_STRUCTURES, MOST_BASES = 500, 8, 64
"""Cases of an outer index, structures and bases that are looked at; of more cases a regular choice."""


def scene_cautions(grid: Grid) -> tuple[str, ...]:
    """Return what to beware of, one sentence each, none twice."""
    cautions = (*_springs(grid), *_scenes(grid), *_bases(grid))
    return tuple(dict.fromkeys(cautions))


def _chosen(grid: Grid) -> Indices:
    """Return inner indices to look at: all, or a regular choice that has the first and the last."""
    count = grid.inner_count
    return np.unique(np.linspace(0, count - 1, min(count, MOST_CASES)).round().astype(np.int64))


def _scenes(grid: Grid) -> Iterator[str]:
    """Yield what is to be said of the first structures with the conditions of their cases."""
    model = grid.study.scene.model
    structures = np.unique(grid.alike(grid.places.computed, lambda path: path.startswith(f"scene.{model}.")))
    for outer in structures[:MOST_STRUCTURES].tolist():
        cell = grid.settings(outer)
        structure = structure_of(cell.scene.model, cell.scene.parameters)
        if isinstance(structure, Chain) and not structure.has_matrices:
            continue  # its modes are not at hand
        inner = _chosen(grid)
        cases = conditions(cell, structure, grid.inner_values(inner), inner.size)
        if structure.coordinates is not None:
            yield from _from_files(structure, cases)
        if isinstance(structure, Sparse):
            structure, cases = on_basis(cell, cases)
        if cell.scene.initial == "static":
            try:
                cases = at_rest(structure, cases)
            except NoEquilibriumError:
                continue  # its cases fail and say so
        with np.errstate(all="ignore"):
            reach = free_reach(structure, cases, grid.sampling.duration)
        yield from _clear(cases, reach)
        yield from _jams(structure, cases)


def _from_files(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield what matrices of a file may hold otherwise than meant: which way heat moves the tip, and its stiffness."""
    shares = static_tip_growth(structure) * structure.thermal.constraint
    closing = float(shares.sum())
    if cases.alpha.max() > 0 and closing < -_CANCELLED * np.abs(shares).max():
        yield (
            f"friction heat moves the tip away from the casing, {-closing:.3g} m for each kelvin at the tip, and no "
            "alpha is critical; where heat should close the gap, check the sign of `coupling` (equation 1a has K12 θ "
            "on the left) and the direction of `contact`"
        )
    if np.isfinite(tip_flexibility(structure)):
        lost = rounding_of_flexibility(structure)
        if lost > ROUNDED:
            yield (
                f"`stiffness` holds the tip's static stiffness to about {lost:.1g}: entries that are far larger are "
                "rounded in the file; join what near-rigid links hold together, or make them softer"
            )


def _clear(cases: Cases, reach: Array) -> Iterator[str]:
    """Yield the gaps at which no case's tip reaches the casing; a bound that is not a number is none."""
    reaches = ~(reach < cases.gap - cases.casing_harmonics.reach)
    clear = [gap for gap in np.unique(cases.gap) if not np.any(reaches[cases.gap == gap])]
    if clear:
        most = float(reach[np.isin(cases.gap, clear)].max())
        yield (
            f"the tip cannot reach the casing at gap = {_listed(f'{gap:g} m' for gap in clear)}: without contact it "
            f"stays below {most:.3g} m (static and harmonic answer, and a bound of what the start adds)"
        )


def _jams(structure: Structure, cases: Cases) -> Iterator[str]:
    """Yield friction coefficients at which the tip does not yield to the contact force."""
    if structure.tangent is None:
        return
    critical, most = critical_friction(structure), float(cases.friction.max(initial=0.0))
    if most >= critical.impact:
        yield (
            f"from a friction coefficient of {critical.impact:.4g} on contact has no unique solution "
            f"(n·M⁻¹(n - µt) <= 0: an impulse pushes the tip into the casing); the largest here is {most:g}"
        )
    if most >= critical.standstill:
        yield (
            f"from a friction coefficient of {critical.standstill:.4g} on a tip in lasting contact has no stable place "
            f"(n·K⁻¹(n - µt) <= 0): its contact force grows without bound; the largest here is {most:g}"
        )


def _springs(grid: Grid) -> Iterator[str]:
    """Yield contact springs that give way more than the structure they stand against."""
    model = grid.study.scene.model
    computed = grid.places.computed
    kinds = np.unique(
        grid.alike(computed, lambda path: path.startswith((f"scene.{model}.", "schemes.")) or path == "scheme")
    )
    for outer in kinds[:MOST_BASES].tolist():
        cell = grid.settings(outer)
        scheme = schemes.load(cell.scheme.method)
        if scheme.contact_stiffness_of is None:
            continue
        structure = structure_of(cell.scene.model, cell.scene.parameters)
        flexibility = tip_flexibility(structure)
        if not 0 < flexibility < np.inf:
            continue
        stiffness = scheme.contact_stiffness_of(reduced_structure(cell), cell.scheme.options)
        if stiffness * flexibility < 1:
            yield (
                f"the contact spring of {cell.scheme.label}, {stiffness:.3g} N/m, is softer than the tip, "
                f"{1 / flexibility:.3g} N/m: it gives way more than the structure it stands against"
            )


def _bases(grid: Grid) -> Iterator[str]:
    """Yield bases that cannot hold the initial states or constant loads of their cases."""
    model, names = grid.study.scene.model, ("reduction", "mechanical_modes", "thermal_modes")
    kinds = np.unique(
        grid.alike(grid.places.computed, lambda path: path in names or path.startswith(f"scene.{model}."))
    )
    worst: dict[str, float] = {}
    for outer in kinds[:MOST_BASES].tolist():
        cell = grid.settings(outer)
        lost = _lost(grid, cell)
        basis = f"{cell.mechanical_modes} + {cell.thermal_modes} modes"
        basis += "" if cell.reduction == DEFAULT else f" of {cell.reduction}"
        if lost > LOST:
            worst[basis] = max(worst.get(basis, 0.0), lost)
    for basis, lost in worst.items():
        yield (
            f"{basis} lose {lost:.2g} of initial states or constant loads (projection_residual): what they cannot hold "
            "is left out of the reduced model"
        )


def _lost(grid: Grid, cell: Cell) -> float:
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    inner = _chosen(grid)
    cases = conditions(cell, structure, grid.inner_values(inner), inner.size)
    return float(np.nanmax(projection_residual_of(cell, cases), initial=0.0))


def _listed(texts: Iterable[str]) -> str:
    """Join a few texts, or the ends of many."""
    few = list(texts)
    return ", ".join(few) if len(few) <= 6 else f"{few[0]} to {few[-1]}"
