"""From shards, and what is taken of an earlier archive, to the archive, which is then read back."""

from __future__ import annotations

import math
import os
from collections import deque
from collections.abc import Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache
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

_HELD = 8
"""Sources of which the values of one variable are held at a time."""

_AHEAD = 2 * (os.cpu_count() or 1)
"""Chunks that are being encoded while others are read and written."""


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

    Chunks are encoded in threads and written past HDF5's filters. ``places`` are those of the hashes.

    Raises
    ------
    OSError, RuntimeError, ArchiveError
        A file cannot be read or written.
    """
    import h5py

    from workflow.archive._lock import LOCK

    create(template, texts, path, _messages(stored, *places), hashes)
    with LOCK, h5py.File(path, "r+") as archive, ThreadPoolExecutor() as threads:
        # looked up once: it takes as long as writing a chunk
        variables = {str(name): archive[name] for name in template.data_vars}
        encoded = deque[tuple[str, tuple[int, ...], Future[bytes]]]()
        for name, offset, values in _chunks(template, stored, *places):
            if not offset:  # a single case without t
                variables[name][()] = values[()]
                continue
            encoded.append((name, offset, threads.submit(encode_chunk, values)))
            if len(encoded) > _AHEAD:
                _write_first(variables, encoded)
        while encoded:
            _write_first(variables, encoded)


def _write_first(variables: Mapping[str, Any], encoded: deque[tuple[str, tuple[int, ...], Future[bytes]]]) -> None:
    name, offset, chunk = encoded.popleft()
    variables[name].id.write_direct_chunk(offset, chunk.result())


def _chunks(
    template: xr.Dataset, stored: Stored, source: NDArray[np.int64], row: NDArray[np.int64]
) -> Iterator[tuple[str, tuple[int, ...], NDArray[Any]]]:
    """Yield the chunks of all variables: name, offset and values."""
    status = template.variables[STATUS]
    index = np.arange(status.size).reshape(status.shape)
    cut = [
        (box, _by_source(np.ravel(index[box]), source, row))
        for box in boxes(status.shape, status.encoding.get("chunksizes", ()))
    ]
    for name in map(str, template.data_vars):
        held = lru_cache(_HELD)(lambda number, name=name: stored.sources[number].read(name))
        blank, shape = template.variables[name].values, template.variables[name].encoding.get("chunksizes", ())
        tail = blank.shape[status.ndim :]
        pieces = list(boxes(tail, shape[status.ndim :]))
        for box, parts in cut:
            values = np.array(blank[box], blank.dtype.newbyteorder("<"), order="C")
            for number, where, rows in parts:
                if name in stored.sources[number].kinds:
                    _put(values.reshape(-1, *tail), where, held(number)[rows])
            for piece in pieces:
                chunk = values[status.ndim * (slice(None),) + piece]
                if chunk.shape != shape:
                    part, chunk = chunk, np.full(shape, blank.flat[0], values.dtype)
                    chunk[tuple(map(slice, part.shape))] = part
                yield name, tuple(side.start for side in (*box, *piece)), chunk


def _by_source(
    cases: NDArray[np.int64], source: NDArray[np.int64], row: NDArray[np.int64]
) -> list[tuple[int, Index, Index]]:
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
