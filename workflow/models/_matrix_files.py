"""Files of matrices, read by NumPy, SciPy and pyyeti: entries by name; nothing in a file is executed.

Entries are dense NumPy arrays, SciPy's sparse arrays in compressed rows, and texts. Numbers in a text are read whole,
as C or Fortran writes them, or refused with file and line: SciPy's readers drop what follows the part they know.

- NPZ without pickles; a sparse matrix in it is ``mass.data``, ``mass.indices``, ``mass.indptr`` and ``mass.shape``.
- MATLAB up to version 7.
- Directories with a file for each entry: ``mass.mtx`` by Matrix Market, ``mass.rua`` by Harwell-Boeing, and
  ``labels.txt`` with a name in each line.
- CalculiX, ``*FREQUENCY, SOLVER=MATRIXSTORAGE``: ``blade.sti`` holds K1 and ``blade.mas`` M, a line ``row column
  value`` for each entry on or above the diagonal, counted from 1; ``blade.dof`` names each row ``node.direction``.
- Abaqus, ``*MATRIX OUTPUT``: ``JOB_STIF1.mtx`` holds K1 of step 1, and beside it ``JOB_MASS1.mtx`` M, if they are there
  ``JOB_DMPV1.mtx`` C1 and ``JOB_LOAD1.mtx`` a load. Lines are ``node dof node dof value``, which gives labels
  ``node.dof`` (MATRIX INPUT, LABELS), or ``row column value`` from 1 (COORDINATE).
- Nastran DMIG, ``blade.pch``, by its names (KAAX, KGG, …), in small, large and free fields; labels ``node.component``.
- Nastran OUTPUT4 (extra ``output4``), whose names have up to eight characters: the beginnings of the entries' names
  (``s_speed2``, ``l_speed2``), or Nastran's own.

A symmetric matrix of CalculiX, Abaqus and DMIG may be one of its triangles, in any order.

Files that came with a study, whose contents it holds, are laid out in a directory for readers and models.
"""

from __future__ import annotations

import dataclasses
import re
import shutil
import tempfile
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple
from zipfile import is_zipfile

import numpy as np

from workflow.declare import NUMBER, File
from workflow.declare import files_of as files_declared
from workflow.models._pair import UnusableMatricesError

INDEX, GAP = "[0-9]+", r"[ \t]+"

_PLAIN = NUMBER.replace("[-+]?", "-?", 1)
_ANY = NUMBER.replace("[eE][-+]?", "(?:[eE][-+]?|[-+])")
"""Also with a plus, or an exponent of a sign alone, as Fortran writes one of three digits: ``1.0-103``."""

_NOT_PLAIN = re.compile(r"(?<=[0-9.])(?=[-+])|(?<![0-9.eE])(\+)")
"""Where an e belongs, or (in a group) a plus that goes."""


def in_c(text: str, row: str, what: str, name: str, line: int = 1) -> str:
    """Return a text with its numbers as every reader takes them: exponents of e, no plus before a number.

    Parameters
    ----------
    text
        Lines, each with its line feed: the last number of a file without it may be cut off. Empty ones do not count.
    row
        Regular expression of a line, in which :data:`~workflow.declare.NUMBER` stands for a number.
    what, name
        What a line is, and the file's name, for the message.
    line
        Number of the first line in the file.

    Raises
    ------
    UnusableMatricesError
        A line is another one.
    """
    plain = text.replace("D", "e").replace("d", "e")
    for number in (_PLAIN, _ANY):
        rows = re.match(rf"(?:[ \t]*+(?:{row.replace(NUMBER, number)})?[ \t]*\n)*+", plain)
        end = rows.end() if rows else 0
        if end == len(text):
            return plain if number == _PLAIN else _NOT_PLAIN.sub(lambda found: "" if found[1] else "e", plain)
    (wrong, ended, _), place = text[end:].partition("\n"), line + text.count("\n", 0, end)
    problem = f"`{name}`, line {place}: `{wrong.strip()[:60]}` is not {what}" + (not ended) * " and the end of a line"
    raise UnusableMatricesError(problem, "write complete numbers, as -1.5e-3, and complete lines")


