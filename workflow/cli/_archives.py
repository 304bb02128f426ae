"""Commands that read archives: ``show``, ``recommend``, ``limits``, ``report`` and ``verify``."""

from __future__ import annotations

import dataclasses
import shlex
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from workflow.cli._failures import NOT_OK
from workflow.cli._terminal import clean, console, print_error, say, write_json
from workflow.cli._words import ArchiveFile, ArchiveFiles, AsJson

if TYPE_CHECKING:
    import xarray as xr

    from workflow.analysis import Recommendation

VALUES_SHOWN = 8
FAILURES_SHOWN = 20


def show(
    archives: ArchiveFiles,
    as_json: AsJson = False,
) -> None:
    """Show what archives hold: dimensions, statuses, what failed and why; as JSON one line for each archive."""
    from workflow.archive import open_archive

    for archive in archives:
        with open_archive(archive) as dataset:
            if as_json:
                write_json(_entries(archive, dataset))
            else:
                for line in _lines(archive, dataset):
                    say(line)


def _lines(archive: Path, dataset: xr.Dataset) -> Iterator[str]:
    from workflow.run import warnings_of

    yield f"{archive}: {dataset.attrs.get('title', 'without a title')}"
    yield from (f"  beware: {warning}" for warning in warnings_of(dataset))
    yield from _coordinates(dataset)
    yield from decided_lines(dataset)
    yield from _statuses(dataset)


def _entries(archive: Path, dataset: xr.Dataset) -> dict[str, Any]:
    """Return what is shown as the entries of its JSON, with all values of the coordinates."""
    from workflow.analysis import failures
    from workflow.run import status_counts, warnings_of

    coordinates = {
        str(name): {
            "dims": list(values.dims),
            "units": values.attrs.get("units", ""),
            "values": values.values.tolist(),
        }
        for name, values in dataset.coords.items()
        if name != "t"
    }
    return {
        "archive": str(archive),
        "title": dataset.attrs.get("title", ""),
        "warnings": warnings_of(dataset),
        "dimensions": {str(name): size for name, size in dataset.sizes.items()},
        "coordinates": coordinates,
        "status": status_counts(dataset),
        "runaway": int(dataset["runaway"].sum()) if "runaway" in dataset else 0,
        "failures": failures(dataset),
    }


def _coordinates(dataset: xr.Dataset) -> Iterator[str]:
    from workflow.analysis import case_dims, exact, labels_of, swept_axis

    for dim in case_dims(dataset):
        values = labels_of(dataset, dim, named=False, rounded=True)
        more = f"; … {len(values)} in all" if len(values) > VALUES_SHOWN else ""
        how = ", swept" if dim == swept_axis(dataset) else ""
        yield f"  {dim} ({len(values)}{how}): {'; '.join(values[:VALUES_SHOWN])}{more}"
    if "contact" in dataset.dims and "contact" not in case_dims(dataset):
        yield f"  contact ({dataset.sizes['contact']}): {', '.join(map(str, dataset['contact'].values))}"
    if "sensor" in dataset.dims:
        yield f"  sensors: {', '.join(map(str, dataset['sensor'].values))}"
    for name in dataset.coords:
        if dataset[name].ndim == 0:
            yield f"  {name} = {labels_of(dataset.expand_dims(name), str(name), named=False)[0]}"
    if "t" in dataset.sizes:
        t = dataset["t"].values
        yield f"  t: {t.size} samples to {exact(t[-1])} s"


