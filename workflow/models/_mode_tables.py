"""Tables of modes: rows from a CSV file, or as a study has them."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from workflow.declare import File, Rows
from workflow.kernels import Array
from workflow.models._semidefinite import UnusableMatricesError

COLUMNS = (("frequency", "Hz"), ("damping_ratio", "1"), ("tip", "1/kg**0.5"))
HEAT_COLUMNS = (("rate", "1/s"), ("tip", "(K/J)**0.5"))

_SPELLINGS = {
    "Hz": ("Hz",),
    "1": ("1", "-"),
    "1/kg**0.5": ("1/√kg", "1/sqrt(kg)", "1/kg**0.5"),
    "1/s": ("1/s",),
    "(K/J)**0.5": ("1/√(J/K)", "1/sqrt(J/K)", "(K/J)**0.5"),
}
"""How the unit of a column may stand in brackets behind its name, the first as it is asked for."""

_HEADING = re.compile(r"(\w+)\s*(?:\[\s*(.*?)\s*\])?")

MOST_MODES = 2000
_MOST_BYTES = 2**25


def read_table(source: File | Rows, columns: Sequence[tuple[str, str]]) -> Array:
    """Return a table with a row for each mode and the columns in this order, ``(mode, column)``.

    The head of a CSV file names them in any order, with or without their units: ``frequency [Hz]``.

    Raises
    ------
    UnusableMatricesError
        A column is missing, unknown, twice or in another unit, or a value is no number.
    """
    rows: Rows | Array
    names, order = [name for name, _ in columns], list(range(len(columns)))
    if isinstance(source, File):
        head, *lines = _lines(source)
        parsed = [_HEADING.fullmatch(word.strip(' "')) for word in head.split(",")]
        headings = [match[1] if match else "" for match in parsed]
        if sorted(headings) != sorted(names):
            raise UnusableMatricesError(f"`{source.name}` has the columns {head[:80]}", f"write {', '.join(names)}")
        _check_units(source.name, {match[1]: match[2] for match in parsed if match}, dict(columns))
        name, order, rows = f"`{source.name}`", [headings.index(name) for name in names], _numbers(source, lines)
    else:
        name, rows = "the table", source
    table = _table(name, rows)
    if table.shape[1] != len(names):
        raise UnusableMatricesError(f"{name} has a different number of columns", f"write {', '.join(names)}")
    return _shaken(source, table[:, order]) if isinstance(source, File) else table


def _check_units(name: str, written: Mapping[str, str | None], units: Mapping[str, str]) -> None:
    """Refuse a column whose heading has another unit than the one it is read in."""
    for column, unit in written.items():
        known = _SPELLINGS[units[column]]
        if unit is not None and unit not in known:
            raise UnusableMatricesError(f"`{name}` has `{column}` in {unit}", f"write `{column} [{known[0]}]`")


def read_matrix(source: File | Rows, shape: tuple[int, int]) -> Array:
    """Return a matrix of numbers from a CSV file without a head, or from rows.

    Raises
    ------
    UnusableMatricesError
        It has another shape.
    """
    name = f"`{source.name}`" if isinstance(source, File) else "the coupling"
    matrix = _table(name, _numbers(source, _lines(source)) if isinstance(source, File) else source)
    if matrix.shape != shape:
        remedy = f"write {shape[0]}, one for each mode, of {shape[1]} numbers, one for each thermal mode"
        raise UnusableMatricesError(f"{name} has {matrix.shape[0]} rows of {matrix.shape[1]}", remedy)
    return _shaken(source, matrix) if isinstance(source, File) else matrix


def _shaken(file: File, table: Array) -> Array:
    """Return numbers of a file changed by its share, neighbours in a row in opposite directions."""
    return np.asarray(table * (1 + file.shaken * (-1.0) ** np.arange(table.shape[1])))


def _lines(file: File) -> list[str]:
    """Return the lines of a file that are not empty."""
    path = Path(file.place)
    if path.stat().st_size > _MOST_BYTES:
        raise UnusableMatricesError(f"`{file.name}` has {path.stat().st_size >> 20} MB", f"at most {_MOST_BYTES >> 20}")
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip(" \t,")]
    except UnicodeDecodeError as error:
        raise UnusableMatricesError(
            f"`{file.name}` is no CSV file: {error}", "write values with commas between"
        ) from None
    if not lines:
        raise UnusableMatricesError(f"`{file.name}` is empty", "write a row for each mode")
    return lines


def _numbers(file: File, lines: list[str]) -> Array:
    """Return lines as rows of numbers, all of one length."""
    try:
        return np.loadtxt(lines, delimiter=",", quotechar='"', comments=None, ndmin=2) if lines else np.zeros((0, 0))
    except ValueError as error:
        raise UnusableMatricesError(f"`{file.name}` is no table of numbers: {error}", "write numbers") from None


def _table(name: str, rows: Rows | Array) -> Array:
    """Return rows as an array, all of one length, finite and not too many."""
    if not 0 < len(rows) <= MOST_MODES:
        raise UnusableMatricesError(f"{name} has {len(rows)} rows", f"write 1 to {MOST_MODES}")
    if len({len(row) for row in rows}) > 1:
        raise UnusableMatricesError(f"{name} has rows of different lengths", "write as many values in each")
    table = np.array(rows, dtype=np.float64)
    if not np.isfinite(table).all():
        raise UnusableMatricesError(f"{name} has a value that is not finite", "write finite numbers")
    return table