MOST_COORDINATES = 200_000
"""Largest number of rows of a matrix."""


class Entry(NamedTuple):
    """What a file may contain."""

    axes: tuple[str, ...]
    """What each of its rows, and of its columns, belongs to."""
    unit: str
    """In SI; empty for texts."""
    meaning: str


_X, _T, _C = "displacement", "temperature", "contact"
_DIRECTION = "an index, a label, a vector, or rows of several contacts"
MATRICES = {
    "mass": Entry((_X, _X), "kg", "M, symmetric"),
    "stiffness": Entry((_X, _X), "N/m", "K1, symmetric"),
    "damping": Entry((_X, _X), "N s/m", "C1, symmetric and positive semi-definite; it may couple modes"),
    "coupling": Entry((_X, _T), "N/K", "K12; where heat lengthens a blade, its entries are negative"),
    "heat_capacity": Entry((_T, _T), "J/K", "C2, symmetric; without it the structure stays cold"),
    "conductance": Entry((_T, _T), "W/K", "K2, symmetric"),
    "stiffness_speed2": Entry((_X, _X), "N s²/(m rad²)", "K_Ω of K1 + Ω² K_Ω at the scene's speed, symmetric"),
}
VECTORS = {
    "contact": Entry((_X,), "1", f"w, of which x = wᵀx touches the casing: {_DIRECTION}"),
    "thermal_contact": Entry(
        (_T,),
        "1",
        f"s, shares of the contact heat with the sum 1: {_DIRECTION}; left out, the temperature with the label of the "
        "contact, or of its one displacement",
    ),
    "load": Entry((_X,), "1", "direction of `scene.load`; left out, that of the contact"),
    "steady": Entry((_X,), "N", "constant load"),
    "heating": Entry((_T,), "W", "constant heat load"),
    "tangent": Entry((_X,), "1", f"t, in which the casing slides: {_DIRECTION}"),
    "load_speed2": Entry((_X,), "N s²/rad²", "r of the constant load f + Ω² r"),
}
ROWS = {
    "angle": Entry((_C,), "rad", "ψ: contact i sees the casing at Ωt + ψ_i"),
    "residual_flexibility": Entry(
        (_C, _C), "m/N", "w ΔF wᵀ, the static flexibility that the matrices lack; these contacts have no mass"
    ),
    "residual_tangent": Entry((_C, _C), "m/N", "w ΔF tᵀ, of friction"),
    "residual_coupling": Entry((_C, _T), "m/K", "w ΔF K12"),
    "residual_load": Entry((_C,), "m/N", "w ΔF b, of the load"),
    "residual_steady": Entry((_C,), "m", "constant displacement, of constant loads"),
}
"""Of contacts, which have rows of `contact`, `tangent` and `thermal_contact` too; 0 where left out."""

LABELS = {
    "labels": Entry((_X,), "", "a text of printable characters for each; in a directory `labels.txt`, one a line"),
    "thermal_labels": Entry((_T,), "", "the same"),
    "contact_labels": Entry((_C,), "", "name of each contact"),
}
ENTRIES = MATRICES | VECTORS | ROWS | LABELS

SPEED2 = "stiffness_speed2", "load_speed2"

STRUCTURAL = "structural_damping"
"""Imaginary stiffness of Abaqus and Nastran; equation (1a) has no such term, which is of one frequency."""

Entries = Mapping[str, Any]
"""Matrices, vectors and labels by name."""

