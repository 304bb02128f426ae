"""The command line: run, plan, show, report, verify, schema."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from workflow.grid import Plan
    from workflow.run import Outcome, Progress
    from workflow.study import Study

app = typer.Typer(
    name="workflow",
    help="From a YAML study of a blade rubbing on its casing to a labelled NetCDF archive.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

WRONG = 2
"""Exit status: the study or the call is wrong."""
NOT_OK = 1
"""Exit status: some case is not ok; the rest is complete and stored."""
FAILURES_SHOWN = 20
INTERRUPTED = 130
"""Exit status: stopped by Ctrl-C."""
TERMINATED = 143
"""Exit status: stopped by SIGTERM."""

StudyFile = Annotated[Path, typer.Argument(metavar="STUDY", help="YAML study, or an archive whose study to repeat.")]
ArchiveFile = Annotated[Path, typer.Argument(metavar="ARCHIVE", help="Archive that `workflow run` wrote.")]


def _console() -> Console:
    from rich.console import Console

    return Console(highlight=False, soft_wrap=True)


@contextmanager
def _told() -> Iterator[None]:
    """Turn what a user can mend into one clear message and the exit status of a wrong call."""
    from workflow.archive import ArchiveError
    from workflow.study import StudyError

    try:
        yield
    except (ArchiveError, StudyError) as error:
        print(error, file=sys.stderr)
        raise typer.Exit(WRONG) from None
    except RuntimeError as error:
        if not any(word in str(error) for word in ("NetCDF", "HDF")):
            raise
        print(
            f"the archive is damaged ({error}); restore a copy, or move it away and run its study again",
            file=sys.stderr,
        )
        raise typer.Exit(WRONG) from None
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        print(f"{where}{(error.strerror or str(error)).lower()}; choose a place that can be written", file=sys.stderr)
        raise typer.Exit(WRONG) from None


def _is_hdf5(path: Path) -> bool:
    try:
        with open(path, "rb") as file:
            return file.read(8) == b"\x89HDF\r\n\x1a\n"
    except OSError:
        return False


def _named(archive: Path) -> Path:
    """Refuse a path that names no file: nothing, a dot, the root."""
    from workflow.archive import ArchiveError

    if not archive.name:
        raise ArchiveError(f"{archive}: a directory, not an archive; name a file")
    return archive


def _read(path: Path) -> Study:
    """Read a study from its YAML, or from the archive that came of it."""
    from workflow.archive import provenance
    from workflow.study import parse_study, read_study

    if _is_hdf5(path):
        return parse_study(provenance(path)["study"], path.name)
    return read_study(path)


@app.command()
def run(
    study: StudyFile,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="ARCHIVE", help="Default: STUDY.nc here.")
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
) -> None:
    """Run a study; what an interrupted run or an earlier archive of it holds is kept and the rest is run."""
    given = {"--threads": threads, "--workers": workers, "--scheduler": scheduler}
    chosen = [name for name, value in given.items() if value is not None]
    if len(chosen) > 1:
        raise typer.BadParameter(f"{' and '.join(chosen)} exclude each other; give one of them")
    console = _console()
    with _told():
        from workflow.run import ClusterError, run_study

        read = _read(study)
        archive = Path(f"{read.name}.nc") if output is None else _named(output)
        reached: list[int] = []
        try:
            with _stoppable(), _progress(console, reached) as progress:
                outcome = run_study(
                    read,
                    archive,
                    threads,
                    progress,
                    workers=workers,
                    scheduler=scheduler,
                    retry=retry,
                    recompute=recompute,
                )
        except ClusterError as error:
            stored = f"; {reached[0]} of {reached[1]} cases are stored beside {archive}" if reached else ""
            print(f"{error}{stored}", file=sys.stderr)
            raise typer.Exit(WRONG) from None
        except KeyboardInterrupt as stopped:
            stored = f"{reached[0]} of {reached[1]} cases are" if reached else "what was done is"
            print(f"stopped; {stored} stored beside {archive}, the same command goes on from there", file=sys.stderr)
            sys.stderr.flush()
            os._exit(TERMINATED if isinstance(stopped, _Terminated) else INTERRUPTED)  # kernels cannot be stopped
    _tell_outcome(console, outcome)
    raise typer.Exit(0 if outcome.ok else NOT_OK)


class _Terminated(KeyboardInterrupt):
    """SIGTERM, which ends a run as Ctrl-C does."""


@contextmanager
def _stoppable() -> Iterator[None]:
    """Let SIGTERM stop a run as Ctrl-C does, so that it says what is stored."""
    import signal

    def stop(number: int, frame: object) -> None:
        raise _Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def _progress(console: Console, reached: list[int]) -> Iterator[Progress]:
    """Show a bar with cases done, cases failed and the time left; ``reached`` holds cases stored and all of them."""
    from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("cases, {task.fields[failed]} failed,"),
        TimeRemainingColumn(),
        TextColumn("left"),
    )
    with Bar(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None, failed=0)

        def advance(stored: int, failed: int, cases: int) -> None:
            reached[:] = stored, cases
            bar.update(task, completed=stored, total=cases, failed=failed)

        yield advance


def _tell_outcome(console: Console, outcome: Outcome) -> None:
    cases = sum(outcome.counts.values())
    counts = ", ".join(f"{number} {name}" for name, number in outcome.counts.items())
    if outcome.resumed == cases:
        console.print(f"{outcome.archive}: nothing to do, all {cases} cases are there ({counts})")
    else:
        before = f", {outcome.resumed} of them stored before" if outcome.resumed else ""
        console.print(f"{outcome.archive}: {cases} cases in {outcome.seconds:.1f} s{before} ({counts})")
    for labels, message in outcome.failures:
        console.print(f"  {labels}: {message}", markup=False)
    told = len(outcome.failures)
    bad = cases - outcome.counts.get("ok", 0)
    if bad > told:
        console.print(f"  … and {bad - told} more; `workflow show {outcome.archive}` groups them")


@app.command()
def plan(study: StudyFile) -> None:
    """Say what a study comes to: cases, batches, time, size, structures, warnings. Runs nothing."""
    with _told():
        from workflow.grid import arrange, units_of
        from workflow.grid import plan as make_plan

        read = _read(study)
        grid = arrange(read)
        made = make_plan(grid, units_of(grid))
    _tell_plan(_console(), read, grid.dims, made)


def _tell_plan(console: Console, study: Study, dims: tuple[tuple[str, int], ...], plan: Plan) -> None:
    console.print(f"{study.name}: {study.title}", markup=False)
    console.print("  dimensions   " + (" × ".join(f"{name} {size}" for name, size in dims) or "none, a single case"))
    console.print(f"  cases        {plan.cases}, of which {plan.unique} are computed")
    console.print(f"  work         {plan.batches} batches in {plan.tasks} tasks, {plan.steps:.4g} steps")
    console.print(f"  time         about {_duration(plan.seconds)} of one core")
    console.print(f"  size         at most {_size(plan.bytes)} before compression")
    for figures in plan.structures:
        alpha = f"{figures.critical_alpha:.4g} m/s" if figures.critical_alpha < float("inf") else "none, no runaway"
        first = f"{figures.first_frequency:.5g} Hz" if figures.first_frequency else "0, a free body"
        console.print(
            f"  {figures.label}: f1 {first}, tip stiffness {figures.tip_stiffness:.4g} N/m, "
            f"thermal times {figures.fastest:.3g} to {figures.slowest:.3g} s, critical alpha {alpha}",
            markup=False,
        )
    for operator in plan.operators:
        console.print(f"  {operator}", markup=False)
    for warning in plan.warnings:
        console.print(f"  beware: {warning}", markup=False)


def _duration(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.2g} s" if seconds < 10 else f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:.1f} h"


def _size(size: int) -> str:
    return f"{size / 1e3:.3g} kB" if size < 1e6 else f"{size / 1e6:.3g} MB" if size < 1e9 else f"{size / 1e9:.3g} GB"


@app.command()
def show(archive: ArchiveFile) -> None:
    """Say what an archive holds: dimensions, statuses, what failed and why."""
    console = _console()
    with _told():
        from workflow.analysis import case_dims, failures, labels_of
        from workflow.archive import open_archive
        from workflow.run import status_counts

        with open_archive(archive) as dataset:
            console.print(f"{archive}: {dataset.attrs.get('title', 'without a title')}", markup=False)
            for dim in case_dims(dataset):
                values = labels_of(dataset, dim, named=False)
                more = f"; … {len(values)} in all" if len(values) > 8 else ""
                console.print(f"  {dim} ({len(values)}): {'; '.join(values[:8])}{more}", markup=False)
            for name in dataset.coords:
                if dataset[name].ndim == 0:
                    unit = str(dataset[name].attrs.get("units", "1")).removeprefix("1")
                    console.print(f"  {name} = {dataset[name].item()} {unit}".rstrip(), markup=False)
            if "t" in dataset.sizes:
                t = dataset["t"].values
                console.print(f"  t: {t.size} samples to {t[-1]:g} s")
            counts = status_counts(dataset)
            console.print("  status: " + ", ".join(f"{number} {name}" for name, number in counts.items()))
            runaway = int(dataset["runaway"].sum()) if "runaway" in dataset else 0
            if runaway:
                console.print(f"  {runaway} cases above their critical alpha (flag runaway)")
            told = failures(dataset)
            for group in told[:FAILURES_SHOWN]:
                many = "" if group.cases == 1 else f" and {group.cases - 1} more"
                console.print(f"  {group.status}: {group.first}{many}: {group.message}", markup=False)
            if len(told) > FAILURES_SHOWN:
                console.print(f"  … and {len(told) - FAILURES_SHOWN} more messages")


@app.command()
def verify(
    archive: ArchiveFile,
    sample: Annotated[int, typer.Option(min=0, help="Cases to run again.")] = 12,
) -> None:
    """Check an archive's bytes and hashes, then run a sample of its cases again and compare."""
    console = _console()
    whole = True
    with _told():
        from workflow.run import verify as checks_of

        for check in checks_of(archive, sample):
            whole &= check.holds
            console.print(f"  {check.name:8} {'ok' if check.holds else 'DIFFERS'}: {check.found}", markup=False)
    console.print(f"{archive}: " + ("verified" if whole else "not as it was written"), markup=False)
    raise typer.Exit(0 if whole else NOT_OK)


@app.command()
def report(
    archives: Annotated[list[Path], typer.Argument(metavar="ARCHIVE...", help="Archives that `workflow run` wrote.")],
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="PAGE", help="Default: ARCHIVE.html; of several: report.html."),
    ] = None,
) -> None:
    """Write figures and tables of one archive or several as one self-contained HTML page."""
    with _told():
        from workflow.report import write_report

        written = write_report([_named(archive) for archive in archives], output)
    if written.figure is not None:
        print(f"figure {written.figure}")
    print(f"page   {written.page}")


@app.command()
def schema(
    output: Annotated[
        Path | None, typer.Option("-o", "--output", metavar="FILE", help="Default: the terminal.")
    ] = None,
) -> None:
    """Write the JSON Schema of a study, for editors."""
    with _told():
        from workflow.study import json_schema

        text = json.dumps(json_schema(), indent=2, ensure_ascii=False)
        if output is None:
            print(text)
        else:
            output.write_text(text + "\n", encoding="utf-8")
            print(output)


def main() -> None:
    """Entry point of the command ``workflow``."""
    app()
