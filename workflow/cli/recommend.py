"""``workflow recommend``."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workflow.cli._failures import NOT_OK
from workflow.cli._terminal import console, print_error, say, write_json
from workflow.cli._words import ArchiveFile, AsJson

if TYPE_CHECKING:
    from workflow.analysis import Recommendation

Tolerance = Annotated[
    str | None,
    typer.Option("--tolerance", metavar="SHARE", help="Largest error, as 0.01 or 1%; default: the study's, else 1%."),
]

WIDE = 240
"""Characters of a line where the output goes to a file or another program, which fold nothing."""


def recommend(archive: ArchiveFile, tolerance: Tolerance = None, as_json: AsJson = False) -> None:
    """Name scheme, step and reduced model that meet a tolerance in all cases at about the least cost, and the evidence.

    Exit status: 0 answered, 1 nothing in the archive meets it, 2 the archive has no reference.
    """
    from workflow.analysis import (
        NoReferenceError,
        recommendation_cautions,
        recommendation_entries,
        usual_recommendations,
    )
    from workflow.analysis import recommend as choose
    from workflow.archive import ArchiveError, open_archive

    with open_archive(archive) as dataset:
        if "point" in dataset.dims:
            raise ArchiveError(f"{archive}: holds branches of steady rubs, which have no errors to recommend by")
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
    if recommendation.choice is None:
        raise typer.Exit(NOT_OK)


def _with_reference(archive: Path) -> str:
    """Return the command that runs an archive's study with the exact solution of its full model as its reference."""
    reference = "reference={scheme: event_driven, mechanical_modes: full, thermal_modes: full}"
    words = ("workflow", "run", str(archive), "-s", reference)
    return shlex.join((*words, "-o", f"{archive.stem}_errors.nc"))


def _write_text(recommendation: Recommendation, table: list[Recommendation]) -> None:
    from rich.table import Table
    from rich.text import Text

    from workflow.analysis import RECOMMENDATION_COLUMNS, recommendation_row, sentence, undecidable
    from workflow.cli._terminal import clean

    say(sentence(recommendation))
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
