"""``workflow plan``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workflow.cli._terminal import console, say, write_json
from workflow.cli._words import AsJson, Settings, StudyFile, named, read
from workflow.cli.show import decided_lines

if TYPE_CHECKING:
    from workflow.grid import Figures, Plan


def plan(
    study: StudyFile,
    settings: Settings = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="ARCHIVE", help="Compare the study with this archive.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say what a study comes to: cases, batches, time, size, structures, warnings. Runs no case.

    Where counts of modes are `auto` they are decided here as in a run, by trials at the corners of the scene.

    With an archive: how many cases it holds, how many are missing, how many the study no longer asks for.
    """
    from workflow.archive import open_archive
    from workflow.grid import plan_study
    from workflow.run import holdings

    requested = read(study, settings)
    with console().status("planning"):
        plan = plan_study(requested)
    held = None if output is None else holdings(requested, named(output))
    if as_json:
        write_json({**vars(plan), "archive": held})
        return
    for line in _lines(plan):
        say(line)
    if output is not None and held is not None:
        say(f"  in {output}: {held.stored} stored, {held.missing} missing, {held.dropped} no longer asked for")
        if held.stored and requested.is_auto:
            with open_archive(named(output)) as dataset:
                for line in decided_lines(dataset):
                    say(line)
        if held.note:
            say(f"  beware: {held.note}")


def _lines(plan: Plan) -> Iterator[str]:
    dims = plan.dims
    yield f"{plan.study}: {plan.title}"
    width = max(len(value.path) for value in plan.scene)
    for value in plan.scene:
        origin = {"study": "", "axis": "   (varied)", "default": "   (default)"}[value.origin]
        yield f"  {value.path:{width}}  {value.text}{origin}"
    yield "  dimensions   " + (" × ".join(f"{name} {size}" for name, size in dims) or "none, a single case")
    yield f"  cases        {plan.cases}, of which {plan.unique} are computed"
    if plan.references:
        yield f"  references   {plan.references}, and {plan.exact} exact solutions of reduced models to split errors"
    yield f"  work         {plan.batches} batches in {plan.tasks} tasks, {plan.steps:.4g} steps"
    yield f"  time         {plan.time}"
    yield f"  stored       metrics{''.join(f', {name}' for name in plan.stored)}"
    yield f"  size         at most {_size(plan.bytes)} before compression"
    yield from map(_structure, plan.structures)
    if plan.more_structures:
        yield f"  … and {plan.more_structures} more structures"
    yield from (f"  auto         {choice}" for choice in plan.choices)
    yield from (f"  {operator}" for operator in plan.operators)
    yield from (f"  beware: {warning}" for warning in plan.warnings)


def _structure(figures: Figures) -> str:
    alpha = f"{figures.critical_alpha:.4g} W/N" if figures.critical_alpha < float("inf") else "none, no runaway"
    first = f"{figures.first_frequency:.5g} Hz" if figures.first_frequency else "0, a free body"
    no_decay = figures.fastest == float("inf")  # no heat moves, and none leaves
    times = "no heat flows" if no_decay else f"thermal times {figures.fastest:.3g} to {figures.slowest:.3g} s"
    by = f" by {figures.stiffness_by}" if figures.stiffness_by else ""
    stiffness = f"tip stiffness {figures.tip_stiffness:.4g} N/m{by}"
    return f"  {figures.label}: f1 {first}, {stiffness}, {times}, critical alpha {alpha}"


def _size(size: int) -> str:
    return f"{size / 1e3:.3g} kB" if size < 1e6 else f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"
