"""Commands that read a study: ``run``, ``plan``; its ``schema`` for editors, and an ``example`` to begin with."""

from __future__ import annotations

import json
import re
import shlex
import sys
from collections.abc import Iterator
from contextlib import redirect_stdout
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from workflow.cli._archives import decided_lines, failure_lines
from workflow.cli._failures import NOT_OK, WRONG
from workflow.cli._stop import saying
from workflow.cli._terminal import clean, following, print_error, say, write, write_json
from workflow.cli._words import AsJson, Settings, StudyFile, named, read

if TYPE_CHECKING:
    from workflow.plan import Figures, Plan
    from workflow.run import Follower, Outcome


def run(
    study: StudyFile,
    settings: Settings = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="ARCHIVE", help="Default: NAME.nc here, for `study: NAME`."),
    ] = None,
    threads: Annotated[int | None, typer.Option(min=1, help="Threads; default: one per processor.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Worker processes here, instead of threads.")] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Dask scheduler, instead of threads, e.g. tcp://HOST:8786.")
    ] = None,
    retry: Annotated[bool, typer.Option("--retry", help="Run the cases again that are not ok.")] = False,
    recompute: Annotated[
        bool, typer.Option("--recompute", help="Run all cases again, also of an archive of another solver version.")
    ] = False,
    drop: Annotated[
        bool, typer.Option("--drop", help="Leave out stored cases and histories that the study no longer asks for.")
    ] = False,
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Print errors only.")] = False,
) -> None:
    """Run a study. What an interrupted run or an earlier archive of it holds is kept, and the rest is run."""
    _refuse_several({"--threads": threads, "--workers": workers, "--scheduler": scheduler})
    _refuse_several({"--retry": retry, "--recompute": recompute})
    from workflow.run import ClusterError, Follower, run_study

    requested = read(study, settings)
    archive = Path(f"{requested.name}.nc") if output is None else named(output)
    follower = Follower()
    try:
        with (
            following(follower, archive.name, quiet),
            saying(lambda: _stopped(archive, follower)),
            redirect_stdout(sys.stderr),
        ):
            outcome = run_study(
                requested, archive, threads, follower,
                workers=workers, scheduler=scheduler, retry=retry, recompute=recompute, drop=drop,
            )  # fmt: skip
    except ClusterError as error:
        print_error(f"{error}{_stored(follower, archive)}")
        raise typer.Exit(WRONG) from None
    if not (quiet and outcome.ok):
        _tell(outcome)
    raise typer.Exit(0 if outcome.ok else NOT_OK)


def _refuse_several(options: dict[str, Any]) -> None:
    chosen = [name for name, value in options.items() if value]
    if len(chosen) > 1:
        raise typer.BadParameter(f"{' and '.join(chosen)} exclude each other; give one of them")


def _stopped(archive: Path, follower: Follower) -> str:
    return clean(f"stopped{_stored(follower, archive)}, the same command goes on from there")


def _stored(follower: Follower, archive: Path) -> str:
    """Return how many cases are stored, nothing where the run has not come to its cases."""
    done = follower.advance
    return f"; {done.stored} of {done.cases} cases are stored beside {archive}" if done else ""