_CALCULIX = (".sti", ".mas", ".dof")
_ABAQUS = re.compile(r"(.+_)STIF([0-9]+)\.mtx")
_OF_ABAQUS = {"STIF": "stiffness", "MASS": "mass", "DMPV": "damping", "DMPS": STRUCTURAL, "LOAD": "load"}
_OF_NASTRAN = {"m": "mass", "k": "stiffness", "b": "damping", "k4": STRUCTURAL}
_NASTRAN = {f"{short}{freedoms}": name for short, name in _OF_NASTRAN.items() for freedoms in ("aa", "gg", "aax")}
_LABEL = rf"{INDEX}\.{INDEX}"
_COORDINATES = rf"{INDEX}{GAP}{INDEX}{GAP}{NUMBER}"
_FREEDOM = rf"-?{INDEX}{GAP}[0-9]{{1,3}}"
_NODES = rf"{_FREEDOM}{GAP}{_FREEDOM}{GAP}{NUMBER}"
_LOADS = rf"(?:{_FREEDOM}|{INDEX}){GAP}{NUMBER}"
_MARKET = re.compile(
    r"%%MatrixMarket\s+matrix\s+(coordinate|array)\s+(real|integer)\s.*\n(?:[ \t]*(?:%.*)?\n)*.*\n", re.I
)
_OUTPUT4 = re.compile(r"[-\d\s]{32,48}[A-Z]\w*\s*(?:(?:1P,)?\d+[ED](\d+)\.\d+)?\s*(?:\|I16)?\s*", re.I)
PART = re.compile(rf"({'|'.join(MATRICES)})[._](data|indices|indptr|shape|row|col|format)")


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
    if _ABAQUS.fullmatch(place.name):
        several = tuple(part for entry, part in _of_abaqus(place).items() if entry == "mass" or part.is_file())
    elif place.suffix.lower() in _CALCULIX:
        several = tuple(place.with_suffix(suffix) for suffix in _CALCULIX)
    else:
        return (place,)
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
    files, entries = files_of(place), dict[str, Any]()
    _refuse_twice([path.stem for path in files], f"in {', '.join(path.name for path in files)}")
    for path in files:
        entries |= _read(path, _ENTRY)
    return entries


def _read(place: Path, readers: Mapping[str, Callable[[Path], dict[str, Any]]]) -> dict[str, Any]:
    """Return the entries of a file by the reader of its kind; any error of the reader is that of a damaged file."""
    kind = "_STIF1.mtx" if readers is _WHOLE and _ABAQUS.fullmatch(place.name) else place.suffix.lower()
    if kind not in readers:
        remedy = f"name a file {', '.join(readers)} or a directory of .mtx files"
        raise UnusableMatricesError(f"`{place.name}` is of an unknown kind", remedy)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            entries = {name: _of_rows(name, value) for name, value in readers[kind](place).items()}
        return {name: in_unicode(f"{place.name}: {name}", value) for name, value in entries.items()}
    except UnusableMatricesError:
        raise
    except Exception as error:
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        problem = f"`{place.name}` is no {kind[1:].upper()} file, or damaged: {reason}"
        raise UnusableMatricesError(problem, "write it again") from None


def _of_rows(name: str, value: Any) -> Any:
    """Return an entry after a check of its size, a sparse one in compressed rows with checked indices."""
    if len(value.shape) == 2 and max(value.shape) > MOST_COORDINATES:
        shape = " x ".join(map(str, value.shape))
        raise UnusableMatricesError(f"`{name}` is {shape}", f"at most {MOST_COORDINATES} rows are read")
    if hasattr(value, "check_format"):
        value.check_format(full_check=True)
    return value.tocsr() if hasattr(value, "tocsr") else value


def in_unicode(name: str, value: Any) -> Any:
    """Return an entry with its texts as characters: bytes are UTF-8."""
    try:
        return np.char.decode(value, "utf-8") if value.dtype.kind == "S" else value
    except UnicodeDecodeError as error:
        raise UnusableMatricesError(f"`{name}` has a text that is not UTF-8: {error.object!r}", "write UTF-8") from None


