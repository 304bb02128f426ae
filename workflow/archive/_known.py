"""Cases that an earlier archive of a study holds already, found by their hashes and taken from it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._create import CASE_HASH, PROVENANCE
from workflow.archive._files import ArchiveError, commit, reading, writing
from workflow.archive._layout import MESSAGE, OK, STATUS, Layout, Variable
from workflow.archive._seal import FILE_CHECKSUM, is_sealed_with

KNOWN = "known.npy"
"""File in the directory of the shards: which file is under the target's name, then each cell's place in it, or -1."""

_OTHERWISE = "--recompute runs all cases again and replaces it, -o chooses another archive"

_FILE = 2
"""Numbers that tell the file."""

Cells = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Known:
    """The cells of a layout that an archive holds.

    Attributes
    ----------
    path
        That archive.
    cells
        For each cell its number there, -1 where it has none.
    """

    path: Path
    cells: Cells

    @property
    def file(self) -> tuple[int, int]:
        """Which file it is: another one may come under its name, with the very same bytes."""
        about = self.path.stat()
        return about.st_ino, about.st_mtime_ns

    def take(self, layout: Layout, cells: Cells) -> tuple[dict[str, NDArray[Any]], dict[int, str]]:
        """Return the stored results of some cells, ``(cell[, t or period])`` by name, and messages by position.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        places = self.cells[cells]
        with _opened(self.path) as file:
            values = {v.name: _picked(file.get(v.name), places, v, layout) for v in layout.variables}
            bad = np.flatnonzero(values[STATUS] != OK)
            texts = _texts(file, places[bad])
        return values, {int(k): text for k, text in zip(bad, texts, strict=True) if text}

    def copies(self, layout: Layout) -> Cells:
        """Return for each unit the cell there that its chunks begin with, -1 where they are not the same chunks.

        Such units are copied as they are, compressed: the same cases in the same order fill the same chunks.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        none = np.full(layout.units, -1, dtype=np.int64)
        if np.all(self.cells < 0):
            return none
        with _opened(self.path) as file:
            shape = file[STATUS].shape
            if not shape or not all(v.name in file and _same_chunks(file[v.name], v, layout) for v in layout.variables):
                return none
        rows = self.cells.reshape(-1, layout.inner)
        starts = np.arange(0, layout.inner, layout.chunk)
        first = rows[:, starts]
        place = np.arange(layout.inner) % layout.chunk
        follow = np.logical_and.reduceat(
            rows == np.repeat(first, layout.chunk, axis=1)[:, : layout.inner] + place, starts, axis=1
        )
        begin = first % shape[-1]
        length = np.minimum(starts + layout.chunk, layout.inner) - starts
        whole = (begin % layout.chunk == 0) & (np.minimum(begin + layout.chunk, shape[-1]) - begin == length)
        return np.where(follow & whole & (first >= 0), first, -1).ravel()

    def messages(self, cells: Cells) -> dict[int, str]:
        """Return what those of some cells that are not ok have to say, by cell.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        with _opened(self.path) as file:
            bad = cells[file[STATUS][...].ravel()[self.cells[cells]] != OK]
            texts = _texts(file, self.cells[bad])
        return {int(c): text for c, text in zip(bad, texts, strict=True) if text}

    def without_failures(self) -> Known:
        """Return only the cases that are ok, so that the others are run again.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        with _opened(self.path) as file:
            ok = file[STATUS][...].ravel() == OK
        return Known(self.path, np.where(ok[self.cells], self.cells, -1))


def find_known(path: Path, layout: Layout, hashes: NDArray[np.uint8]) -> Known:
    """Return the cases of a layout that an archive holds.

    Parameters
    ----------
    hashes
        Of every case, ``(cell, byte)``.

    Raises
    ------
    ArchiveError
        It holds none of them or not all of their variables, is not as it was written, or was made by
        a version that kept no hashes.
    """
    stored = stored_hashes(path)
    with _opened(path) as file:
        checksum = _text(file[PROVENANCE][FILE_CHECKSUM][...])
        lacking = [variable.name for variable in layout.variables if not _holds(file, variable, layout)]
    if not is_sealed_with(path, checksum):
        raise ArchiveError(
            f"{path}: changed or damaged since it was written, so that nothing is taken from it; restore a copy, "
            f"{_OTHERWISE}"
        )
    cells = _matched(hashes, stored)
    if np.all(cells < 0):
        raise ArchiveError(
            f"{path}: holds another study of the same name: none of its cases is one of this study as it is now; "
            f"{_OTHERWISE}"
        )
    if lacking:
        raise ArchiveError(f"{path}: holds cases of this study, but without {', '.join(lacking)}; {_OTHERWISE}")
    return Known(path, cells)


def stored_hashes(path: Path) -> NDArray[np.uint8]:
    """Return the identity of every case of an archive, ``(cell, byte)``.

    Raises
    ------
    ArchiveError
        It was made by a version that kept none, or is damaged.
    """
    with _opened(path) as file:
        group = file[PROVENANCE]
        if CASE_HASH not in group or FILE_CHECKSUM not in group:
            raise ArchiveError(f"{path}: made by a version that did not keep the identity of cases; {_OTHERWISE}")
        hashes = group[CASE_HASH][...]
        return np.asarray(hashes.reshape(-1, hashes.shape[-1]), dtype=np.uint8)


def keep_known(parts: Path, known: Known | None) -> None:
    """Leave in the directory of the shards what :func:`read_known` gives to every worker.

    Raises
    ------
    ArchiveError
        It cannot be written.
    """
    if known is None:
        (parts / KNOWN).unlink(missing_ok=True)
        return
    import io

    image = io.BytesIO()
    np.save(image, np.concatenate([known.file, known.cells]))
    with writing("what the archive holds already", parts):
        commit(parts / KNOWN, image.getvalue())


def read_known(parts: Path) -> Known | None:
    """Return what :func:`keep_known` left, ``None`` if nothing.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    stored = _stored(parts)
    return None if stored is None else Known(parts.with_name(parts.name.removesuffix(".parts")), stored[_FILE:])


