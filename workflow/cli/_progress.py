"""How far a run is, as long as it goes on: a bar in a terminal, elsewhere a line every minute."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from workflow.cli._terminal import console, print_error

if TYPE_CHECKING:
    from rich.console import Console

    from workflow.run import Follower

EVERY = 60.0
"""Seconds between two lines where there is no terminal."""

_BAR = 12
"""Characters of the bar, which leave room for the line in a terminal of 80."""


@contextmanager
def following(follower: Follower, name: str, quiet: bool) -> Iterator[None]:
    """Show how far a run is while the context lasts.

    Parameters
    ----------
    follower
        Keeps the progress that the run reports.
    name
        Of the archive, which begins each line where there is no terminal.
    quiet
        Show nothing.
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
