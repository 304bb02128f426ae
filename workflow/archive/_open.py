"""Reading archives, finished or not."""

from __future__ import annotations

import atexit
import math
import os
import signal
import tempfile
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._checksums import has_sound_head, hash_content, is_intact, is_sealed
from workflow.archive._files import ArchiveError, opened, reading, reason, usable, writing
from workflow.archive._gather import FORMAT, FORMAT_NAME, assemble
from workflow.archive._parts import COMMAND, Command, parts_of, read_command
from workflow.archive._provenance import grid_of
from workflow.archive._stored import MESSAGE, PROVENANCE, STATUS, Stored, find_shards
from workflow.cases import case_hashes
from workflow.plan import template
from workflow.study import StudyError

if TYPE_CHECKING:
    import xarray as xr

HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"

_SECONDS = 4.0
"""Processor time after which reading counts as endless; archives of 1e5 chunks take a tenth of it."""

_MOST_DEFLATED = 1032
"""Bytes that one byte of zlib's stands for, at most (RFC 1951: 258 bytes in two bits)."""


def open_archive(path: str | Path, chunks: Any = None) -> xr.Dataset:
    """Open an archive as :func:`xarray.open_dataset` does, with an index for each coordinate of a zip.

    Values are read when they are used; a chunk whose bytes have changed is an error then. While the study still runs,
    or was interrupted, this is a view of the shards there are at this moment: status ``not_run`` and NaN elsewhere.

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
    path = usable(path)
    command = _unfinished(path)
    if command is not None:
        try:
            return _open_view(path, command, chunks)
        except ArchiveError:
            if not path.exists():  # the run may have ended just now
                raise
    return _open_dataset(path, chunks, path)


def provenance(path: str | Path) -> dict[str, str]:
    """Return the texts of an archive's provenance group: ``key``, ``content_hash`` and the study's own.

    An unfinished archive has no ``content_hash`` yet. What is no archive of this workflow is refused.
    """
    path = usable(path)
    command = _unfinished(path)
    if command is not None:
        return dict(command.texts)
    with _read(path) as file:
        if PROVENANCE not in file:
            raise ArchiveError(
                f"{path}: has no {PROVENANCE}, as a copy that another program saved; "
                "the archive that `workflow run` wrote is expected"
            )
        group = file[PROVENANCE]
        attributes = {name: _as_text(value) for name, value in group.attrs.items() if not name.startswith("_")}
        return attributes | {name: item[()].tobytes().decode() for name, item in group.items() if item.dtype == "S1"}


def study_text(path: str | Path) -> tuple[str, str]:
    """Return the study as written that a sound archive came of, and the files that came with it, as one text."""
    path = usable(path)
    if path.exists():
        require_whole(path)
    texts = provenance(path)
    if "study" not in texts:
        raise ArchiveError(f"{path}: its provenance is not as `workflow run` writes it: no study; restore a copy")
    return texts["study"], texts.get("files", "")


def statuses(path: str | Path) -> NDArray[np.int8]:
    """Return the status of every case of a finished archive; refuse what is none."""
    with _read(usable(path)) as file:
        return np.asarray(file[STATUS][...])


def content_hash(path: str | Path) -> str:
    """Compute the hash of a finished archive's decoded arrays anew, see :func:`hash_content`; of a damaged one too.

    The one it was stored with is ``provenance(path)["content_hash"]``. Values that cannot be read are refused.
    """
    path = usable(path)
    with _read(path):
        pass  # what is no archive of this workflow is refused
    with reading(path):
        return hash_content(path)


def is_whole(path: str | Path) -> bool:
    """Tell whether a finished archive's bytes are those that were written; refuse what is none.

    All of them are read, at about 1.5 GB/s from memory, before a library reads any.
    """
    path = usable(path)
    _look(path)
    try:
        if is_sealed(path):
            return is_intact(path)
    except OSError as error:
        raise ArchiveError(f"{path}: cannot be read: {reason(error)}") from error
    with _read(path):
        return False


def require_whole(path: str | Path) -> None:
    """Refuse an archive whose bytes are not those that were written."""
    if not is_whole(path):
        raise ArchiveError(
            f"{path}: damaged, its bytes are not those that were written; restore a copy, or run its study again "
            "with --recompute"
        )


def require_own_content(path: str | Path) -> None:
    """Refuse an archive whose bytes or values are not those that were written."""
    require_whole(path)
    if content_hash(path) != provenance(path).get("content_hash"):
        raise ArchiveError(f"{path}: another program has changed what it holds; restore a copy")


@contextmanager
def _read(path: Path, named: Path | None = None) -> Iterator[Any]:
    """Open a finished archive of this version with h5py; messages name the archive of which a file is a view."""
    _look(path)
    with opened(path) as file:
        require_own_data(named or path, file)
        if FORMAT_NAME not in file.attrs:
            raise ArchiveError(
                f"{named or path}: a NetCDF file, but not an archive of this workflow (it has no {FORMAT_NAME}); "
                "an archive that `workflow run` wrote is expected"
            )
        if (version := _as_text(file.attrs[FORMAT_NAME])) != str(FORMAT):
            raise ArchiveError(
                f"{named or path}: archive format {version}, this version reads {FORMAT}; use the version that wrote it"
            )
        yield file


def _as_text(value: Any) -> str:
    """Return an attribute as text: netCDF-C stores ASCII as characters, anything else as a string."""
    value = np.ravel(value)[0] if isinstance(value, np.ndarray) and value.size else value
    return value.decode(errors="replace") if isinstance(value, bytes) else str(value)


def _unfinished(path: Path) -> Command | None:
    """Return the command of a run whose archive is not there yet, ``None`` where there is none."""
    return None if path.exists() else read_command(parts_of(path))


def _open_view(path: Path, command: Command, chunks: Any) -> xr.Dataset:
    """Gather what is there into a temporary file, which goes when it is closed, or with the process."""
    try:
        grid = grid_of(command.texts)
    except (StudyError, LookupError, ValueError) as error:
        raise ArchiveError(f"{parts_of(path)}: its study cannot be read by this version: {error}") from error
    descriptor, name = tempfile.mkstemp(prefix=f"{path.stem}-", suffix=".nc")
    os.close(descriptor)
    view = Path(name)
    _VIEWS.add(view)
    try:
        with writing("a view of the shards", view.parent):
            stored, hashes = Stored(find_shards(parts_of(path))), case_hashes(grid)
            assemble(template(grid, command.warnings), command.texts, view, hashes, stored, stored.find(hashes))
        dataset = _open_dataset(view, chunks, path)
    except BaseException:
        view.unlink(missing_ok=True)
        raise

    def discard() -> None:
        dataset.close()
        view.unlink(missing_ok=True)
        _VIEWS.discard(view)

    shown = dataset.copy()
    shown.set_close(discard)
    return shown


_VIEWS: set[Path] = set()
"""Temporary files of views that are being made or are open."""


@atexit.register
def discard_views() -> None:
    """Remove the temporary files of unfinished archives that are open; the process is about to end."""
    for view in list(_VIEWS):
        view.unlink(missing_ok=True)


def _open_dataset(path: Path, chunks: Any, named: Path) -> xr.Dataset:
    """Open a file with xarray; messages name the archive of which it is a view."""
    from workflow.archive._labels import open_dataset

    with _read(path, named):
        pass  # what is no archive of this workflow is refused
    with reading(named):
        dataset = open_dataset(path, chunks)
    for name, kinds in ((STATUS, "i"), (MESSAGE, "OSU")):
        if name not in dataset or dataset[name].dtype.kind not in kinds:
            dataset.close()
            raise ArchiveError(f"{named}: its {name} is not as `workflow run` writes it; restore a copy")
    return dataset


def _look(path: Path) -> None:
    """Say what is wrong with a path before a library says it less clearly."""
    try:
        with open(path, "rb") as file:
            signature = file.read(len(HDF5_SIGNATURE))
        sound = has_sound_head(path)
    except FileNotFoundError as error:
        if _unfinished(path) is not None:
            text = f"{path}: unfinished, only its shards are there; run the study to its end first"
            raise ArchiveError(text) from error
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
        raise ArchiveError(f"{path}: not a NetCDF-4 file; {_expected(path)}")
    if not sound:
        raise ArchiveError(f"{path}: damaged, what describes its variables has changed; restore a copy")


def _expected(path: Path) -> str:
    """Return what to give in the place of a file that is no archive: that of a study of this name, if it is there."""
    if path.suffix in (".yaml", ".yml"):
        for beside in (path.with_suffix(".nc"), Path(path.with_suffix(".nc").name)):
            if beside.exists() or (parts_of(beside) / COMMAND).exists():
                return f"did you mean {beside}?"
        return "a study is given where an archive that `workflow run` wrote is expected"
    return "an archive that `workflow run` wrote is expected"


def require_readable(path: Path) -> None:
    """Refuse an archive that crashes a process that reads it, or keeps it busy; who opens it tells what else is wrong.

    Libraries may crash, or never end, on a file whose bytes have changed: a process of its own reads it first.
    """
    if not path.is_file():
        return
    import h5py  # noqa: F401 - libraries that the new process then has
    import netCDF4  # noqa: F401
    import xarray  # noqa: F401

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # about threads, none of which reads archives now
        process = os.fork()
    if not process:
        try:
            signal.setitimer(signal.ITIMER_PROF, _SECONDS)
            _try(path)
        finally:
            os._exit(0)
    if os.WIFSIGNALED(os.waitpid(process, 0)[1]):
        raise ArchiveError(
            f"{path}: damaged, libraries that read it crash or do not end; restore a copy, or move it away and run its "
            "study again"
        )


def _try(path: Path) -> None:
    """Read all that HDF5 follows pointers to; values in chunks have checksums."""
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    with open_archive(path) as dataset:
        dataset[[STATUS]].load()
    provenance(path)
    with opened(path) as file:
        for entry in file.values():
            if getattr(entry, "chunks", None):
                entry.id.get_num_chunks()


def require_own_data(path: Path, file: Any) -> None:
    """Refuse an archive, as h5py has opened it, that leads out of its file, in a circle, or to more than it can hold.

    Soft and external links, raw data in other files and virtual datasets lead out, a second name of one object may lead
    in a circle.
    """
    from h5py import h5d, h5l, h5o, h5t

    seen, size = {h5o.get_info(file.id).addr: b"/"}, file.id.get_filesize()

    def leads_away(name: bytes, link: Any) -> bytes | None:
        """Return the name of a link that does, which ends the visit."""
        return name if link.type != h5l.TYPE_HARD or seen.setdefault(link.u, name) != name else None

    odd = file.id.links.visit(leads_away, info=True)
    for name in seen.values() if odd is None else ():
        entry = h5o.open(file.id, name)
        if isinstance(entry, h5d.DatasetID):
            made = entry.get_create_plist()
            if made.get_layout() == h5d.VIRTUAL or made.get_external_count():
                odd = name
                break
            kind, count = entry.get_type(), math.prod(entry.shape)
            is_text = isinstance(kind, h5t.TypeStringID) and (kind.is_variable_str() or kind.get_size() == 1)
            if not (is_text or isinstance(kind, h5t.TypeIntegerID | h5t.TypeFloatID)):
                raise ArchiveError(f"{path}: `{name.decode()}` has neither numbers nor texts; get a sound copy")
            most = size if name == STATUS.encode() else _MOST_DEFLATED * size / kind.get_size()
            if count > most:  # a case takes its hash, which is not compressed
                raise ArchiveError(f"{path}: `{name.decode()}` has more values than there are bytes; restore a copy")
    if odd is not None:
        raise ArchiveError(
            f"{path}: `{odd.decode(errors='replace')}` refers to data elsewhere, as no archive of `workflow run` "
            "does; nothing of it is read: get a sound copy"
        )
