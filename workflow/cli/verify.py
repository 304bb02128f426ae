"""``workflow verify``."""

from __future__ import annotations

from typing import Annotated

import typer

from workflow.cli._failures import NOT_OK
from workflow.cli._terminal import say
from workflow.cli._words import ArchiveFile


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
