"""The directory beside an unfinished archive: the command that its run was given, and what to clear away."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from workflow.archive._files import ArchiveError, commit, reason, require_directory, sync, usable, writing
from workflow.archive._run_lock import HOLDER
from workflow.archive._shard import SUFFIX

COMMAND = "command.json"


@dataclass(frozen=True)
class Command:
    """What a run was asked for.

    Attributes
    ----------
    texts
        Those of the provenance group: the study, its files, counts of modes that tolerances decided, software.
    warnings
        What the plan warned of, a line each.
    archive
        Which file was under the archive's name, ``None`` where none was: another one may come under it, with the very
        same bytes.
    begun
        Number of the command; those of later ones are larger.
    retry, recompute, drop, since
        What it does with cases that are stored already.
    """

    texts: Mapping[str, str]
    warnings: str = ""
    archive: tuple[int, int] | None = None
    begun: int = 0
    retry: bool = False
    recompute: bool = False
    drop: bool = False
    since: int = 0

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


def start_parts(parts: str | Path, command: Command) -> None:
    """Make the directory for the shards of a command, or take up one that a run left behind.

    The command is recorded in it, leftovers of interrupted writes are swept, shards
    stay. One run at a time: whoever calls this holds the directory.

    Raises
    ------
    ArchiveError
        The directory holds what no run left there, or cannot be written.
    """
    parts = Path(parts)
    require_directory(parts)
    with writing("the directory of the shards", parts.parent):
        parts.mkdir(exist_ok=True)
        sync(parts.parent)
    if others := _others(parts):
        raise ArchiveError(
            f"{parts}: holds {others[0]}, which no run left there; move it away, or choose another archive with -o"
        )
    with writing("the command", parts):
        for leftover in parts.glob("*.tmp"):
            leftover.unlink(missing_ok=True)
        commit(parts / COMMAND, json.dumps(asdict(command)).encode())


def _is_ours(file: Path) -> bool:
    """Tell whether a run may have left a file: only such files go in the end."""
    named = file.name in (COMMAND, HOLDER) or file.suffix in (".tmp", SUFFIX) or file.name.startswith(".nfs")
    return named and file.is_file()


def _others(parts: Path) -> list[str]:
    """Return the names of what no run left in the directory of the shards."""
    return sorted(file.name for file in parts.iterdir() if not _is_ours(file))


def read_command(parts: str | Path) -> Command | None:
    """Return the command that :func:`start_parts` recorded, ``None`` where there is none.

    Raises
    ------
    ArchiveError
        It cannot be read.
    """
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
    """Remove the directory of the shards, if there is one; the archive must be in place before.

    Raises
    ------
    ArchiveError
        It cannot be removed.
    """
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
