"""What commands write to the terminal: the one place through which all of it passes.

Titles, units, messages, keys and file names come from files. They are data: characters that a terminal
would obey are taken out.
"""

from __future__ import annotations

import io
import json
import os
import re
import sys
from contextlib import suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

_BREAKS = re.compile("[\t\n\v\f\r\x1c-\x1e\x85\u2028\u2029]+")
"""Tabs, line feeds and what else ends a line."""

_OBEYED = re.compile("[\x00-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]")
"""C0 and C1 control characters, delete, and what changes the order of writing (Unicode Annex 9)."""


def clean(text: str) -> str:
    """Return text as one line without the characters that a terminal obeys; a break becomes a space."""
    return _OBEYED.sub("", _BREAKS.sub(" ", text))


def write_anything() -> None:
    """Have characters that the encoding of the standard output lacks written as their codes."""
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")


def say(line: str) -> None:
    """Print one line on the standard output, cleaned."""
    write(clean(line))


def write(text: str) -> None:
    """Print text on the standard output as it is; a reader that has gone, as `head` does, harms nobody.

    Raises
    ------
    OSError
        The standard output cannot be written to.
    """
    try:
        print(text, flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left in the buffer goes nowhere
        if not isinstance(error, BrokenPipeError):
            error.filename = "standard output"
            raise


def write_json(value: Any, indent: int | None = None) -> None:
    """Print a value as JSON; characters that a terminal obeys stand as their codes.

    Raises
    ------
    OSError
        The standard output cannot be written to.
    """
    from workflow.analysis import json_value

    lines = json.dumps(json_value(value), indent=indent, ensure_ascii=False, allow_nan=False).split("\n")
    write("\n".join(_OBEYED.sub(lambda match: f"\\u{ord(match[0]):04x}", line) for line in lines))


def print_error(line: str) -> None:
    """Print one line on the standard error, cleaned; nothing where that is closed."""
    with suppress(OSError, ValueError, AttributeError):
        print(clean(line), file=sys.stderr, flush=True)


def console() -> Console:
    """Return what draws a progress bar; it interprets no markup."""
    from rich.console import Console

    return Console(highlight=False, soft_wrap=True, markup=False)
