"""The command line as a process that can be watched and killed."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from workflow.archive import parts_of

PATIENCE = 120.0
"""Seconds after which a test has failed."""

FINELY = """
import time
import workflow.solve._tasks as cutting
import workflow.run._task as running
from workflow.cli import main
cutting.LONGEST, cutting.unit = 1e-9, lambda grid, *_: grid.inner_shape[-1]
write = running.write_shard
def slowly(*words):
    time.sleep({pause})
    return write(*words)
running.write_shard = slowly
main()
"""
"""The command line with a task for each unit, none of which ends at once: there is time to kill it."""

Process = subprocess.Popen[str]


@contextmanager
def started(*words: str | Path, pause: float = 0.02) -> Iterator[Process]:
    command = [sys.executable, "-c", FINELY.format(pause=pause), *map(str, words)]
    with subprocess.Popen(command, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                process.send_signal(signal.SIGKILL)


def wait_until(what: Callable[[], bool], process: Process) -> bool:
    """Wait for something to be so while a process runs; tell whether it came to be."""
    until = time.monotonic() + PATIENCE
    while not what():
        if process.poll() is not None:
            return False
        if time.monotonic() > until:
            raise TimeoutError
        time.sleep(5e-4)
    return True


def shards(archive: Path) -> set[str]:
    """Return the names of the shards of an archive."""
    return {shard.name for shard in parts_of(archive).glob("*.shard")}


def is_gathered(archive: Path, since: float) -> bool:
    """Tell whether an archive has begun to be put together since a time; a run that was killed leaves what it had."""
    try:
        return (parts_of(archive) / f"{archive.name}.tmp").stat().st_mtime >= since
    except FileNotFoundError:
        return False
