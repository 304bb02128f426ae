"""``workflow report``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workflow.cli._terminal import clean, console, say
from workflow.cli._words import ArchiveFiles


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
