"""NPZ files: arrays of NumPy in a zip archive, read without pickles and never beyond the sizes they may have."""

from __future__ import annotations

import zipfile
import zlib
from io import BytesIO
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy

from workflow.models._matrix_files import MOST_BYTES, MOST_COORDINATES, refuse, too_large

_MOST_ENTRIES = 100
_LONGEST_HEADER = 10_000


def read(place: Path) -> dict[str, Any]:
    """Return the arrays of a file by name.

    Raises
    ------
    UnusableMatricesError
        It is damaged, too large, or holds Python objects.
    """
    try:
        with zipfile.ZipFile(place) as archive:
            entries = [entry for entry in archive.infolist() if entry.filename.endswith(".npy")]
            if len(entries) > _MOST_ENTRIES:
                raise refuse(f"it has {len(entries)} entries", f"write at most {_MOST_ENTRIES}")
            arrays, room = {}, MOST_BYTES
            for entry in entries:
                array = _array(archive, entry, room)
                room -= array.nbytes
                arrays[entry.filename.removesuffix(".npy")] = array
            return arrays
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError, OSError) as error:
        raise refuse(f"it is no NPZ file, or damaged: {error}", "write it anew, with numpy.savez") from None


def _array(archive: zipfile.ZipFile, entry: zipfile.ZipInfo, room: int) -> Any:
    """Return one array; its header says how much is read."""
    name = entry.filename.removesuffix(".npy")
    with archive.open(entry) as opened:
        try:
            start = opened.read(_LONGEST_HEADER)
            head = BytesIO(start)
            version = npy.read_magic(head)
            header = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
            shape, in_columns, dtype = header(head)
        except (ValueError, TypeError, KeyError, SyntaxError, RecursionError, MemoryError) as error:
            raise refuse(f"`{name}` is no array: {error}", "write it with numpy.savez") from None
        if dtype.hasobject:
            raise refuse(
                f"`{name}` holds pickled Python objects, which are not read",
                "write arrays of numbers; of a sparse matrix its data, indices, indptr and shape",
            )
        if dtype.kind not in "fiubUS":
            raise refuse(f"`{name}` has values of type {dtype}", "write real numbers, or texts for labels")
        count = prod(shape) * dtype.itemsize
        if count > room or max(shape, default=0) > max(MOST_COORDINATES, MOST_BYTES // 8):
            raise too_large(name, shape)
        content = start[head.tell() :][:count]
        content += opened.read(count - len(content))
    if len(content) != count:
        raise refuse(f"`{name}` ends after {len(content)} of {count} bytes", "write it anew, with numpy.savez")
    return np.frombuffer(content, dtype).reshape(shape, order="F" if in_columns else "C")
