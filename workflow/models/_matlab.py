"""MATLAB files up to version 7: arrays, sparse matrices and texts, read within the sizes they may have."""

from __future__ import annotations

import struct
import warnings
import zlib
from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_files import (
    LABELS,
    MATRICES,
    MOST_BYTES,
    MOST_COORDINATES,
    checked_sparse,
    refuse,
    too_large,
)

_HEAD = 128
_COMPRESSED = 15
_BLOCK = 2**20


def read(place: Path) -> dict[str, Any]:
    """Return the variables of a file by name.

    Raises
    ------
    UnusableMatricesError
        It is damaged, too large, or of version 7.3.
    """
    from scipy.io import loadmat, whosmat  # imported here: reading a study needs none of it
    from scipy.io.matlab import MatReadError

    try:
        _judge(place)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            names = []
            for name, shape, kind in whosmat(place, appendmat=False):
                if max(shape, default=0) > MOST_COORDINATES or (
                    kind != "sparse" and 8 * np.prod(shape, dtype=float) > MOST_BYTES
                ):
                    raise too_large(name, shape)
                names += [name] if kind in _KINDS else []
            variables = loadmat(place, variable_names=names, appendmat=False, spmatrix=False)
    except NotImplementedError:
        raise refuse(f"`{place.name}` is of version 7.3 (HDF5)", "save it with -v7") from None
    except (
        ValueError,
        TypeError,
        OverflowError,
        LookupError,
        OSError,
        zlib.error,
        struct.error,
        MatReadError,
        MemoryError,
    ) as error:
        reason = " ".join(str(error).split())[:100]
        raise refuse(f"`{place.name}` is damaged: {reason}", "save it anew, with -v7") from None
    return {name: _plain(name, variables[name]) for name in names if name in variables}


_KINDS = (
    "double",
    "single",
    "sparse",
    "char",
    "cell",
    "logical",
    "string",
    *(f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)),
)


def _judge(place: Path) -> None:
    """Refuse a file whose compressed parts hold more than may be read, before anything is made of them."""
    if place.stat().st_size > MOST_BYTES:
        raise refuse(f"`{place.name}` has {place.stat().st_size >> 20} MB", f"at most {MOST_BYTES >> 20} MB are read")
    with place.open("rb") as opened:
        head = opened.read(_HEAD)
        if not head.startswith(b"MATLAB 5.0 MAT-file") or len(head) < _HEAD:
            if head.startswith(b"MATLAB 7.3"):
                raise NotImplementedError
            raise refuse(f"`{place.name}` is no MATLAB file of version 5 to 7", "save it with -v7")
        order = "<" if head[126:128] == b"IM" else ">"
        room = MOST_BYTES
        while len(tag := opened.read(8)) == 8:
            kind, length = struct.unpack(order + "II", tag)
            if kind != _COMPRESSED:
                opened.seek(length, 1)
                continue
            inflate = zlib.decompressobj()
            while length > 0 and (block := opened.read(min(length, _BLOCK))):
                length -= len(block)
                while block:
                    room -= len(inflate.decompress(block, _BLOCK))
                    block = inflate.unconsumed_tail
                    if room < 0:
                        raise refuse(f"`{place.name}` holds too much", f"at most {MOST_BYTES >> 20} MB are read")


def _plain(name: str, value: Any) -> Any:
    """Return a variable as other readers do: texts one by one, vectors flat, a single whole number as one."""
    if name in MATRICES:
        return checked_sparse(name, value) if hasattr(value, "tocsr") else value
    if hasattr(value, "toarray"):
        value = checked_sparse(name, value).toarray()
    if value.dtype == object:
        value = np.array(["".join(np.asarray(text).astype(str).ravel()) for text in value.ravel()])
    if name in LABELS or value.dtype.kind in "US":
        return value.ravel()
    if value.size == 1 and float(value.ravel()[0]).is_integer():
        return value.ravel().astype(np.int64)
    return value
