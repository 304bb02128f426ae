"""How far a run is: cases stored and how they ended, the share of its work, its throughput, the time left.

A notebook shows it as one line with a bar that is drawn anew in its place.
"""

from __future__ import annotations

import html
import math
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib import import_module
from threading import Event, Lock, Thread
from typing import Any

from workflow.cases import COMPILING, seconds_compiled, waited_for
from workflow.run._outcome import Outcome
from workflow.run._task import Report

REDRAWN = 1.0
"""Seconds after which the line is drawn anew."""


@dataclass(frozen=True)
class Advance:
    """How far a run is."""

    cases: int
    stored: int
    """``cases``, ``stored``: cases of the study, and those whose results are stored."""
    endings: Mapping[str, int]
    """Number of stored cases that are not ok, by name of their status."""
    work: float
    """Share of the study's work that is done, by the cost model that cuts its tasks."""
    elapsed: float
    """Seconds since the run began."""
    rate: float
    left: float
    """``rate``, ``left``: cases per second of this run so far, and the seconds that the rest takes if its work goes on
    as fast; NaN until a shard is stored. Compilation in this process does not count."""


Progress = Callable[[Advance], None]
"""Hears how far a run is: when it begins to compute and whenever results are stored, from any thread."""


@dataclass
class ProgressCounter:
    """Counts what tasks store and reports how far the run is."""

    cases: int
    """Cases of the study."""
    missing: float
    """Seconds of the cost model of the cases that are missing."""
    before: float
    """Those of the cases that were stored before."""
    begun: float
    """Time at which the run began, of ``clock``."""
    tell: Progress
    """What hears of it."""
    clock: Callable[[], float] = time.perf_counter
    """Tells the time in seconds."""

    def __post_init__(self) -> None:
        self._lock, self._computing = Lock(), self.clock() - seconds_compiled()
        self._done, self._new, self._stored, self._endings = 0.0, 0, 0, Counter[str]()

    def set(self, stored: int, endings: Mapping[str, int]) -> None:
        """Take what is stored altogether, and report it."""
        with self._lock:
            self._stored, self._endings = stored, Counter(endings)
            self.tell(self._advance())

    def add(self, report: Report) -> None:
        """Take what a shard holds, and report it."""
        with self._lock:
            self._stored += report.cases
            self._new += report.cases
            self._endings.update(report.endings)
            self._done += report.seconds
            self.tell(self._advance())

    def _advance(self) -> Advance:
        now = self.clock()
        seconds = now - seconds_compiled() - self._computing
        total = self.before + self.missing
        work = (self.before + self._done) / total if total > 0 else self._stored / max(self.cases, 1)
        rate = self._new / seconds if self._new and seconds > 0 else math.nan
        left = max(self.missing / self._done - 1, 0.0) * seconds if self._done > 0 else math.nan
        return Advance(self.cases, self._stored, dict(self._endings), min(work, 1.0), now - self.begun, rate, left)


def in_words(advance: Advance | None, elapsed: float, waited: float = 0.0) -> str:
    """Return how far a run is, and what this process is waiting for, as one line.

    While kernels compile it says no throughput and no time that is left: those are the cases'.

    Parameters
    ----------
    advance
        The last report; ``None`` before the first.
    elapsed
        Seconds since the beginning.
    waited
        Seconds since that report.
    """
    awaited = waited_for()
    what = f"{awaited}; " if awaited else ""
    if advance is None:
        return f"{what}{clock_time(elapsed)} elapsed"
    endings = "".join(f", {number} {name.replace('_', '-')}" for name, number in advance.endings.items() if number)
    is_known = not math.isnan(advance.left) and awaited != COMPILING
    left = f", {clock_time(max(advance.left - waited, 0.0))} left" if is_known else ""
    rate = f", {float(f'{advance.rate:.2g}'):g}/s" if is_known else ""
    times = f"{math.floor(100 * advance.work)} %, {clock_time(elapsed)} elapsed{left}"
    return f"{what}{times}; {advance.stored} of {advance.cases} cases{rate}{endings}"


class Follower:
    """Keeps the last progress of a run, for a line that says it in words; its time counts from when it is made."""

    def __init__(self) -> None:
        self.advance: Advance | None = None
        self.begun = self._updated = time.monotonic()

    def __call__(self, advance: Advance) -> None:
        """Take how far the run is."""
        self.advance, self._updated = advance, time.monotonic()

    def line(self) -> str:
        """Return how far the run is at this moment."""
        now = time.monotonic()
        return in_words(self.advance, now - self.begun, now - self._updated)


def clock_time(seconds: float) -> str:
    """Return a time in hours, minutes and seconds, ``0:07`` or ``1:02:30``."""
    minutes, second = divmod(int(seconds), 60)
    hours, minute = divmod(minutes, 60)
    return f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"


@contextmanager
def repeating(act: Callable[[], None], seconds: float) -> Iterator[None]:
    """Do something again and again in a thread of its own, each time after so many seconds, until the context ends."""
    ended = Event()

    def repeat() -> None:
        while not ended.wait(seconds):
            act()

    thread = Thread(target=repeat, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


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