def _npz(place: Path) -> dict[str, Any]:
    from scipy import sparse  # here and below: reading a study needs none of it

    if not is_zipfile(place):
        raise ValueError("it is no ZIP archive, as numpy.savez writes")
    with np.load(place, allow_pickle=False) as arrays:
        entries = dict(arrays)
        found = [(name, PART.fullmatch(name)) for name in arrays]
    _refuse_twice([".".join(part.groups()) if part else name for name, part in found], "as a part")
    parts: dict[str, dict[str, Any]] = {}
    for match in filter(None, (part for _, part in found)):
        parts.setdefault(match[1], {})[match[2]] = entries.pop(match[0])
    _refuse_twice([*entries, *parts], "dense and sparse")
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
    from scipy.io import loadmat, whosmat

    try:
        _refuse_twice([name for name, *_ in whosmat(place, appendmat=False)], "under one name")
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

    text = place.read_text(encoding="latin-1")
    head = _MARKET.match(text)
    if head is None:
        problem = f"`{place.name}` begins with `{text.partition(chr(10))[0][:80]}`"
        remedy = "write `%%MatrixMarket matrix coordinate real general`, and all values; of Abaqus name JOB_STIF1.mtx"
        raise UnusableMatricesError(problem, remedy)
    row, what = (NUMBER, "a number") if head[1].lower() == "array" else (_COORDINATES, "row, column and value")
    body = in_c(text[head.end() :], row, what, place.name, 1 + head[0].count("\n"))
    sizes = head[0].replace(head[2], "real", 1).lower().removeprefix("%%matrixmarket")
    return {place.stem: mmread(BytesIO(f"%%MatrixMarket{sizes}{body}".encode("latin-1")), spmatrix=False)}


def _rua(place: Path) -> dict[str, Any]:
    """Return a matrix of Harwell-Boeing: column pointers, rows and values in cards, with gaps between the numbers.

    Source: Duff, Grimes and Lewis, Users' guide for the Harwell-Boeing sparse matrix collection (1992), section 2.
    """
    from scipy import sparse

    *_, sizes, formats, cards = place.read_text(encoding="latin-1").split("\n", 4)
    kind, form = sizes[:3].upper(), " ".join(formats.upper().split())
    rows, columns, entries = (int(sizes[at : at + 14]) for at in (14, 28, 42))
    if not re.fullmatch("[RI][URS]A", kind) or re.search("P.*[FG]", form):  # with P Fortran's F are multiples
        problem = f"`{place.name}` is of the type {kind} in the format {form}"
        raise UnusableMatricesError(problem, "write an assembled matrix of real values (RUA), with exponents")
    row, what = rf"{NUMBER}(?:{GAP}{NUMBER})*", f"numbers with gaps between, as they are read of the format {form}"
    numbers = np.fromstring(in_c(cards, row, what, place.name, 5), sep=" ")
    starts, ends = columns + 1, columns + 1 + entries
    if numbers.size != ends + entries or np.any(numbers[:ends] % 1):
        problem = f"`{place.name}` has {numbers.size} numbers with gaps between in the format {form}"
        remedy = f"write {starts} column pointers and {entries} rows, which are whole, and {entries} values"
        raise UnusableMatricesError(problem, remedy)
    pointers, indices = (part.astype(np.int64) - 1 for part in np.split(numbers[:ends], [starts]))
    matrix = sparse.csc_array((numbers[ends:], indices, pointers), shape=(rows, columns))
    return {place.stem: matrix + sparse.tril(matrix, -1).T if kind[1] == "S" else matrix}


def _txt(place: Path) -> dict[str, Any]:
    return {place.stem: np.array([line.strip() for line in place.read_bytes().splitlines() if line.strip()])}


