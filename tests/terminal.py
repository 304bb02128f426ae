"""Commands as a user types them, and processes that tests wait for."""

import contextlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from typer.testing import CliRunner

from workflow.cli import app


def typed(*words: str | Path, cwd: Path, **more: Any) -> subprocess.CompletedProcess[str]:
    """Run a command as a shell does, in a process of its own, and return what it said and how it ended."""
    command = [sys.executable, "-m", "workflow", *map(str, words)]
    return subprocess.run(command, cwd=cwd, capture_output=True, encoding="utf-8", timeout=120, **more)


def workflow(*words: str | Path, cwd: Path) -> subprocess.CompletedProcess[str]:
    """Run a command in this process, which has imported already what it needs."""
    with contextlib.chdir(cwd):
        ran = CliRunner().invoke(app, [str(word) for word in words])
    return subprocess.CompletedProcess(words, ran.exit_code, ran.stdout, ran.stderr)


def told(*words: str | Path) -> tuple[int, str]:
    """Run a command in this process and return its exit status and all that it said, which is no traceback."""
    ran = CliRunner().invoke(app, [str(word) for word in words])
    assert ran.exception is None or isinstance(ran.exception, SystemExit), ran.exception
    return ran.exit_code, ran.output


@contextlib.contextmanager
def started(*words: str | Path, **more: Any) -> Iterator[subprocess.Popen[str]]:
    """Start Python with some arguments in a session of its own; nothing of it is left in the end."""
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    command = [sys.executable, *map(str, words)]
    process = subprocess.Popen(command, text=True, start_new_session=True, **pipes, **more)
    try:
        yield process
    finally:
        if alive(process.pid):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


PATIENCE = 60.0
"""Seconds after which a test has failed."""


def until(holds: Callable[[], bool]) -> None:
    """Wait for something to be so."""
    end = time.monotonic() + PATIENCE
    while not holds():
        assert time.monotonic() < end, "waited too long"
        time.sleep(0.02)


def children(process: int) -> list[int]:
    """Return the processes that a process has started."""
    lists = [task.read_text() for task in Path(f"/proc/{process}/task").glob("*/children")]
    return [int(child) for text in lists for child in text.split()]


def alive(process: int) -> bool:
    """Tell whether a process runs; one that is dead and not yet waited for does not."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
