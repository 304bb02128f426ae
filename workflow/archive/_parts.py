"""The directory beside an unfinished archive: its lock, the command that its run was given, what to clear away."""

from __future__ import annotations

import fcntl
import json
import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import IO

from workflow.archive._files import ArchiveError, commit, reason, sync, usable, writing

COMMAND, SHARD = "command.json", ".shard"
"""File of the command, and suffix of the shards."""

HOLDER = "holder"
"""File that the running process keeps locked."""


@dataclass(frozen=True)
class Command:
    """What a run was asked for."""

    texts: Mapping[str, str]
    """Those of the provenance group: the study, its files, counts of modes that tolerances decided, software."""
    warnings: str = ""
    """What the plan warned of, a line each."""
    archive: tuple[int, int] | None = None
    """Which file was under the archive's name, ``None`` where none was: another one may come under it, with the very
    same bytes."""
    begun: int = 0
    """Number of the command; those of later ones are larger."""
    retry: bool = False
    recompute: bool = False
    drop: bool = False
    """``retry``, ``recompute``, ``drop``: what it does with cases that are stored already."""

    @property
    def key(self) -> str:
        """Identity of study and solver version."""
        return self.texts["key"]

    @property
    def study(self) -> str:
        """Name of the study."""
        return str(json.loads(self.texts["resolved"])["study"])


def parts_of(path: str | Path) -> Path:
    """Return the directory that holds an archive's shards while its study runs; a link is followed."""
    path = usable(path)
    path = path.resolve() if path.is_symlink() else path
    return path.with_name(path.name + ".parts")


@contextmanager
def run_lock(parts: Path) -> Iterator[None]:
    """Keep other runs from an archive's shards, or refuse to; their directory is made where it is missing.

    The operating system unlocks it where a process crashes. A directory that is empty at the end is removed.
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
    """Return the file that this process has locked; it is unlocked when it is closed."""
    if not parts.parent.is_dir():
        raise ArchiveError(f"{parts.parent}: no such directory; make it, or choose another place with -o")
    while True:
        _make(parts)
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
        with suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(file.fileno()), (parts / HOLDER).stat()):
                return file
        file.close()  # it was removed before it was locked


def _make(parts: Path) -> None:
    if (parts.exists() or parts.is_symlink()) and not parts.is_dir():
        raise ArchiveError(
            f"{parts}: a file, where a run keeps its shards in a directory; move it away, or choose another archive "
            "with -o"
        )
    with writing("the directory of the shards", parts.parent):
        parts.mkdir(exist_ok=True)


def start_parts(parts: str | Path, command: Command) -> None:
    """Make the directory for the shards of a command, or take up one that a run left behind.

    The command is recorded in it, leftovers of interrupted writes are swept, shards stay. One run at a time: whoever
    calls this holds the directory. One with something in it that no run left is refused.
    """
    parts = Path(parts)
    _make(parts)
    if others := _others(parts):
        raise ArchiveError(
            f"{parts}: holds {others[0]}, which no run left there; move it away, or choose another archive with -o"
        )
    with writing("the command", parts):
        sync(parts.parent)
        for leftover in parts.glob("*.tmp"):
            leftover.unlink(missing_ok=True)
        commit(parts / COMMAND, json.dumps(asdict(command)).encode())


def _is_ours(file: Path) -> bool:
    """Tell whether a run may have left a file: only such files go in the end."""
    named = file.name in (COMMAND, HOLDER) or file.suffix in (".tmp", SHARD) or file.name.startswith(".nfs")
    return named and file.is_file()


def _others(parts: Path) -> list[str]:
    """Return the names of what no run left in the directory of the shards."""
    return sorted(file.name for file in parts.iterdir() if not _is_ours(file))


def read_command(parts: str | Path) -> Command | None:
    """Return the command that :func:`start_parts` recorded, ``None`` where there is none; refuse a damaged one."""
    path = Path(parts) / COMMAND
    try:
        stored = json.loads(path.read_bytes())
        archive = stored["archive"]
        command = Command(**{**stored, "archive": None if archive is None else tuple(archive)})
        assert command.study
        assert command.key
        return command
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {reason(error)}") from error
    except (ValueError, KeyError, TypeError, AssertionError) as error:
        raise ArchiveError(
            f"{path}: damaged; remove this file and give the command again: stored cases of the study are taken"
        ) from error


def remove_parts(parts: str | Path) -> None:
    """Remove the directory of the shards, if there is one; the archive must be in place before."""
    parts = Path(parts)
    try:
        for file in filter(_is_ours, parts.iterdir()):
            file.unlink(missing_ok=True)
        parts.rmdir()
    except FileNotFoundError:
        return
    except OSError as error:
        if parts.is_dir() and all(file.name.startswith(".nfs") for file in parts.iterdir()):
            return  # NFS keeps what is still open under such names; the next run finds an empty directory
        if parts.is_dir() and (others := _others(parts)):
            raise ArchiveError(
                f"{parts}: the archive is complete; the directory stays because it holds {others[0]}, which no run "
                "left there: move it away and remove the directory"
            ) from error
        raise ArchiveError(
            f"{parts}: the archive is complete, but its shards could not be removed: {reason(error)}; "
            "remove the directory by hand"
        ) from error