def decided_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield counts of modes that tolerances decided, and in how many conditions they meet them."""
    from workflow.analysis import decided

    models = decided(dataset)
    for one in models[:VALUES_SHOWN]:
        yield f"  auto: {one.text}"
    if len(models) > VALUES_SHOWN:
        yield f"  auto: … {len(models)} in all"


_PHYSICS = "which is physics, not a fault of the solver (flag `runaway`)"


def _statuses(dataset: xr.Dataset) -> Iterator[str]:
    from workflow.analysis import runaways
    from workflow.run import status_counts

    counts = status_counts(dataset)
    yield "  status: " + ", ".join(f"{number} {name}" for name, number in counts.items())
    growing, several = runaways(dataset), "critical_set" in dataset
    if growing.above:
        runs_away = "in permanent contact their tip runs away thermally"
        limits = f" ({growing.critical} W/N)" if several else ""
        yield f"  {growing.above} ok cases above their critical alpha{limits}: {runs_away}, {_PHYSICS}"
    if growing.flutter:
        flutters = f"in permanent contact {growing.flutter_sets if several else 'their tip'} flutters"
        yield f"  {growing.flutter} ok cases below their critical alpha: {flutters}, {_PHYSICS}"
    yield from failure_lines(dataset)


def failure_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield a line for each message of cases, with the first of them and how many more there are."""
    from workflow.analysis import failures

    groups = failures(dataset, rounded=True)
    for group in groups[:FAILURES_SHOWN]:
        many = "" if group.cases == 1 else f" and {group.cases - 1} more"
        yield f"  {group.status}: {group.first}{many}: {group.message}"
    if len(groups) > FAILURES_SHOWN:
        yield f"  … and {len(groups) - FAILURES_SHOWN} more messages"


Tolerance = Annotated[
    str | None,
    typer.Option("--tolerance", metavar="SHARE", help="Largest error, as 0.01 or 1%; default: the study's, else 1%."),
]

WIDE = 240
"""Characters of a line where the output goes to a file or another program, which fold nothing."""


def recommend(archive: ArchiveFile, tolerance: Tolerance = None, as_json: AsJson = False) -> None:
    """Name scheme, step and reduced model that meet a tolerance in all cases at about the least cost, and the evidence.

    Of all that meet it and cost at most 25 % more than the cheapest of them, the most accurate is named.

    Exit status: 0 answered, 1 nothing in the archive meets it or no case is decidable, 2 the archive has no reference.
    """
    from workflow.analysis import (
        NoReferenceError,
        recommendation_cautions,
        recommendation_entries,
        swept_axis,
        usual_recommendations,
    )
    from workflow.analysis import recommend as choose
    from workflow.archive import ArchiveError, open_archive

    with open_archive(archive) as dataset:
        if "point" in dataset.dims:
            raise ArchiveError(f"{archive}: holds branches of steady rubs, which have no errors to recommend by")
        if swept_axis(dataset) is not None:
            advice = "run its study to another archive with a list in the place of the sweep, and a `reference`"
            raise ArchiveError(f"{archive}: holds a sweep, which has no errors to recommend by; {advice}")
        try:
            recommendation = choose(dataset, tolerance)
            table = usual_recommendations(dataset, recommendation)
        except NoReferenceError as error:
            advice = f"run it with one to another archive, e.g. {_with_reference(archive)}"
            raise ArchiveError(f"{archive}: {error}; {advice}") from None
        except ValueError as error:
            raise typer.BadParameter(str(error)) from None
        cautions = recommendation_cautions(dataset)
    for caution in cautions:
        print_error(f"{archive}: {caution}")
    if as_json:
        others = [recommendation_entries(other) for other in table]
        write_json(recommendation_entries(recommendation) | {"cautions": cautions, "table": others}, indent=2)
    else:
        _write_text(recommendation, table)
    if recommendation.choice is None or len(recommendation.undecidable) == recommendation.cases:
        raise typer.Exit(NOT_OK)


def _with_reference(archive: Path) -> str:
    """Return the command that runs an archive's study with the exact solution of its full model as its reference."""
    reference = "reference={scheme: event_driven, mechanical_modes: full, thermal_modes: full}"
    words = ("workflow", "run", str(archive), "-s", reference)
    return shlex.join((*words, "-o", f"{archive.stem}_errors.nc"))


def _write_text(recommendation: Recommendation, table: list[Recommendation]) -> None:
    from rich.table import Table
    from rich.text import Text

    from workflow.analysis import RECOMMENDATION_COLUMNS, answer_lines, recommendation_row, undecidable

    for line in answer_lines(recommendation):
        say(line)
    if recommendation.choice is None and recommendation.next and recommendation.next.worst.status == "not_run":
        return  # every row would say so
    if recommendation.undecidable:
        say(undecidable(recommendation))
    drawn = Table(box=None, pad_edge=False)
    for name in RECOMMENDATION_COLUMNS:
        drawn.add_column(name, overflow="fold")
    for other in table:
        drawn.add_row(*(Text(clean(cell)) for cell in recommendation_row(other)))
    screen = console()
    if not screen.is_terminal:
        screen.width = WIDE
    screen.print(drawn)


