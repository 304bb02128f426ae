"""``workflow run``."""

from __future__ import annotations

import shlex
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from workflow.cli._failures import NOT_OK, WRONG
from workflow.cli._progress import following
from workflow.cli._stop import saying
from workflow.cli._terminal import clean, print_error, say
from workflow.cli._words import Settings, StudyFile, named, read

if TYPE_CHECKING:
    from workflow.run import Advance, Follower, Outcome


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
    quiet: Annotated[bool, typer.Option("-q", "--quiet", help="Say nothing but what went wrong.")] = False,
) -> None:
    """Run a study; what an interrupted run or an earlier archive of it holds is kept and the rest is run."""
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
        reached = "" if follower.advance is None else f"; {_reached(follower.advance)} {archive}"
        print_error(f"{error}{reached}")
        raise typer.Exit(WRONG) from None
    if not (quiet and outcome.ok):
        _tell(outcome)
    raise typer.Exit(0 if outcome.ok else NOT_OK)


def _refuse_several(options: dict[str, Any]) -> None:
    """Refuse more than one of some options."""
    chosen = [name for name, value in options.items() if value]
    if len(chosen) > 1:
        raise typer.BadParameter(f"{' and '.join(chosen)} exclude each other; give one of them")


def _stopped(archive: Path, follower: Follower) -> str:
    """Return what a run that is stopped says."""
    stored = "what was done is stored beside" if follower.advance is None else _reached(follower.advance)
    return clean(f"stopped; {stored} {archive}, the same command goes on from there")


def _reached(advance: Advance) -> str:
    return f"{advance.stored} of {advance.cases} cases are stored beside"


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
        say(f"  {outcome.without_error} of the ok cases have an error against the reference that cannot be formed")
    for labels, message in outcome.failures:
        say(f"  {labels}: {message}")
    bad = cases - outcome.counts.get("ok", 0) + outcome.without_error
    if bad > len(outcome.failures):
        say(f"  … and {bad - len(outcome.failures)} more; `workflow show {outcome.archive}` groups them")
    say(f"next: {shlex.join(('workflow', 'report', str(outcome.archive)))}")
