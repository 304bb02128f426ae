"""Matrices as CalculiX stores them (``*FREQUENCY, SOLVER=MATRIXSTORAGE``): upper triangles in text, and their labels.

``blade.sti`` holds K1 and ``blade.mas`` M, a line ``row column value`` for each entry on or above the diagonal, counted
from 1; ``blade.dof`` names each row ``node.direction``. Displacements that the model fixes are left out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

BESIDE = (".sti", ".mas", ".dof")


def read(place: Path) -> dict[str, Any]:
    """Return stiffness, mass and labels of a file and those beside it."""
    stiffness, mass, labels = (place.with_suffix(suffix) for suffix in BESIDE)
    named = labels.read_text(encoding="ascii", errors="replace").split()
    size = len(named)
    return {"stiffness": _symmetric(stiffness, size), "mass": _symmetric(mass, size), "labels": np.array(named)}


def _symmetric(place: Path, size: int) -> Any:
    """Return the whole of a symmetric matrix whose upper triangle a file lists."""
    from scipy import sparse  # imported here: reading a study needs none of it

    row, column, values = np.loadtxt(place, ndmin=2).reshape(-1, 3).T
    places = row.astype(np.int64) - 1, column.astype(np.int64) - 1
    upper = sparse.coo_array((values, places), shape=(size, size)).tocsr()
    return (upper + sparse.triu(upper, 1).T).tocsr()
