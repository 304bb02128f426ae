"""The archive without its results: dimensions, coordinates, attributes, messages, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._chunk import LEVEL
from workflow.archive._layout import CHUNK_BYTES, FORMAT, MESSAGE, Attributes, Layout
from workflow.archive._stored import CASE_HASH, PROVENANCE, Hashes, boxes

CONVENTIONS = "CF-1.11"
FORMAT_NAME = "archive_format"
"""Global attribute that marks a NetCDF file as an archive of this package, with its version."""

ATTRIBUTE_BYTES = 64_000
"""A longer text of the provenance group is a variable, as HDF5's plain attributes end at 64 KiB."""


def create(layout: Layout, path: Path, messages: Mapping[int, bytes], hashes: Hashes) -> None:
    """Write everything but the results to a new NetCDF-4 file; chunks stay unallocated.

    Parameters
    ----------
    messages
        In UTF-8, by cell; the variable ``message`` is empty elsewhere.
    hashes
        Identity of every case, ``(cell, byte)``.

    Raises
    ------
    OSError, RuntimeError
        The file cannot be written.
    """
    import netCDF4

    from workflow.archive._lock import LOCK

    path = path.absolute()  # netCDF-C skips spaces that a path begins with
    with LOCK, netCDF4.Dataset(path, "w", format="NETCDF4") as file:
        for name, value in {"Conventions": CONVENTIONS, **layout.attrs, FORMAT_NAME: str(FORMAT)}.items():
            file.setncattr(name, value)
        for name, size in layout.sizes.items():
            file.createDimension(name, size)
        _create_coordinates(file, layout)
        _create_variables(file, layout)
        _create_messages(file, layout, messages)
        _create_provenance(file, layout, hashes)


def _create_coordinates(file: Any, layout: Layout) -> None:
    """Write coordinates; those of a zip are cut along its dimension as the results are, so that dask's chunks agree."""
    lengths = dict(zip((name for name, _ in layout.dims), layout.lengths, strict=True))
    for coordinate in layout.coordinates:
        name, dims, values = coordinate.name, coordinate.dims, coordinate.values
        chunks = values.shape if dims in ((), (name,)) else tuple(lengths[dim] for dim in dims)
        if coordinate.text and dims == (name,):  # CF allows an axis no further dimension
            target = file.createVariable(name, str, dims)
            target.setncatts(coordinate.attrs)
            target[...] = values
        elif coordinate.text:
            encoded = [text.encode() for text in values.ravel()]
            target = _create_text(file, name, dims, chunks, max(1, *map(len, encoded)), coordinate.attrs)
            target[...] = _characters(encoded, values.shape, target.shape[-1])
        else:
            target = file.createVariable(name, values.dtype, dims, chunksizes=chunks or None, fletcher32=bool(dims))
            target.setncatts(_typed(coordinate.attrs, values.dtype))
            target[...] = values


def _create_text(
    file: Any, name: str, dims: tuple[str, ...], chunks: tuple[int, ...], length: int, attrs: Attributes
) -> Any:
    """Create a variable of texts: UTF-8 characters along a last dimension, of which xarray makes strings as it reads.

    HDF5's strings of variable length have no checksum, and xarray reads all of them as it opens a file.
    """
    file.createDimension(f"{name}_length", length)
    target = file.createVariable(
        name,
        "S1",
        (*dims, f"{name}_length"),
        compression="zlib",
        complevel=LEVEL,
        fletcher32=True,
        chunksizes=(*chunks, max(1, min(length, CHUNK_BYTES // math.prod(chunks)))),
    )
    target.setncatts({**attrs, "_Encoding": "utf-8"})
    target.set_auto_chartostring(False)
    return target


def _characters(encoded: Sequence[bytes], shape: tuple[int, ...], length: int) -> NDArray[np.bytes_]:
    """Return texts in UTF-8 as single bytes, ``(…, length)``."""
    return np.array(encoded, f"S{length}").view("S1").reshape(*shape, length)


def _create_variables(file: Any, layout: Layout) -> None:
    for variable in layout.variables:
        dims = layout.dims_of(variable)
        target = file.createVariable(
            variable.name,
            variable.dtype,
            dims,
            compression="zlib" if dims else None,
            complevel=LEVEL,
            shuffle=True,
            fletcher32=bool(dims),
            chunksizes=layout.chunk_of(variable) or None,
            fill_value=False if variable.dtype == "i1" else np.nan,
        )
        target.setncatts(_typed(variable.attrs, np.dtype(variable.dtype)) | _labels(layout, dims))


def _create_messages(file: Any, layout: Layout, messages: Mapping[int, bytes]) -> None:
    """Write the messages of cells; chunks without a message are never allocated."""
    dims = tuple(name for name, _ in layout.dims)
    about = {"long_name": "what a case has to say: why it is not ok, or what it could not be given"}
    length = max([1, *map(len, messages.values())])
    target = _create_text(file, MESSAGE, dims, layout.lengths, length, about | _labels(layout, dims))
    if not messages:
        return
    cells = np.sort(np.fromiter(messages, np.int64))
    index = np.arange(layout.cells).reshape(layout.shape)
    for box in boxes(layout.shape, layout.lengths):
        here = np.asarray(index[box])
        if np.isin(cells, here).any():
            texts = [messages.get(cell, b"") for cell in here.ravel().tolist()]
            target[(*box, slice(None))] = _characters(texts, here.shape, length)


def _create_provenance(file: Any, layout: Layout, hashes: Hashes) -> None:
    """Write texts as attributes or, compressed, as arrays of characters.

    No variable-length strings here: netCDF-C 4.10 crashes when it reads them from a group of a file
    that is open twice.
    """
    group = file.createGroup(PROVENANCE)
    for name, text in {"key": layout.key, **layout.provenance}.items():
        encoded = text.encode()
        if len(encoded) <= ATTRIBUTE_BYTES:
            group.setncattr(name, text)
        else:
            group.createDimension(f"{name}_bytes", len(encoded))
            target = group.createVariable(name, "S1", (f"{name}_bytes",), compression="zlib", complevel=LEVEL)
            target[:] = np.frombuffer(encoded, "S1")
    group.createDimension("byte", hashes.shape[1])
    target = group.createVariable(CASE_HASH, "u1", (*(name for name, _ in layout.dims), "byte"), fletcher32=True)
    target.setncattr("long_name", "identity of the case: a hash of what its results depend on")
    target[...] = hashes.reshape(*layout.shape, hashes.shape[1])


def _typed(attrs: Attributes, dtype: np.dtype[Any]) -> dict[str, Any]:
    """Return attributes as netCDF4 takes them: numbers in the dtype of their variable, as CF wants."""
    return {k: value if isinstance(value, str) else np.asarray(value, dtype) for k, value in attrs.items()}


def _labels(layout: Layout, dims: tuple[str, ...]) -> dict[str, str]:
    """Return CF's ``coordinates``: the scalar coordinates, those of a zip and the labels that are text."""
    names = [c.name for c in layout.coordinates if set(c.dims) <= set(dims) and (c.text or c.dims != (c.name,))]
    return {"coordinates": " ".join(names)} if names else {}