def _calculix(place: Path) -> dict[str, Any]:
    freedoms = place.with_suffix(".dof")
    labels = np.array(in_c(freedoms.read_text(encoding="latin-1"), _LABEL, "node.direction", freedoms.name).split())
    entries: dict[str, Any] = {"labels": labels}
    for name, suffix in (("stiffness", ".sti"), ("mass", ".mas")):
        part = place.with_suffix(suffix)
        text = in_c(part.read_text(encoding="latin-1"), _COORDINATES, "row, column and value", part.name)
        row, column, values = np.fromstring(text, sep=" ").reshape(-1, 3).T
        size, count = int(max(row.max(initial=0), column.max(initial=0))), labels.size
        if size != count:
            cyclic = ", as of a cyclic sector, which is not taken" if size == 2 * count else ""
            problem = f"`{part.name}` has {size} rows for the {count} labels of `{place.stem}.dof`{cyclic}"
            raise UnusableMatricesError(problem, "take the three files of one run of CalculiX, of a whole structure")
        entries[name] = _symmetric(part.name, (row.astype(np.int64) - 1, column.astype(np.int64) - 1), values, count)
    return entries


def _symmetric(name: str, places: tuple[Any, Any], values: Any, size: int) -> Any:
    """Return a symmetric matrix from its entries, all of them or those of one triangle."""
    from scipy import sparse

    given = sparse.coo_array((values, places), shape=(size, size)).tocsr()
    if given.nnz < len(values):
        raise UnusableMatricesError(f"`{name}` has an entry twice", "write one matrix, each entry once")
    beside = given - sparse.diags_array(given.diagonal())
    return given if beside.sign().multiply(beside.T.sign()).nnz else given + beside.T


def _by_nodes(name: str, tables: Mapping[str, Any]) -> dict[str, Any]:
    """Return matrices, and vectors, of rows of ``node component`` for each index and a value, with their labels."""
    keys = {entry: 1000 * table[:, :-1:2] + table[:, 1:-1:2] for entry, table in tables.items()}
    freedoms = np.unique(np.concatenate([key.ravel() for key in keys.values()])).astype(np.int64)
    entries: dict[str, Any] = {"labels": np.array([f"{key // 1000}.{key % 1000}" for key in freedoms])}
    for entry, key in keys.items():
        row, *column = np.searchsorted(freedoms, key).T
        values = tables[entry][:, -1]
        if column:
            entries[entry] = _symmetric(f"{name}: {entry}", (row, column[0]), values, freedoms.size)
        else:
            entries[entry] = np.bincount(row, values, freedoms.size)
    return entries


def _of_abaqus(place: Path) -> dict[str, Path]:
    """Return the files of a step of a job by their entries, whether they are there or not."""
    job, step = re.fullmatch(_ABAQUS, place.name).groups()  # type: ignore[union-attr]
    return {entry: place.with_name(f"{job}{short}{step}.mtx") for short, entry in _OF_ABAQUS.items()}


def _abaqus(place: Path) -> dict[str, Any]:
    tables = {entry: _of_form(part, entry) for entry, part in _of_abaqus(place).items() if part.is_file()}
    if len({table.shape[1] for entry, table in tables.items() if entry != "load"}) > 1:
        raise UnusableMatricesError(f"the files of `{place.name}` have several forms", "write them by one FORMAT")
    if tables["stiffness"].shape[1] == 5:
        return _by_nodes(place.name, tables)
    if "load" in tables and np.any(tables["load"][:, 1:-1] != 1):
        raise UnusableMatricesError(f"`{place.name}` has several loads beside it", "write one load")
    indices = {entry: table[:, [0, -1]] if entry == "load" else table for entry, table in tables.items()}
    each = {entry: np.insert(table, range(1, table.shape[1]), 0, axis=1) for entry, table in indices.items()}
    entries = _by_nodes(place.name, each)
    if entries.pop("labels")[-1] != f"{entries['mass'].shape[0]}.0":
        raise UnusableMatricesError(f"`{place.name}` has rows without an entry", "write labels, by another FORMAT")
    return entries


