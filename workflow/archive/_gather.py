"""From shards, and what is taken of an earlier archive, to the archive, which is then read back."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._chunk import encode_chunk
from workflow.archive._content import hash_content
from workflow.archive._create import create
from workflow.archive._files import ArchiveError, free_space, sync, writing
from workflow.archive._layout import MESSAGE, NOT_RUN, STATUS, Layout
from workflow.archive._seal import seal
from workflow.archive._stored import PROVENANCE, Hashes, Places, Stored, boxes

_VARIABLE_BYTES, _CHUNK_BYTES, _CELL_BYTES = 5000, 100, 16
"""What an archive takes beside its chunks: attributes and indices, up to these in archives of all sizes; hashes."""

Index = NDArray[np.int64] | slice

_HELD = 8
"""Sources of which the values of one variable are held at a time."""


def gather(layout: Layout, parts: str | Path, target: str | Path, hashes: Hashes, stored: Stored) -> None:
    """Make the archive of stored cases, read it back, put it under its name; the shards may go then.

    At no time is there an incomplete file under the archive's name: it is made inside ``parts``,
    flushed, and renamed over ``target``.

    Parameters
    ----------
    hashes
        Identity of every case, ``(cell, byte)``.
    stored
        All of these cases.

    Raises
    ------
    ArchiveError
        Cases are missing or damaged, the disk is full or not writable, or what was written does not
        read back. ``target`` is as it was before and the shards are kept.
    """
    parts, target = Path(parts), Path(os.path.realpath(target))  # a link goes on to lead to it
    places = stored.find(hashes)
    if missing := int(np.sum(places[0] < 0)):
        raise ArchiveError(f"{parts}: {missing} of {layout.cells} cases are missing; give the command again")
    aside = parts / f"{target.name}.tmp"
    try:
        with writing("the archive", parts):
            _make_room(layout, parts, target)
            assemble(layout, aside, hashes, stored, places)
            digest = hash_content(aside)
            _tell_hash(aside, digest)
            _read_back(layout, aside, digest)
            seal(aside)
            sync(aside)
        with writing("the archive", target.parent):
            os.replace(aside, target)
            sync(target.parent)
    finally:
        aside.unlink(missing_ok=True)


def assemble(layout: Layout, path: Path, hashes: Hashes, stored: Stored, places: Places) -> None:
    """Write the results of stored cases to a new file; others have status ``not_run``.

    Chunks are encoded in threads and written past HDF5's filters. ``places`` are those of the hashes.

    Raises
    ------
    OSError, RuntimeError, ArchiveError
        A file cannot be read or written.
    """
    import h5py

    from workflow.archive._lock import LOCK

    create(layout, path, _messages(stored, *places), hashes)
    with LOCK, h5py.File(path, "r+") as archive, ThreadPoolExecutor() as threads:
        chunks = _chunks(layout, stored, *places)
        while some := list(islice(chunks, 2 * (os.cpu_count() or 1))):
            encoded = threads.map(encode_chunk, (values for *_, values in some))
            for (name, offset, values), chunk in zip(some, encoded, strict=True):
                if archive[name].chunks is None:  # a scalar: one cell without t
                    archive[name][()] = values[()]
                else:
                    archive[name].id.write_direct_chunk(offset, chunk)


def _chunks(
    layout: Layout, stored: Stored, source: NDArray[np.int64], row: NDArray[np.int64]
) -> Iterator[tuple[str, tuple[int, ...], NDArray[Any]]]:
    """Yield the chunks of all variables: name, offset and values."""
    index = np.arange(layout.cells).reshape(layout.shape)
    cut = [
        (box, np.asarray(index[box]).shape, _by_source(np.ravel(index[box]), source, row))
        for box in boxes(layout.shape, layout.lengths)
    ]
    for variable in layout.variables:
        held = lru_cache(_HELD)(lambda number, name=variable.name: stored.sources[number].read(name))
        shape = layout.chunk_of(variable)
        tail = layout.tail_shape(variable)
        pieces = list(boxes(tail, shape[len(layout.dims) :]))
        for box, size, parts in cut:
            values = np.full((math.prod(size), *tail), variable.fill, np.dtype(variable.dtype).newbyteorder("<"))
            for number, where, rows in parts:
                if variable.name in stored.sources[number].kinds:
                    _put(values, where, held(number)[rows])
            values = values.reshape((*size, *tail))
            for piece in pieces:
                chunk = values[len(size) * (slice(None),) + piece]
                if chunk.shape != shape:
                    part, chunk = chunk, np.full(shape, variable.fill, values.dtype)
                    chunk[tuple(map(slice, part.shape))] = part
                yield variable.name, tuple(side.start for side in (*box, *piece)), chunk


def _by_source(
    cells: NDArray[np.int64], source: NDArray[np.int64], row: NDArray[np.int64]
) -> list[tuple[int, Index, Index]]:
    """Return by the sources that hold some cells which of the cells they are, and in which rows."""
    places = [(int(k), np.flatnonzero(source[cells] == k)) for k in np.unique(source[cells]) if k >= 0]
    return [(number, _as_slice(where), _as_slice(row[cells[where]])) for number, where in places]


def _as_slice(index: NDArray[np.int64]) -> Index:
    """Return indices that follow each other as a slice, by which nothing is copied."""
    return slice(int(index[0]), int(index[-1]) + 1) if np.all(np.diff(index) == 1) else index


def _put(values: NDArray[Any], where: Index, there: NDArray[Any]) -> None:
    """Put stored values of cases in their places; of load periods each case has as many as it had."""
    if there.shape[1:] != values.shape[1:]:
        width = min(there.shape[1], values.shape[1])
        values[where, :width] = there[:, :width]
        return
    with np.errstate(over="ignore"):  # a diverged float64 is an infinite float32
        values[where] = there


def _messages(stored: Stored, source: NDArray[np.int64], row: NDArray[np.int64]) -> dict[int, bytes]:
    """Return the messages of cells, in UTF-8; those without one are left out."""
    messages: dict[int, bytes] = {}
    for number in np.unique(source[source >= 0]).tolist():
        texts = stored.sources[number].read(MESSAGE)
        if texts.dtype.itemsize > 1 or texts.any():
            cells = np.flatnonzero(source == number)
            messages |= {
                cell: text for cell, text in zip(cells.tolist(), texts[row[cells]].tolist(), strict=True) if text
            }
    return messages


def _make_room(layout: Layout, parts: Path, target: Path) -> None:
    """Refuse before HDF5 runs into a full disk, which it cannot recover from."""
    needed = sum(path.stat().st_size for path in (*parts.iterdir(), target) if path.is_file())
    variables = len(layout.variables) + len(layout.coordinates)
    chunks = math.prod(-(-size // length) for size, length in zip(layout.shape, layout.lengths, strict=True))
    needed += variables * (_VARIABLE_BYTES + _CHUNK_BYTES * chunks) + layout.cells * _CELL_BYTES
    if needed > free_space(parts):
        raise OSError(f"no space left on device, it needs about {needed / 2**20:.3g} MiB")


def _tell_hash(path: Path, digest: str) -> None:
    """Add the content hash, in characters of fixed length like the other texts."""
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, h5py.File(path, "r+") as archive:
        archive[PROVENANCE].attrs["content_hash"] = np.bytes_(digest)


def _read_back(layout: Layout, path: Path, digest: str) -> None:
    """Compare what is on the disk with what should be there; the hash has decoded every chunk before."""
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, h5py.File(path, "r") as archive:
        faults = []
        for variable in layout.variables:
            stored = archive[variable.name]
            cut = zip(stored.shape, stored.chunks or stored.shape, strict=True)
            expected = math.prod(-(-size // length) for size, length in cut)
            if stored.chunks is not None and stored.id.get_num_chunks() != expected:
                faults.append(f"{variable.name} has {stored.id.get_num_chunks()} of {expected} chunks")
        status = archive[STATUS][...]
        if status.size != layout.cells or np.any((status < 0) | (status >= NOT_RUN)):
            faults.append(f"{np.sum(status < NOT_RUN)} of {layout.cells} cases have run")
        if archive[PROVENANCE].attrs["content_hash"] != digest.encode():
            faults.append("the content hash is not in place")
    if faults:
        raise ArchiveError(f"{path}: does not read back as written: {'; '.join(faults)}; gather again")
