"""How fast this machine runs: what parts of runs took, over what a fixed model of them says, kept from run to run.

A run measures its parts in processor seconds (:func:`timed`) and adds them at its end to a small file of this
machine (:func:`remember`), which ``plan`` reads (:func:`speeds`). The file is no part of any result: where it
cannot be read or written nothing else changes.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
import platform
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import workflow
from workflow.schemes import SOLVER_VERSION

FORMAT = 2

MOST_SECONDS = 30.0
"""Model seconds of a part that the file holds at most: the latest runs weigh most."""

LEAST_SECONDS = 0.02
"""Model seconds of a part below which it does not count: what comes once to a process outweighs it."""

SLOWEST, UNEXPECTED = 20.0, 0.1
"""What took more than so many times the model, and so many seconds more, compiled or loaded something: not counted."""

MOST_KEYS = 2000
"""Parts that the file holds, about 100 bytes each; those measured longest ago go first."""

Sums = dict[str, tuple[float, float]]
"""By part: seconds by the fixed model, and processor seconds measured."""


class _Own(threading.local):
    """Seconds of measured parts within each part that this thread is in, outermost first."""

    def __init__(self) -> None:
        self.inside: list[float] = []


_OWN = _Own()
_LOCK = threading.Lock()
_SUMS: Sums = {}


@dataclass(frozen=True, eq=False)
class Speeds:
    """Measured over model seconds by part; empty before the first run on a machine."""

    sums: Mapping[str, tuple[float, float]]

    def ratio(self, *keys: str) -> float | None:
        """Return the ratio of the first of some parts that was measured, ``None`` where none was."""
        for key in keys:
            model, measured = self.sums.get(key, (0.0, 0.0))
            if model >= LEAST_SECONDS:
                return measured / model
        return None


@contextmanager
def timed(model: float, *keys: str, slowest: float = SLOWEST) -> Iterator[None]:
    """Measure what this thread does within, less the parts measured inside it; nothing where it raises.

    Parameters
    ----------
    model
        Seconds by the fixed model.
    keys
        The part's names, the most specific first.
    slowest
        How many times the model's seconds, and :data:`UNEXPECTED` more, it may take and still count.
    """
    begun = time.thread_time()
    _OWN.inside.append(0.0)
    try:
        yield
    except BaseException:
        _OWN.inside.pop()
        raise
    elapsed = time.thread_time() - begun
    own = elapsed - _OWN.inside.pop()
    if _OWN.inside:
        _OWN.inside[-1] += elapsed
    if own <= slowest * model + UNEXPECTED:
        add(model, own, *keys)


def add(model: float, measured: float, *keys: str) -> None:
    """Add the measured seconds of a part, and those of the model, under some keys."""
    with _LOCK:
        for key in keys:
            before = _SUMS.get(key, (0.0, 0.0))
            _SUMS[key] = before[0] + model, before[1] + measured


def attributed() -> float:
    """Return the seconds of all parts measured since :func:`forget`, each counted once by its general name."""
    with _LOCK:
        return sum(measured for key, (_, measured) in _SUMS.items() if is_general(key))


def is_general(key: str) -> bool:
    """Tell whether a key is the least specific name of its part: more specific ones add to it after a slash."""
    return "/" not in key


def forget() -> None:
    """Drop what was measured and not remembered."""
    with _LOCK:
        _SUMS.clear()


def speeds() -> Speeds:
    """Return what runs of this solver measured on this machine."""
    return Speeds(_read(speed_file()))


def remember() -> None:
    """Add what was measured to this machine's file, and drop it; never raises, at worst nothing is kept.

    Other runs may do the same at the same time: one after the other they read, add and replace the file whole.
    """
    with _LOCK:
        fresh = dict(_SUMS)
        _SUMS.clear()
    with suppress(Exception):
        path = speed_file()
        path.parent.mkdir(parents=True, exist_ok=True)
        with open(path.with_suffix(".lock"), "wb") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _write(path, _merged(_read(path), fresh))


def _merged(stored: Sums, fresh: Sums) -> Sums:
    """Return the sums of both, the fresh ones last, none above :data:`MOST_SECONDS`."""
    merged = {key: sums for key, sums in stored.items() if key not in fresh}
    for key, (model, measured) in fresh.items():
        if not (model > 0 and measured >= 0):
            continue
        before = stored.get(key, (0.0, 0.0))
        share = min(1.0, max(0.0, MOST_SECONDS - model) / before[0]) if before[0] > 0 else 0.0
        merged[key] = model + share * before[0], measured + share * before[1]
    return dict(list(merged.items())[-MOST_KEYS:])


@cache
def _machine() -> str:
    return f"{processor_name()}, solver {SOLVER_VERSION}, rotor-stator-workflow {workflow.__version__}"


def speed_file() -> Path:
    """Return this machine's file: one for each processor, version of the solver and of the package."""
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return home / "rotor-stator-workflow" / f"speed-{hashlib.sha256(_machine().encode()).hexdigest()[:16]}.json"


@cache
def processor_name() -> str:
    """Return the processor's name as the system names it."""
    with suppress(OSError):
        for line in Path("/proc/cpuinfo").read_text(encoding="utf-8", errors="replace").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _read(path: Path) -> Sums:
    """Return what a file holds; nothing where it is missing, damaged or another machine's."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
        if content["format"] != FORMAT or content["machine"] != _machine():
            return {}
        return {str(key): (float(model), float(measured)) for key, (model, measured) in content["parts"].items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _write(path: Path, sums: Sums) -> None:
    content = {"format": FORMAT, "machine": _machine(), "parts": sums}
    with tempfile.NamedTemporaryFile("w", dir=path.parent, suffix=".tmp", delete=False, encoding="utf-8") as file:
        file.write(json.dumps(content))  # at once: piece by piece it takes ten times as long
    os.replace(file.name, path)
