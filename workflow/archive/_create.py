"""The archive without its results: dimensions, coordinates, attributes, messages, provenance."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._layout import CHUNK_BYTES, FORMAT, MESSAGE, Attributes, Layout
from workflow.archive._seal import BLANK, FILE_CHECKSUM
from workflow.archive._shard import LEVEL

CONVENTIONS = "CF-1.11"
FORMAT_NAME = "archive_format"
"""Global attribute that tells an archive of ours, and which version of it, from any other NetCDF file."""

LENGTH = "message_length"

PROVENANCE = "provenance"
CASE_HASH = "case_hash"
"""Identity of every case, ``(…, byte)``, in the provenance group."""
ATTRIBUTE_BYTES = 64_000
"""A longer text of the provenance group is a variable, as HDF5's plain attributes end at 64 KiB."""


def create(layout: Layout, path: Path, messages: Mapping[int, str], hashes: NDArray[np.uint8] | None = None) -> None:
    """Write everything but the results to a new NetCDF-4 file; chunks stay unallocated.

    Parameters
    ----------
    messages
        By cell; the variable ``message`` is empty elsewhere.
    hashes
        Identity of every case, ``(cell, byte)``; left out of a view.

    Raises
    ------
    OSError, RuntimeError
        The file cannot be written.
    """
    import netCDF4

    from workflow.archive._lock import LOCK

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
    for coordinate in layout.coordinates:
        kind = str if coordinate.text else coordinate.values.dtype
        made = file.createVariable(coordinate.name, kind, coordinate.dims)
        made.setncatts(_typed(coordinate.attrs, coordinate.values.dtype))
        made[...] = coordinate.values


def _create_variables(file: Any, layout: Layout) -> None:
    for variable in layout.variables:
        dims = layout.dims_of(variable)
        made = file.createVariable(
            variable.name,
            variable.dtype,
            dims,
            compression="zlib" if dims else None,
            complevel=LEVEL,
            shuffle=True,
            chunksizes=layout.archive_chunk_of(variable) or None,
            fill_value=False if variable.dtype == "i1" else np.nan,
        )
        made.setncatts(_typed(variable.attrs, np.dtype(variable.dtype)) | _labels(layout, dims))


def _create_messages(file: Any, layout: Layout, messages: Mapping[int, str]) -> None:
    """Write texts as characters along a last dimension, which xarray reads as strings, lazily.

    Variable-length strings would be read whole when the archive is opened. Chunks without a message
    are never allocated.
    """
    encoded = {cell: text.encode() for cell, text in messages.items()}
    length = max((len(text) for text in encoded.values()), default=1)
    file.createDimension(LENGTH, length)
    dims = tuple(name for name, _ in layout.dims)
    chunks = (1,) * (len(dims) - 1) + (layout.chunk,) * (len(dims) > 0)
    made = file.createVariable(
        MESSAGE,
        "S1",
        (*dims, LENGTH),
        compression="zlib",
        complevel=LEVEL,
        chunksizes=(*chunks, min(length, CHUNK_BYTES // layout.chunk)),
    )
    made.setncatts({"long_name": "what a case that is not ok did", "_Encoding": "utf-8"})
    made.setncatts(_labels(layout, dims))
    made.set_auto_chartostring(False)
    by_unit: dict[int, list[int]] = defaultdict(list)
    for cell in encoded:
        by_unit[layout.unit_of(cell)[0]].append(cell)
    for unit, told in sorted(by_unit.items()):
        cells = layout.cells_of(unit)
        block = np.zeros(len(cells), dtype=f"S{length}")
        for cell in told:
            block[cell - cells.start] = encoded[cell]
        characters = block.view("S1").reshape(len(cells), length)
        if dims:
            *outer, start = layout.offset_of(unit)
            made[(*outer, slice(start, start + len(cells)), slice(None))] = characters
        else:
            made[:] = characters[0]


def _create_provenance(file: Any, layout: Layout, hashes: NDArray[np.uint8] | None) -> None:
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
            made = group.createVariable(name, "S1", (f"{name}_bytes",), compression="zlib", complevel=LEVEL)
            made[:] = np.frombuffer(encoded, "S1")
    group.createDimension("digit", len(BLANK))
    place = group.createVariable(FILE_CHECKSUM, "S1", ("digit",), contiguous=True)
    place[:] = np.frombuffer(BLANK.encode(), "S1")
    if hashes is not None:
        group.createDimension("byte", hashes.shape[1])
        made = group.createVariable(CASE_HASH, "u1", (*(name for name, _ in layout.dims), "byte"))
        made.setncattr("long_name", "identity of the case: a hash of what its results depend on")
        made[...] = hashes.reshape(*layout.shape, hashes.shape[1])


def _typed(attrs: Attributes, dtype: np.dtype[Any]) -> dict[str, Any]:
    """Return attributes as netCDF4 takes them: numbers in the dtype of their variable, as CF wants."""
    return {k: value if isinstance(value, str) else np.asarray(value, dtype) for k, value in attrs.items()}


def _labels(layout: Layout, dims: tuple[str, ...]) -> dict[str, str]:
    """Return CF's ``coordinates``: the scalar coordinates, those of a zip and the labels that are text."""
    names = [c.name for c in layout.coordinates if set(c.dims) <= set(dims) and (c.text or c.dims != (c.name,))]
    return {"coordinates": " ".join(names)} if names else {}
