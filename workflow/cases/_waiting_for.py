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
PREPARING, PLANNING = "preparing", "planning"
WORKERS = "workers start"
GATHERING = "gathering"

_ORDER = (COMPILING, WORKERS, PREPARING, TRIALS, REFERENCES, CASES, GATHERING, PLANNING)
"""Of several at once the first is named: the others wait for it."""

_UNDER_WAY: Counter[str] = Counter()
_MORE: dict[str, str] = {}
"""Words behind what is under way."""
_BEGUN: dict[str, float] = {}
_SPENT: dict[str, float] = {}
"""When what is under way began, and the seconds that each thing took before, on the clock of ``perf_counter``."""
_LOCK = Lock()


@contextmanager
def waiting_for(what: str, more: str = "") -> Iterator[None]:
    """Say that something is under way in this process while the context lasts, with more words behind it."""
    with _LOCK:
        _MORE[what] = more
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


_STRUCTURES = [0, 0]
"""How many structures the study has that is planned or run, and how many of them are reduced."""


def expect_structures(count: int) -> None:
    """Have :func:`preparing` say of how many structures each is one."""
    _STRUCTURES[:] = count, 0


@contextmanager
def preparing() -> Iterator[None]:
    """Say that a structure is reduced while the context lasts."""
    count, done = _STRUCTURES
    with waiting_for(PREPARING, f"{count} structures, {done} done" if count > 1 else "a structure"):
        yield
    _STRUCTURES[1] += 1


def waited_for() -> str:
    """Return what this process is waiting for, empty where it is nothing that takes long."""
    return next((f"{what} {_MORE[what]}".rstrip() for what in _ORDER if _UNDER_WAY[what]), "")


def seconds_compiled() -> float:
    """Return the seconds that this process has compiled."""
    return _SPENT.get(COMPILING, 0.0)
