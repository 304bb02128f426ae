"""Files that are either there whole or not at all, and the one error of this floor."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


class ArchiveError(Exception):
    """An archive or its shards cannot be read or written; the message says where, what and what to do."""


def reason(error: BaseException) -> str:
    """Return what the operating system says of an error, without paths and library internals."""
    if isinstance(error, OSError) and error.errno is not None and error.errno > 0:
        return os.strerror(error.errno).lower()
    return " ".join(str(error).split()) or type(error).__name__


def free_space(directory: Path) -> int:
    """Return the bytes an ordinary user may still write to the file system of ``directory``."""
    status = os.statvfs(directory)
    return status.f_bavail * status.f_frsize


@contextmanager
def writing(what: str, directory: Path) -> Iterator[None]:
    """Turn a failed write into an :class:`ArchiveError` that says why and that nothing finished is lost.

    netCDF-C and HDF5 report a full disk as a bare ``RuntimeError`` ("HDF error"), hence the look at
    what is free.
    """
    try:
        yield
    except (OSError, RuntimeError) as error:
        why = reason(error)
        try:
            free = free_space(directory)
        except OSError:
            free = None
        if free is not None:
            why += f" ({free / 2**20:.0f} MiB free there)"
        raise ArchiveError(
            f"{directory}: {what} could not be written: {why}. Finished shards stay where they are: "
            "make the directory writable or make room, then give the same command again"
        ) from error


def damaged(path: Path, error: BaseException) -> ArchiveError:
    """Return what to say of an archive that a library cannot read."""
    return ArchiveError(
        f"{path}: damaged, or not a NetCDF-4 file ({reason(error)}); "
        "restore a copy, or move it away and run its study again"
    )


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn what libraries raise on a damaged archive into an :class:`ArchiveError`."""
    try:
        yield
    except (OSError, RuntimeError, LookupError, ValueError, TypeError) as error:
        raise damaged(path, error) from error


def sync(path: Path) -> None:
    """Wait until a file's bytes, or a directory's entries, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def commit(path: Path, data: bytes) -> None:
    """Write ``data`` aside as ``*.tmp``, flush it, and rename it to ``path``: all of it or nothing.

    Raises
    ------
    OSError
        The disk is full, or the directory missing or not writable. Nothing is left behind.
    """
    aside = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(aside, path)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise
    sync(path.parent)
