"""An archive's file as a dataset of xarray: chunks for dask, indices that find what users ask for, texts that are lazy.

It is imported where an archive is opened: it takes xarray with it.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from xarray.backends import BackendArray
from xarray.core import indexing
from xarray.indexes import PandasIndex

from workflow.archive._files import LOCK

_SAME = 1e-9
"""Relative difference up to which two numbers are one: values of an archive have twelve digits at least."""


def open_dataset(path: Path, chunks: Any) -> xr.Dataset:
    """Open a file with xarray and give an index to each coordinate along a dimension of cases of another name.

    ``chunks="auto"`` cuts each variable by the size of its numbers: dimensions are then cut as finely as any of them,
    so that all have one set of chunks.
    """
    open_file = partial(xr.open_dataset, path, engine="netcdf4", decode_timedelta=False, lock=LOCK)
    with LOCK:
        dataset = open_file(chunks=_finest(open_file) if chunks == "auto" else chunks)
    texts = {name: each for name, each in dataset.variables.items() if each.dtype.kind == "O" and not each._in_memory}
    indexed = dataset.assign({name: turnable(each) for name, each in texts.items() if chunks is None})
    along: dict[Hashable, list[Hashable]] = {}  # without the lock: dask reads coordinates in threads
    for name, coordinate in dataset.coords.items():
        if coordinate.ndim == 1 and name not in dataset.xindexes and coordinate.dims != ("contact",):
            along.setdefault(coordinate.dims[0], []).append(name)
    for names in along.values():
        indexed = indexed.set_xindex(names, ZipIndex if len(names) > 1 else None)
    for index in indexed.indexes.values():
        find_near(index)
    indexed.set_close(dataset._close)
    return indexed


def _finest(open_file: Callable[..., xr.Dataset]) -> dict[str, int]:
    """Return the least length of the chunks along each dimension that dask chooses; it cannot choose for texts."""
    with open_file() as dataset:
        texts = [name for name, variable in dataset.variables.items() if variable.dtype.kind == "O"]
    lengths: dict[str, int] = {}
    with open_file(chunks="auto", drop_variables=texts) as dataset:
        for variable in dataset.variables.values():
            for dim, own in variable.chunksizes.items():
                lengths[str(dim)] = min(lengths.get(str(dim), own[0]), own[0])
    return lengths


class Numbers(pd.Index):  # type: ignore[misc]
    """An index that finds a number within :data:`_SAME`, and its slices begin and end there; its parts do so too."""

    def get_loc(self, key: Any) -> Any:
        return super().get_loc(self._held(key)[()])

    def get_indexer(self, target: Any, *how: Any, **kind: Any) -> Any:
        return super().get_indexer(self._held(target), *how, **kind)

    def get_slice_bound(self, label: Any, side: Any) -> Any:
        return super().get_slice_bound(self._held(label)[()], side)

    def _held(self, wanted: Any) -> Any:
        """Return numbers as the index holds them, others as they are."""
        numbers = np.asarray(wanted)
        if numbers.dtype.kind not in "fiu" or not self.size:
            return numbers
        held = np.sort(self.values)
        above = np.searchsorted(held, numbers)
        low, high = held.take(above - 1, mode="clip"), held.take(above, mode="clip")
        near = np.where(numbers - low < high - numbers, low, high)
        return np.where(np.abs(near - numbers) <= _SAME * np.abs(numbers), near, numbers)


def find_near(index: pd.Index) -> pd.Index:
    """Make an index of numbers one of :class:`Numbers`, whatever class pandas calls, and return it."""
    if index.dtype.kind == "f":
        index.__class__ = Numbers
    return index


class ZipIndex(PandasIndex):
    """An index of the coordinates along one dimension together: xarray stacks no dimension that has several."""

    @classmethod
    def from_variables(cls, variables: Mapping[Any, Any], *, options: Mapping[str, Any]) -> ZipIndex:
        """Return the index of coordinates."""
        (dim,) = {variable.dims[0] for variable in variables.values()}
        return cls(pd.MultiIndex.from_arrays([each.values for each in variables.values()], names=list(variables)), dim)

    def create_variables(self, variables: Mapping[Any, Any] | None = None) -> dict[Any, Any]:
        """Return the coordinates."""
        named = {name: np.asarray(self.index.get_level_values(name)) for name in self.index.names}
        kept = {name: (variables or {}).get(name) for name in named}
        return {name: xr.Variable(self.dim, named[name], getattr(kept[name], "attrs", None)) for name in named}

    def sel(self, labels: dict[Any, Any], method: Any = None, tolerance: Any = None) -> Any:
        """Return where labels of one of the coordinates lie."""
        if len(labels) > 1:
            raise ValueError(f"{', '.join(labels)} lie along one dimension: select by one of them")
        (name,) = labels
        return PandasIndex(find_near(self.index.get_level_values(name)), self.dim).sel(labels, method, tolerance)

    def rename(self, name_dict: Mapping[Any, Any], dims_dict: Mapping[Any, Any]) -> ZipIndex:
        """Return the index of coordinates of other names."""
        names = [name_dict.get(name, name) for name in self.index.names]
        return ZipIndex(self.index.rename(names), dims_dict.get(self.dim, self.dim))


class _Texts(BackendArray):
    def __init__(self, texts: Any):
        self.texts, self.shape, self.dtype = texts, texts.shape, texts.dtype

    def __getitem__(self, key: indexing.ExplicitIndexer) -> Any:
        return indexing.explicit_indexing_adapter(key, self.shape, indexing.IndexingSupport.OUTER, self._read)

    def _read(self, key: tuple[Any, ...]) -> Any:
        return np.asarray(indexing.LazilyIndexedArray(self.texts).oindex[indexing.OuterIndexer(key)])


def turnable(texts: xr.Variable) -> xr.Variable:
    """Return texts of a file that are read when they are used; xarray's own, of single characters, cannot be turned."""
    return xr.Variable(texts.dims, indexing.LazilyIndexedArray(_Texts(texts._data)), texts.attrs, texts.encoding)
