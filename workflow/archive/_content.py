"""The content hash: what two runs of one study share, whoever computed which part of it."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from workflow.archive._stored import boxes

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
    digest, pieces = hashlib.sha256(), _pieces(path)
    with ThreadPoolExecutor(1) as thread:
        due = thread.submit(next, pieces, None)
        while (piece := due.result()) is not None:
            due = thread.submit(next, pieces, None)  # the next one is decoded meanwhile
            digest.update(piece)
    return digest.hexdigest()


def _pieces(path: Path) -> Iterator[Any]:
    """Yield the bytes that are hashed."""
    import netCDF4

    from workflow.archive._lock import LOCK

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
            yield json.dumps(head).encode() + b"\n"
            size = 16 if text else np.dtype(kind).itemsize
            for block in boxes(head[3], lengths(head[3], chunks, BLOCK // size)):
                with LOCK:
                    values = variable[block]
                yield _texts(values) if text else np.ascontiguousarray(values, kind).data
    finally:
        with LOCK:
            file.close()


def lengths(shape: Sequence[int], chunks: Sequence[int], limit: int) -> list[int]:
    """Return the lengths of boxes of about ``limit`` values that follow each other in C order.

    They are whole dimensions innermost, whole chunks along one, and single indices of the others: as an archive is cut
    no chunk is decoded twice.
    """
    cut: list[int] = []
    for whole, chunk in zip(reversed(shape), reversed(chunks), strict=True):
        inner = math.prod(cut)
        is_whole = inner == math.prod(shape[len(shape) - len(cut) :])
        cut.append(min(whole, max(chunk, limit // inner // chunk * chunk)) if is_whole else 1)
    return cut[::-1]


def _texts(values: Any) -> bytes:
    encoded = [text.encode() for text in np.asarray(values, dtype=object).ravel()]
    return b"".join(len(text).to_bytes(8, "little") + text for text in encoded)
