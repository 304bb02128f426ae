"""What a study comes to before anything runs: numbers of cases, time, size, and what to beware of."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workflow import schemes
from workflow.grid._arrangement import Grid
from workflow.grid._solve import reduced_structure, structure_of
from workflow.grid._tasks import Units, bytes_per_case, seconds_per_case, tasks
from workflow.models import critical_alpha, mechanical_modes, thermal_modes, tip_flexibility
from workflow.study import Cell

_GROWS = 1e-12
"""Growth of a free step that is told: below, a million steps grow by less than a millionth."""

_COARSE = 20
"""Steps per load period below which a plan says so: implicit Euler then errs by about a sixth."""

_STRUCTURES_SHOWN = 8


@dataclass(frozen=True)
class Figures:
    """What a structure comes to.

    Attributes
    ----------
    label
        Which structure.
    first_frequency
        f1, Hz; 0 for a free body.
    tip_stiffness
        1/S, N/m; 0 for a free body.
    slowest, fastest
        Longest and shortest thermal time 1/μ, s; ``inf`` for an adiabatic mode.
    critical_alpha
        α_c, m/s.
    """

    label: str
    first_frequency: float
    tip_stiffness: float
    slowest: float
    fastest: float
    critical_alpha: float


@dataclass(frozen=True)
class Plan:
    """What a study comes to; nothing has run.

    Attributes
    ----------
    cases, unique
        Cells of the archive, and cases that are computed.
    batches, tasks
        Runs of cases that share operators, and dask tasks.
    steps
        Steps of all cases together (0 for a scheme without steps).
    seconds
        Estimated work of one core.
    bytes
        Size of the results before compression.
    structures
        Figures of the first distinct structures.
    warnings
        What to beware of, one sentence each.
    """

    cases: int
    unique: int
    batches: int
    tasks: int
    steps: int
    seconds: float
    bytes: int
    structures: tuple[Figures, ...]
    warnings: tuple[str, ...]


def figures(label: str, cell: Cell) -> Figures:
    """Return what the full structure of a cell comes to."""
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    rates = thermal_modes(structure).values
    with np.errstate(divide="ignore"):
        times = 1.0 / rates
    flexibility = tip_flexibility(structure)
    return Figures(
        label=label,
        first_frequency=float(mechanical_modes(structure).values[0] / (2 * np.pi)),
        tip_stiffness=0.0 if np.isinf(flexibility) else 1.0 / flexibility,
        slowest=float(times.max()),
        fastest=float(times.min()),
        critical_alpha=critical_alpha(structure),
    )


def plan(grid: Grid, units: Units) -> Plan:
    """Return what a study comes to."""
    unique = batches = steps = number = 0
    seconds = 0.0
    structures: dict[object, Figures] = {}
    warnings: dict[str, None] = {}
    for outer in grid.places:
        cell = grid.settings(outer)
        distinct = grid.distinct_inner(cell)
        unique += distinct
        seconds += distinct * seconds_per_case(grid, outer)
        scheme = schemes.load(cell.scheme.method)
        if "h" in scheme.READS:
            steps += distinct * grid.sampling.steps(cell.h)
        key = (cell.scene.model, cell.scene.parameters)
        if key not in structures and len(structures) < _STRUCTURES_SHOWN:
            label = f"{cell.scene.model}, {cell.scene.parameters.nodes} nodes"
            structures[key] = figures(label, cell)
        warnings.update(dict.fromkeys(_beware(grid, cell)))
    for task in tasks(grid, units):
        number += 1
        batches += len(task.segments)
    cases = grid.outer_count * grid.inner_count
    stored = 8 if grid.study.output.precision == "float64" else 4
    size = cases * (
        bytes_per_case(grid)
        - 8 * 5 * grid.sampling.count
        + stored * len(grid.study.output.histories) * grid.sampling.count
    )
    return Plan(cases, unique, batches, number, steps, seconds, size, tuple(structures.values()), tuple(warnings))


def _beware(grid: Grid, cell: Cell) -> list[str]:
    """Return what there is to say of one scheme at one step on one structure."""
    found: list[str] = []
    scheme = schemes.load(cell.scheme.method)
    if "h" not in scheme.READS:
        return found
    structure = reduced_structure(cell)
    modes, rates = mechanical_modes(structure), thermal_modes(structure).values
    omega = modes.values
    damping = structure.damping.mass + structure.damping.stiffness * omega**2
    free = scheme.amplification(omega, damping, cell.h, cell.scheme.options)
    heat = scheme.thermal_amplification(rates, cell.h, cell.scheme.options)
    growth = float(max(np.abs(free).max(initial=0.0), np.abs(heat).max(initial=0.0)))
    where = f"{cell.scheme.label} at h = {cell.h:g} s"
    if growth > 1 + _GROWS:
        found.append(f"{where} diverges: its free step grows {growth:.6g}-fold")
        return found
    if omega[0] > 0:
        factor = complex(free[0, 0])
        turn = abs(np.angle(factor))
        physical = float(damping[0] / (2 * omega[0]))
        total = float(-np.log(abs(factor)) / turn) if abs(factor) > 0 and turn > 0 else float("inf")
        if total - physical > physical + _GROWS:
            found.append(
                f"{where} damps the first mode ({omega[0] / (2 * np.pi):.4g} Hz) numerically by "
                f"{total - physical:.2g} of critical, more than the structure's own {physical:.2g}"
            )
    fastest_load = max(
        [cell.scene.load.frequency]
        + [
            float(value)
            for dimension in (*grid.outer, *grid.inner)
            for axis in dimension.axes
            if axis.path == "scene.load.frequency"
            for value in axis.values
        ]
    )
    if fastest_load * cell.h * _COARSE > 1:
        found.append(f"{where} takes only {1 / (fastest_load * cell.h):.3g} steps per load period")
    return found
