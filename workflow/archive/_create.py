"""The archive without its results: dimensions, coordinates, attributes, messages, provenance."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._layout import CHUNK_BYTES, FORMAT, MESSAGE, Attributes, Coordinate, Layout, truncated_message
from workflow.archive._shard import LEVEL

CONVENTIONS = "CF-1.11"
FORMAT_NAME = "archive_format"
"""Global attribute that marks a NetCDF file as an archive of this package, with its version."""

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
    """Write coordinates, those of a zip cut along its dimension as the results are, so that dask's chunks agree."""
    lengths = dict(zip((name for name, _ in layout.dims), layout.stored.lengths, strict=True))
    for coordinate in layout.coordinates:
        kind = str if coordinate.text else coordinate.values.dtype
        zipped = coordinate.dims not in ((), (coordinate.name,))
        if zipped and coordinate.text:
            _create_characters(file, layout, coordinate, lengths)
            continue
        chunks = tuple(lengths[name] for name in coordinate.dims) if zipped else None
        checked = bool(coordinate.dims) and not coordinate.text
        target = file.createVariable(coordinate.name, kind, coordinate.dims, chunksizes=chunks, fletcher32=checked)
        target.setncatts(_typed(coordinate.attrs, coordinate.values.dtype))
        target[...] = coordinate.values


def _create_characters(file: Any, layout: Layout, coordinate: Coordinate, lengths: Mapping[str, int]) -> None:
    """Write texts of a zip as characters: xarray forgets the chunks of strings."""
    encoded = [text.encode() for text in coordinate.values.ravel()]
    width = max(1, *map(len, encoded))
    name = f"{coordinate.name}_length"
    file.createDimension(name, width)
    chunks = (*(lengths[dim] for dim in coordinate.dims), width)
    target = file.createVariable(coordinate.name, "S1", (*coordinate.dims, name), chunksizes=chunks, fletcher32=True)
    target.setncatts({**coordinate.attrs, "_Encoding": "utf-8"})
    target.set_auto_chartostring(False)
    target[...] = np.array(encoded, f"S{width}").view("S1").reshape(*coordinate.values.shape, width)


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
            chunksizes=layout.archive_chunk_of(variable) or None,
            fill_value=False if variable.dtype == "i1" else np.nan,
        )
        target.setncatts(_typed(variable.attrs, np.dtype(variable.dtype)) | _labels(layout, dims))


def _create_messages(file: Any, layout: Layout, messages: Mapping[int, str]) -> None:
    """Write texts as characters along a last dimension: xarray makes Python strings of them when they are read.

    Chunks without a message are never allocated.
    """
    encoded = {cell: truncated_message(text).encode() for cell, text in messages.items()}
    length = max([2, *map(len, encoded.values())])  # xarray joins single bytes once more
    dims = tuple(name for name, _ in layout.dims)
    file.createDimension(LENGTH, length)
    target = file.createVariable(
        MESSAGE,
        "S1",
        (*dims, LENGTH),
        compression="zlib",
        complevel=LEVEL,
        fletcher32=True,
        chunksizes=(*layout.stored.lengths, max(1, min(length, CHUNK_BYTES // layout.stored.size))),
    )
    about = {"long_name": "what a case has to say: why it is not ok, or what it could not be given"}
    target.setncatts({**about, "_Encoding": "utf-8", **_labels(layout, dims)})
    target.set_auto_chartostring(False)
    _write_characters(target, layout, encoded, length)


def _write_characters(target: Any, layout: Layout, encoded: Mapping[int, bytes], length: int) -> None:
    """Write the messages of one block after the other."""
    by_block: dict[int, list[int]] = defaultdict(list)
    for cell in encoded:
        by_block[layout.stored.block_of(cell)[0]].append(cell)
    for number, in_block in sorted(by_block.items()):
        cells, offset = layout.stored.cells_of(number), layout.stored.offset_of(number)
        block = np.zeros(len(cells), dtype=f"S{length}")
        for cell in in_block:
            block[cell - cells.start] = encoded[cell]
        ends = zip(offset, layout.stored.lengths, layout.shape, strict=True)
        place = tuple(slice(first, min(first + size, most)) for first, size, most in ends)
        shape = tuple(part.stop - part.start for part in place)
        target[(*place, slice(None))] = block.view("S1").reshape(*shape, length)


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
            target = group.createVariable(name, "S1", (f"{name}_bytes",), compression="zlib", complevel=LEVEL)
            target[:] = np.frombuffer(encoded, "S1")
    if hashes is not None:
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
