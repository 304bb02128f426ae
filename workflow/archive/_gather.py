"""From shards to the archive: compressed chunks are copied as they are, then everything is read back."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._content import hash_content
from workflow.archive._create import PROVENANCE, create
from workflow.archive._files import ArchiveError, free_space, sync, writing
from workflow.archive._guard import vouch
from workflow.archive._layout import NOT_RUN, STATUS, Layout, Variable
from workflow.archive._seal import seal
from workflow.archive._shard import Shards, decode_chunk, encode_chunk, find_shards, stored_chunks, stored_values
from workflow.archive._stored_cells import StoredCells

_VARIABLE_BYTES, _CHUNK_BYTES, _CELL_BYTES = 5000, 100, 16
"""What an archive takes beside its chunks: attributes and indices, up to these in archives of all sizes; hashes."""


def gather(
    layout: Layout,
    parts: str | Path,
    target: str | Path,
    hashes: NDArray[np.uint8] | None = None,
    stored_cells: StoredCells | None = None,
) -> None:
    """Make the archive of complete shards, read it back, put it under its name; the shards may go then.

    At no time is there an incomplete file under the archive's name: it is made inside ``parts``,
    flushed, and renamed over ``target``.

    Parameters
    ----------
    hashes
        Identity of every case, ``(cell, byte)``.
    known
        Cases of an earlier archive; whole chunks of it that no shard replaces are copied.

    Raises
    ------
    ArchiveError
        Units are missing or damaged, the disk is full or not writable, or what was written does not
        read back. ``target`` is as it was before and the shards are kept.
    """
    parts, target = Path(parts), Path(os.path.realpath(target))  # a link goes on to lead to it
    shards = find_shards(parts, layout)
    copies = np.full(layout.units, -1) if stored_cells is None else stored_cells.copies(layout)
    if np.any((shards.owner < 0) & (copies < 0)):
        faults = "".join(f"; {name} is {fault}" for name, fault in shards.rejected)
        ranges = ", ".join(f"{first} to {stop - 1}" for first, stop in shards.missing[:5])
        raise ArchiveError(
            f"{parts}: {np.sum(shards.owner < 0)} of {layout.units} units are missing ({ranges}"
            f"{', …' if len(shards.missing) > 5 else ''}){faults}; compute them, then gather again"
        )
    aside = parts / f"{target.name}.tmp"
    try:
        with writing("the archive", parts):
            _make_room(layout, shards, stored_cells, parts)
            assemble(layout, shards, aside, hashes, stored_cells)
            digest = hash_content(aside)
            _tell_hash(aside, digest)
            _read_back(layout, aside, digest)
            seal(aside)
            sync(aside)
        with writing("the archive", target.parent):
            os.replace(aside, target)
            sync(target.parent)
            vouch(target)
    except BaseException:
        aside.unlink(missing_ok=True)
        raise


def assemble(
    layout: Layout,
    shards: Shards,
    path: Path,
    hashes: NDArray[np.uint8] | None = None,
    stored_cells: StoredCells | None = None,
) -> None:
    """Write what shards and an earlier archive hold to a new file; missing units have status ``not_run``.

    Raises
    ------
    OSError, RuntimeError
        A file cannot be read or written.
    """
    import h5py

    from workflow.archive._lock import LOCK

    copies = (
        np.full(layout.units, -1)
        if stored_cells is None
        else np.where(shards.owner < 0, stored_cells.copies(layout), -1)
    )
    messages = _messages(layout, shards)
    if stored_cells is not None and np.any(copies >= 0):
        messages |= stored_cells.messages(
            np.concatenate([layout.cells_of(int(u)) for u in np.flatnonzero(copies >= 0)])
        )
    create(layout, path, messages, hashes)
    with LOCK, h5py.File(path, "r+") as archive:
        stored = {variable.name: archive[variable.name] for variable in layout.variables}
        if layout.joined:
            _join(layout, shards, stored)
            return
        for number, shard in enumerate(shards.files):
            units = np.flatnonzero(shards.owner == number).tolist()
            chunks = stored_chunks(shard) if units else {}
            offsets = {unit: layout.cut.offset_of(unit) for unit in units}
            for variable in layout.variables:
                mine = {offsets[unit]: chunks[variable.name][unit - shard.first] for unit in units}
                _copy(mine, stored[variable.name], layout, variable)
        if stored_cells is not None and np.any(copies >= 0):
            with h5py.File(stored_cells.path, "r") as source:
                for variable in layout.variables:
                    _copy_stored(source[variable.name], stored[variable.name], layout, variable, copies)
        missing = np.flatnonzero((shards.owner < 0) & (copies < 0)).tolist()
        for variable in layout.variables:
            if variable.dtype == "i1":  # floats are missing by themselves
                _leave_blank(stored[variable.name], layout, variable, missing)


def _copy(chunks: Mapping[tuple[int, ...], list[bytes]], archive: Any, layout: Layout, variable: Variable) -> None:
    """Put chunks, by the offset of their unit, in their places."""
    if archive.chunks is None:  # a scalar: one cell without t
        for chunk, *_ in chunks.values():
            archive[()] = decode_chunk(chunk, variable.dtype)[0]
        return
    tails, write = list(_tails(layout, variable)), archive.id.write_direct_chunk
    for offset, stored in chunks.items():
        for tail, chunk in zip(tails, stored, strict=True):
            write((*offset, *tail), chunk)


def _join(layout: Layout, shards: Shards, stored: Mapping[str, Any]) -> None:
    """Put units together to the chunks of an archive, each with what is there of them."""
    held = lru_cache(maxsize=1)(lambda number: stored_values(shards.files[number], layout))
    with ThreadPoolExecutor() as threads:
        for block in range(layout.stored.count):
            values = _joined_values(layout, shards, block, held)
            for variable, chunk in zip(layout.variables, threads.map(encode_chunk, values.values()), strict=True):
                offset = (*layout.stored.offset_of(block), *(0 for _ in layout.tail(variable)))
                stored[variable.name].id.write_direct_chunk(offset, chunk)


def _joined_values(
    layout: Layout, shards: Shards, block: int, held: Callable[[int], Mapping[str, NDArray[Any]]]
) -> dict[str, NDArray[Any]]:
    """Return what is there of a chunk of the archive, by variable, ``(place, …)``.

    ``held`` gives the values of a shard by its number; units of a shard follow each other.
    """
    cells, values = layout.stored.cells_of(block), dict[str, NDArray[Any]]()
    for v in layout.variables:
        shape = (layout.stored.size, *layout.shape_of(v, 1)[2:])
        values[v.name] = np.full(shape, v.fill, np.dtype(v.dtype).newbyteorder("<"))
    for unit in range(layout.cut.block_of(cells.start)[0], layout.cut.block_of(cells.stop - 1)[0] + 1):
        number = int(shards.owner[unit])
        if number < 0:
            continue
        mine, place, stored = layout.cells_of(unit), unit - shards.files[number].first, held(number)
        first, stop = max(mine.start, cells.start), min(mine.stop, cells.stop)
        into, part = slice(first - cells.start, stop - cells.start), slice(first - mine.start, stop - mine.start)
        for name, array in values.items():
            array[into] = stored[name][place, part]
    return values


def _copy_stored(source: Any, archive: Any, layout: Layout, variable: Variable, copies: NDArray[np.int64]) -> None:
    """Copy the chunks of units from an earlier archive, where each begins with the cell that ``copies`` gives."""
    shape = source.shape[: source.ndim - len(layout.tail(variable))]
    tails = list(_tails(layout, variable))
    for unit in np.flatnonzero(copies >= 0).tolist():
        origin = tuple(int(i) for i in np.unravel_index(int(copies[unit]), shape))
        for tail in tails:
            mask, chunk = source.id.read_direct_chunk((*origin, *tail))
            archive.id.write_direct_chunk((*layout.cut.offset_of(unit), *tail), chunk, mask)


def _leave_blank(archive: Any, layout: Layout, variable: Variable, missing: list[int]) -> None:
    if archive.chunks is None:
        if missing:
            archive[()] = variable.fill
        return
    chunk = encode_chunk(np.full(archive.chunks, variable.fill, dtype=variable.dtype))
    for unit in missing:
        for tail in _tails(layout, variable):
            archive.id.write_direct_chunk((*layout.cut.offset_of(unit), *tail), chunk)


def _tails(layout: Layout, variable: Variable) -> Iterator[tuple[int, ...]]:
    """Yield where a unit's chunks of a variable begin beyond the cases; cut is the first of its dimensions."""
    length = layout.archive_chunk_of(variable)[len(layout.dims) :]
    if not length:
        yield ()
        return
    name, *rest = layout.tail(variable)
    yield from ((start, *(0 for _ in rest)) for start in range(0, layout.sizes[name], length[0]))


