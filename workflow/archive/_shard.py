"""Shards: the results of a range of units in a file of its own, whose presence says that they are done.

A shard is one line of JSON, which says what it holds, and the archive's own chunks, filtered as HDF5
stores them, one after the other; of units that are joined when they are gathered, all values of each
variable, not compressed yet. It is built in memory and written in one go; its name carries the
checksum of its bytes, so that one rename commits both.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._files import commit, reason, writing
from workflow.archive._layout import NOT_RUN, STATUS, Layout, Variable

SUFFIX = ".shard"
LEVEL = 1
"""zlib level of shards and archive, always with shuffle."""
UNCOMPRESSED = 0
"""zlib level of what is compressed later."""


@dataclass(frozen=True)
class Shard:
    """A sound shard of this layout: units ``first`` to ``stop - 1``, messages by place in the shard."""

    path: Path
    task: int
    first: int
    stop: int
    messages: Mapping[int, str]


@dataclass(frozen=True, eq=False)
class Shards:
    """What :func:`find_shards` found.

    Attributes
    ----------
    files
        Sound shards; where two hold the same unit, the later one of this tuple counts.
    owner
        Which of ``files`` counts for each unit, -1 where none does, shape ``(unit,)``.
    rejected
        Name and fault of each file that does not count.
    """

    files: tuple[Shard, ...]
    owner: NDArray[np.intp]
    rejected: tuple[tuple[str, str], ...]

    @property
    def complete(self) -> bool:
        """Whether no unit is missing."""
        return bool(np.all(self.owner >= 0))

    @property
    def missing(self) -> tuple[tuple[int, int], ...]:
        """Ranges ``(first, stop)`` of units that no sound shard holds."""
        return _ranges(self.owner < 0)

    @property
    def present(self) -> tuple[tuple[int, int], ...]:
        """Ranges ``(first, stop)`` of units that are done."""
        return _ranges(self.owner >= 0)


def write_shard(
    parts: str | Path,
    task: int,
    first_unit: int,
    arrays: Mapping[str, NDArray[Any]],
    messages: Mapping[int, str],
    layout: Layout,
) -> Path:
    """Store a contiguous range of units durably and return the shard's path.

    Threads and processes may write at the same time. When this returns the shard survives a crash;
    when it does not, there is none.

    Parameters
    ----------
    parts
        The directory that :func:`start_parts` made.
    task
        Orders shards that hold the same unit: the highest number counts.
    first_unit
        The first unit of the range.
    arrays
        One per variable, shape ``(units, chunk, …)``; what pads a row's last unit is
        free. :func:`blank` makes them.
    messages
        What a case that is not ok did, by its position ``unit * chunk + place`` in the first two
        axes of ``arrays``.
    layout
        The archive's layout.

    Raises
    ------
    ArchiveError
        The disk is full, or the directory missing or not writable.
    ValueError
        The arrays do not fit the layout, or a case has not run.
    """
    parts = Path(parts)
    stop = first_unit + _check(first_unit, arrays, messages, layout)
    encoded = {v.name: _encode(arrays[v.name], v, layout) for v in layout.variables}
    about = {
        "structure": layout.structure,
        "task": task,
        "first": first_unit,
        "stop": stop,
        "messages": {str(place): messages[place] for place in sorted(messages)},
        "chunks": {name: [len(chunk) for chunk in chunks] for name, chunks in encoded.items()},
    }
    data = b"".join([json.dumps(about).encode(), b"\n", *(chunk for chunks in encoded.values() for chunk in chunks)])
    checksum = hashlib.sha256(data).hexdigest()
    path = parts / f"{_stem(first_unit, stop, task)}-{checksum}{SUFFIX}"
    with writing("a shard", parts):
        commit(path, data)
    return path


def find_shards(parts: str | Path, layout: Layout) -> Shards:
    """Return which units are done, and which files are torn or of another study.

    Every byte is read against its checksum. What does not count is left where it is: its units are
    missing, and shards computed anew take their place.

    Raises
    ------
    ArchiveError
        The directory cannot be read; one that is not there merely holds nothing.
    """
    parts = Path(parts)
    shards: list[Shard] = []
    rejected: list[tuple[str, str]] = []
    for path in sorted(parts.glob(f"*{SUFFIX}")):
        shard = _inspect(path, layout)
        if isinstance(shard, Shard):
            shards.append(shard)
        else:
            rejected.append((path.name, shard))
    shards.sort(key=lambda shard: (shard.task, shard.path.name))
    owner = np.full(layout.units, -1, dtype=np.intp)
    for number, shard in enumerate(shards):
        owner[shard.first : shard.stop] = number
    return Shards(tuple(shards), owner, tuple(rejected))


def find_shard(parts: str | Path, task: int, first: int, stop: int, layout: Layout) -> Shard | None:
    """Return the sound shard of units ``first`` to ``stop - 1`` that this very task has stored, if there is one."""
    for path in sorted(Path(parts).glob(f"{_stem(first, stop, task)}-*{SUFFIX}")):
        shard = _inspect(path, layout)
        if isinstance(shard, Shard):
            return shard
    return None


def stored_chunks(shard: Shard) -> dict[str, list[list[bytes]]]:
    """Return the chunks of a sound shard, filtered as they lie in the archive: by variable, one list per unit.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    units = shard.stop - shard.first
    return {
        name: [chunks[k * len(chunks) // units : (k + 1) * len(chunks) // units] for k in range(units)]
        for name, chunks in _read_chunks(shard).items()
    }


def stored_values(shard: Shard, layout: Layout) -> dict[str, NDArray[Any]]:
    """Return what a sound shard holds whose units are joined, by variable, ``(unit, place, …)``.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    chunks, units = _read_chunks(shard), shard.stop - shard.first
    return {
        v.name: np.concatenate([decode_chunk(chunk, v.dtype) for chunk in chunks[v.name]]).reshape(
            layout.shape_of(v, units)
        )
        for v in layout.variables
    }


def _read_chunks(shard: Shard) -> dict[str, list[bytes]]:
    with open(shard.path, "rb") as file:
        lengths = json.loads(file.readline())["chunks"]
        return {name: [file.read(length) for length in several] for name, several in lengths.items()}


def stored_status(shard: Shard, layout: Layout) -> NDArray[np.int8]:
    """Return the status of the cases of a sound shard, ``(unit, place)``; nothing else of it is read.

    Raises
    ------
    OSError
        The file cannot be read.
    """
    with open(shard.path, "rb") as file:
        lengths = json.loads(file.readline())["chunks"]
        before = list(lengths)[: list(lengths).index(STATUS)]
        file.seek(sum(sum(lengths[name]) for name in before), os.SEEK_CUR)
        chunks = [file.read(length) for length in lengths[STATUS]]
    return np.array([decode_chunk(chunk, "i1") for chunk in chunks]).reshape(-1, layout.chunk)


def encode_chunk(values: NDArray[Any], level: int = LEVEL) -> bytes:
    """Return one chunk as HDF5's filters shuffle and deflate would store it.

    Done here rather than in HDF5 because zlib and NumPy let other threads run meanwhile.
    """
    size = values.dtype.itemsize
    if size > 1:
        values = np.ascontiguousarray(values.view(np.uint8).reshape(-1, size).T)
    return zlib.compress(values.data, level)


def decode_chunk(chunk: bytes, dtype: str) -> NDArray[Any]:
    """Return the values of a chunk that :func:`encode_chunk` made, ``(value,)``."""
    kind = np.dtype(dtype).newbyteorder("<")
    shuffled = np.frombuffer(zlib.decompress(chunk), np.uint8).reshape(kind.itemsize, -1)
    return np.ascontiguousarray(shuffled.T).view(kind).ravel()


def _stem(first: int, stop: int, task: int) -> str:
    return f"{first:08d}-{stop:08d}-{task:06d}"


def _check(first: int, arrays: Mapping[str, NDArray[Any]], messages: Mapping[int, str], layout: Layout) -> int:
    if wrong := set(arrays) ^ {v.name for v in layout.variables}:
        raise ValueError(f"arrays of a shard and variables of its layout differ: {', '.join(sorted(wrong))}")
    status = arrays[STATUS]
    units = len(status)
    for variable in layout.variables:
        shape, expected = arrays[variable.name].shape, layout.shape_of(variable, units)
        if shape != expected:
            raise ValueError(f"{variable.name} has shape {shape} in a shard that wants {expected}")
    if not 0 <= first < first + units <= layout.units:
        raise ValueError(f"units {first} to {first + units - 1} are not among the layout's {layout.units}")
    for unit in range(units):
        here = len(layout.cells_of(first + unit))
        if np.any((status[unit, :here] < 0) | (status[unit, :here] >= NOT_RUN)):
            raise ValueError(f"unit {first + unit} holds a case that has not run")
    if any(not 0 <= place < units * layout.chunk for place in messages):
        raise ValueError("a message for a case outside the shard")
    return units


def _encode(values: NDArray[Any], variable: Variable, layout: Layout) -> list[bytes]:
    """Return the chunks of a variable, unit by unit; one of all units where they are joined."""
    with np.errstate(over="ignore"):  # a diverged float64 is an infinite float32
        values = np.ascontiguousarray(values, dtype=np.dtype(variable.dtype).newbyteorder("<"))
    if variable.dtype != "i1" and (missing := np.isnan(values)).any():
        values = np.where(missing, np.array(np.nan, values.dtype), values)  # one NaN, whatever made it
    if layout.joined:
        return [encode_chunk(values, UNCOMPRESSED)]
    _, _, *tail = layout.chunk_of(variable)
    if not tail:
        return [encode_chunk(unit) for unit in values]
    length, *rest = tail
    pieces = []
    for unit in values:
        starts = range(0, unit.shape[1], length)
        padded = np.full((layout.chunk, len(starts) * length, *rest), variable.fill, dtype=values.dtype)
        padded[:, : unit.shape[1]] = unit
        pieces += [encode_chunk(np.ascontiguousarray(padded[:, at : at + length])) for at in starts]
    return pieces


def _inspect(path: Path, layout: Layout) -> Shard | str:
    """Return a sound shard, or what is wrong with the file."""
    try:
        with open(path, "rb") as file:
            checksum = hashlib.file_digest(file, "sha256").hexdigest()
            file.seek(0)
            head = file.readline()
    except OSError as error:
        return f"cannot be read: {reason(error)}"
    if not path.name.endswith(f"-{checksum}{SUFFIX}"):
        return "damaged: its bytes do not have the checksum of its name"
    try:
        about = json.loads(head)
        if about["structure"] != layout.structure:
            return "of another study, solver version or chunk length"
        messages = {int(place): text for place, text in about["messages"].items()}
        return Shard(path, about["task"], about["first"], about["stop"], messages)
    except (ValueError, KeyError, TypeError, AttributeError):
        return "not a shard"


def _ranges(chosen: NDArray[np.bool_]) -> tuple[tuple[int, int], ...]:
    edges = np.flatnonzero(np.diff(np.concatenate(([False], chosen, [False])).astype(np.int8)))
    return tuple((int(first), int(stop)) for first, stop in edges.reshape(-1, 2))
