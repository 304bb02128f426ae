"""Reading archives, finished or not."""

from __future__ import annotations

import atexit
import os
import tempfile
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._content import hash_content
from workflow.archive._create import PROVENANCE
from workflow.archive._files import ArchiveError, damaged, reading, reason, writing
from workflow.archive._gather import assemble
from workflow.archive._guard import try_out
from workflow.archive._judge import as_text, judge
from workflow.archive._layout import STATUS
from workflow.archive._parts import LAYOUT, parts_of, read_layout
from workflow.archive._shard import find_shards

if TYPE_CHECKING:
    import xarray as xr

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"


def open_archive(path: str | Path, chunks: Any = None) -> xr.Dataset:
    """Open an archive lazily: values are read when they are used.

    While the study still runs, or was interrupted, this is a view of the shards there are at this
    moment: status ``not_run`` and NaN elsewhere.

    Parameters
    ----------
    path
        The archive, as given to ``workflow run``.
    chunks
        As in :func:`xarray.open_dataset`, for dask arrays; ``{}`` takes the chunks of the file.

    Raises
    ------
    ArchiveError
        There is no such file, or it is not an archive of this workflow.
    """
    path = Path(path)
    if _unfinished(path):
        try:
            return _open_view(path, chunks)
        except ArchiveError:
            if not path.exists():  # the run may have ended just now
                raise
    return _open_dataset(path, chunks, path)


def provenance(path: str | Path) -> dict[str, str]:
    """Return the texts of an archive's provenance group: ``key``, ``content_hash`` and the study's own.

    An unfinished archive has no ``content_hash`` yet.

    Raises
    ------
    ArchiveError
        There is no such file, or it is not an archive of this workflow.
    """
    path = Path(path)
    if _unfinished(path):
        layout = read_layout(parts_of(path))
        return {"key": layout.key, **layout.provenance}
    import h5py

    from workflow.archive._lock import LOCK

    _look(path)
    try_out(path, _read_at_all)
    try:
        with LOCK, h5py.File(path, "r") as file:
            return _texts(file[PROVENANCE])
    except (OSError, RuntimeError, LookupError) as error:
        raise damaged(path, error) from error


def _texts(group: Any) -> dict[str, str]:
    found = {name: as_text(value) for name, value in group.attrs.items() if not name.startswith("_")}
    return found | {name: as_text(item[()].tobytes()) for name, item in group.items() if item.dtype == "S1"}


def statuses(path: str | Path) -> NDArray[np.int8]:
    """Return the status of every case of a finished archive, without what xarray takes to load.

    Raises
    ------
    ArchiveError
        There is no such file, or it is not an archive of this workflow.
    """
    import h5py

    from workflow.archive._lock import LOCK

    path = Path(path)
    _look(path)
    try_out(path, _read_at_all)
    with LOCK, reading(path), h5py.File(path, "r") as file:
        return np.asarray(file[STATUS][...], dtype=np.int8)


def content_hash(path: str | Path) -> str:
    """Compute the hash of a finished archive's decoded arrays anew, see :func:`hash_content`.

    The one it was stored with is ``provenance(path)["content_hash"]``.

    Raises
    ------
    ArchiveError
        There is no such file, it is unfinished or damaged, or not an archive of this workflow.
    """
    path = Path(path)
    if _unfinished(path):
        raise ArchiveError(f"{path}: unfinished, only its shards are there; run the study to its end first")
    provenance(path)
    try:
        return hash_content(path)
    except (OSError, RuntimeError) as error:
        raise damaged(path, error) from error


def archive_key(path: str | Path) -> str | None:
    """Return the key of the study that an archive or its shards belong to, ``None`` if there is neither.

    Raises
    ------
    ArchiveError
        A file is there, but it is not an archive of this workflow: not to be overwritten.
    """
    path = Path(path)
    if not path.exists() and not _unfinished(path):
        return None
    return provenance(path)["key"]


def _unfinished(path: Path) -> bool:
    return not path.exists() and (parts_of(path) / LAYOUT).exists()


def _open_view(path: Path, chunks: Any) -> xr.Dataset:
    """Gather what is there into a temporary file, which goes when it is closed, or with the process."""
    parts = parts_of(path)
    layout = read_layout(parts)
    descriptor, name = tempfile.mkstemp(prefix=f"{path.stem}-", suffix=".nc")
    os.close(descriptor)
    view = Path(name)
    try:
        with writing("a view of the shards", view.parent):
            assemble(layout, find_shards(parts, layout), view)
        opened = _open_dataset(view, chunks, path)
    except BaseException:
        view.unlink(missing_ok=True)
        raise

    def discard() -> None:
        opened.close()
        view.unlink(missing_ok=True)

    dataset = opened.copy()
    dataset.set_close(discard)
    atexit.register(view.unlink, missing_ok=True)
    return dataset


def _open_dataset(path: Path, chunks: Any, named: Path) -> xr.Dataset:
    _look(path)
    for name in _LOADED:
        import_module(name)
    try_out(path, _opened_at_all)
    import xarray as xr

    from workflow.archive._lock import LOCK

    try:
        with LOCK:
            dataset = xr.open_dataset(path, engine="netcdf4", chunks=chunks, decode_timedelta=False, lock=LOCK)
    except Exception as error:  # whatever xarray makes of a file that is not what it was
        raise damaged(named, error) from error
    return dataset


_LOADED = ("xarray", "netCDF4", "dask.array", "pint")
"""What xarray loads to open a file: once here, not in every process that tries a file out."""


def _look(path: Path) -> None:
    """Say what is wrong with a path before a library says it less clearly."""
    try:
        with open(path, "rb") as file:
            signature = file.read(len(HDF5_SIGNATURE))
    except FileNotFoundError as error:
        raise ArchiveError(
            f"{path}: no such archive, nor {parts_of(path).name} of one in the making; "
            "`workflow run` makes it from a study"
        ) from error
    except IsADirectoryError as error:
        hint = f"the archive is {path.with_suffix('').name}" if path.suffix == ".parts" else "name a file"
        raise ArchiveError(f"{path}: a directory, not an archive; {hint}") from error
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {reason(error)}") from error
    if signature != HDF5_SIGNATURE:
        raise ArchiveError(f"{path}: not a NetCDF-4 file; an archive that `workflow run` wrote is expected")


def _read_at_all(path: Path) -> None:
    """Judge a file's headers, then read its texts as :func:`provenance` does; damaged values harm nobody."""
    import h5py

    judge(path)
    with h5py.File(path, "r") as file:
        _texts(file[PROVENANCE])


def _opened_at_all(path: Path) -> None:
    """Judge a file's headers, then open it as :func:`open_archive` does."""
    judge(path)
    import xarray as xr

    xr.open_dataset(path, engine="netcdf4", decode_timedelta=False, cache=False).close()