def _of_form(part: Path, entry: str) -> Any:
    """Return the numbers of a file of Abaqus, whose lines have as many as its first one."""
    text = part.read_text(encoding="latin-1")
    if len(re.findall(r"(?mi)^\*CLOAD", text)) > 1:
        raise UnusableMatricesError(f"`{part.name}` has several loads", "write one load, and a real one")
    text = re.sub(r"(?m)^[ \t]*\*.*$", "", text).replace(",", " ")
    columns = len(text.lstrip().partition("\n")[0].split())
    row, what = (_NODES, "node, dof, node, dof and value") if columns > 3 else (_COORDINATES, "row, column and value")
    row, what = (_LOADS, "node, dof and value") if entry == "load" else (row, what)
    return np.fromstring(in_c(text, row, what, part.name).strip(), sep=" ").reshape(-1, columns or 3)


def _punch(place: Path) -> dict[str, Any]:
    """Return the matrices of Nastran's DMIG entries, whose fields are 8 or, with a ``*``, 16 wide, or free.

    A header has the name, 0, the form and the type; a column its node and component, and from the fifth field on four
    fields for each row: node, component, real and imaginary part. Source: MSC Nastran Quick Reference Guide, DMIG.
    """
    whole = place.read_text(encoding="latin-1")
    in_c(whole, ".*", "an entry", place.name)
    lines = whole.expandtabs().splitlines()
    heads: list[tuple[str, str, str]] = []
    texts: dict[str, dict[int, str]] = {}
    name = column = ""
    for line, text in enumerate(lines):
        begin, *fields = _fields(text.partition("$")[0])
        if begin.upper() == "DMIG":
            name, column = fields[0].lower(), "" if fields[1] == "0" else f"{fields[1]} {fields[2] or 0}"
            if not column:
                heads.append((name, fields[2], fields[3]))
            fields = fields[4:]
        elif not begin.startswith("+") and begin:
            column = ""  # another entry
        rows = [f"{g} {c or 0} {a} {b}" for g, c, a, b in zip(*[iter(fields)] * 4, strict=True) if g or a]
        if column:
            texts.setdefault(name, {})[line] = " ".join(f"{column} {row}" for row in rows)
    tables, read = {}, [head for head in heads if head[0] in _NASTRAN and head[0] in texts]
    if not read:
        written = ", ".join(name.upper() for name, *_ in heads) or "none"
        raise UnusableMatricesError(f"`{place.name}` has the DMIG matrices {written}", "name them KAAX, MAAX, BAAX")
    _refuse_twice([_NASTRAN[name] for name, *_ in read], f"in `{place.name}`")
    for name, form, kind in read:
        if form not in ("1", "6") or kind not in ("1", "2"):
            problem = f"`{place.name}`: {name.upper()} is of the form {form} and the type {kind}"
            raise UnusableMatricesError(problem, "write a square (1) or symmetric (6) matrix of real numbers (1 or 2)")
        text = "".join(texts[name].get(line, "") + "\n" for line in range(len(lines)))
        text = in_c(text, rf"{_NODES}(?:{GAP}{_NODES})?", "nodes, components and a real number", place.name)
        tables[_NASTRAN[name]] = np.fromstring(text.strip(), sep=" ").reshape(-1, 5)
    return _by_nodes(place.name, tables)


def _fields(text: str) -> list[str]:
    """Return the first field of a line of Nastran without its ``*`` and the eight fields of data, or four wide ones."""
    wide = "*" in text.partition(",")[0][:8]
    count, width = (4, 16) if wide else (8, 8)
    fixed = [text[:8], *(text[8 + width * k :][:width] for k in range(count))]
    begin, *fields = text.split(",") if "," in text else fixed
    return ["_".join(field.split()) for field in [begin.replace("*", ""), *fields, *[""] * count][: count + 1]]


