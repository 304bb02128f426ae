"""Nastran OUTPUT4 files, through pyyeti where it is installed (extra ``output4``).

Names have eight characters there: ``MASS``, ``STIFFNES``, ``HEAT_CAP``, … are the beginnings of the entries' names,
``MAA``, ``MGG``, ``KAA``, ``KGG``, ``BAA`` and ``BGG`` are those of Nastran.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from workflow.models._matrix_files import MATRICES, VECTORS, refuse

_NASTRAN = {"maa": "mass", "mgg": "mass", "kaa": "stiffness", "kgg": "stiffness", "baa": "damping", "bgg": "damping"}
_LONGEST_NAME = 8


def read(place: Path) -> dict[str, Any]:
    """Return the matrices of a file by the names they stand for.

    Raises
    ------
    UnusableMatricesError
        pyyeti is not installed.
    """
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise refuse(
            "OUTPUT4 files are read through pyyeti, which is not installed",
            "install `rotor-stator-workflow[output4]`, or write NPZ or Matrix Market files",
        ) from None
    matrices = op4.OP4().dctload(str(place), sparse=True)
    entries = {}
    for name, value in matrices.items():
        stands_for = _entry_of(name)
        entries[stands_for] = value[0].toarray() if stands_for in VECTORS else value[0]
    return entries


def _entry_of(name: str) -> str:
    """Return the entry that a name of up to eight characters stands for, itself if none."""
    short = name.strip().lower()
    matching = [entry for entry in (*MATRICES, *VECTORS) if entry[:_LONGEST_NAME] == short]
    return matching[0] if matching else _NASTRAN.get(short, short)
