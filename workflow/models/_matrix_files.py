"""Files of matrices, read by NumPy, SciPy and pyyeti: entries by name; nothing in a file is executed.

Entries are dense NumPy arrays, SciPy's sparse arrays in compressed rows, and texts.

- NPZ without pickles; a sparse matrix in it is ``mass.data``, ``mass.indices``, ``mass.indptr`` and ``mass.shape``.
- MATLAB up to version 7.
- Directories with a file for each entry: ``mass.mtx`` by Matrix Market, ``mass.rua`` by Harwell-Boeing, and
  ``labels.txt`` with a name in each line.
- CalculiX, ``*FREQUENCY, SOLVER=MATRIXSTORAGE``: ``blade.sti`` holds K1 and ``blade.mas`` M, a line ``row column
  value`` for each entry on or above the diagonal, counted from 1; ``blade.dof`` names each row ``node.direction``.
- Nastran OUTPUT4 (extra ``output4``), whose names have up to eight characters: the beginnings of the entries' names, or
  Nastran's own.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workflow.models._semidefinite import UnusableMatricesError

MOST_BYTES = 2**30
"""Largest size of a file: 1e5 degrees of freedom with 300 entries in each row of M and K1."""

MOST_COORDINATES = 200_000
"""Largest number of rows of a matrix."""

MATRICES = ("mass", "stiffness", "damping", "coupling", "heat_capacity", "conductance")
VECTORS = ("contact", "thermal_contact", "load", "steady", "heating", "tangent")
LABELS = ("labels", "thermal_labels")

Entries = Mapping[str, Any]
"""Matrices, vectors and labels by name."""

_CALCULIX = (".sti", ".mas", ".dof")
_NASTRAN = {"maa": "mass", "mgg": "mass", "kaa": "stiffness", "kgg": "stiffness", "baa": "damping", "bgg": "damping"}
_PART = re.compile(rf"({'|'.join(MATRICES)})[._](data|indices|indptr|shape|row|col|format)")


def files_of(place: Path) -> tuple[Path, ...]:
    """Return all files of a path that a study names.

    Raises
    ------
    ValueError
        One of them is missing.
    """
    if place.is_dir():
        kinds = (*_ENTRY.keys() - {".txt"}, *(f"{name}.txt" for name in LABELS))
        files = tuple(path for path in sorted(place.iterdir()) if path.name.endswith(kinds))
        if not files:
            raise ValueError("it holds no file that is read, such as mass.mtx")
        return files
    if place.suffix.lower() not in _CALCULIX:
        return (place,)
    several = tuple(place.with_suffix(suffix) for suffix in _CALCULIX)
    missing = [path.name for path in several if not path.is_file()]
    if missing:
        raise ValueError(f"{', '.join(missing)} is not beside it")
    return several


def read_entries(place: Path) -> dict[str, Any]:
    """Return the entries of a file or directory.

    Raises
    ------
    UnusableMatricesError
        It is damaged, too large, or of an unknown kind.
    """
    if not place.is_dir():
        return _read(place, _WHOLE)
    entries: dict[str, Any] = {}
    for path in files_of(place):
        if path.stem in entries:
            raise UnusableMatricesError(f"`{path.stem}` is there twice", "keep one file of it")
        entries |= _read(path, _ENTRY)
    return entries


def _read(place: Path, readers: Mapping[str, Callable[[Path], dict[str, Any]]]) -> dict[str, Any]:
    """Return the entries of a file by the reader of its kind; any error of the reader is that of a damaged file."""
    kind = place.suffix.lower()
    if kind not in readers:
        remedy = f"name a file {', '.join(readers)} or a directory of .mtx files"
        raise UnusableMatricesError(f"`{place.name}` is of no kind that is known", remedy)
    try:
        size = place.stat().st_size
        if size > MOST_BYTES:
            raise UnusableMatricesError(f"`{place.name}` has {size >> 20} MB", f"at most {MOST_BYTES >> 20} are read")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return {name: _of_rows(name, value) for name, value in readers[kind](place).items()}
    except UnusableMatricesError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        problem = f"`{place.name}` is no {kind[1:].upper()} file, or damaged: {reason}"
        raise UnusableMatricesError(problem, "write it anew") from None


def _of_rows(name: str, value: Any) -> Any:
    """Return an entry after a check of its size, a sparse one in compressed rows with checked indices."""
    if len(value.shape) == 2 and max(value.shape) > MOST_COORDINATES:
        shape = " x ".join(map(str, value.shape))
        raise UnusableMatricesError(f"`{name}` is {shape}", f"at most {MOST_COORDINATES} rows are read")
    if hasattr(value, "check_format"):
        value.check_format(full_check=True)
    return value.tocsr() if hasattr(value, "tocsr") else value


def _npz(place: Path) -> dict[str, Any]:
    from scipy import sparse  # here and below: reading a study needs none of it

    with np.load(place, allow_pickle=False) as arrays:
        entries = dict(arrays)
    parts: dict[str, dict[str, Any]] = {}
    for match in filter(None, map(_PART.fullmatch, tuple(entries))):
        parts.setdefault(match[1], {})[match[2]] = entries.pop(match[0])
    for name, of in parts.items():
        try:
            shape = tuple(map(int, of["shape"]))
            if "row" in of:
                entries[name] = sparse.coo_array((of["data"], (of["row"], of["col"])), shape=shape)
            else:
                by = sparse.csc_array if str(of.get("format", "csr")) in ("csc", "b'csc'") else sparse.csr_array
                entries[name] = by((of["data"], of["indices"], of["indptr"]), shape=shape)
        except KeyError as missing:
            problem = f"`{name}` lacks {missing.args[0]}"
            raise UnusableMatricesError(problem, "write data, indices, indptr and shape") from None
    return entries


def _mat(place: Path) -> dict[str, Any]:
    from scipy.io import loadmat

    try:
        variables = loadmat(place, appendmat=False, spmatrix=False)
    except NotImplementedError:
        raise UnusableMatricesError(f"`{place.name}` is of version 7.3 (HDF5)", "save it with -v7") from None
    return {name: _plain(name, value) for name, value in variables.items() if hasattr(value, "shape")}


def _plain(name: str, value: Any) -> Any:
    """Return a MATLAB variable in the form of other files: texts one by one, a single whole number as an integer."""
    if name in MATRICES:
        return value
    value = value.toarray() if hasattr(value, "toarray") else value
    if value.dtype == object:
        value = np.array(["".join(np.asarray(text).astype(str).ravel()) for text in value.ravel()])
    if value.size == 1 and value.dtype.kind in "fiub" and float(value.item()).is_integer():
        value = value.astype(np.int64)
    return value.ravel() if name in LABELS or value.dtype.kind in "USi" else value


def _mtx(place: Path) -> dict[str, Any]:
    from scipy.io import mmread

    return {place.stem: mmread(place, spmatrix=False)}


def _rua(place: Path) -> dict[str, Any]:
    from scipy.io import hb_read

    return {place.stem: hb_read(place, spmatrix=False)}


def _txt(place: Path) -> dict[str, Any]:
    lines = place.read_text(encoding="utf-8", errors="replace").splitlines()
    return {place.stem: np.array([line.strip() for line in lines if line.strip()])}


def _calculix(place: Path) -> dict[str, Any]:
    from scipy import sparse

    labels = np.array(place.with_suffix(".dof").read_text(encoding="ascii", errors="replace").split())
    entries: dict[str, Any] = {"labels": labels}
    for name, suffix in (("stiffness", ".sti"), ("mass", ".mas")):
        row, column, values = np.loadtxt(place.with_suffix(suffix), ndmin=2).reshape(-1, 3).T
        places = row.astype(np.int64) - 1, column.astype(np.int64) - 1
        upper = sparse.coo_array((values, places), shape=(labels.size, labels.size)).tocsr()
        entries[name] = upper + sparse.triu(upper, 1).T
    return entries


def _op4(place: Path) -> dict[str, Any]:
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise UnusableMatricesError(
            "OUTPUT4 files are read through pyyeti, which is not installed",
            "install `rotor-stator-workflow[output4]`, or write NPZ or Matrix Market files",
        ) from None
    names = _NASTRAN | {name[:8]: name for name in (*MATRICES, *VECTORS)}
    entries = {}
    for short, (value, *_) in op4.OP4().dctload(str(place), sparse=True).items():
        name = names.get(short.strip().lower(), short.strip().lower())
        entries[name] = value.toarray() if name in VECTORS else value
    return entries


_WHOLE = {".npz": _npz, ".mat": _mat, ".op4": _op4, **dict.fromkeys(_CALCULIX, _calculix)}
_ENTRY = {".mtx": _mtx, ".rua": _rua, ".hb": _rua, ".txt": _txt}
