"""An archive's file as a dataset of xarray: texts that it holds as characters, and chunks for dask."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workflow.archive._layout import STATUS

if TYPE_CHECKING:
    import xarray as xr


def opened(path: Path, chunks: Any, lock: Any) -> xr.Dataset:
    """Open a file with xarray; what it holds as characters becomes texts when it is read.

    ``chunks="auto"`` cuts each variable by the size of its numbers: dimensions are then cut as finely as any of them,
    so that all have one set of chunks.
    """
    import xarray as xr

    open_file = partial(xr.open_dataset, path, engine="netcdf4", decode_timedelta=False, lock=lock)
    dataset = open_file()
    widths = _widths(dataset)
    dataset.update(_decoded(dataset[list(widths)]))
    if chunks is None:
        return dataset
    if not widths:  # netCDF-C 4.10 crashes where several threads read strings of a file that is open twice
        dataset.close()
    if chunks == "auto":
        chunks = _finest(open_file(chunks=chunks, drop_variables=widths))
    with_chunks = open_file(chunks=chunks, drop_variables=widths)
    sizes = dict(with_chunks[STATUS].chunksizes)
    for name, width in widths.items():
        own = {dim: sizes[dim] for dim in dataset[name].dims if dim in sizes}
        with_chunks[name] = dataset[name].chunk(own).astype(f"U{width}")
    with_chunks.set_close(_closing(with_chunks, dataset))
    return with_chunks


def _finest(dataset: xr.Dataset) -> dict[str, int]:
    """Return the length of the chunks along each dimension in the variable that is cut most finely there; close it."""
    lengths: dict[str, int] = {}
    for variable in dataset.variables.values():
        for dim, own in variable.chunksizes.items():
            lengths[str(dim)] = min(lengths.get(str(dim), own[0]), own[0])
    dataset.close()
    return lengths


def _widths(dataset: xr.Dataset) -> dict[str, int]:
    """Return how many bytes the texts have that a file holds as characters; no text has more characters than bytes.

    Of characters with an attribute ``_Encoding`` (a zip's texts, messages of older archives) xarray makes objects.
    """
    several = {str(name): variable for name, variable in dataset.variables.items() if variable.ndim > 0}
    stored = {name: variable.dtype.itemsize for name, variable in several.items() if variable.dtype.kind == "S"}
    decoded = {n: v.encoding["original_shape"][-1] for n, v in several.items() if v.dtype.kind == "O"}
    return stored | decoded


def _decoded(characters: xr.Dataset) -> xr.Dataset:
    """Return variables of bytes as variables of texts, which xarray decodes when they are read."""
    import xarray as xr

    encoded = [name for name in characters.data_vars if characters[name].dtype.kind == "S"]
    named = characters.assign({n: characters[n].assign_attrs(_Encoding="utf-8") for n in encoded})
    return xr.decode_cf(named, decode_times=False)


def _closing(*datasets: xr.Dataset) -> Callable[[], None]:
    """Return what closes several datasets; taken from them before one of them is given it."""
    closers = [dataset._close for dataset in datasets]

    def close() -> None:
        for closer in closers:
            if closer is not None:
                closer()

    return close
