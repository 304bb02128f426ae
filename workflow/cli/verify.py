"""``workflow verify``."""

from __future__ import annotations

from typing import Annotated

import typer

from workflow.cli._failures import NOT_OK, errors_in_words
from workflow.cli._terminal import say
from workflow.cli._words import ArchiveFile


def verify(
    archive: ArchiveFile,
    sample: Annotated[int, typer.Option(min=0, help="Cases to run again.")] = 12,
) -> None:
    """Check an archive's bytes and hashes, then run a sample of its cases again and compare."""
    whole = True
    with errors_in_words():
        from workflow.run import verify as checks_of

        for check in checks_of(archive, sample):
            whole &= check.holds
            say(f"  {check.name:8} {'ok' if check.holds else 'DIFFERS'}: {check.found}")
        say(f"{archive}: " + ("verified" if whole else "not as it was written"))
    raise typer.Exit(0 if whole else NOT_OK)
