"""How fast this machine runs: processor seconds that its last run took, over those of the cost model.

The file is no part of any result: where it cannot be read or written nothing else changes.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

import workflow
from workflow.schemes import SOLVER_VERSION

LEAST_SECONDS = 0.5
"""Model seconds of a run below which it does not count: what comes once to a process outweighs it."""

_LOCK = threading.Lock()
_SUMS = {"model": 0.0, "measured": 0.0}
"""Of this process, not remembered yet."""


@contextmanager
def timed(model: float) -> Iterator[None]:
    """Measure what this thread does within and the model says takes so many seconds."""
    begun = time.thread_time()
    yield
    add(model, time.thread_time() - begun)


@contextmanager
def untimed() -> Iterator[None]:
    """Leave out of :func:`timed` what this thread does within."""
    begun = time.thread_time()
    try:
        yield
    finally:
        add(0.0, begun - time.thread_time())


def add(model: float, measured: float) -> None:
    """Add seconds of the cost model and measured ones."""
    with _LOCK:
        _SUMS["model"] += model
        _SUMS["measured"] += measured


def forget() -> None:
    """Drop what was measured and not remembered."""
    with _LOCK:
        _SUMS.update(model=0.0, measured=0.0)


def factor() -> float | None:
    """Return measured over model seconds of the last run on this machine, ``None`` before the first."""
    try:
        content = json.loads(speed_file().read_text(encoding="utf-8"))
        model, measured = (float(content[name]) for name in _SUMS)
    except (OSError, ValueError, KeyError, TypeError, RuntimeError):  # it is missing or damaged, or there is no home
        return None
    return measured / model if model > 0 and measured > 0 else None


def remember() -> None:
    """Keep what was measured in this machine's file, and drop it; never raises, at worst nothing is kept."""
    fresh = dict(_SUMS)
    forget()
    if fresh["model"] < LEAST_SECONDS:
        return
    with suppress(Exception):
        path = speed_file()
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".tmp", delete=False, encoding="utf-8") as file:
            file.write(json.dumps(fresh))
        os.replace(file.name, path)


def speed_file() -> Path:
    """Return this machine's file: one for each processor, version of the solver and of the package."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    machine = f"{processor_name()}, solver {SOLVER_VERSION}, rotor-stator-workflow {workflow.__version__}, one factor"
    return home / "rotor-stator-workflow" / f"speed-{hashlib.sha256(machine.encode()).hexdigest()[:16]}.json"


@cache
def processor_name() -> str:
    """Return the processor's name as the system names it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()