def is_kept(parts: Path, known: Known) -> bool:
    """Tell whether :func:`keep_known` left just this: the same cells of the same file.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    stored = _stored(parts)
    return stored is not None and np.array_equal(stored, np.concatenate([known.file, known.cells]))


def _stored(parts: Path) -> Cells | None:
    try:
        stored = np.load(parts / KNOWN, allow_pickle=False)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError) as error:
        raise ArchiveError(f"{parts / KNOWN}: damaged; remove the directory and give the command again") from error
    return np.asarray(stored, dtype=np.int64)


def made_by(path: Path, texts: dict[str, str]) -> tuple[str, str, str]:
    """Return name and title of the study of an archive, and the version of the solver, from its provenance.

    Raises
    ------
    ArchiveError
        They are not there.
    """
    try:
        resolved = json.loads(texts["resolved"])
        return str(resolved["study"]), str(resolved["title"]), texts["solver_version"]
    except (ValueError, LookupError, TypeError) as error:
        raise ArchiveError(
            f"{path}: does not say which study it holds; choose another archive with -o, or move it away"
        ) from error


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open an archive with what it is read with here, under the lock of that library."""
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, reading(path), h5py.File(path, "r") as file:
        yield file


def _texts(file: Any, places: Cells) -> list[str]:
    return [_text(row) for row in _rows(file[MESSAGE], places, tail=1)] if places.size else []


def _text(row: NDArray[Any]) -> str:
    return row.tobytes().rstrip(b"\0").decode()


def _same_chunks(stored: Any, variable: Variable, layout: Layout) -> bool:
    """Tell whether chunks of a stored variable may stand in the archive of a layout as they are."""
    tail = tuple(layout.sizes[name] for name in layout.tail(variable))
    return bool(
        stored.chunks is not None
        and stored.chunks[-1 - len(tail) :] == layout.archive_chunk_of(variable)[-1 - len(tail) :]
        and stored.shape[stored.ndim - len(tail) :] == tail
        and stored.dtype == np.dtype(variable.dtype)
    )


def _matched(hashes: NDArray[np.uint8], stored: NDArray[np.uint8]) -> Cells:
    """Return for each hash the place of the same one among those stored, -1 where there is none."""
    new, old = (np.ascontiguousarray(rows[:, :8]).view(np.uint64).ravel() for rows in (hashes, stored))
    if not old.size:
        return np.full(new.size, -1, dtype=np.int64)
    order = np.argsort(old, kind="stable")
    place = order[np.minimum(np.searchsorted(old[order], new), old.size - 1)]
    return np.where(np.all(stored[place] == hashes, axis=1), place, -1).astype(np.int64)


def _holds(file: Any, variable: Variable, layout: Layout) -> bool:
    """Tell whether a file has a variable as exactly as it is wanted, along ``t`` to its end.

    One that is optional, or told per load period, is missing in all of the cases of a file without it.
    """
    stored = file.get(variable.name)
    if stored is None:
        return variable.optional or variable.kind == "period"
    if np.dtype(variable.dtype).itemsize > stored.dtype.itemsize:
        return False
    return variable.kind != "history" or stored.shape[-1] == layout.samples


def _picked(stored: Any, places: Cells, variable: Variable, layout: Layout) -> NDArray[Any]:
    """Return a variable of some cells; one that the file does not have, or a period beyond its last, is missing."""
    if stored is None:
        return np.full((len(places), *layout.shape_of(variable, 1)[2:]), variable.fill, dtype=variable.dtype)
    rows = _rows(stored, places, tail=len(layout.tail(variable)))
    if variable.kind != "period" or rows.shape[1] == layout.periods:
        with np.errstate(over="ignore"):  # as in a shard: a diverged float64 is an infinite float32
            return rows.astype(variable.dtype)
    wide = np.full((len(rows), layout.periods), variable.fill, dtype=variable.dtype)
    width = min(rows.shape[1], layout.periods)
    wide[:, :width] = rows[:, :width]
    return wide


def _rows(stored: Any, places: Cells, tail: int) -> NDArray[Any]:
    """Return some cells of a dataset; each run along its innermost case dimension is read once."""
    case_dims = stored.ndim - tail
    shape = stored.shape[:case_dims]
    if not shape:
        return np.repeat(stored[...][None], len(places), axis=0)
    found = np.empty((len(places), *stored.shape[case_dims:]), dtype=stored.dtype)
    row, column = np.divmod(places, shape[-1])
    for number in np.unique(row):
        here = np.flatnonzero(row == number)
        outer = np.unravel_index(int(number), shape[:-1]) if shape[:-1] else ()
        first, last = int(column[here].min()), int(column[here].max())
        block = stored[(*(int(i) for i in outer), slice(first, last + 1))]
        found[here] = block[column[here] - first]
    return found
