"""The content hash, which two runs of one study share, and the checksums at the end of a file.

HDF5 reads no further than the end that it has noted itself, and cuts off what follows when it writes. It has checksums
for all that an archive holds but for the references from variables to their dimensions, on which netCDF-C crashes or
never ends: they lie in the head, which every reader compares before a library reads any. Functions raise ``OSError``
where a file cannot be read.
"""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np

from workflow.archive._files import LOCK
from workflow.archive._stored import boxes

LEFT_OUT = frozenset({"processor_time", "batch_width"})
"""Variables that differ between two runs of one study: how long a case took, and with how many others it ran."""

BLOCK = 4 * 2**20
"""Bytes of a variable that are decoded at once, or one chunk along the cases where that is larger."""

_MARK = b"\nsha256 "
_LENGTH = len(_MARK) + 64

_HEAD = re.compile(rb"\nhead +(\d+) ([0-9a-f]{64})$")
_HEAD_LENGTH = len(b"\nhead %16d " % 0) + 64

_FIRST_CHUNKS = b"TREE"
"""Signature of an index of chunks; the file's head ends at the first."""

_PIECE = 2**20
"""Bytes read at a time, and the longest head."""


def hash_content(path: Path) -> str:
    """Return the SHA-256 of an archive's decoded arrays, in hexadecimal.

    For each variable and coordinate, by name, except :data:`LEFT_OUT`: a line of JSON with name,
    dimensions, dtype and shape, then the values in C order: numbers as little-endian bytes, characters
    as they are, each string as its length in UTF-8 (8 bytes, little-endian) and its bytes. Attributes, chunks and
    compression do not enter.
    """
    digest, pieces = hashlib.sha256(), _pieces(path)
    with ThreadPoolExecutor(1) as thread:
        due = thread.submit(next, pieces, None)
        while (piece := due.result()) is not None:
            due = thread.submit(next, pieces, None)  # the next one is decoded meanwhile
            digest.update(piece)
    return digest.hexdigest()


def _pieces(path: Path) -> Iterator[Any]:
    """Yield the bytes that are hashed; the lock is never held for long, other threads wait for it."""
    import h5py

    with LOCK:
        file = h5py.File(path, "r", rdcc_nbytes=0)  # blocks end with chunks: none is wanted twice
        every = {name: each for name, each in file.items() if name not in LEFT_OUT and hasattr(each, "shape")}
    try:
        for name, variable in sorted(every.items()):
            with LOCK:
                if variable.is_scale and _is_bare(variable):
                    continue
                shape, kind = variable.shape, variable.dtype.newbyteorder("<").str
                is_text = variable.dtype.kind == "O"
                dims = [name] if variable.is_scale else [dim[0].name[1:] for dim in variable.dims]
                head = json.dumps([name, dims, "text" if is_text else kind, shape])
                cut = boxes(shape, lengths(shape, variable.chunks or shape, BLOCK // variable.dtype.itemsize))
            yield head.encode() + b"\n"
            for block in cut:
                with LOCK:
                    values = variable[block]
                yield _texts(values) if is_text else np.ascontiguousarray(values, kind).data
    finally:
        with LOCK:
            file.close()


def _is_bare(scale: Any) -> bool:
    """Tell whether a scale is a dimension without a coordinate, which netCDF-C marks so."""
    return bytes(scale.attrs["NAME"]).startswith(b"This is a netCDF dimension but not a netCDF variable")


def _texts(values: Any) -> bytes:
    encoded = np.ravel(values).tolist()
    return b"".join(len(text).to_bytes(8, "little") + text for text in encoded)


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


def seal(path: Path) -> None:
    """Append the SHA-256 of the head and of the whole of a finished file to it."""
    with open(path, "r+b") as file:
        head = file.read(_PIECE).split(_FIRST_CHUNKS)[0]
        file.seek(0, 2)
        file.write(b"\nhead %16d %s" % (len(head), hashlib.sha256(head).hexdigest().encode()))
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").hexdigest()
        file.seek(0, 2)
        file.write(_MARK + digest.encode())


def is_sealed(path: Path) -> bool:
    """Tell whether a file ends with a checksum, right or wrong."""
    return _end(path, _LENGTH).startswith(_MARK)


def has_sound_head(path: Path) -> bool:
    """Tell whether the head of a file is the one that was sealed; without a checksum of it, it counts as sound."""
    found = _HEAD.match(_end(path, _LENGTH + _HEAD_LENGTH)[:_HEAD_LENGTH])
    if not found:
        return True
    with open(path, "rb") as file:
        return hashlib.sha256(file.read(int(found[1]))).hexdigest().encode() == found[2]


def _end(path: Path, length: int) -> bytes:
    with open(path, "rb") as file:
        file.seek(max(0, path.stat().st_size - length))
        return file.read(length)


def is_intact(path: Path) -> bool:
    """Tell whether a file is, byte for byte, the one that was sealed."""
    digest, left = hashlib.sha256(), path.stat().st_size - _LENGTH
    with open(path, "rb") as file:
        while left > 0:
            piece = file.read(min(_PIECE, left))
            digest.update(piece)
            left -= len(piece) or left
        return file.read() == _MARK + digest.hexdigest().encode()
