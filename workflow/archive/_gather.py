"""From shards, and what is taken of an earlier archive, to the archive, which is then read back.

netCDF4 writes labels, attributes and messages, h5py the chunks of results past HDF5's filters: zlib and NumPy, which
make them, let other threads run meanwhile.
"""

from __future__ import annotations

import math
import os
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._checksums import hash_content, seal
from workflow.archive._files import LOCK, ArchiveError, free_space, put, sync, writing
from workflow.archive._stored import CASE_HASH, MESSAGE, PROVENANCE, STATUS, Hashes, Places, Stored, boxes
from workflow.plan import CHUNK_BYTES, COMPRESSED, LEVEL

if TYPE_CHECKING:
    import xarray as xr

FORMAT = 2
"""Version of shards and archives; raised when an older reader would misread them."""

FORMAT_NAME = "archive_format"
"""Global attribute that marks a NetCDF file as an archive of this package, with its version."""

ATTRIBUTE_BYTES = 64_000
"""A longer text of the provenance group is a variable, as HDF5's plain attributes end at 64 KiB."""

_RAMP = np.arange(2**15)
"""Weights of the words that Fletcher's checksum sums up at a time."""

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

    At no time is there an incomplete file under the archive's name: it is made inside ``parts``, flushed, and renamed
    over ``target``. ``texts`` are those of the provenance group, ``hashes`` the identities of cases, ``(case, byte)``.

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
            put(aside, target)
    finally:
        aside.unlink(missing_ok=True)


def assemble(
    template: xr.Dataset, texts: Mapping[str, str], path: Path, hashes: Hashes, stored: Stored, places: Places
) -> None:
    """Write the results of stored cases to a new file; others have status ``not_run``.

    Chunks are read and encoded in threads and written past HDF5's filters. ``places`` are those of the hashes.
    """
    import h5py

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
    """Put stored values of cases in their places; of load periods, or sectors, each case has as many as it had."""
    if there.shape[1:] != values.shape[1:]:
        both = tuple(slice(min(sizes)) for sizes in zip(there.shape[1:], values.shape[1:], strict=True))
        values[(where, *both)] = there[(slice(None), *both)]
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

    with LOCK, h5py.File(path, "r+") as archive:
        archive[PROVENANCE].attrs["content_hash"] = np.bytes_(digest)


def create(
    template: xr.Dataset, texts: Mapping[str, str], path: Path, messages: Mapping[int, bytes], hashes: Hashes
) -> None:
    """Write everything but the results to a new NetCDF-4 file; chunks stay unallocated.

    ``texts`` are those of the provenance group; ``messages`` are in UTF-8, by case.
    """
    import netCDF4

    path = path.absolute()  # netCDF-C skips spaces that a path begins with
    with LOCK, netCDF4.Dataset(path, "w", format="NETCDF4") as opened:
        file: Any = opened
        file.setncatts({**template.attrs, FORMAT_NAME: str(FORMAT)})
        for name, size in template.sizes.items():
            file.createDimension(name, size)
        for name, variable in template.variables.items():
            values = variable.values
            if variable.encoding.get("dtype") == "S1":
                encoded = [text.encode() for text in values.ravel()]
                target = _create_text(file, str(name), variable, max(1, *map(len, encoded)), variable.attrs)
                target[...] = _characters(encoded, values.shape, target.shape[-1])
                continue
            how = dict(variable.encoding)
            listed, fill = {k: how.pop(k) for k in ("coordinates",) if k in how}, how.pop("_FillValue", False)
            kind = str if values.dtype.kind == "O" else values.dtype
            target = file.createVariable(name, kind, variable.dims, fill_value=fill, **how)
            target.setncatts({**variable.attrs, **listed})
            if name in template.coords:
                target[...] = values
        _create_messages(file, template.variables[STATUS], messages)
        _create_provenance(file, texts, template.variables[STATUS], hashes)