def _op4(place: Path) -> dict[str, Any]:
    try:
        from pyyeti.nastran import op4
    except ImportError:
        raise UnusableMatricesError(
            "OUTPUT4 files are read through pyyeti, which is not installed",
            "install `rotor-stator-workflow[output4]`, or write NPZ or Matrix Market files",
        ) from None
    _check_output4(place)
    names = _NASTRAN | {name[:8]: name for name in (*MATRICES, *VECTORS) if name not in SPEED2}
    names |= {f"{name[0]}_speed2": name for name in SPEED2}
    written, values, *_ = op4.OP4().listload(str(place), sparse=True)
    read = [names.get(short, short) for short in written]
    _refuse_twice(read, f"as {', '.join(written).upper()}")
    return {name: value.toarray() if name in VECTORS else value for name, value in zip(read, values, strict=True)}


def _check_output4(place: Path) -> None:
    """Refuse a text of OUTPUT4 in which a line is not fields of one width: pyyeti cuts them without a look."""
    with place.open("rb") as file:
        if 0 in file.read(4):
            return  # it is binary
    width, number = 16, ""
    for line, text in enumerate(place.read_text(encoding="latin-1").splitlines(), 1):
        head = _OUTPUT4.fullmatch(text)
        if head:
            width = int(head[1] or 16)
        elif "." in text:
            number = number or NUMBER.replace("eE", "D" if "D" in text else "eE")
            fields = (text[at : at + width] for at in range(0, len(text.rstrip()), width))
            if not all(len(field) == width and re.fullmatch(rf" *{number}", field) for field in fields):
                problem = f"`{place.name}`, line {line}: `{text[:60].strip()}` is not numbers of {width} characters"
                raise UnusableMatricesError(problem, "write them by the format of the matrix's first line, all with E")


def _refuse_twice(names: Sequence[str], where: str) -> None:
    for name, times in Counter(names).items():
        if times > 1:
            raise UnusableMatricesError(f"`{name}` is there twice, {where}", "keep one of them")


_WHOLE = {
    **{".npz": _npz, ".mat": _mat, ".op4": _op4, ".pch": _punch, "_STIF1.mtx": _abaqus},
    **dict.fromkeys(_CALCULIX, _calculix),
}
_ENTRY = {".mtx": _mtx, **dict.fromkeys((".rua", ".rsa", ".hb"), _rua), ".txt": _txt}


_DIRECTORIES: set[Path] = set()
_MAKING = threading.RLock()
"""Held while a directory is made, and for good once the process is about to end."""


@contextmanager
def files_laid_out(parameters: Any) -> Iterator[Any]:
    """Give parameters whose files lie in a directory of their own, which goes with this context.

    Raises
    ------
    UnusableMatricesError
        There is no room for them.
    """
    if not any(file.contents for file in files_declared(parameters)):
        yield parameters
        return
    with _MAKING:
        directory = Path(tempfile.mkdtemp(prefix="workflow-"))
        _DIRECTORIES.add(directory)
    try:
        try:
            own = _laid_out(parameters, directory)
        except OSError as error:
            problem = f"its files cannot be written to {directory.parent}: {error.strerror}"
            raise UnusableMatricesError(problem, "make room, or set TMPDIR to another directory") from None
        yield own
    finally:
        shutil.rmtree(directory, ignore_errors=True)
        _DIRECTORIES.discard(directory)


def discard_files() -> None:
    """Remove what is laid out, also while it is being written; the process is about to end."""
    _MAKING.acquire()
    for directory in tuple(_DIRECTORIES):
        while directory.exists():
            shutil.rmtree(directory, ignore_errors=True)


def _laid_out(declared: Any, directory: Path) -> Any:
    if isinstance(declared, File):
        home = directory / declared.digest
        home.mkdir(exist_ok=True)
        for name, content in declared.contents.items():
            (home / name).write_bytes(content)
        whole = Path(declared.name).name
        return dataclasses.replace(declared, place=str(home / whole if whole in declared.contents else home))
    if dataclasses.is_dataclass(declared) and not isinstance(declared, type):
        entries = [entry.name for entry in dataclasses.fields(declared) if entry.init]
        return dataclasses.replace(
            declared, **{name: _laid_out(getattr(declared, name), directory) for name in entries}
        )
    return declared
