"""The archive without its results: dimensions, coordinates, attributes, messages, provenance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive._stored import CASE_HASH, MESSAGE, PROVENANCE, STATUS, Hashes, boxes
from workflow.grid import CHUNK_BYTES, COMPRESSED, LEVEL

if TYPE_CHECKING:
    import xarray as xr

FORMAT = 2
"""Version of shards and archives; raised when an older reader would misread them."""

FORMAT_NAME = "archive_format"
"""Global attribute that marks a NetCDF file as an archive of this package, with its version."""

ATTRIBUTE_BYTES = 64_000
"""A longer text of the provenance group is a variable, as HDF5's plain attributes end at 64 KiB."""


def create(
    template: xr.Dataset, texts: Mapping[str, str], path: Path, messages: Mapping[int, bytes], hashes: Hashes
) -> None:
    """Write everything but the results to a new NetCDF-4 file; chunks stay unallocated.

    Parameters
    ----------
    template
        See :func:`workflow.grid.template`.
    texts
        Those of the provenance group.
    messages
        In UTF-8, by case; the variable ``message`` is empty elsewhere.
    hashes
        Identity of every case, ``(case, byte)``.

    Raises
    ------
    OSError, RuntimeError
        The file cannot be written.
    """
    import netCDF4

    from workflow.archive._lock import LOCK

    path = path.absolute()  # netCDF-C skips spaces that a path begins with
    with LOCK, netCDF4.Dataset(path, "w", format="NETCDF4") as opened:
        file: Any = opened
        file.setncatts({**template.attrs, FORMAT_NAME: str(FORMAT)})
        for name, size in template.sizes.items():
            file.createDimension(name, size)
        for name, variable in template.variables.items():
            values = variable.values
            if variable.encoding.get("dtype") == "S1":
                encoded = [text.encode() for text in values.ravel()]
                target = _create_text(file, str(name), variable, max(1, *map(len, encoded)), variable.attrs)
                target[...] = _characters(encoded, values.shape, target.shape[-1])
                continue
            how = dict(variable.encoding)
            listed, fill = {k: how.pop(k) for k in ("coordinates",) if k in how}, how.pop("_FillValue", False)
            kind = str if values.dtype.kind == "O" else values.dtype
            target = file.createVariable(name, kind, variable.dims, fill_value=fill, **how)
            target.setncatts({**variable.attrs, **listed})
            if name in template.coords:
                target[...] = values
        _create_messages(file, template.variables[STATUS], messages)
        _create_provenance(file, texts, template.variables[STATUS], hashes)


def _create_text(file: Any, name: str, like: xr.Variable, length: int, attributes: Mapping[str, Any]) -> Any:
    """Create a variable of texts: UTF-8 characters along a last dimension, of which xarray makes strings as it reads.

    HDF5's strings of variable length have no checksum, and xarray reads all of them as it opens a file. Dimensions and
    chunks are those of another variable.
    """
    file.createDimension(f"{name}_length", length)
    chunks = like.encoding.get("chunksizes", ())
    chunks = (*chunks, max(1, min(length, CHUNK_BYTES // math.prod(chunks))))
    target = file.createVariable(name, "S1", (*like.dims, f"{name}_length"), chunksizes=chunks, **COMPRESSED)
    target.setncatts({**attributes, "_Encoding": "utf-8"})
    target.set_auto_chartostring(False)
    return target


def _characters(encoded: Sequence[bytes], shape: tuple[int, ...], length: int) -> NDArray[np.bytes_]:
    """Return texts in UTF-8 as single bytes, ``(…, length)``."""
    return np.array(encoded, f"S{length}").view("S1").reshape(*shape, length)


def _create_messages(file: Any, status: xr.Variable, messages: Mapping[int, bytes]) -> None:
    """Write the messages of cases; chunks without a message are never allocated."""
    about = {"long_name": "what a case has to say: why it is not ok, or what it could not be given"}
    about |= {key: status.encoding[key] for key in ("coordinates",) if key in status.encoding}
    length = max([1, *map(len, messages.values())])
    target = _create_text(file, MESSAGE, status, length, about)
    if not messages:
        return
    cases = np.sort(np.fromiter(messages, np.int64))
    index = np.arange(status.size).reshape(status.shape)
    for box in boxes(status.shape, status.encoding.get("chunksizes", ())):
        here = np.asarray(index[box])
        if np.isin(cases, here).any():
            texts = [messages.get(case, b"") for case in here.ravel().tolist()]
            target[(*box, slice(None))] = _characters(texts, here.shape, length)


def _create_provenance(file: Any, texts: Mapping[str, str], status: xr.Variable, hashes: Hashes) -> None:
    """Write texts as attributes or, compressed, as arrays of characters.

    No variable-length strings here: netCDF-C 4.10 crashes when it reads them from a group of a file
    that is open twice.
    """
    group = file.createGroup(PROVENANCE)
    for name, text in texts.items():
        encoded = text.encode()
        if len(encoded) <= ATTRIBUTE_BYTES:
            group.setncattr(name, text)
        else:
            group.createDimension(f"{name}_bytes", len(encoded))
            target = group.createVariable(name, "S1", (f"{name}_bytes",), compression="zlib", complevel=LEVEL)
            target[:] = np.frombuffer(encoded, "S1")
    group.createDimension("byte", hashes.shape[1])
    target = group.createVariable(CASE_HASH, "u1", (*status.dims, "byte"), fletcher32=True)
    target.setncattr("long_name", "identity of the case: a hash of what its results depend on")
    target[...] = hashes.reshape(*status.shape, hashes.shape[1])
