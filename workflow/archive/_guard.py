"""Damaged files are tried in a process of their own before this one opens them.

HDF5 trusts what it reads in heaps without checksums: of a few hundred files with flipped bytes one sent
it round for ever, and some left it in a state in which the next file crashed the interpreter.
"""

from __future__ import annotations

import os
import signal
import time
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from workflow.archive._files import ArchiveError, damaged, reason

LONGEST = 5.0
"""Seconds that opening a file may take; it takes milliseconds."""

_SOUND, _REFUSED, _DAMAGED = 0, 1, 2


def try_out(path: Path, work: Callable[[Path], None]) -> None:
    """Do something with a file in a forked process, and again here only if it ends well there.

    A file that has not changed since is not tried again.

    Raises
    ------
    ArchiveError
        What the forked process said of the file, or that it came to no end or crashed.
    """
    about = path.stat()
    ended, told = _tried(work, path, about.st_size, about.st_mtime_ns, about.st_ino)
    if ended != _SOUND:
        raise ArchiveError(told) if ended == _REFUSED else damaged(path, RuntimeError(told))


@lru_cache(maxsize=1024)
def _tried(work: Callable[[Path], None], path: Path, *_unchanged: int) -> tuple[int, str]:
    from workflow.archive._lock import LOCK

    reading, writing = os.pipe()
    with LOCK, warnings.catch_warnings():  # nobody else is within HDF5
        warnings.simplefilter("ignore", DeprecationWarning)  # that other threads exist: the child uses none
        child = os.fork()
    if child == 0:
        os._exit(_told(work, path, writing))
    os.close(writing)
    try:
        status = _waited_for(child)
        with open(reading, "rb", closefd=False) as told:
            said = told.read().decode(errors="replace") if status is not None else ""
    finally:
        os.close(reading)
    if status is None:
        return _DAMAGED, "opening it comes to no end"
    if os.WIFSIGNALED(status):
        return _DAMAGED, f"opening it ends with {signal.Signals(os.WTERMSIG(status)).name}"
    return os.WEXITSTATUS(status), said


def _told(work: Callable[[Path], None], path: Path, writing: int) -> int:
    """Do the work in the child and write what was wrong; less than a pipe holds."""
    try:
        work(path)
    except ArchiveError as error:
        os.write(writing, str(error).encode()[:4000])
        return _REFUSED
    except BaseException as error:
        os.write(writing, reason(error).encode()[:4000])
        return _DAMAGED
    return _SOUND


def _waited_for(child: int) -> int | None:
    """Return the status of a child that ends in time, else end it and return ``None``."""
    end, pause = time.monotonic() + LONGEST, 1e-4
    while time.monotonic() < end:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return status
        time.sleep(pause)
        pause = min(2 * pause, 0.05)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return None
