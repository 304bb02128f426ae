"""Directories in which compiled kernels are kept, one for each module of kernels and each state of its sources.

A directory is named by the module and by a digest of what its kernels are made of (:mod:`workflow.kernels.sources`),
of the versions of Python and numba and of the compiler used. A process that uses a directory holds a shared lock on a
file in it until it ends. Directories of other states of a module that no process has used for a day are removed, under
an exclusive lock: never one that a running process has.
"""

from __future__ import annotations

import fcntl
import hashlib
import os
import re
import shutil
import sys
import tempfile
import time
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Lock

from workflow.kernels.sources import ChangedSourceError, digest

PLAIN = "WORKFLOW_PLAIN_NUMBA"
"""Environment variable that has numba's own compiler used."""

UNUSED_SECONDS = 24 * 3600.0
"""Seconds that a directory of another state of the sources is kept after its last use: whoever goes back and forth
between two states within a day compiles nothing anew."""

_NAME = "rotor-stator-workflow"
_LOCK, _SOURCES, _REMOVED = "in-use", "sources.json", "removed-"

_MAKING = Lock()
_HELD: list[int] = []
"""Descriptors of the locks that this process holds until it ends."""


@cache
def root() -> Path:
    """Return the directory of all compiled kernels.

    It lies in ``NUMBA_CACHE_DIR`` where that is set, else beside the sources, else in the user's cache; it is a
    temporary one where none of them can be written.
    """
    chosen = os.environ.get("NUMBA_CACHE_DIR")
    home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    for parent in [Path(chosen)] if chosen else [Path(__file__).parent / "__pycache__", home]:
        directory = parent / _NAME
        try:
            directory.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=directory):
                pass
        except OSError:
            continue
        for leftover in directory.glob(f"{_REMOVED}*"):  # of a process that was killed while it removed one
            shutil.rmtree(leftover, ignore_errors=True)
        return directory
    return Path(tempfile.mkdtemp(prefix=f"{_NAME}-"))


def is_lasting() -> bool:
    """Tell whether other processes find the same directory."""
    return root().name == _NAME


def directory_of(module: str) -> Path | None:
    """Return where the compiled kernels of an imported module are kept.

    The directory exists and is locked against removal until this process ends. ``None`` where the module's source is
    unknown, or one of its sources has changed since this process began.
    """
    with _MAKING:
        return _directory_of(module, bool(os.environ.get(PLAIN)))


@cache
def _directory_of(module: str, plain: bool) -> Path | None:
    sources = None
    with suppress(ChangedSourceError):
        sources = digest(module, root() / _SOURCES)
    if sources is None:
        return None
    state = (sources, sys.version_info[:3], version("numba"), plain)
    directory = root() / f"{module}-{hashlib.sha256(repr(state).encode()).hexdigest()[:16]}"
    with suppress(OSError):  # a file system without locks
        _hold(directory)
    name = re.compile(re.escape(module) + "-[0-9a-f]{16}")
    for other in root().iterdir():
        if name.fullmatch(other.name) and other != directory:
            _remove_unused(other)
    return directory


def _hold(directory: Path) -> None:
    """Make a directory where there is none, and lock it until this process ends."""
    while True:
        directory.mkdir(parents=True, exist_ok=True)
        try:
            descriptor = os.open(directory / _LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        except FileNotFoundError:  # removed since it was made
            continue
        fcntl.flock(descriptor, fcntl.LOCK_SH)
        with suppress(FileNotFoundError):  # removed before it was locked
            if os.path.samestat(os.fstat(descriptor), os.stat(directory / _LOCK)):
                os.utime(descriptor)
                _HELD.append(descriptor)
                return
        os.close(descriptor)


def _remove_unused(directory: Path) -> None:
    """Remove a directory that no process holds and none has used for :data:`UNUSED_SECONDS`.

    It is given another name first, so that no process finds half of it.
    """
    with suppress(OSError):
        if time.time() - os.stat(directory / _LOCK).st_mtime <= UNUSED_SECONDS:
            return
        aside = directory.with_name(f"{_REMOVED}{os.getpid()}-{directory.name}")
        descriptor = os.open(directory / _LOCK, os.O_RDWR)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            directory.rename(aside)
        finally:
            os.close(descriptor)
        shutil.rmtree(aside, ignore_errors=True)