def _messages(layout: Layout, shards: Shards) -> dict[int, str]:
    """Return the messages of all shards that count, by cell."""
    messages: dict[int, str] = {}
    for number, shard in enumerate(shards.files):
        for place, text in shard.messages.items():
            unit, k = divmod(place, layout.chunk)
            cells = layout.cells_of(shard.first + unit)
            if shards.owner[shard.first + unit] == number and k < len(cells):
                messages[cells[k]] = text
    return messages


def _make_room(layout: Layout, shards: Shards, stored_cells: StoredCells | None, directory: Path) -> None:
    """Refuse before HDF5 runs into a full disk, which it cannot recover from."""
    needed = sum(shard.path.stat().st_size for shard in shards.files)
    needed += 0 if stored_cells is None else stored_cells.path.stat().st_size
    variables = len(layout.variables) + len(layout.coordinates)
    needed += variables * (_VARIABLE_BYTES + _CHUNK_BYTES * layout.units) + layout.cells * _CELL_BYTES
    if needed > free_space(directory):
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
            expected = layout.stored.count * len(list(_tails(layout, variable)))
            stored = archive[variable.name]
            if stored.chunks is not None and stored.id.get_num_chunks() != expected:
                faults.append(f"{variable.name} has {stored.id.get_num_chunks()} of {expected} chunks")
        status = archive[STATUS][...]
        if status.size != layout.cells or np.any((status < 0) | (status >= NOT_RUN)):
            faults.append(f"{np.sum(status < NOT_RUN)} of {layout.cells} cases have run")
        if archive[PROVENANCE].attrs["content_hash"] != digest.encode():
            faults.append("the content hash is not in place")
    if faults:
        raise ArchiveError(f"{path}: does not read back as written: {'; '.join(faults)}; gather again")
