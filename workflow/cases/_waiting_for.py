"""What a run is waiting for at this moment, and how long it has compiled, for the line that says how far it is."""

from __future__ import annotations

import time
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
_BEGUN: dict[str, float] = {}
_SPENT: dict[str, float] = {}
"""When what is under way began, and the seconds that each thing took before, on the clock of ``perf_counter``."""
_LOCK = Lock()


@contextmanager
def waiting_for(what: str) -> Iterator[None]:
    """Say that something is under way in this process while the context lasts."""
    with _LOCK:
        if not _UNDER_WAY[what]:
            _BEGUN[what] = time.perf_counter()
        _UNDER_WAY[what] += 1
    try:
        yield
    finally:
        with _LOCK:
            _UNDER_WAY[what] -= 1
            if not _UNDER_WAY[what]:
                _SPENT[what] = _SPENT.get(what, 0.0) + time.perf_counter() - _BEGUN[what]


def waited_for() -> str:
    """Return what this process is waiting for, empty where it is nothing that takes long."""
    return next((what for what in _ORDER if _UNDER_WAY[what]), "")


def seconds_compiled() -> float:
    """Return the seconds that this process has compiled."""
    return _SPENT.get(COMPILING, 0.0)
