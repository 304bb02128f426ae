"""Matrices as CalculiX stores them (``*FREQUENCY, SOLVER=MATRIXSTORAGE``): upper triangles in text, and their labels.

``blade.sti`` holds K1 and ``blade.mas`` M, a line ``row column value`` for each entry on or above the diagonal, counted
from 1; ``blade.dof`` names each row ``node.direction``. Displacements that the model fixes are left out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_files import refuse

BESIDE = (".sti", ".mas", ".dof")


def read(place: Path) -> dict[str, Any]:
    """Return stiffness, mass and labels of a file and those beside it.

    Raises
    ------
    UnusableMatricesError
        They do not fit together.
    """
    stiffness, mass, labels = (place.with_suffix(suffix) for suffix in BESIDE)
    named = labels.read_text(encoding="ascii", errors="replace").split()
    size = len(named)
    return {"stiffness": _symmetric(stiffness, size), "mass": _symmetric(mass, size), "labels": np.array(named)}


def _symmetric(place: Path, size: int) -> Any:
    """Return the whole of a symmetric matrix whose upper triangle a file lists."""
    from scipy import sparse  # imported here: reading a study needs none of it

    table = np.loadtxt(place, ndmin=2).reshape(-1, 3)
    places = table[:, :2].astype(np.int64) - 1
    if np.any(places + 1 != table[:, :2]) or np.any(places < 0) or np.any(places >= size):
        raise refuse(f"`{place.name}` has an entry outside its {size} rows", "write it anew, with the .dof of one run")
    row, column = places.T
    if np.any(row > column):
        raise refuse(f"`{place.name}` has entries below the diagonal", "write upper triangles, as CalculiX does")
    upper = sparse.coo_array((table[:, 2], (row, column)), shape=(size, size)).tocsr()
    if upper.nnz < row.size:
        raise refuse(f"`{place.name}` has an entry twice", "write each entry once")
    return (upper + sparse.triu(upper, 1).T).tocsr()
