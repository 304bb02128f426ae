"""How an archive stores its variables, in xarray's words: chunks, filters, fill values, CF's list of coordinates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

CHUNK_BYTES = 2**20
"""No chunk is larger than this before compression, unless it is one instant of many phases."""

LEVEL = 1
"""zlib level of an archive, always with shuffle."""

COMPRESSED = {"zlib": True, "complevel": LEVEL, "shuffle": True, "fletcher32": True}


def encode(dataset: xr.Dataset) -> xr.Dataset:
    """Say of each variable of a dataset how it is stored, and return the dataset.

    All have the same lengths of a chunk along the dimensions of the cases, those of ``status``: whole dimensions
    innermost, then a part of one, as many cases as the largest variable has in :data:`CHUNK_BYTES`, at least one. The
    history of one case may be cut along ``t``, into nearly equal lengths.
    """
    shape, results = dataset["status"].shape, [dataset.variables[name] for name in dataset.data_vars]
    most = CHUNK_BYTES // max(_case_bytes(variable, len(shape)) for variable in results)
    lengths: list[int] = []
    for size in reversed(shape):
        lengths.append(max(1, min(size, most // math.prod(lengths))))
    cut = dict(zip(dataset["status"].dims, reversed(lengths), strict=True))
    for variable in results:
        fill = {} if variable.dtype.kind == "i" else {"_FillValue": np.nan}
        tail = list(variable.shape[len(shape) :])
        if tail:
            tail[0] = -(-tail[0] // -(-_case_bytes(variable, len(shape)) // CHUNK_BYTES))
        chunks = {**COMPRESSED, "chunksizes": (*cut.values(), *tail)} if variable.dims else {}
        variable.encoding = {**chunks, **fill, **listed_coordinates(dataset, variable.dims)}
    for name in dataset.coords:
        variable = dataset.variables[name]
        is_axis = variable.dims == (name,)
        chunks = {"chunksizes": tuple(size if is_axis else cut[dim] for dim, size in variable.sizes.items())}
        if variable.dtype.kind == "O" and not is_axis:  # CF allows an axis no further dimension
            variable.encoding = {"dtype": "S1", **COMPRESSED, **chunks}
        elif variable.dtype.kind != "O" and variable.dims:
            variable.encoding = {"fletcher32": True, **chunks}
    return dataset


def listed_coordinates(dataset: xr.Dataset, dims: tuple[Any, ...]) -> dict[str, str]:
    """Return CF's ``coordinates``: the scalar coordinates, those of a zip and the labels that are text."""
    names = [
        str(name)
        for name, one in ((name, dataset.variables[name]) for name in dataset.coords)
        if set(one.dims) <= set(dims) and (one.dtype.kind == "O" or one.dims != (name,))
    ]
    return {"coordinates": " ".join(names)} if names else {}


def _case_bytes(variable: xr.Variable, cases: int) -> int:
    """Return the bytes of one case of a variable, the first dimensions of which are those of the cases."""
    return int(variable.dtype.itemsize) * math.prod(variable.shape[cases:])
