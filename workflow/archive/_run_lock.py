"""One run at a time on the shards of an archive."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from workflow.archive._files import ArchiveError, reason, require_directory, writing

HOLDER = "holder"
"""File in the directory of the shards that the running process keeps locked."""


@contextmanager
def run_lock(parts: Path) -> Iterator[None]:
    """Lock the directory of an archive's shards against other runs, and make it where it is missing.

    The operating system unlocks it where a process crashes. A directory that is empty at the end is removed.

    Raises
    ------
    ArchiveError
        Another run holds it, or it cannot be made.
    """
    with _locked(parts) as file:
        try:
            with writing("the number of this process", parts):
                file.truncate(0)
                os.write(file.fileno(), f"process {os.getpid()}".encode())  # nothing is left to write as it closes
            yield
        finally:
            with suppress(OSError):
                if [each.name for each in parts.iterdir()] == [HOLDER]:
                    (parts / HOLDER).unlink()
                    parts.rmdir()


def _locked(parts: Path) -> IO[str]:
    if not parts.parent.is_dir():
        raise ArchiveError(f"{parts.parent}: no such directory; make it, or choose another place with -o")
    require_directory(parts)
    while True:
        with writing("the directory of the shards", parts.parent):
            parts.mkdir(exist_ok=True)
        try:
            file = open(parts / HOLDER, "a+")  # noqa: SIM115 - locked as long as it is open
        except FileNotFoundError:
            continue  # the other run just finished and removed the directory
        except OSError as error:
            raise ArchiveError(f"{parts}: cannot be written to; make it writable, or choose another archive") from error
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            file.seek(0)
            who = file.read().strip() or "a process that has not said which"
            file.close()
            why = f"another run has it ({who}); wait for it or stop it, then try again"
            if not isinstance(error, BlockingIOError | PermissionError):
                why = f"its file system has no locks ({reason(error)}); choose an archive on another one with -o"
            raise ArchiveError(f"{parts}: {why}") from error
        if _same_file(file, parts / HOLDER):
            return file
        file.close()


def _same_file(file: IO[str], path: Path) -> bool:
    """Tell whether the locked file is still the one under its name, not a removed one."""
    try:
        return os.path.samestat(os.fstat(file.fileno()), path.stat())
    except FileNotFoundError:
        return False
