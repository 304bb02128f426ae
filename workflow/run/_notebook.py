"""The progress of a run in a notebook: one line with a bar that is drawn anew in its place."""

from __future__ import annotations

import html
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib import import_module
from typing import Any

from workflow.run._outcome import Outcome
from workflow.run._progress import Follower, repeating

REDRAWN = 1.0
"""Seconds after which the line is drawn anew."""


def in_notebook() -> bool:
    """Tell whether this process is the kernel of a notebook."""
    ipython = sys.modules.get("IPython")
    shell = None if ipython is None else ipython.get_ipython()
    return hasattr(shell, "kernel")


class NotebookLine(Follower):
    """A line in the output of the cell that runs a study; what is drawn follows progress within :data:`REDRAWN`."""

    def __init__(self, name: str) -> None:
        super().__init__()
        display: Any = import_module("IPython.display").display
        self._name = name
        self._outcome: Outcome | None = None
        self._handle: Any = display(self._shown(), raw=True, display_id=True)

    def draw(self) -> None:
        """Draw the line as it is now."""
        with suppress(Exception):  # no run fails because its notebook was closed
            self._handle.update(self._shown(), raw=True)

    def end(self, outcome: Outcome) -> None:
        """Take how the run ended, which the line says from the next drawing on."""
        self._outcome = outcome

    def _shown(self) -> dict[str, str]:
        if self._outcome is not None:
            return {"text/plain": _in_words(self._outcome)}
        text = f"{self._name}: {self.line()}"
        value = "" if self.advance is None else f' value="{self.advance.work:.4f}"'
        return {"text/plain": text, "text/html": f'<progress max="1"{value}></progress> {html.escape(text)}'}


@contextmanager
def notebook_line(name: str) -> Iterator[NotebookLine]:
    """Show a line while a run goes on; what it shows last is drawn after the thread that draws it anew has ended."""
    line = NotebookLine(name)
    try:
        with repeating(line.draw, REDRAWN):
            yield line
    finally:
        line.draw()


def _in_words(outcome: Outcome) -> str:
    counts = ", ".join(f"{number} {name}" for name, number in outcome.counts.items())
    return f"{outcome.archive.name}: {sum(outcome.counts.values())} cases in {outcome.seconds:.1f} s ({counts})"
