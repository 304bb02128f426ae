"""Cases that are stored, by their hashes: in the shards of a run and in the archive of an earlier one."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._files import ArchiveError, file_of, reading
from workflow.schemes import Status
from workflow.variables import BY_NAME

if TYPE_CHECKING:
    import xarray as xr

STATUS, MESSAGE = "status", "message"

PROVENANCE, CASE_HASH = "provenance", "case_hash"
"""Group of an archive, and its variable with the identity of every case, ``(…, byte)``."""

Hashes = NDArray[np.uint8]
"""Identities of cases, ``(case, byte)``."""

Places = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Number of a source and row there, for each case; -1 where none holds it."""

Kinds = Mapping[str, tuple[np.dtype[Any], tuple[int, ...]]]
"""For each variable that is stored its dtype, and its sizes along ``t`` and so on."""


@dataclass(frozen=True, eq=False)
class Source:
    """Results of some cases, which are read when they are asked for: a shard, or a chunk of an archive.

    Attributes
    ----------
    hashes
        Identity of each case, ``(case, byte)``.
    status
        Of each case, ``(case,)``.
    read
        Returns a variable of all of them, ``(case, …)``, by its name; ``message`` as bytes.
    kinds
        What is stored.
    name
        Of a shard; empty of an archive, which is earlier than any.
    """

    hashes: Hashes
    status: NDArray[np.int8]
    read: Callable[[str], NDArray[Any]]
    kinds: Kinds
    name: str = ""

    def only_ok(self) -> Source:
        """Return the cases that are ok."""
        rows = np.flatnonzero(self.status == Status.OK)
        return Source(self.hashes[rows], self.status[rows], lambda name: self.read(name)[rows], self.kinds, self.name)


class Stored:
    """Cases that sources hold, the earliest first; of two with one hash that of the later source counts."""

    def __init__(self, sources: Iterable[Source] = ()) -> None:
        self.sources = tuple(sources)
        self._first = np.cumsum([0, *(each.status.size for each in self.sources)])
        self.hashes: Hashes = np.concatenate([np.empty((0, 16), np.uint8), *(each.hashes for each in self.sources)])

    def find(self, hashes: Hashes) -> Places:
        """Return which source holds each hash, in which row."""
        import pandas as pd

        if not len(self.hashes):
            return np.full(len(hashes), -1), np.full(len(hashes), -1)
        keys = _keys(self.hashes)
        last = np.flatnonzero(~pd.Index(keys).duplicated(keep="last"))
        place = last[pd.Index(keys[last]).get_indexer(_keys(hashes))]  # some other one where none is held
        same = self.hashes[place].view(np.uint64) == np.ascontiguousarray(hashes).view(np.uint64)
        is_held, source = same[:, 0] & same[:, 1], np.searchsorted(self._first, place, side="right") - 1
        return np.where(is_held, source, -1), np.where(is_held, place - self._first[source], -1)

    def holds(self, hashes: Hashes) -> NDArray[np.bool_]:
        """Tell which hashes some source holds."""
        return self.find(hashes)[0] >= 0

    def status(self, hashes: Hashes) -> NDArray[np.int8]:
        """Return the status of the cases that some source holds."""
        source, row = self.find(hashes)
        status = np.empty(len(hashes), np.int8)
        for number in np.unique(source[source >= 0]).tolist():
            status[source == number] = self.sources[number].status[row[source == number]]
        return status[source >= 0]


def are_among(hashes: Hashes, others: Hashes) -> NDArray[np.bool_]:
    """Tell which hashes are among some others."""
    return Stored([Source(others, np.zeros(len(others), np.int8), lambda _: others, {})]).holds(hashes)


def _keys(hashes: Hashes) -> NDArray[np.uint64]:
    """Return the first eight bytes of hashes, by which they are looked up."""
    return np.ascontiguousarray(hashes[:, :8]).view(np.uint64).ravel()


def archive_sources(path: Path) -> list[Source]:
    """Return the cases of an archive, chunk by chunk.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    then, hashes = file_of(path), stored_hashes(path)
    with opened(path) as file:
        status, lengths = file[STATUS][...], file[STATUS].chunks or ()
        kinds = {name: (each.dtype, each.shape[status.ndim :]) for name, each in file.items() if hasattr(each, "dtype")}
    index = np.arange(status.size).reshape(status.shape)
    sources = []
    for box in boxes(status.shape, lengths):
        cases = index[box].ravel()
        sources.append(Source(hashes[cases], status.ravel()[cases], partial(_read, path, then, box), kinds))
    return sources


def boxes(shape: Sequence[int], lengths: Sequence[int]) -> Iterator[tuple[slice, ...]]:
    """Yield the parts of an array, at most so long along each dimension, in C order."""
    sides = ([slice(k, min(k + n, size)) for k in range(0, size, n)] for size, n in zip(shape, lengths, strict=True))
    return product(*sides)


def _read(path: Path, then: tuple[int, int] | None, box: tuple[slice, ...], name: str) -> NDArray[Any]:
    """Return a variable of a box of cases, ``(case, …)``, of the very file whose hashes were read."""
    with opened(path) as file:
        values = np.asarray(file[name][box])
    if file_of(path) != then:
        raise ArchiveError(f"{path}: was replaced while cases are taken from it; give the command again")
    values = values.reshape(-1, *values.shape[len(box) :])
    return np.ascontiguousarray(values).view(f"S{values.shape[1]}")[:, 0] if name == MESSAGE else values


def stored_hashes(path: Path) -> Hashes:
    """Return the identity of every case of an archive, ``(case, byte)``.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    with opened(path) as file:
        hashes = file[PROVENANCE][CASE_HASH][...]
        return np.asarray(hashes.reshape(-1, hashes.shape[-1]), dtype=np.uint8)


def lacking(template: xr.Dataset, kinds: Kinds) -> list[str]:
    """Return the variables of a template that are not stored, or not in its precision, or not along ``t`` to its end.

    What not every scheme gives is missing in all cases without it, and so are load periods without any.
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
    is_whole = is_period or is_steady or tail == variable.shape[cases:]  # the hash covers how many samples an orbit has
    return is_whole and dtype.itemsize >= variable.dtype.itemsize


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


@contextmanager
def opened(path: Path) -> Iterator[Any]:
    """Open an archive with what it is read with here, under the lock of that library.

    Raises
    ------
    ArchiveError
        It is damaged.
    """
    import h5py

    from workflow.archive._lock import LOCK

    with LOCK, reading(path), h5py.File(path, "r") as file:
        yield file
