"""Files of matrices: which reader reads what, and how much is read at most. Nothing in a file is executed.

Every reader returns entries by name: dense arrays of NumPy, sparse ones of SciPy, labels as texts. Sizes are read
before values, so that a file takes the memory that its matrices may have and no more, whatever it says.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._from_matrices import UnusableMatricesError

MOST_BYTES = 2**30
"""Of all entries of a file together: 1e5 degrees of freedom with 300 entries in each row of M and K1."""

MOST_COORDINATES = 200_000
"""Rows of a matrix."""

MATRICES = ("mass", "stiffness", "damping", "coupling", "heat_capacity", "conductance")
VECTORS = ("contact", "thermal_contact", "load", "steady", "heating", "tangent")
LABELS = ("labels", "thermal_labels")

Entries = Mapping[str, Any]
"""Matrices, vectors and labels by name."""


def refuse(problem: str, remedy: str) -> UnusableMatricesError:
    """Return the error of a file that cannot be used."""
    return UnusableMatricesError(problem, remedy)


def too_large(name: str, shape: tuple[int, ...]) -> UnusableMatricesError:
    """Return the error of an entry that is larger than any structure may be."""
    size = " x ".join(map(str, shape))
    return refuse(
        f"`{name}` says it is {size}", f"at most {MOST_COORDINATES} rows and {MOST_BYTES >> 20} MB in all are read"
    )


def files_of(place: Path) -> tuple[Path, ...]:
    """Return all files that belong to a place that a study names.

    Raises
    ------
    ValueError
        One of them is missing.
    """
    from workflow.models import _calculix, _directories

    if place.is_dir():
        files = _directories.parts(place)
        if not files:
            raise ValueError("it holds no file that is read, such as mass.mtx")
        return files
    if place.suffix.lower() not in _calculix.BESIDE:
        return (place,)
    several = tuple(place.with_suffix(suffix) for suffix in _calculix.BESIDE)
    missing = [path.name for path in several if not path.is_file()]
    if missing:
        raise ValueError(f"{', '.join(missing)} is not beside it")
    return several


def read_entries(place: Path) -> dict[str, Any]:
    """Return the entries of a file or directory.

    Raises
    ------
    UnusableMatricesError
        It is damaged, too large, holds what is not read, or is of no kind that is known.
    """
    from workflow.models import _calculix, _directories, _matlab, _npz, _output4

    if place.is_dir():
        return _directories.read(place)
    readers = {".npz": _npz.read, ".mat": _matlab.read, ".op4": _output4.read}
    readers |= dict.fromkeys(_calculix.BESIDE, _calculix.read)
    reader = readers.get(place.suffix.lower())
    if reader is None:
        raise refuse(
            f"`{place.name}` is of no kind that is known",
            f"name a file {', '.join(readers)} or a directory of .mtx files",
        )
    try:
        return combined(reader(place))
    except OSError as error:
        raise refuse(f"`{place.name}` cannot be read: {error.strerror}", "name a file that can be read") from None


def checked_sparse(name: str, matrix: Any) -> Any:
    """Return a sparse matrix by compressed rows, once its indices are known to lie within it.

    Raises
    ------
    UnusableMatricesError
        It is too large.
    ValueError
        They do not.
    """
    if max(matrix.shape) > MOST_COORDINATES:
        raise too_large(name, matrix.shape)
    if hasattr(matrix, "check_format"):
        matrix.check_format(full_check=True)
    return matrix.tocsr()


_SPARSE = ("data", "indices", "indptr", "shape", "row", "col", "format")


def combined(entries: Entries) -> dict[str, Any]:
    """Return entries with the parts of sparse matrices, ``mass.data`` and so on, put together."""
    whole: dict[str, Any] = {}
    parts: dict[str, dict[str, Any]] = {}
    for key, value in entries.items():
        name = next(
            (name for name in MATRICES if key[: len(name)] == name and key[len(name) : len(name) + 1] in "._"), ""
        )
        part = key[len(name) + 1 :]
        if name and part in _SPARSE:
            parts.setdefault(name, {})[part] = value
        else:
            whole[key] = value
    for name, of in parts.items():
        whole[name] = _sparse(name, of)
    return whole


def _sparse(name: str, of: dict[str, Any]) -> Any:
    """Return a sparse matrix from the arrays of its compressed rows (columns with format ``csc``), or coordinates.

    Raises
    ------
    UnusableMatricesError
        They do not fit together.
    """
    from scipy import sparse  # imported here: reading a study needs none of it

    try:
        shape = tuple(int(length) for length in np.asarray(of["shape"]).ravel())
        if len(shape) != 2 or not 0 < max(shape) <= MOST_COORDINATES:
            raise too_large(name, shape)
        if "row" in of:
            return sparse.coo_array((of["data"], (of["row"], of["col"])), shape=shape).tocsr()
        kind = str(np.asarray(of.get("format", "csr")).astype(str))
        matrix = (sparse.csc_array if kind == "csc" else sparse.csr_array)(
            (of["data"], of["indices"], of["indptr"]), shape=shape
        )
        return checked_sparse(name, matrix)
    except KeyError as missing:
        raise refuse(f"`{name}` lacks {missing.args[0]}", "write data, indices, indptr and shape") from None
    except (ValueError, TypeError, OverflowError) as error:
        raise refuse(f"the parts of `{name}` do not fit together: {error}", "write it as scipy.sparse has it") from None
