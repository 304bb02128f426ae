"""The archive without its results: dimensions, coordinates, attributes, messages, provenance."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workflow.archive._layout import FORMAT, MESSAGE, Attributes, Layout
from workflow.archive._shard import LEVEL

CONVENTIONS = "CF-1.11"
FORMAT_NAME = "archive_format"
"""Global attribute that tells an archive of ours, and which version of it, from any other NetCDF file."""

PROVENANCE = "provenance"
ATTRIBUTE_BYTES = 64_000
"""A longer text of the provenance group is a variable, as HDF5's plain attributes end at 64 KiB."""


def create(layout: Layout, path: Path, messages: Mapping[int, str]) -> None:
    """Write everything but the results to a new NetCDF-4 file; chunks stay unallocated.

    Parameters
    ----------
    messages
        By cell; the variable ``message`` is empty elsewhere.

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
        _create_provenance(file, layout)


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
    dims = tuple(name for name, _ in layout.dims)
    chunks = (1,) * (len(dims) - 1) + (layout.chunk,) if dims else None
    made = file.createVariable(MESSAGE, str, dims, chunksizes=chunks)
    made.setncatts({"long_name": "what a case that is not ok did"} | _labels(layout, dims))
    by_unit: dict[int, dict[int, str]] = defaultdict(dict)
    for cell, text in messages.items():
        unit, place = layout.unit_of(cell)
        by_unit[unit][place] = text
    for unit, texts in sorted(by_unit.items()):
        block = np.full(len(layout.cells_of(unit)), "", dtype=object)
        for place, text in texts.items():
            block[place] = text
        if dims:
            *outer, start = layout.offset_of(unit)
            made[(*outer, slice(start, start + len(block)))] = block
        else:
            made[...] = block[0]


def _create_provenance(file: Any, layout: Layout) -> None:
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


def _typed(attrs: Attributes, dtype: np.dtype[Any]) -> dict[str, Any]:
    """Return attributes as netCDF4 takes them: numbers in the dtype of their variable, as CF wants."""
    return {k: value if isinstance(value, str) else np.asarray(value, dtype) for k, value in attrs.items()}


def _labels(layout: Layout, dims: tuple[str, ...]) -> dict[str, str]:
    """Return CF's ``coordinates``: the scalar coordinates, those of a zip and the labels that are text."""
    names = [c.name for c in layout.coordinates if set(c.dims) <= set(dims) and (c.text or c.dims != (c.name,))]
    return {"coordinates": " ".join(names)} if names else {}
