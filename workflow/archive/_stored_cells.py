"""Cases of a study whose results an earlier archive holds: matched by their hashes, then copied from it."""

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
from workflow.archive._layout import OK, STATUS, Layout
from workflow.archive._stored import Cells, cut_of, holds, messages_of, picked, same_chunks, with_messages
from workflow.variables import BY_NAME

STORED_CELLS = "known.npy"
"""File in the directory of the shards: which file is under the target's name, then each cell's place in it, or -1."""

_OTHERWISE = "--recompute runs all cases again and replaces it, -o chooses another archive"

_FILE = 2
"""Numbers that identify the file."""


@dataclass(frozen=True, eq=False)
class StoredCells:
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
            values = {v.name: picked(file.get(v.name), places, v, layout) for v in layout.variables}
            with_text = np.flatnonzero(with_messages(file)[places])
            texts = messages_of(file, places[with_text])
        return values, {int(k): text for k, text in zip(with_text, texts, strict=True) if text}

    def copies(self, layout: Layout) -> Cells:
        """Return for each unit the cell there that its chunks begin with, -1 where they are not the same chunks.

        Such units are copied as they are, compressed: the same cases in the same order fill the same chunks.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        none = np.full(layout.units, -1, dtype=np.int64)
        if layout.joined or np.all(self.cells < 0):
            return none
        with _opened(self.path) as file:
            if not all(v.name in file and same_chunks(file[v.name], v, layout) for v in layout.variables):
                return none
            there = cut_of(file[STATUS])
        row, chunk = layout.cut.row, layout.chunk
        if there is None or there.size != chunk:
            return none
        rows = self.cells.reshape(-1, row)
        starts = np.arange(0, row, chunk)
        first = rows[:, starts]
        place = np.arange(row) % chunk
        follow = np.logical_and.reduceat(rows == np.repeat(first, chunk, axis=1)[:, :row] + place, starts, axis=1)
        begin = first % there.row
        length = np.minimum(starts + chunk, row) - starts
        whole = (begin % chunk == 0) & (np.minimum(begin + chunk, there.row) - begin == length)
        return np.where(follow & whole & (first >= 0), first, -1).ravel()

    def messages(self, cells: Cells) -> dict[int, str]:
        """Return the messages of some cells, by cell; cells without a message are left out.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        with _opened(self.path) as file:
            with_text = cells[with_messages(file)[self.cells[cells]]]
            texts = messages_of(file, self.cells[with_text])
        return {int(c): text for c, text in zip(with_text, texts, strict=True) if text}

    def without_failures(self) -> StoredCells:
        """Return only the cases that are ok, so that the others are run again.

        Raises
        ------
        ArchiveError
            The archive is damaged.
        """
        with _opened(self.path) as file:
            ok = file[STATUS][...].ravel() == OK
        return StoredCells(self.path, np.where(ok[self.cells], self.cells, -1))


def find_stored_cells(path: Path, layout: Layout, hashes: NDArray[np.uint8]) -> StoredCells:
    """Return which cases of a layout an archive holds; there may be none.

    Parameters
    ----------
    hashes
        Of every case, ``(cell, byte)``.

    Raises
    ------
    ArchiveError
        It holds some of them without all of their variables.
    """
    stored = stored_hashes(path)
    with _opened(path) as file:
        lacking = [variable.name for variable in layout.variables if not holds(file, variable, layout)]
    cells = match_hashes(hashes, stored)
    if lacking and np.any(cells >= 0):
        raise ArchiveError(f"{path}: holds cases of this study, but without {', '.join(lacking)}; {_OTHERWISE}")
    return StoredCells(path, cells)


