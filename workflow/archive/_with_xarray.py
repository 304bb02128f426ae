"""An archive's file as a dataset of xarray: chunks for dask, and an index for each coordinate of a zip."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


def open_dataset(path: Path, chunks: Any) -> xr.Dataset:
    """Open a file with xarray and give an index to each coordinate along a dimension of another name.

    ``chunks="auto"`` cuts each variable by the size of its numbers: dimensions are then cut as finely as any of them,
    so that all have one set of chunks.
    """
    import xarray as xr

    from workflow.archive._lock import LOCK
    from workflow.archive._numbers import find_near
    from workflow.archive._xarray_parts import ZipIndex, turnable

    open_file = partial(xr.open_dataset, path, engine="netcdf4", decode_timedelta=False, lock=LOCK)
    with LOCK:
        dataset = open_file(chunks=_finest(open_file) if chunks == "auto" else chunks)
    texts = {name: each for name, each in dataset.variables.items() if each.dtype.kind == "O" and not each._in_memory}
    indexed = dataset.assign({name: turnable(each) for name, each in texts.items() if chunks is None})
    along: dict[Hashable, list[Hashable]] = {}  # without the lock: dask reads coordinates in threads
    for name, coordinate in dataset.coords.items():
        if coordinate.ndim == 1 and name not in dataset.xindexes:
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
