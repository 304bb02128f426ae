"""Cases that are stored, found by their hashes: in the shards of a run and in the chunks of an archive.

A shard holds an array for each variable, ``(case, …)``, the messages of its cases and their hashes: a line with its CRC
in hexadecimal and, in JSON, name, dtype, shape and CRC of each array, then their bytes. It is written aside in one go,
flushed and renamed: its presence says that its cases are done. A shard of hashes alone takes cases back that were
stored before: they are run again.
"""

from __future__ import annotations

import json
import math
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.archive._files import ArchiveError, commit, file_of, opened, reason, writing
from workflow.archive._parts import SHARD
from workflow.schemes import Status
from workflow.variables import BY_NAME

if TYPE_CHECKING:
    import xarray as xr

STATUS, MESSAGE = "status", "message"

PROVENANCE, CASE_HASH = "provenance", "case_hash"
"""Group of an archive, and its variable with the identity of every case, ``(…, byte)``."""

LONGEST_MESSAGE = 4000
"""Bytes of a case's message that are kept; those of this package have a few hundred."""

Hashes = NDArray[np.uint8]
"""Identities of cases, ``(case, byte)``."""

Places = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Index of its source and row there, for each case; -1 and -1 where it is not stored."""

Kinds = Mapping[str, tuple[np.dtype[Any], tuple[int, ...]]]
"""Dtype of each stored variable, and its shape beyond the axis of the cases."""


@dataclass(frozen=True, eq=False)
class Source:
    """Some stored cases, read when they are asked for: a shard, or a chunk of an archive."""

    hashes: Hashes
    """Identity of each case, ``(case, byte)``."""
    status: NDArray[np.int8]
    """Of each case, ``(case,)``; ``not_run`` of one that is taken back."""
    read: Callable[[str], NDArray[Any]]
    """Returns a variable of all of them, ``(case, …)``, by its name; ``message`` as bytes."""
    kinds: Kinds
    """Its variables."""

    @property
    def takes_back(self) -> bool:
        """Whether it holds no results, but says which cases of earlier sources are run again."""
        return MESSAGE not in self.kinds


class Stored:
    """Cases that sources hold, the earliest first; of two with one hash that of the later source counts.

    Attributes
    ----------
    sources
        The shards and chunks.
    hashes
        Of the stored cases, each once, ``(case, byte)``.
    status
        Of each of them.
    """

    def __init__(self, sources: Iterable[Source] = ()) -> None:
        import pandas as pd

        self.sources = tuple(sources)
        self._first = np.cumsum([0, *(each.status.size for each in self.sources)])
        every = np.concatenate([np.empty((0, 16), np.uint8), *(each.hashes for each in self.sources)])
        status = np.concatenate([np.empty(0, np.int8), *(each.status for each in self.sources)])
        is_held = ~pd.Index(_keys(every)).duplicated(keep="last") & (status != Status.NOT_RUN)
        self._place = np.flatnonzero(is_held)
        self.hashes: Hashes = every if is_held.all() else every[is_held]
        self.status = status[is_held]

    def find(self, hashes: Hashes) -> Places:
        """Return which source holds each hash, in which row."""
        place = _found(self.hashes, hashes)
        is_held = place >= 0
        place[is_held] = self._place[place[is_held]]
        source = np.searchsorted(self._first, place, side="right") - 1  # -1 of -1
        return source, np.where(is_held, place - self._first[source], -1)

    def holds(self, hashes: Hashes) -> NDArray[np.bool_]:
        """Tell which hashes some source holds."""
        return _found(self.hashes, hashes) >= 0

    def status_of(self, hashes: Hashes) -> NDArray[np.int8]:
        """Return the status of the cases with some hashes; of one that no source holds it is ``not_run``."""
        return np.append(self.status, np.int8(Status.NOT_RUN))[_found(self.hashes, hashes)]


def are_among(hashes: Hashes, others: Hashes) -> NDArray[np.bool_]:
    """Tell which hashes are among some others."""
    import pandas as pd

    return _found(others[~pd.Index(_keys(others)).duplicated(keep="last")], hashes) >= 0


def _found(held: Hashes, hashes: Hashes) -> NDArray[np.int64]:
    """Return the places of hashes among those held, no two of which have one key; -1 where one is not held."""
    import pandas as pd

    if not len(held):
        return np.full(len(hashes), -1)
    place = np.asarray(pd.Index(_keys(held)).get_indexer(_keys(hashes)))
    same = held[place].view(np.uint64) == np.ascontiguousarray(hashes).view(np.uint64)
    place[~(same[:, 0] & same[:, 1])] = -1
    return place


def _keys(hashes: Hashes) -> NDArray[np.uint64]:
    """Return the first eight bytes of hashes, by which they are looked up."""
    return np.ascontiguousarray(hashes[:, :8]).view(np.uint64).ravel()


def write_shard(
    parts: str | Path,
    name: str,
    hashes: Hashes,
    values: Mapping[str, NDArray[Any]],
    messages: Mapping[int, str],
    template: xr.Dataset,
) -> Path:
    """Store the results of some cases durably and return the shard's path.

    Threads and processes may write at the same time. When this returns the shard survives a crash;
    when it does not, as on a full disk, there is none.

    Parameters
    ----------
    parts
        The directory that :func:`~workflow.archive._parts.start_parts` made.
    name
        Of the shard; of two that hold the same case the one whose name comes last counts.
    hashes
        Identity of each case, ``(case, byte)``.
    values
        One array for each variable of the template, ``(case, …)``.
    messages
        What a case has to say, by its position.
    """
    encoded = {k: truncated_message(text).encode() for k, text in messages.items()}
    texts = np.zeros(len(hashes), f"S{max([1, *map(len, encoded.values())])}")
    for k, text in encoded.items():
        texts[k] = text
    arrays = {str(name): _as_stored(values[str(name)], template.variables[name]) for name in template.data_vars}
    return _write(Path(parts), name, arrays | {MESSAGE: texts, CASE_HASH: hashes})


def take_back(parts: str | Path, name: str, hashes: Hashes) -> Source:
    """Say durably that some cases, whatever is stored of them so far, are run again; see :func:`write_shard`."""
    arrays: dict[str, NDArray[Any]] = {STATUS: np.full(len(hashes), Status.NOT_RUN, np.int8), CASE_HASH: hashes}
    _write(Path(parts), name, arrays)
    return Source(hashes, arrays[STATUS], arrays.__getitem__, {})


def _write(parts: Path, name: str, arrays: Mapping[str, NDArray[Any]]) -> Path:
    path, pieces = parts / f"{name}{SHARD}", {key: np.ascontiguousarray(array) for key, array in arrays.items()}
    about = {key: [array.dtype.str, array.shape, zlib.crc32(array.data)] for key, array in pieces.items()}
    head = json.dumps(about).encode()
    with writing("a shard", parts):
        commit(path, b"%08x " % zlib.crc32(head), head, b"\n", *pieces.values())
    return path


def _as_stored(values: NDArray[Any], like: xr.Variable) -> NDArray[Any]:
    if values.dtype.kind == "U":
        values = np.strings.encode(values).astype(f"S{like.shape[-1]}").view("S1").reshape(len(values), -1)
    with np.errstate(over="ignore"):  # a diverged float64 is an infinite float32
        values = np.asarray(values, dtype=like.dtype.newbyteorder("<"))
    if values.dtype.kind == "f" and (missing := np.isnan(values)).any():
        values = np.where(missing, np.array(np.nan, values.dtype), values)  # one NaN, whatever made it
    return values


def truncated_message(text: str) -> str:
    """Return a case's message cut to :data:`LONGEST_MESSAGE` bytes."""
    encoded = text.encode(errors="replace")
    if len(encoded) <= LONGEST_MESSAGE:
        return encoded.decode()
    return encoded[: LONGEST_MESSAGE - 3].decode(errors="ignore") + "…"