def narrowed(path: Path, layout: Layout) -> list[str]:
    """Return what an archive holds of its cases that a layout has no place for: histories, balances, digits of them.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    declared = {variable.name: np.dtype(variable.dtype) for variable in layout.variables}
    names = []
    with _opened(path) as file:
        for variable in BY_NAME.values():
            if variable.name not in file or not (
                variable.shape == "history" or variable.condition in ("balances", "sections")
            ):
                continue
            if variable.name not in declared:
                names.append(variable.name)
            elif file[variable.name].dtype.itemsize > declared[variable.name].itemsize:
                names.append(f"{variable.name} as {file[variable.name].dtype.name}")
    return names


def stored_hashes(path: Path) -> NDArray[np.uint8]:
    """Return the identity of every case of an archive, ``(cell, byte)``.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    with _opened(path) as file:
        hashes = file[PROVENANCE][CASE_HASH][...]
        return np.asarray(hashes.reshape(-1, hashes.shape[-1]), dtype=np.uint8)


def save_stored_cells(parts: Path, stored_cells: StoredCells | None) -> None:
    """Write to the directory of the shards what :func:`load_stored_cells` reads in every worker.

    Raises
    ------
    ArchiveError
        It cannot be written.
    """
    if stored_cells is None:
        (parts / STORED_CELLS).unlink(missing_ok=True)
        return
    import io

    image = io.BytesIO()
    np.save(image, np.concatenate([stored_cells.file, stored_cells.cells]))
    with writing("what the archive holds already", parts):
        commit(parts / STORED_CELLS, image.getvalue())


def load_stored_cells(parts: Path) -> StoredCells | None:
    """Return what :func:`save_stored_cells` wrote, ``None`` where it wrote nothing.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    stored = _stored(parts)
    return None if stored is None else StoredCells(parts.with_name(parts.name.removesuffix(".parts")), stored[_FILE:])


def are_saved(parts: Path, stored_cells: StoredCells) -> bool:
    """Tell whether :func:`save_stored_cells` wrote these cells of this file.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    stored = _stored(parts)
    return stored is not None and np.array_equal(stored, np.concatenate([stored_cells.file, stored_cells.cells]))


def saved_file(parts: Path) -> tuple[int, int] | None:
    """Return the file whose cases :func:`save_stored_cells` wrote, see :attr:`StoredCells.file`.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    stored = _stored(parts)
    return None if stored is None else (int(stored[0]), int(stored[1]))


def _stored(parts: Path) -> Cells | None:
    try:
        stored = np.load(parts / STORED_CELLS, allow_pickle=False)
    except FileNotFoundError:
        return None
    except (OSError, ValueError, EOFError) as error:
        raise ArchiveError(
            f"{parts / STORED_CELLS}: damaged; remove the directory and give the command again"
        ) from error
    return np.asarray(stored, dtype=np.int64)


@dataclass(frozen=True)
class ArchiveOrigin:
    """What an archive was made of: name, title and licence of its study, and version of the solver."""

    study: str
    title: str
    license: str
    solver: str


def archive_origin(path: Path, texts: dict[str, str]) -> ArchiveOrigin:
    """Return what an archive was made of, from its provenance.

    Raises
    ------
    ArchiveError
        They are not there.
    """
    try:
        resolved = json.loads(texts["resolved"])
        named = str(resolved["study"]), str(resolved["title"]), str(resolved.get("license", ""))
        return ArchiveOrigin(*named, texts["solver_version"])
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
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


def count_unmatched(stored: NDArray[np.uint8], hashes: NDArray[np.uint8]) -> int:
    """Return how many stored cases have the hash of none of some others."""
    return int(np.sum(match_hashes(stored, hashes) < 0))


def match_hashes(hashes: NDArray[np.uint8], stored: NDArray[np.uint8]) -> Cells:
    """Return for each hash the place of the same one among those stored, -1 where there is none."""
    new, old = (np.ascontiguousarray(rows[:, :8]).view(np.uint64).ravel() for rows in (hashes, stored))
    if not old.size:
        return np.full(new.size, -1, dtype=np.int64)
    order = np.argsort(old, kind="stable")
    place = order[np.minimum(np.searchsorted(old[order], new), old.size - 1)]
    return np.where(np.all(stored[place] == hashes, axis=1), place, -1).astype(np.int64)
