"""Directories of matrices in text, a file for each: ``mass.mtx`` by Matrix Market, ``mass.rsa`` by Harwell-Boeing.

``labels.txt`` and ``thermal_labels.txt`` name the degrees of freedom, one in each line.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_files import (
    LABELS,
    MATRICES,
    MOST_BYTES,
    MOST_COORDINATES,
    VECTORS,
    checked_sparse,
    refuse,
    too_large,
)

MATRIX_MARKET = ".mtx"
HARWELL_BOEING = (".rsa", ".rua", ".hb")
LABEL_FILE = ".txt"
_LONGEST_HEAD = 2**16


def parts(place: Path) -> tuple[Path, ...]:
    """Return the files of a directory that are read, sorted."""
    kinds = (MATRIX_MARKET, *HARWELL_BOEING)
    return tuple(
        sorted(
            path
            for path in place.iterdir()
            if path.is_file()
            and (
                (path.suffix == LABEL_FILE and path.stem in LABELS)
                or (path.suffix in kinds and (path.stem in (*MATRICES, *VECTORS) or path.suffix == MATRIX_MARKET))
            )
        )
    )


def read(place: Path) -> dict[str, Any]:
    """Return the entries of a directory by the names of its files.

    Raises
    ------
    UnusableMatricesError
        A file is damaged, too large, or there is a second one of its name.
    """
    entries: dict[str, Any] = {}
    room = MOST_BYTES
    for path in parts(place):
        room -= path.stat().st_size
        if room < 0:
            raise refuse(f"`{place.name}` has more than {MOST_BYTES >> 20} MB", "so much text is not read")
        if path.stem in entries:
            raise refuse(f"`{path.stem}` is there twice", "keep one file of it")
        entries[path.stem] = _entry(path)
    return entries


def _entry(path: Path) -> Any:
    if path.suffix == LABEL_FILE:
        lines = path.read_text(encoding="utf-8", errors="replace").split("\n", MOST_COORDINATES + 1)
        return np.array([line.strip() for line in lines if line.strip()])
    reader = _matrix_market if path.suffix == MATRIX_MARKET else _harwell_boeing
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return reader(path)
    except (ArithmeticError, ValueError, TypeError, LookupError, SyntaxError, Warning, MemoryError) as error:
        raise refuse(f"`{path.name}` is damaged: {_line(error)}", "write it anew, e.g. with scipy.io") from None


def _line(error: BaseException) -> str:
    return " ".join(str(error).split())[:100]


def _matrix_market(path: Path) -> Any:
    """Return a matrix; its head says how large it is, its length how large it can be."""
    from scipy.io import mmread  # imported here: reading a study needs none of it

    rows, columns, entries = _head(path)
    if max(rows, columns) > MOST_COORDINATES:
        raise too_large(path.stem, (rows, columns))
    if 2 * entries > path.stat().st_size:  # an entry has a character and an end of line
        raise refuse(
            f"`{path.name}` says it has {entries} entries, and {path.stat().st_size} bytes cannot hold them",
            "write it anew, e.g. with scipy.io.mmwrite",
        )
    matrix = mmread(path, spmatrix=False)
    return np.asarray(matrix) if isinstance(matrix, np.ndarray) else checked_sparse(path.stem, matrix)


def _head(path: Path) -> tuple[int, int, int]:
    """Return rows, columns and number of entries that a file says it has."""
    with path.open("rb") as opened:
        lines = opened.read(_LONGEST_HEAD).decode("ascii", errors="replace").split("\n")
    if not lines[0].startswith("%%MatrixMarket "):
        raise ValueError("it does not begin with %%MatrixMarket")
    words = lines[0].split()
    size_line = next((line for line in lines[1:-1] if line.strip() and not line.startswith("%")), "")
    sizes = [int(word) for word in size_line.split()]
    if "array" in words and len(sizes) == 2:
        return sizes[0], sizes[1], sizes[0] * sizes[1] // (1 if "general" in words else 3)
    if "coordinate" not in words or len(sizes) != 3 or min(sizes) < 0:
        raise ValueError(f"no sizes in its first {_LONGEST_HEAD} characters")
    return sizes[0], sizes[1], sizes[2]


def _harwell_boeing(path: Path) -> Any:
    """Return a matrix, both halves of one whose type says that it is symmetric."""
    from scipy import sparse  # imported here: reading a study needs none of it
    from scipy.io import hb_read

    with path.open(encoding="ascii", errors="replace") as opened:
        head = [opened.readline(_LONGEST_HEAD) for _ in range(3)]
    kind = head[2][:3].upper()
    sizes = [int(word) for word in head[2][3:].split()[:3]]
    if len(sizes) < 3 or max(sizes[:2]) > MOST_COORDINATES or 2 * sizes[2] > path.stat().st_size:
        raise ValueError(f"its head says {sizes}")
    matrix = checked_sparse(path.stem, hb_read(path, spmatrix=False))
    return (matrix + sparse.tril(matrix, -1).T).tocsr() if kind[1:2] == "S" else matrix