_Bound = Annotated[
    str | None,
    typer.Option(metavar="QUANTITY", help="Bound of rubs, in SI or with its unit: 40K, 0.1mm, '0.1 N*s'."),
]


def limits(
    archive: ArchiveFile,
    max_temperature: _Bound = None,
    max_displacement: _Bound = None,
    max_impulse: _Bound = None,
    as_json: AsJson = False,
) -> None:
    """Name the range of each axis in which every rub settles within bounds, and what ends it.

    Exit status: 0 answered, 1 no case is within, 2 the archive has nothing to judge by.
    """
    from workflow.analysis import NothingSteadyError, limit_lines
    from workflow.analysis import limits as find
    from workflow.archive import ArchiveError, open_archive

    bounds = {
        "temperature": _read("--max-temperature", "K", max_temperature),
        "displacement": _read("--max-displacement", "m", max_displacement),
        "impulse": _read("--max-impulse", "N*s", max_impulse),
    }
    with open_archive(archive) as dataset:
        try:
            found = find(dataset, **bounds)
        except NothingSteadyError as error:
            raise ArchiveError(f"{archive}: {error}") from None
        lines = limit_lines(found, dataset, bounds)
    if as_json:
        answer = dataclasses.asdict(found)
        for limit in (*answer["limits"], *answer["each"]):
            limit["from"], limit["to"] = limit.pop("start"), limit.pop("stop")
        write_json(answer, indent=2)
    else:
        for line in lines:
            say(line)
    if not found.within:
        raise typer.Exit(NOT_OK)


def _read(option: str, unit: str, text: str | None) -> float | None:
    """Return a bound in SI; a number without unit is in SI."""
    if text is None:
        return None
    from pydantic_core import ValidationError

    from workflow.declare import Quantity
    from workflow.study.mistakes import faults_of
    from workflow.study.quantities import read_quantity

    value: float | str = text
    with suppress(ValueError):
        value = float(text)
    try:
        return read_quantity(value, Quantity(unit, option, above=0))
    except ValidationError as error:
        ((_, problem, remedy),) = faults_of(error)
        raise typer.BadParameter(f"{option}: {problem}; {remedy}") from None


def report(
    archives: ArchiveFiles,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FILE",
            help="A page, .html, with its figure beside it; or the figure alone, .png, .svg or .pdf. "
            "Default: ARCHIVE.html; of several: report.html.",
        ),
    ] = None,
) -> None:
    """Write figures and tables of one archive or several as one self-contained HTML page."""
    with console().status(clean(f"reading {', '.join(path.name for path in archives)}, drawing figures and the page")):
        from workflow.archive import require_own_content
        from workflow.report import write_report

        try:
            written = write_report(archives, output)
        except (LookupError, ValueError):  # of a variable, say, that another program has taken away
            for path in filter(Path.exists, archives):
                require_own_content(path)
            raise
    if written.figure is not None:
        say(f"figure {written.figure}")
    if written.page is not None:
        say(f"page   {written.page}")


def verify(
    archive: ArchiveFile,
    sample: Annotated[int, typer.Option(min=0, help="Cases to run again.")] = 12,
) -> None:
    """Check an archive's bytes and hashes, then run a sample of its cases again and compare.

    Where other versions of packages or of this code made it, what the sample differs by is said and not judged.
    """
    from workflow.run import verify as checks_of

    holds = judged = True
    for check in checks_of(archive, sample):
        holds, judged = holds and check.holds, judged and check.judged
        found = "not judged" if not check.judged else "ok" if check.holds else "DIFFERS"
        say(f"  {check.name:8} {found}: {check.detail}")
    whole = "verified" if judged else "as it was written, by other versions: its cases are not judged"
    say(f"{archive}: {whole if holds else 'not as it was written'}")
    raise typer.Exit(0 if holds else NOT_OK)
