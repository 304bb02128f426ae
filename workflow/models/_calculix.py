"""Matrices as CalculiX stores them (``*FREQUENCY, SOLVER=MATRIXSTORAGE``): upper triangles in text, and their labels.

``blade.sti`` holds K1 and ``blade.mas`` M, a line ``row column value`` for each entry on or above the diagonal, counted
from 1; ``blade.dof`` names each row ``node.direction``. Displacements that the model fixes are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from workflow.kernels import Array
from workflow.models._matrix_files import MOST_BYTES, MOST_COORDINATES, refuse, too_large

BESIDE = (".sti", ".mas", ".dof")
_BLOCK = 2**20
_LONGEST_LINE = 200


def read(place: Path) -> dict[str, Any]:
    """Return stiffness, mass and labels of a file and those beside it.

    Raises
    ------
    UnusableMatricesError
        One is damaged, too large, or they do not fit together.
    """
    stiffness, mass, labels = (place.with_suffix(suffix) for suffix in BESIDE)
    named = _labels(labels)
    size = len(named)
    return {"stiffness": _symmetric(stiffness, size), "mass": _symmetric(mass, size), "labels": np.array(named)}


def _labels(place: Path) -> list[str]:
    if place.stat().st_size > MOST_COORDINATES * _LONGEST_LINE:
        raise refuse(f"`{place.name}` has {place.stat().st_size} bytes", f"at most {MOST_COORDINATES} labels are read")
    named = place.read_text(encoding="ascii", errors="replace").split()
    if not 0 < len(named) <= MOST_COORDINATES:
        raise too_large(place.name, (len(named),))
    return named


def _symmetric(place: Path, size: int) -> Any:
    """Return the whole of a symmetric matrix whose upper triangle a file lists."""
    from scipy import sparse  # imported here: reading a study needs none of it

    if place.stat().st_size > MOST_BYTES:
        raise refuse(f"`{place.name}` has {place.stat().st_size >> 20} MB", f"at most {MOST_BYTES >> 20} MB are read")
    table = np.concatenate([np.zeros((0, 3)), *_tables(place)])
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


def _tables(place: Path) -> Iterator[Array]:
    """Yield rows, columns and values, ``(entry, 3)``, block by block."""
    with place.open("rb") as opened:
        rest = b""
        while block := opened.read(_BLOCK):
            *lines, rest = (rest + block).split(b"\n")
            if len(rest) > _LONGEST_LINE:
                raise refuse(f"`{place.name}` has a line without end", "write `row column value` lines")
            yield _numbers(place, lines)
        yield _numbers(place, [rest])


def _numbers(place: Path, lines: list[bytes]) -> Array:
    try:
        table = np.array([line.split() for line in lines if line.strip()], dtype=np.float64)
        return table.reshape(-1, 3)
    except ValueError:
        raise refuse(f"`{place.name}` has a line that is not `row column value`", "write it anew") from None
