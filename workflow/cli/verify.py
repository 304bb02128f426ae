"""``workflow verify``."""

from __future__ import annotations

from typing import Annotated

import typer

from workflow.cli._failures import NOT_OK
from workflow.cli._terminal import say
from workflow.cli._words import ArchiveFile

_OTHER_SOLVER = "as it was written, by another version of the solver: none of its cases was run again"


def verify(
    archive: ArchiveFile,
    sample: Annotated[int, typer.Option(min=0, help="Cases to run again.")] = 12,
) -> None:
    """Check an archive's bytes and hashes, then run a sample of its cases again and compare."""
    differing: set[str] = set()
    from workflow.run import verify as checks_of

    for check in checks_of(archive, sample):
        differing |= set() if check.holds else {check.name}
        say(f"  {check.name:8} {'ok' if check.holds else 'DIFFERS'}: {check.detail}")
    verdict = _OTHER_SOLVER if differing == {"solver"} else "not as it was written" if differing else "verified"
    say(f"{archive}: {verdict}")
    raise typer.Exit(NOT_OK if differing else 0)
