"""Whether the mesh of a blade is fine enough: its cell at the tip, and how far heat enters in a contact."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from workflow.grid._arrangement import Grid, decides_structure
from workflow.grid._frequencies import fastest
from workflow.grid._operators import full_structure, reduced_structure
from workflow.grid._scene_cautions import MOST_OUTER
from workflow.models import Chain, frequencies

CONTACT = 0.1
"""Time of a contact, over the load's period, before a run has told it."""


def tip_cells(grid: Grid) -> dict[str, Any]:
    """Return what an archive says of the tip temperature of blades: depths [m] and diffusivity [m²/s].

    It is the mean over half the cell at the tip; few thermal modes amount to a larger cell, of the capacity
    1/(e_nᵀ C2⁻¹ e_n) that heat at the tip warms at once.
    """
    rows = []
    for outer in grid.kinds(decides_structure)[:MOST_OUTER] if grid.study.scene.model == "blade" else ():
        full, structure = (of(grid.settings(outer)) for of in (full_structure, reduced_structure))
        assert isinstance(full, Chain)
        half, capacity = full.lengths[-1] / 2, full.heat_capacities[-1]
        warmed = np.linalg.solve(structure.heat_capacity, structure.thermal.unit_tip)[-1]
        rows.append((half / (capacity * warmed), half, 2 * full.conduction[-1] * half**2 / capacity))
    if not rows:
        return {}
    depth, mesh, diffusivity = zip(*rows, strict=True)
    return {"depth": [min(depth), max(depth)], "depth_of_mesh": max(mesh), "thermal_diffusivity": min(diffusivity)}


def coarse_tip(grid: Grid) -> Iterator[str]:
    """Yield that the cell at the tip is thicker than heat enters in a contact of a tenth of the load's period."""
    about, frequency, scene = tip_cells(grid), fastest(grid), grid.study.scene
    heated = scene.friction or any(any(axis.values) for axis in grid.study.axes() if axis.path == "alpha")
    if about and frequency > 0 and heated:
        yield from too_thick(about, CONTACT / frequency, "a tenth of the load's period")


def too_thick(about: Mapping[str, Any], seconds: float, words: str) -> Iterator[str]:
    """Yield that heat does not enter the whole cell at the tip in some time, by what :func:`tip_cells` returns."""
    cell, mesh = 2e3 * float(np.max(about["depth"])), 2e3 * float(about["depth_of_mesh"])
    entered = 1e3 * math.sqrt(float(about["thermal_diffusivity"]) * seconds)
    if mesh > entered > 0:
        remedy = f"max_temperature is too low; `tip_cell: {entered / 4:.1g} mm` would do"
        yield f"the cell at the tip is {mesh:.3g} mm thick, and heat enters {entered:.2g} mm in {words}: {remedy}"
    elif cell > entered > 0:
        kept = f"the thermal modes kept amount to a cell of {cell:.3g} mm at the tip"
        yield f"{kept}, and heat enters {entered:.2g} mm in {words}: max_temperature depends on their number; keep more"


def fast_samples(grid: Grid) -> Iterator[str]:
    """Yield that contact forces are means over less than a wave takes through two cells of a chain, 4/ω_max."""
    every = (full_structure(grid.settings(outer)) for outer in grid.kinds(decides_structure)[:MOST_OUTER])
    two = max((4 / frequencies(one)[-1] for one in every if isinstance(one, Chain) and one.springs.all()), default=0.0)
    if "contact_force" in grid.study.output.histories and grid.sampling.interval < two:
        mean = f"contact_force is a mean over {grid.sampling.interval:g} s"
        yield f"{mean}, less than a wave takes through two cells ({two:.2g} s): it shows the cells"
