"""``workflow schema``."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from workflow.cli._terminal import say, write


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
