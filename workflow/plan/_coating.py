"""What a plan says of a coating: how deep loads press the blade into it, and whether its sectors are narrow enough."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from workflow import schemes
from workflow.cases import Grid, cases_of, full_structure
from workflow.declare import measure
from workflow.judges.static_cuts import ANGLES, StaticCut, static_cut

_SECTORS = "scene.casing.coating.sectors"


def _cut(grid: Grid) -> StaticCut | None:
    """Return the static cut of the first case, ``None`` without a coating."""
    if not grid.most_sectors:
        return None
    settings = grid.settings(0)
    return static_cut(full_structure(settings), cases_of(settings, grid.inner_values(np.zeros(1, np.int64)), 1)[1])


def coating_lines(grid: Grid) -> tuple[str, ...]:
    """Return a line on how far the loads, applied statically, press the blade into the casing, and what that cuts."""
    cut = _cut(grid)
    if cut is None:
        return ()
    deepest = float(cut.inside.max())
    if deepest <= 0:
        return (f"coating      loads, applied statically, leave {measure(-deepest, 'm', 3)} to the casing",)
    edges = [ANGLES[(cut.inside > 0) & (np.roll(cut.inside, side) <= 0)] for side in (1, -1)]
    ends = np.roll(edges[1], -1) if edges[0].size and edges[1][0] < edges[0][0] else edges[1]
    where = ", ".join(f"{a:g}° to {b:g}°" for a, b in zip(edges[0], ends, strict=True)) or "all around"
    worn = f"there they cut up to {measure(cut.depth, 'm', 3)}" if cut.depth else "it does not yield"
    return (
        f"coating      loads, applied statically, press {measure(deepest, 'm', 3)} into the casing, {where}: {worn}",
    )


def coating_cautions(grid: Grid) -> Iterator[str]:
    """Yield that worn depths depend on sectors: to compare them, and that they are wide, or passed by a step."""
    most, counts = grid.most_sectors, {*grid.study.each(_SECTORS)} if grid.most_sectors else set()
    if most < 2:
        return
    if len(counts) == 1:
        remedy = f"compare e.g. `axes: {{{_SECTORS}: [{most // 2}, {most}]}}`"
        yield f"worn depths depend on `sectors`, and there is one number of them: {remedy}"
    cut, speeds = _cut(grid), [*map(float, grid.study.each("scene.speed"))]
    travel = 0.0 if cut is None else cut.speed / (min(speeds) * most)
    if cut is not None and travel > cut.depth > 0:
        yield (
            f"casing and load move a contact by up to {measure(travel, 'm', 2)} while it passes one of {most} sectors, "
            f"more than the static cut of {measure(cut.depth, 'm', 2)}: take more than {most * travel / cut.depth:.0f}"
        )
    every = (grid.settings(outer) for outer in grid.kinds(lambda path: path in ("scheme", "h")))
    h = max((one.h for one in every if "h" in schemes.load(one.scheme.method).READS), default=0.0)
    passed = h * max(speeds) * most
    if passed > 1:
        remedy = f"take h below {h / passed:.2g} s, or fewer sectors"
        yield f"a step of {h:g} s passes {passed:.3g} sectors, of which it wears the last: {remedy}"
