"""An archive's file as a dataset of xarray: chunks for dask, texts among them, and the indices of a zip."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workflow.archive._layout import STATUS

if TYPE_CHECKING:
    import xarray as xr


def opened(path: Path, chunks: Any, lock: Any) -> xr.Dataset:
    """Open a file with xarray; each coordinate of a zip has an index.

    ``chunks="auto"`` cuts each variable by the size of its numbers: dimensions are then cut as finely as any of them,
    so that all have one set of chunks. xarray makes Python strings of characters, of which dask knows no size.
    """
    import xarray as xr

    open_file = partial(xr.open_dataset, path, engine="netcdf4", decode_timedelta=False, lock=lock)
    dataset = open_file()
    if chunks is None:
        return _indexed(dataset)
    widths = _widths(dataset)
    if not widths:  # netCDF-C 4.10 crashes where several threads read strings of a file that is open twice
        dataset.close()
    if chunks == "auto":
        chunks = _finest(open_file(chunks=chunks, drop_variables=widths))
    with_chunks = open_file(chunks=chunks, drop_variables=widths)
    sizes = dict(with_chunks[STATUS].chunksizes)
    for name, width in widths.items():
        own = {dim: sizes[dim] for dim in dataset[name].dims if dim in sizes}
        with_chunks[name] = dataset[name].chunk(own).astype(f"U{width}")
    close = _closing(with_chunks, dataset)
    with_chunks = _indexed(with_chunks)
    with_chunks.set_close(close)
    return with_chunks


def _indexed(dataset: xr.Dataset) -> xr.Dataset:
    """Give an index to each coordinate of a zip: one along a dimension that has not its name."""
    zipped = [name for name, coordinate in dataset.coords.items() if coordinate.ndim == 1]
    indexed = dataset
    for name in zipped:
        if name not in dataset.xindexes:
            indexed = indexed.set_xindex(name)
    indexed.set_close(dataset._close)
    return indexed


def _finest(dataset: xr.Dataset) -> dict[str, int]:
    """Return the length of the chunks along each dimension in the variable that is cut most finely there; close it."""
    lengths: dict[str, int] = {}
    for variable in dataset.variables.values():
        for dim, own in variable.chunksizes.items():
            lengths[str(dim)] = min(lengths.get(str(dim), own[0]), own[0])
    dataset.close()
    return lengths


def _widths(dataset: xr.Dataset) -> dict[str, int]:
    """Return how many bytes the texts have that a file holds as characters; no text has more characters than bytes."""
    several = {str(name): variable for name, variable in dataset.variables.items() if variable.ndim > 0}
    return {name: v.encoding["original_shape"][-1] for name, v in several.items() if v.dtype.kind == "O"}


def _closing(*datasets: xr.Dataset) -> Callable[[], None]:
    """Return what closes several datasets; taken from them before one of them is given it."""
    closers = [dataset._close for dataset in datasets]

    def close() -> None:
        for closer in closers:
            if closer is not None:
                closer()

    return close