def _create_text(file: Any, name: str, like: xr.Variable, length: int, attributes: Mapping[str, Any]) -> Any:
    """Create a variable of texts: UTF-8 characters along a last dimension, of which xarray makes strings as it reads.

    HDF5's strings of variable length have no checksum, and xarray reads all of them as it opens a file. Dimensions and
    chunks are those of another variable.
    """
    file.createDimension(f"{name}_length", length)
    chunks = like.encoding.get("chunksizes", ())
    chunks = (*chunks, max(1, min(length, CHUNK_BYTES // math.prod(chunks))))
    target = file.createVariable(name, "S1", (*like.dims, f"{name}_length"), chunksizes=chunks, **COMPRESSED)
    target.setncatts({**attributes, "_Encoding": "utf-8"})
    target.set_auto_chartostring(False)
    return target


def _characters(encoded: Sequence[bytes], shape: tuple[int, ...], length: int) -> NDArray[np.bytes_]:
    """Return texts in UTF-8 as single bytes, ``(…, length)``."""
    return np.array(encoded, f"S{length}").view("S1").reshape(*shape, length)


def _create_messages(file: Any, status: xr.Variable, messages: Mapping[int, bytes]) -> None:
    """Write the messages of cases; chunks without a message are never allocated."""
    about = {"long_name": "what a case has to say: why it is not ok, or what it could not be given"}
    about |= {key: status.encoding[key] for key in ("coordinates",) if key in status.encoding}
    length = max([1, *map(len, messages.values())])
    target = _create_text(file, MESSAGE, status, length, about)
    if not messages:
        return
    cases = np.sort(np.fromiter(messages, np.int64))
    index = np.arange(status.size).reshape(status.shape)
    for box in boxes(status.shape, status.encoding.get("chunksizes", ())):
        here = np.asarray(index[box])
        if np.isin(cases, here).any():
            texts = [messages.get(case, b"") for case in here.ravel().tolist()]
            target[(*box, slice(None))] = _characters(texts, here.shape, length)


def _create_provenance(file: Any, texts: Mapping[str, str], status: xr.Variable, hashes: Hashes) -> None:
    """Write texts as attributes or, compressed, as arrays of characters.

    No variable-length strings here: netCDF-C 4.10 crashes when it reads them from a group of a file
    that is open twice.
    """
    group = file.createGroup(PROVENANCE)
    for name, text in texts.items():
        encoded = text.encode()
        if len(encoded) <= ATTRIBUTE_BYTES:
            group.setncattr(name, text)
        else:
            group.createDimension(f"{name}_bytes", len(encoded))
            target = group.createVariable(name, "S1", (f"{name}_bytes",), compression="zlib", complevel=LEVEL)
            target[:] = np.frombuffer(encoded, "S1")
    group.createDimension("byte", hashes.shape[1])
    target = group.createVariable(CASE_HASH, "u1", (*status.dims, "byte"), fletcher32=True)
    target.setncattr("long_name", "identity of the case: a hash of what its results depend on")
    target[...] = hashes.reshape(*status.shape, hashes.shape[1])


def encode_chunk(values: NDArray[Any]) -> bytes:
    """Return one chunk as HDF5's filters Fletcher-32, shuffle and deflate would store it."""
    size, image = values.dtype.itemsize, np.ascontiguousarray(values).view(np.uint8).ravel()
    image = np.concatenate([image, np.frombuffer(fletcher32(image), np.uint8)])
    whole, shuffled = image.size // size * size, np.empty_like(image)
    shuffled[:whole].reshape(size, -1)[...] = image[:whole].reshape(-1, size).T
    shuffled[whole:] = image[whole:]
    return zlib.compress(shuffled.data, LEVEL)


def fletcher32(image: NDArray[np.uint8]) -> bytes:
    """Return HDF5's checksum of some bytes, b_k: Σ w_k and Σ (n - k) w_k of their n words w_k, modulo 65535.

    Words are big-endian; those of little-endian words are 256 times as large, modulo 65535. A sum that is not 0 ends
    as 65535 where its remainder is 0.
    """
    words = np.append(image, np.zeros(image.size % 2, np.uint8)).view("<u2")
    sums = [0, 0]
    for start in range(0, words.size, _RAMP.size):
        some = words[start : start + _RAMP.size].astype(np.int64)
        total = int(some.sum())
        sums = [sums[0] + total, sums[1] + (words.size - start) * total - int(some @ _RAMP[: some.size])]
    first, second = ((256 * value - 1) % 65535 + 1 if value else 0 for value in sums)
    return (second << 16 | first).to_bytes(4, "little")
