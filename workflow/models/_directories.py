"""Directories of matrices in text, a file for each: ``mass.mtx`` by Matrix Market, ``mass.rua`` by Harwell-Boeing.

``labels.txt`` and ``thermal_labels.txt`` name the degrees of freedom, one in each line.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_files import LABELS, MATRICES, VECTORS, read_file, refuse

MATRIX_MARKET = ".mtx"
HARWELL_BOEING = (".rua", ".hb")
LABEL_FILE = ".txt"


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
        A file is damaged, or there is a second one of its name.
    """
    entries: dict[str, Any] = {}
    for path in parts(place):
        if path.stem in entries:
            raise refuse(f"`{path.stem}` is there twice", "keep one file of it")
        entries[path.stem] = read_file(_entry, path)
    return entries


def _entry(path: Path) -> Any:
    from scipy.io import hb_read, mmread  # imported here: reading a study needs none of it

    if path.suffix == LABEL_FILE:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
        return np.array([line.strip() for line in lines if line.strip()])
    return mmread(path, spmatrix=False) if path.suffix == MATRIX_MARKET else hb_read(path, spmatrix=False)
