"""What a run is waiting for at this moment, for the line that says how far it is."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock

COMPILING = "compiling (once)"
TRIALS = "trials of `auto`"
REFERENCES = "references"
CASES = "cases"
WORKERS = "workers start"
GATHERING = "gathering"

_ORDER = (COMPILING, WORKERS, TRIALS, REFERENCES, CASES, GATHERING)
"""Of several at once the first is named: the others wait for it."""

_UNDER_WAY: Counter[str] = Counter()
_LOCK = Lock()


@contextmanager
def waiting_for(what: str) -> Iterator[None]:
    """Say that something is under way in this process while the context lasts."""
    with _LOCK:
        _UNDER_WAY[what] += 1
    try:
        yield
    finally:
        with _LOCK:
            _UNDER_WAY[what] -= 1


def waited_for() -> str:
    """Return what this process is waiting for, empty where it is nothing that takes long."""
    return next((what for what in _ORDER if _UNDER_WAY[what]), "")
