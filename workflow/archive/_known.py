"""Cases that an earlier archive of a study holds already, found by their hashes and taken from it."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._create import CASE_HASH, PROVENANCE
from workflow.archive._files import ArchiveError, commit
from workflow.archive._layout import MESSAGE, OK, STATUS, Layout, Variable

KNOWN = "known.npy"
"""File in the directory of the shards: for each cell its place in the archive under the target's name, or -1."""

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

    def take(self, layout: Layout, cells: Cells) -> tuple[dict[str, NDArray[Any]], dict[int, str]]:
        """Return the stored results of some cells, ``(cell[, t or period])`` by name, and messages by position."""
        import h5py

        from workflow.archive._lock import LOCK

        places = self.cells[cells]
        with LOCK, h5py.File(self.path, "r") as file:
            values = {v.name: _picked(file[v.name], places, v, layout) for v in layout.variables}
        told = self.messages(cells) if np.any(values[STATUS] != OK) else {}
        return values, {int(k): told[int(c)] for k, c in enumerate(cells) if int(c) in told}

    def copies(self, layout: Layout) -> Cells:
        """Return for each unit the cell there that its chunks begin with, -1 where they are not the same chunks.

        Such units are copied as they are, compressed.
        """
        import h5py

        from workflow.archive._lock import LOCK

        with LOCK, h5py.File(self.path, "r") as file:
            shape = file[STATUS].shape
            same = all(_same_chunks(file[v.name], v, layout) for v in layout.variables)
        found = np.full(layout.units, -1, dtype=np.int64)
        if not same or not shape:
            return found
        for unit in range(layout.units):
            cells = layout.cells_of(unit)
            places = self.cells[cells.start : cells.stop]
            first = int(places[0])
            if first >= 0 and first % shape[-1] % layout.chunk == 0 and np.all(np.diff(places) == 1):
                found[unit] = first
        return found

    def messages(self, cells: Cells) -> dict[int, str]:
        """Return what cells that are not ok have to say, by cell."""
        import h5py

        from workflow.archive._lock import LOCK

        with LOCK, h5py.File(self.path, "r") as file:
            bad = cells[file[STATUS][...].ravel()[self.cells[cells]] != OK]
            texts = _rows(file[MESSAGE], self.cells[bad], tail=1) if bad.size else ()
        return {int(c): text for c, row in zip(bad, texts, strict=True) if (text := _text(row))}


def find_known(path: Path, layout: Layout, hashes: NDArray[np.uint8], only_ok: bool = False) -> Known:
    """Return the cases of a layout that an archive holds with the same variables.

    Parameters
    ----------
    hashes
        Of every case, ``(cell, byte)``.
    only_ok
        Leave out the cases that are not ok, to be run again.

    Raises
    ------
    ArchiveError
        The archive was made by a version that kept no hashes.
    OSError, LookupError
        It is damaged.
    """
    import h5py

    from workflow.archive._lock import LOCK

    stored = stored_hashes(path)
    with LOCK, h5py.File(path, "r") as file:
        status = file[STATUS][...].ravel()
        complete = all(_holds(file, variable, layout) for variable in layout.variables)
    cells = _matched(hashes, stored) if complete else np.full(len(hashes), -1, dtype=np.int64)
    if only_ok:
        cells[(cells >= 0) & (status[cells] != OK)] = -1
    return Known(path, cells)


def stored_hashes(path: Path) -> NDArray[np.uint8]:
    """Return the identity of every case of an archive, ``(cell, byte)``.

    Raises
    ------
    ArchiveError
        It was made by a version that kept none.
    """
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, h5py.File(path, "r") as file:
        group = file[PROVENANCE]
        if CASE_HASH not in group:
            raise ArchiveError(
                f"{path}: made by a version that did not keep the identity of cases; --recompute runs all of them "
                "again, -o chooses another archive"
            )
        hashes = group[CASE_HASH][...]
    return np.asarray(hashes.reshape(-1, hashes.shape[-1]), dtype=np.uint8)


def keep_known(parts: Path, known: Known | None) -> None:
    """Leave in the directory of the shards what :func:`read_known` gives to every worker."""
    if known is None:
        (parts / KNOWN).unlink(missing_ok=True)
        return
    import io

    image = io.BytesIO()
    np.save(image, known.cells)
    commit(parts / KNOWN, image.getvalue())


def read_known(parts: Path) -> Known | None:
    """Return what :func:`keep_known` left, ``None`` if nothing."""
    try:
        cells = np.load(parts / KNOWN, allow_pickle=False)
    except FileNotFoundError:
        return None
    return Known(parts.with_name(parts.name.removesuffix(".parts")), cells)


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
    """Tell whether a file has a variable as exactly as it is wanted, along ``t`` to its end."""
    stored = file.get(variable.name)
    if stored is None or np.dtype(variable.dtype).itemsize > stored.dtype.itemsize:
        return False
    return variable.kind != "history" or stored.shape[-1] == layout.samples


def _picked(stored: Any, places: Cells, variable: Variable, layout: Layout) -> NDArray[Any]:
    """Return a variable of some cells; a period beyond those of the file is missing."""
    rows = _rows(stored, places, tail=len(layout.tail(variable)))
    if variable.kind != "period" or rows.shape[1] == layout.periods:
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
