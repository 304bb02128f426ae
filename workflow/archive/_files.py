"""Files that are either there whole or not at all, the lock of the libraries that read them, the error of this room."""

from __future__ import annotations

import os
import stat
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any


class ArchiveError(Exception):
    """An archive or its shards cannot be read or written; the message says where, what and what to do."""


class _ArchiveLock:
    """One per process around netCDF-C and HDF5, wherever it is unpickled; its thread may take it again.

    xarray is given it for lazy reads, and it is held while xarray opens a file: metadata are read without a lock.
    """

    def __init__(self) -> None:
        held = threading.RLock()
        self.acquire, self.release = held.acquire, held.release

    def __enter__(self) -> None:
        self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def __reduce__(self) -> str:
        return "LOCK"


LOCK = _ArchiveLock()


def reason(error: BaseException) -> str:
    """Return what the operating system says of an error, without paths and library internals."""
    if isinstance(error, OSError) and error.errno is not None and error.errno > 0:
        return os.strerror(error.errno).lower()
    return " ".join(str(error).split()) or type(error).__name__


def usable(path: str | Path) -> Path:
    """Return the path of an archive, which need not exist; refuse one that can never be an archive's.

    Those are paths that are not UTF-8, as netCDF-C wants it, or have a backslash, loops of links, pipes and devices.
    """
    path = Path(path)
    try:
        if b"\\" in str(path.absolute()).encode():
            raise ArchiveError(
                f"{path.absolute()}: has a backslash, which NetCDF's library takes for a slash; rename it, or choose "
                "another archive with -o"
            )
        kind = stat.S_IFMT(path.stat().st_mode)
    except UnicodeEncodeError:
        raise ArchiveError(
            f"{path.absolute()}: its name is not UTF-8, which NetCDF files need; rename it, or choose another archive "
            "with -o"
        ) from None
    except (FileNotFoundError, NotADirectoryError):
        return path
    except (OSError, ValueError) as error:  # ValueError: a null character
        raise ArchiveError(f"{path}: cannot be an archive: {reason(error)}; name another file") from None
    if kind not in (stat.S_IFREG, stat.S_IFDIR):
        raise ArchiveError(f"{path}: a pipe or a device, not a file; name a file")
    return path


def file_of(archive: Path) -> tuple[int, int] | None:
    """Return which file is under an archive's name, ``None`` where none is."""
    try:
        about = archive.stat()
    except FileNotFoundError:
        return None
    return about.st_ino, about.st_mtime_ns


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
        if not directory.exists():
            raise ArchiveError(
                f"{directory}: {what} could not be written: {why}. The directory does not exist, or was removed with "
                "what was stored in it; give the same command again, it runs what is missing"
            ) from error
        if free is not None:
            why += f" ({free / 2**20:.0f} MiB free there)"
        raise ArchiveError(
            f"{directory}: {what} could not be written: {why}. Finished shards stay where they are: "
            "make the directory writable or make room, then give the same command again"
        ) from error


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn what libraries raise on a damaged archive into an :class:`ArchiveError`."""
    try:
        yield
    except (ArchiveError, Warning):  # of chunks that dask is asked for, where warnings are errors
        raise
    except Exception as error:  # whatever they make of a file that is not what it was
        raise ArchiveError(
            f"{path}: damaged, or not a NetCDF-4 file ({reason(error)}); "
            "restore a copy, or move it away and run its study again"
        ) from error


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open an archive with h5py, under its lock."""
    import h5py

    with LOCK, reading(path), h5py.File(path, "r") as file:
        yield file


def sync(path: Path) -> None:
    """Wait until a file's bytes, or a directory's entries, are on the disk."""
    descriptor = os.open(path, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def replaceable(path: Path) -> os.stat_result | None:
    """Return what the system says of a file that is to be replaced, ``None`` of none; refuse one that is read-only."""
    try:
        about = path.stat()
    except FileNotFoundError:
        return None
    if not os.access(path, os.W_OK) or not about.st_mode & 0o222:
        raise ArchiveError(f"{path}: read-only; make it writable (chmod u+w), or choose another file with -o")
    return about


def put(aside: Path, path: Path) -> None:
    """Rename a file that was made aside, with the mode of the one that it replaces, and the owner where it may be."""
    about = replaceable(path)
    if about is not None:
        with suppress(OSError):
            os.chown(aside, about.st_uid, about.st_gid)
        os.chmod(aside, stat.S_IMODE(about.st_mode))
    os.replace(aside, path)
    sync(path.parent)


def commit(path: Path, *pieces: Any) -> None:
    """Write pieces of bytes aside as ``*.tmp``, flush it, and :func:`put` it under ``path``: all of it or nothing.

    A link goes on to lead to it. Raises :class:`OSError` where the disk is full or the directory not writable.
    """
    path = Path(os.path.realpath(path))
    aside = path.with_name(f"{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        with open(aside, "wb") as file:
            file.writelines(pieces)
            file.flush()
            os.fsync(file.fileno())
        put(aside, path)
    except BaseException as error:
        aside.unlink(missing_ok=True)
        if isinstance(error, OSError) and error.filename is None:  # as of a full disk
            error.filename = str(path)
        raise
