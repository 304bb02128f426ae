"""Files of matrices: which reader reads what, and how much is read at most. Nothing in a file is executed.

Every reader returns entries by name: dense arrays of NumPy, sparse ones of SciPy, labels as texts.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._semidefinite import UnusableMatricesError

MOST_BYTES = 2**30
"""Of a file: 1e5 degrees of freedom with 300 entries in each row of M and K1."""

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
    return refuse(f"`{name}` is {' x '.join(map(str, shape))}", f"at most {MOST_COORDINATES} rows are read")


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
    return combined(read_file(reader, place))


def read_file(reader: Callable[[Path], Any], place: Path) -> Any:
    """Return what a reader makes of a file, its sparse matrices by compressed rows.

    Raises
    ------
    UnusableMatricesError
        The file is too large, or the reader stumbles, over whatever it is.
    """
    try:
        if place.stat().st_size > MOST_BYTES:
            raise refuse(f"`{place.name}` has {place.stat().st_size >> 20} MB", f"at most {MOST_BYTES >> 20} are read")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            read = reader(place)
        if isinstance(read, dict):
            return {name: _checked(name, value) for name, value in read.items()}
        return _checked(place.stem, read)
    except UnusableMatricesError:
        raise
    except (
        Exception
    ) as error:  # of NumPy's, SciPy's and pyyeti's readers: of damaged files they raise whatever they meet
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        kind = place.suffix.removeprefix(".").upper()
        raise refuse(f"`{place.name}` is no {kind} file, or damaged: {reason}", "write it anew") from None


def _checked(name: str, value: Any) -> Any:
    """Return an entry of a size that is read, a sparse one by compressed rows whose indices lie within it."""
    if len(value.shape) == 2 and max(value.shape) > MOST_COORDINATES:
        raise too_large(name, value.shape)
    if hasattr(value, "check_format"):
        value.check_format(full_check=True)
    return value.tocsr() if hasattr(value, "tocsr") else value


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
        if "row" in of:
            return _checked(name, sparse.coo_array((of["data"], (of["row"], of["col"])), shape=shape))
        kind = str(np.asarray(of.get("format", "csr")).astype(str))
        matrix = (sparse.csc_array if kind == "csc" else sparse.csr_array)(
            (of["data"], of["indices"], of["indptr"]), shape=shape
        )
        return _checked(name, matrix)
    except KeyError as missing:
        raise refuse(f"`{name}` lacks {missing.args[0]}", "write data, indices, indptr and shape") from None
    except (ValueError, TypeError, OverflowError) as error:
        raise refuse(f"the parts of `{name}` do not fit together: {error}", "write it as scipy.sparse has it") from None
