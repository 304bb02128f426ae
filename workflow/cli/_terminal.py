"""What commands write to the terminal, the one place through which all of it passes, and how far a run is.

Titles, units, messages, keys and file names come from files. They are data: characters that a terminal
would obey are taken out.
"""

from __future__ import annotations

import io
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

    from workflow.run import Follower

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
    """Print text on the standard output as it is; a reader that has gone, as `head` does, harms nobody."""
    try:
        print(text, flush=True)
    except OSError as error:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # what is left in the buffer goes nowhere
        if not isinstance(error, BrokenPipeError):
            error.filename = "standard output"
            raise


def write_json(value: Any, indent: int | None = None) -> None:
    """Print a value as JSON; numbers that are not finite are null, characters that a terminal obeys their codes."""
    from pydantic_core import to_json

    lines = to_json(value, indent=indent, inf_nan_mode="null").decode().split("\n")
    write("\n".join(_OBEYED.sub(lambda match: f"\\u{ord(match[0]):04x}", line) for line in lines))


def print_error(line: str) -> None:
    """Print one line on the standard error, cleaned; nothing where that is closed."""
    with suppress(OSError, ValueError, AttributeError):
        print(clean(line), file=sys.stderr, flush=True)


def console() -> Console:
    """Return what draws a progress bar; it interprets no markup."""
    from rich.console import Console

    return Console(highlight=False, soft_wrap=True, markup=False)


EVERY = 60.0
"""Seconds between two lines where there is no terminal."""

_BAR = 12
"""Characters of the bar, which leave room for the line in a terminal of 80."""


@contextmanager
def following(follower: Follower, name: str, quiet: bool) -> Iterator[None]:
    """Show how far a run is, of which ``follower`` keeps the progress, while the context lasts; nothing if ``quiet``.

    ``name`` is the archive's, which begins each line where there is no terminal.
    """
    terminal = console()
    if quiet:
        yield
    elif terminal.is_terminal:
        with _bar(follower, terminal):
            yield
    else:
        from workflow.run import repeating

        with repeating(lambda: print_error(f"{name}: {follower.line()}"), EVERY):
            yield


@contextmanager
def _bar(follower: Follower, terminal: Console) -> Iterator[None]:
    """Show a bar with what a follower says, drawn anew four times a second."""
    from rich.progress import BarColumn, Progress, ProgressColumn
    from rich.text import Text

    class Words(ProgressColumn):
        def render(self, task: Any) -> Text:
            if follower.advance is not None:
                task.total, task.completed = 1.0, follower.advance.work
            return Text(follower.line(), no_wrap=True, overflow="ellipsis")

    words = Words()
    with Progress(BarColumn(_BAR), words, console=terminal, transient=True, refresh_per_second=4) as bar:
        bar.add_task("", total=None)
        yield
