"""Nastran OUTPUT4 files, through pyyeti where it is installed (extra ``output4``).

Names have eight characters there: ``MASS``, ``STIFFNES``, ``HEAT_CAP``, … are the beginnings of the entries' names,
``MAA``, ``MGG``, ``KAA``, ``KGG``, ``BAA`` and ``BGG`` are those of Nastran.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

from workflow.models._matrix_files import (
    MATRICES,
    MOST_BYTES,
    MOST_COORDINATES,
    VECTORS,
    checked_sparse,
    refuse,
    too_large,
)

_NASTRAN = {"maa": "mass", "mgg": "mass", "kaa": "stiffness", "kgg": "stiffness", "baa": "damping", "bgg": "damping"}
_LONGEST_NAME = 8
_SMALLEST = 4
"""Bytes of an entry, at least, of a file that holds dense columns or strings of them."""


def read(place: Path) -> dict[str, Any]:
    """Return the matrices of a file by the names they stand for.

    Raises
    ------
    UnusableMatricesError
        pyyeti is not installed; or the file is damaged or too large.
    """
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise refuse(
            "OUTPUT4 files are read through pyyeti, which is not installed",
            "install `rotor-stator-workflow[output4]`, or write NPZ or Matrix Market files",
        ) from None
    try:
        if place.stat().st_size > MOST_BYTES:
            raise refuse(
                f"`{place.name}` has {place.stat().st_size >> 20} MB", f"at most {MOST_BYTES >> 20} MB are read"
            )
        for name, shape in zip(*op4.OP4().dir(str(place), verbose=False)[:2], strict=True):
            if max(map(abs, shape)) > MOST_COORDINATES:
                raise too_large(name, shape)
        matrices = op4.OP4().dctload(str(place), sparse=True)
    except (
        ArithmeticError,
        ValueError,
        TypeError,
        LookupError,
        OSError,
        RuntimeError,
        MemoryError,
        struct.error,
    ) as error:
        raise refuse(f"`{place.name}` is damaged: {' '.join(str(error).split())[:100]}", "write it anew") from None
    entries = {}
    for name, value in matrices.items():
        matrix = checked_sparse(name, value[0])
        stands_for = _entry_of(name)
        entries[stands_for] = matrix.toarray() if stands_for in VECTORS else matrix
    return entries


def _entry_of(name: str) -> str:
    """Return the entry that a name of up to eight characters stands for, itself if none."""
    short = name.strip().lower()
    matching = [entry for entry in (*MATRICES, *VECTORS) if entry[:_LONGEST_NAME] == short]
    return matching[0] if matching else _NASTRAN.get(short, short)
