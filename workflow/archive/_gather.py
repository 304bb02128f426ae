"""From shards, and what is taken of an earlier archive, to the archive, which is then read back."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._chunk import encode_chunk
from workflow.archive._content import hash_content
from workflow.archive._create import create
from workflow.archive._files import ArchiveError, free_space, sync, writing
from workflow.archive._seal import seal
from workflow.archive._stored import MESSAGE, PROVENANCE, STATUS, Hashes, Places, Stored, boxes

if TYPE_CHECKING:
    import xarray as xr

_VARIABLE_BYTES, _CHUNK_BYTES, _CASE_BYTES = 5000, 100, 16
"""What an archive takes beside its chunks: attributes and indices, up to these in archives of all sizes; hashes."""

Index = NDArray[np.int64] | slice

Part = tuple[int, Index, Index]
"""Number of a source, which cases of a box it holds, and in which rows."""

Box = tuple[slice, ...]

Chunks = list[tuple[tuple[int, ...], Any]]
"""Encoded chunks by their offsets; a number where a variable has no dimensions."""

_HELD = 8
"""Sources of which the values of one variable are held at a time."""

_AHEAD = 2 * (os.cpu_count() or 1)
"""Boxes of cases of a variable that are being read and encoded while others are written."""


def gather(
    template: xr.Dataset,
    texts: Mapping[str, str],
    parts: str | Path,
    target: str | Path,
    hashes: Hashes,
    stored: Stored,
) -> None:
    """Make the archive of stored cases, read it back, put it under its name; the shards may go then.

    At no time is there an incomplete file under the archive's name: it is made inside ``parts``,
    flushed, and renamed over ``target``.

    Parameters
    ----------
    template
        See :func:`workflow.grid.template`.
    texts
        Those of the provenance group.
    hashes
        Identity of every case, ``(case, byte)``.
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
        raise ArchiveError(f"{parts}: {missing} of {len(hashes)} cases are missing; give the command again")
    aside = parts / f"{target.name}.tmp"
    try:
        with writing("the archive", parts):
            _make_room(template, parts, target)
            assemble(template, texts, aside, hashes, stored, places)
            _add_hash(aside, hash_content(aside))
            seal(aside)
            sync(aside)
        with writing("the archive", target.parent):
            os.replace(aside, target)
            sync(target.parent)
    finally:
        aside.unlink(missing_ok=True)


def assemble(
    template: xr.Dataset, texts: Mapping[str, str], path: Path, hashes: Hashes, stored: Stored, places: Places
) -> None:
    """Write the results of stored cases to a new file; others have status ``not_run``.

    Chunks are read and encoded in threads and written past HDF5's filters. ``places`` are those of the hashes.

    Raises
    ------
    OSError, RuntimeError, ArchiveError
        A file cannot be read or written.
    """
    import h5py

    from workflow.archive._lock import LOCK

    create(template, texts, path, _messages(stored, *places), hashes)
    with LOCK:
        archive = h5py.File(path, "r+")
        variables = {str(name): archive[name] for name in template.data_vars}  # once: it takes as long as a chunk
    try:
        with ThreadPoolExecutor() as threads:
            encoded = deque[tuple[Any, Future[Chunks]]]()
            for name, encode in _boxes(template, stored, *places):
                encoded.append((variables[name], threads.submit(encode)))
                if len(encoded) > _AHEAD:
                    _write_first(encoded)
            while encoded:
                _write_first(encoded)
    finally:
        with LOCK:
            archive.close()


def _write_first(encoded: deque[tuple[Any, Future[Chunks]]]) -> None:
    from workflow.archive._lock import LOCK

    variable, chunks = encoded.popleft()
    for offset, chunk in chunks.result():
        with LOCK:  # never for long: threads that read an archive wait for it
            if offset:
                variable.id.write_direct_chunk(offset, chunk)
            else:  # a single case without t
                variable[()] = chunk


def _boxes(
    template: xr.Dataset, stored: Stored, source: NDArray[np.int64], row: NDArray[np.int64]
) -> Iterator[tuple[str, Callable[[], Chunks]]]:
    """Yield for boxes of cases of all variables the name and what encodes their chunks."""
    status = template.variables[STATUS]
    index = np.arange(status.size).reshape(status.shape)
    cut = [
        (box, _by_source(np.ravel(index[box]), source, row))
        for box in boxes(status.shape, status.encoding.get("chunksizes", ()))
    ]
    for name in map(str, template.data_vars):
        held = lru_cache(_HELD)(lambda number, name=name: stored.sources[number].read(name))
        for box, parts in cut:
            there = [part for part in parts if name in stored.sources[part[0]].kinds]
            yield name, partial(_encoded, template.variables[name], box, there, held)


def _encoded(variable: xr.Variable, box: Box, parts: list[Part], held: Callable[[int], NDArray[Any]]) -> Chunks:
    """Return the chunks of a box of cases, blank where no source ``held`` has them."""
    blank, shape = variable.values, variable.encoding.get("chunksizes", ())
    values, tail = np.array(blank[box], blank.dtype.newbyteorder("<"), order="C"), blank.shape[len(box) :]
    for number, where, rows in parts:
        _put(values.reshape(-1, *tail), where, held(number)[rows])
    if not shape:
        return [((), values[()])]
    chunks: Chunks = []
    for piece in boxes(tail, shape[len(box) :]):
        chunk = values[len(box) * (slice(None),) + piece]
        if chunk.shape != shape:
            part, chunk = chunk, np.full(shape, blank.flat[0], values.dtype)
            chunk[tuple(map(slice, part.shape))] = part
        chunks.append((tuple(side.start for side in (*box, *piece)), encode_chunk(chunk)))
    return chunks


def _by_source(cases: NDArray[np.int64], source: NDArray[np.int64], row: NDArray[np.int64]) -> list[Part]:
    """Return by the sources that hold some cases which of the cases they are, and in which rows."""
    places = [(int(k), np.flatnonzero(source[cases] == k)) for k in np.unique(source[cases]) if k >= 0]
    return [(number, _as_slice(where), _as_slice(row[cases[where]])) for number, where in places]


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
    """Return the messages of cases, in UTF-8; those without one are left out."""
    messages: dict[int, bytes] = {}
    for number in np.unique(source[source >= 0]).tolist():
        texts = stored.sources[number].read(MESSAGE)
        if texts.dtype.itemsize > 1 or texts.any():
            cases = np.flatnonzero(source == number)
            messages |= {
                case: text for case, text in zip(cases.tolist(), texts[row[cases]].tolist(), strict=True) if text
            }
    return messages


def _make_room(template: xr.Dataset, parts: Path, target: Path) -> None:
    """Refuse before HDF5 runs into a full disk, which it cannot recover from."""
    status = template.variables[STATUS]
    needed = sum(path.stat().st_size for path in (*parts.iterdir(), target) if path.is_file())
    lengths = status.encoding.get("chunksizes", ())
    chunks = math.prod(-(-size // length) for size, length in zip(status.shape, lengths, strict=True))
    needed += len(template.variables) * (_VARIABLE_BYTES + _CHUNK_BYTES * chunks) + status.size * _CASE_BYTES
    if needed > free_space(parts):
        raise OSError(f"no space left on device, it needs about {needed / 2**20:.3g} MiB")


def _add_hash(path: Path, digest: str) -> None:
    """Add the content hash, as characters, to the provenance group."""
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, h5py.File(path, "r+") as archive:
        archive[PROVENANCE].attrs["content_hash"] = np.bytes_(digest)