def find_shards(parts: str | Path, begins: str = "", *, check: bool = True) -> list[Source]:
    """Return the sound shards whose names begin so, in the order of their names.

    Every byte is compared with its checksum now, or without ``check`` when it is used. A damaged shard is left where it
    is: its cases are run again.
    """
    sources = []
    for path in sorted(Path(parts).glob(f"{begins}*{SHARD}")):
        with suppress(Exception):  # whatever changed bytes make of them
            arrays = _arrays(path)
            for name in arrays if check else ():
                _read_array(path, arrays, name)
            kinds = {name: (array.dtype, array.shape[1:]) for name, array in arrays.items()}
            hashes, status = (_read_array(path, arrays, name) for name in (CASE_HASH, STATUS))
            sources.append(Source(hashes, status, partial(_read_array, path, arrays), kinds))
    return sources


class _Array(NamedTuple):
    """An array in a shard: what it is, the CRC of its bytes, and where they begin."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    crc: int
    begin: int


def _arrays(path: Path) -> dict[str, _Array]:
    """Return the arrays of a shard by name."""
    arrays = {}
    with open(path, "rb") as file:
        crc, head = file.readline().split(b" ", 1)
        begin = file.tell()
    if int(crc, 16) != zlib.crc32(head[:-1]):
        raise ValueError("checksum")
    for name, (kind, shape, crc) in json.loads(head).items():
        arrays[name] = _Array(np.dtype(kind), tuple(shape), crc, begin)
        begin += math.prod(shape) * arrays[name].dtype.itemsize
    return arrays


def _read_array(path: Path, arrays: Mapping[str, _Array], name: str) -> NDArray[Any]:
    try:
        dtype, shape, crc, begin = arrays[name]
        with open(path, "rb") as file:
            file.seek(begin)
            image = file.read(math.prod(shape) * dtype.itemsize)
        if zlib.crc32(image) != crc:
            raise ValueError(f"checksum of {name}")
        return np.frombuffer(image, dtype).reshape(shape)
    except Exception as error:
        raise ArchiveError(f"{path}: damaged while it was read ({reason(error)}); give the command again") from error


def archive_sources(path: Path) -> list[Source]:
    """Return the cases of an archive, chunk by chunk; refuse a damaged one."""
    then, hashes = file_of(path), stored_hashes(path)
    with opened(path) as file:
        status, lengths = file[STATUS][...], file[STATUS].chunks or ()
        kinds = {name: (each.dtype, each.shape[status.ndim :]) for name, each in file.items() if hasattr(each, "dtype")}
    index = np.arange(status.size).reshape(status.shape)
    sources = []
    for box in boxes(status.shape, lengths):
        cases = index[box].ravel()
        sources.append(Source(hashes[cases], status.ravel()[cases], partial(_read_box, path, then, box), kinds))
    return sources


def boxes(shape: Sequence[int], lengths: Sequence[int]) -> Iterator[tuple[slice, ...]]:
    """Yield the parts of an array, at most so long along each dimension, in C order."""
    sides = ([slice(k, min(k + n, size)) for k in range(0, size, n)] for size, n in zip(shape, lengths, strict=True))
    return product(*sides)


def _read_box(path: Path, then: tuple[int, int] | None, box: tuple[slice, ...], name: str) -> NDArray[Any]:
    """Return a variable of a box of cases, ``(case, …)``, of the very file whose hashes were read."""
    with opened(path) as file:
        values = np.asarray(file[name][box])
    if file_of(path) != then:
        raise ArchiveError(f"{path}: was replaced while cases are taken from it; give the command again")
    values = values.reshape(-1, *values.shape[len(box) :])
    return np.ascontiguousarray(values).view(f"S{values.shape[1]}")[:, 0] if name == MESSAGE else values


def stored_hashes(path: Path) -> Hashes:
    """Return the identity of every case of an archive, ``(case, byte)``; refuse a damaged one."""
    with opened(path) as file:
        hashes = file[PROVENANCE][CASE_HASH][...]
        return np.asarray(hashes.reshape(-1, hashes.shape[-1]), dtype=np.uint8)


def lacking(template: xr.Dataset, kinds: Kinds) -> list[str]:
    """Return the variables of a template that are not stored, or not in its precision, or not along ``t`` to its end.

    A scheme's own metrics, which cases of other schemes lack, do not count, nor periods of a study that has none.
    """
    cases = template.variables[STATUS].ndim
    missing = [str(name) for name in template.data_vars if not _has(kinds, str(name), template.variables[name], cases)]
    wanted = {name: template[name].dtype for name in missing}
    return [f"{k} as {dtype}" if k in kinds and kinds[k][0] != dtype else k for k, dtype in wanted.items()]


def _has(kinds: Kinds, name: str, variable: xr.Variable, cases: int) -> bool:
    """Tell whether a variable is stored, the first dimensions of which are those of the cases."""
    is_period, is_steady = "period" in variable.dims, name in BY_NAME and BY_NAME[name].condition == "steady"
    if name not in kinds:
        return name not in BY_NAME or is_steady or (is_period and "period" not in kinds)
    dtype, tail = kinds[name]
    # the hash of a case covers how many samples it has, or events, or sectors
    is_whole = is_period or is_steady or {"event", "sector"} & set(variable.dims) or tail == variable.shape[cases:]
    return bool(is_whole) and dtype.itemsize >= variable.dtype.itemsize


def surplus(template: xr.Dataset, kinds: Kinds) -> list[str]:
    """Return what is stored that a template has no place for: histories, depths, balances, sections, digits of them."""
    names = []
    for name, (dtype, _) in sorted(kinds.items()):  # libraries list a file's variables in orders of their own
        about = BY_NAME.get(name)
        if about is None or not (about.shape == "history" or about.condition in ("depth", "balances", "sections")):
            continue
        if name not in template.data_vars:
            names.append(name)
        elif dtype.itemsize > template.variables[name].dtype.itemsize:
            names.append(f"{name} as {dtype.name}")
    return names
