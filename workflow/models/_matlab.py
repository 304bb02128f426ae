"""MATLAB files up to version 7: arrays, sparse matrices and texts."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._matrix_files import LABELS, MATRICES, refuse


def read(place: Path) -> dict[str, Any]:
    """Return the variables of a file by name.

    Raises
    ------
    UnusableMatricesError
        It is of version 7.3.
    """
    from scipy.io import loadmat  # imported here: reading a study needs none of it

    try:
        variables = loadmat(place, appendmat=False, spmatrix=False)
    except NotImplementedError:
        raise refuse(f"`{place.name}` is of version 7.3 (HDF5)", "save it with -v7") from None
    return {name: _plain(name, value) for name, value in variables.items() if hasattr(value, "shape")}


def _plain(name: str, value: Any) -> Any:
    """Return a variable as other readers do: texts one by one, vectors flat, a single whole number as one."""
    if name in MATRICES:
        return value
    if hasattr(value, "toarray"):
        value = value.toarray()
    if value.dtype == object:
        value = np.array(["".join(np.asarray(text).astype(str).ravel()) for text in value.ravel()])
    if name in LABELS or value.dtype.kind in "US":
        return value.ravel()
    if value.size == 1 and value.dtype.kind in "fiub" and float(value.ravel()[0]).is_integer():
        return value.ravel().astype(np.int64)
    return value