def _tell(outcome: Outcome) -> None:
    cases = sum(outcome.counts.values())
    counts = ", ".join(f"{number} {name}" for name, number in outcome.counts.items())
    if not outcome.written:
        say(f"{outcome.archive}: nothing to do, all {cases} cases are there ({counts})")
    else:
        resumed = "all" if outcome.resumed == cases else outcome.resumed
        before = f", {resumed} of them stored before" if outcome.resumed else ""
        say(f"{outcome.archive}: {cases} cases in {outcome.seconds:.1f} s{before} ({counts})")
    for warning in outcome.warnings:
        say(f"  beware: {warning}")
    if outcome.without_error:
        say(f"  {outcome.without_error} of the ok cases lack an error against the reference")
    for line in () if outcome.ok else failure_lines(outcome.dataset):
        say(line)
    say(f"next: {shlex.join(('workflow', 'report', str(outcome.archive)))}")


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
    from workflow.cases import PLANNING, waiting_for
    from workflow.plan import plan_study
    from workflow.run import Follower, holdings

    requested = read(study, settings)
    with following(Follower(), requested.name, quiet=as_json), waiting_for(PLANNING):
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
        origin += "   = coefficient × sliding_speed × heat_share" if value.path == "alpha" and plan.makes_alpha else ""
        yield f"  {value.path:{width}}  {value.text}{origin}"
    yield "  dimensions   " + (" × ".join(f"{name} {size}" for name, size in dims) or "none, a single case")
    if plan.followed:
        yield f"  of a branch  {', '.join(f'{name} {size}' for name, size in plan.followed)}"
    yield f"  cases        {plan.cases}, of which {plan.unique} are computed"
    if plan.points > 1:
        lines = f"{plan.unique // plan.points} lines × {plan.points} points"
        yield f"  sweep        {lines}, each from the state at the end of the one before; a line is one unit of work"
    if plan.references:
        yield f"  references   {plan.references}, and {plan.exact} exact solutions of reduced models to split errors"
    yield f"  work         {plan.batches} batches in {plan.tasks} tasks, {plan.steps:.4g} steps"
    yield f"  time         {plan.time}"
    yield f"  stored       metrics{''.join(f', {name}' for name in plan.stored)}"
    yield f"  size         at most {_size(plan.bytes)} before compression"
    yield f"  memory       {_size(plan.memory)} for the cases that are held at once on all processors here"
    yield from map(_structure, plan.structures)
    if plan.more_structures:
        yield f"  … and {plan.more_structures} more structures"
    yield from (f"  auto         {choice}" for choice in plan.choices)
    yield from (f"  {operator}" for operator in plan.operators)
    yield from (f"  beware: {warning}" for warning in plan.warnings)


def _structure(figures: Figures) -> str:
    alpha = f"{figures.critical_alpha:.4g} W/N" if figures.critical_alpha < float("inf") else "none"
    first = f"{figures.first_frequency:.5g} Hz" if figures.first_frequency else "0, a free body"
    no_decay = figures.fastest == float("inf")  # no heat moves, and none leaves
    times = "no heat flows" if no_decay else f"thermal times {figures.fastest:.3g} to {figures.slowest:.3g} s"
    by = f" by {figures.stiffness_by}" if figures.stiffness_by else ""
    stiffness = f"tip stiffness {figures.tip_stiffness:.4g} N/m{by}"
    of = f" of {figures.critical_set}:" if figures.critical_set else ""
    ratio = ""
    if 0 < figures.critical_alpha < float("inf") and figures.alpha[1] > 0:
        low, high = (f"{end / figures.critical_alpha:.3g}" for end in figures.alpha)
        ratio = f"; alpha is {low if low == high else f'{low} to {high}'} times that"
    return f"  {figures.label}: f1 {first}, {stiffness}, {times}, critical alpha{of} {alpha}{ratio}"


def _size(size: int) -> str:
    return f"{size / 1e3:.3g} kB" if size < 1e6 else f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"


def schema(
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Default: the terminal.")
    ] = None,
) -> None:
    """Write the JSON Schema of a study, for editors."""
    from workflow.study import json_schema

    text = json.dumps(json_schema(), indent=2, ensure_ascii=False)
    if output is None:
        write(text)
    else:
        try:
            output.write_text(text + "\n", encoding="utf-8")
        except OSError as error:
            error.filename = str(output)  # the system leaves it out where a disk is full
            raise
        say(str(output))


def example(
    name: Annotated[
        str | None, typer.Argument(help="Name of an example; left out: list them all.", metavar="NAME")
    ] = None,
) -> None:
    """List the studies that ship with the program, or print one: `workflow example blade > blade.yaml`."""
    shipped = [file for file in (files("workflow") / "examples").iterdir() if file.name.endswith((".py", ".yaml"))]
    texts = {file.name.partition(".")[0]: file.read_text(encoding="utf-8") for file in shipped}
    if name is None:
        for key, text in sorted(texts.items()):
            title = re.search(r'^(?:title: |""")(.*)$', text, re.MULTILINE)
            say(f"{key:17}{title[1] if title else ''}")
    elif name in texts:
        write(texts[name].rstrip("\n"))
    else:
        raise typer.BadParameter(f"there is no example `{name}`; take one of {', '.join(sorted(texts))}")
