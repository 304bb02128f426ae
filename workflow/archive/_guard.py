"""Damaged files are tried in a process of their own before this one opens them.

HDF5 does not check what it reads in heaps: of a few hundred files with flipped bytes one made it loop for ever,
and some left it in a state in which the next file crashed the interpreter.
"""

from __future__ import annotations

import faulthandler
import os
import select
import signal
import warnings
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

from workflow.archive._files import ArchiveError, reason, unreadable

LONGEST = 20.0
"""Seconds that opening a file may take; it takes milliseconds, and much longer on a slow or busy disk."""

_SOUND, _REFUSED, _DAMAGED = 0, 1, 2

_VOUCHED: set[tuple[int, ...]] = set()
"""Files that this process has made and read back."""


def vouch(path: Path) -> None:
    """Have a file that this process has made and read back not tried out, as long as it does not change."""
    _VOUCHED.add(identity(path))


def is_vouched_for(path: Path) -> bool:
    """Tell whether this process has made and read back a file, which has not changed since."""
    return identity(path) in _VOUCHED


def try_out(path: Path, work: Callable[[Path], str], longest: float | None = None) -> str:
    """Do something with a file in a forked process and return the text that it gives there.

    The caller does the same here only if it ends well there. A file that has not changed since is not
    tried again. The text is empty for a file that this process has made, which is not tried out.

    Parameters
    ----------
    path
        The file.
    work
        What to do with it.
    longest
        Seconds that it may take, :data:`LONGEST` where not given.

    Raises
    ------
    ArchiveError
        What the forked process said of the file, or that it came to no end or crashed.
    """
    if is_vouched_for(path):
        return ""
    ended, answer = _tried(work, path, LONGEST if longest is None else longest, *identity(path))
    if ended != _SOUND:
        raise ArchiveError(answer) if ended == _REFUSED else unreadable(path, RuntimeError(answer))
    return answer


def identity(path: Path) -> tuple[int, ...]:
    """Return what identifies a file in its present state: nobody can set its last number back.

    Raises
    ------
    OSError
        There is no such file.
    """
    about = path.stat()
    return about.st_size, about.st_mtime_ns, about.st_ino, about.st_dev, about.st_ctime_ns


@lru_cache(maxsize=1024)
def _tried(work: Callable[[Path], str], path: Path, longest: float, *_unchanged: int) -> tuple[int, str]:
    from workflow.archive._lock import LOCK

    with LOCK, warnings.catch_warnings():  # nobody else is within HDF5, nor forks with this pipe open
        warnings.simplefilter("ignore", DeprecationWarning)  # that other threads exist: the child uses none
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            faulthandler.disable()  # the parent reports how it ends
            os.write(writing, _outcome(work, path))
            os._exit(0)
        os.close(writing)
    try:
        wait = select.poll()
        wait.register(reading)  # the child writes its answer, or its end closes the pipe
        ended = bool(wait.poll(1e3 * longest))
        if not ended:
            os.kill(child, signal.SIGKILL)
        answer = os.read(reading, select.PIPE_BUF) if ended else b""
    except BaseException:  # Ctrl-C: a child that loops within HDF5 does not notice it
        os.kill(child, signal.SIGKILL)
        raise
    finally:
        os.close(reading)
        _, status = os.waitpid(child, 0)
    if not ended:
        return _DAMAGED, "opening it comes to no end"
    if not answer:
        how = f"with {signal.Signals(os.WTERMSIG(status)).name}" if os.WIFSIGNALED(status) else "the process"
        return _DAMAGED, f"opening it ends {how}"
    return answer[0], answer[1:].decode(errors="replace")


def _outcome(work: Callable[[Path], str], path: Path) -> bytes:
    """Do the work in the child; return how it ended, one byte, and its text or the error's, cut to one write."""
    try:
        return bytes([_SOUND]) + work(path).encode()[:4000]
    except ArchiveError as error:
        return bytes([_REFUSED]) + str(error).encode()[:4000]
    except BaseException as error:
        return bytes([_DAMAGED]) + reason(error).encode()[:4000]
