"""Variables of a finished archive, read cell by cell: what :mod:`workflow.archive._stored_cells` takes from one."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._cut import Cut
from workflow.archive._layout import MESSAGE, Layout, Variable

Cells = NDArray[np.int64]


def with_messages(file: Any) -> NDArray[np.bool_]:
    """Tell which cells of an archive have a message, from its first character: an ok case may have one too."""
    stored = file[MESSAGE]
    first = stored[...] if stored.dtype == object else stored[..., 0]
    return np.asarray(first != b"").ravel()


def messages_of(file: Any, places: Cells) -> list[str]:
    """Return messages, which are strings or, along one more dimension, characters."""
    if not places.size:
        return []
    stored = file[MESSAGE]
    if stored.dtype == object:
        return [row.decode() for row in _rows(stored, places, tail=0)]
    return [row.tobytes().rstrip(b"\0").decode() for row in _rows(stored, places, tail=1)]


def same_chunks(stored: Any, variable: Variable, layout: Layout) -> bool:
    """Tell whether chunks of a stored variable may stand in the archive of a layout as they are."""
    tail = tuple(layout.sizes[name] for name in layout.tail(variable))
    return bool(
        stored.chunks is not None
        and _without_ones(stored.chunks) == _without_ones(layout.archive_chunk_of(variable))
        and stored.shape[stored.ndim - len(tail) :] == tail
        and stored.dtype == np.dtype(variable.dtype)
    )


def _without_ones(lengths: tuple[int, ...]) -> tuple[int, ...]:
    """Return the lengths of a chunk from the first on that is more than one."""
    more = [k for k, length in enumerate(lengths) if length > 1]
    return tuple(lengths[more[0] :]) if more else ()


def cut_of(status: Any) -> Cut | None:
    """Return how a stored variable of cases is cut, ``None`` where its chunks are not those of a cut."""
    if not status.shape or status.chunks is None:
        return None
    try:
        cut = Cut(status.shape, int(np.prod(status.chunks)))
    except ValueError:
        return None
    return cut if cut.lengths == status.chunks else None


def holds(file: Any, variable: Variable, layout: Layout) -> bool:
    """Tell whether a file has a variable as exactly as it is wanted, along ``t`` to its end.

    One that is optional is missing in all of the cases of a file without it, and so are load periods without any.
    """
    stored = file.get(variable.name)
    if stored is None:
        return variable.optional or (variable.kind == "period" and "period" not in file)
    if np.dtype(variable.dtype).itemsize > stored.dtype.itemsize:
        return False
    return variable.kind != "history" or stored.shape[-1] == layout.tails["t"]


def picked(stored: Any, places: Cells, variable: Variable, layout: Layout) -> NDArray[Any]:
    """Return a variable of some cells; one that the file does not have, or a period beyond its last, is missing."""
    if stored is None:
        return np.full((len(places), *layout.shape_of(variable, 1)[2:]), variable.fill, dtype=variable.dtype)
    rows = _rows(stored, places, tail=len(layout.tail(variable)))
    if variable.kind != "period" or rows.shape[1] == layout.tails["period"]:
        with np.errstate(over="ignore"):  # as in a shard: a diverged float64 is an infinite float32
            return rows.astype(variable.dtype)
    wide = np.full((len(rows), layout.tails["period"]), variable.fill, dtype=variable.dtype)
    width = min(rows.shape[1], layout.tails["period"])
    wide[:, :width] = rows[:, :width]
    return wide


_SPARE = 2
"""Cells read for each that is wanted, at most, where that saves reads: each takes as long as a thousand numbers."""


def _rows(stored: Any, places: Cells, tail: int) -> NDArray[Any]:
    """Return some cells of a dataset, read in few boxes."""
    shape = stored.shape[: stored.ndim - tail]
    if not shape:
        return np.repeat(stored[...][None], len(places), axis=0)
    cells = np.empty((len(places), *stored.shape[len(shape) :]), dtype=stored.dtype)
    if places.size:
        _read(stored, np.stack(np.unravel_index(places, shape)), np.arange(len(places)), cells)
    return cells


def _read(stored: Any, index: Cells, which: Cells, cells: NDArray[Any]) -> None:
    """Read the cells at ``index``, ``(dimension, cell)``, into rows ``which``: the box around them at once.

    Where most of it is other cells it is cut along its outermost dimension, but not along its last.
    """
    first, stop = index.min(axis=1), index.max(axis=1) + 1
    across = np.flatnonzero(stop - first > 1)
    if across.size <= 1 or np.prod(stop - first) <= _SPARE * which.size:
        box = stored[tuple(map(slice, first.tolist(), stop.tolist()))]
        cells[which] = box[tuple(index - first[:, None])]
        return
    outer = index[across[0]]
    order = np.argsort(outer, kind="stable")
    for alike in np.split(order, np.flatnonzero(np.diff(outer[order])) + 1):
        _read(stored, index[:, alike], which[alike], cells)
