"""The content hash: what two runs of one study share, whoever computed which part of it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

LEFT_OUT = frozenset({"processor_time", "batch_width"})
"""Variables that differ between two runs of one study: how long a case took, and with how many others it ran."""

BLOCK = 4 * 2**20
"""Bytes of a variable that are decoded at once, or one chunk along the cases where that is larger."""


def hash_content(path: Path) -> str:
    """Return the SHA-256 of an archive's decoded arrays, in hexadecimal.

    For each variable and coordinate, by name, except :data:`LEFT_OUT`: a line of JSON with name,
    dimensions, dtype and shape, then the values in C order: numbers as little-endian bytes, characters
    as they are, each string as its length in UTF-8 (8 bytes, little-endian) and its bytes. Attributes, chunks and
    compression do not enter.

    Raises
    ------
    OSError, RuntimeError
        The file, or one of its chunks, cannot be read.
    """
    import netCDF4

    from workflow.archive._lock import LOCK

    digest = hashlib.sha256()
    with LOCK:
        file = netCDF4.Dataset(path.absolute())  # see _create
        file.set_auto_mask(False)
        file.set_auto_scale(False)
        file.set_auto_chartostring(False)
        names = sorted(set(file.variables) - LEFT_OUT)
    try:
        for name in names:
            with LOCK:  # never for long: other threads wait for it
                variable = file[name]
                if variable.chunking() != "contiguous":
                    variable.set_var_chunk_cache(size=0)  # blocks end with chunks: no chunk is wanted twice
                text = variable.dtype is str
                kind = "text" if text else np.dtype(variable.dtype).newbyteorder("<").str
                head = [name, variable.dimensions, kind, variable.shape]
                chunks = variable.chunking() if variable.chunking() != "contiguous" else variable.shape
            digest.update(json.dumps(head).encode() + b"\n")
            size = 16 if text else np.dtype(kind).itemsize
            for block in blocks(head[3], chunks, BLOCK // size):
                with LOCK:
                    values = variable[block]
                digest.update(_texts(values) if text else np.ascontiguousarray(values, kind).data)
    finally:
        with LOCK:
            file.close()
    return digest.hexdigest()


def blocks(shape: Sequence[int], chunks: Sequence[int], limit: int) -> Iterator[tuple[slice, ...]]:
    """Cut an array into blocks of about ``limit`` values that follow each other in C order.

    A block begins and ends with a chunk along the dimension that is cut, so that no chunk is
    decoded twice unless a single index of an outer dimension is larger than the limit.
    """
    if not shape:
        yield ()
        return
    rest = math.prod(shape[1:])
    if rest > limit and chunks[0] == 1:
        for i in range(shape[0]):
            yield from ((slice(i, i + 1), *inner) for inner in blocks(shape[1:], chunks[1:], limit))
        return
    step = max(1, limit // max(1, rest) // chunks[0]) * chunks[0]
    for start in range(0, shape[0], step):
        yield (slice(start, min(start + step, shape[0])), *(slice(0, size) for size in shape[1:]))


def _texts(values: Any) -> bytes:
    encoded = [text.encode() for text in np.asarray(values, dtype=object).ravel()]
    return b"".join(len(text).to_bytes(8, "little") + text for text in encoded)
