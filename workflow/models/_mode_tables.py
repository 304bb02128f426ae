"""Tables of modes: rows of a CSV file or of a study."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from workflow.declare import File, Rows
from workflow.kernels import Array
from workflow.models._semidefinite import UnusableMatricesError

COLUMNS = (("frequency", "Hz"), ("damping_ratio", "1"), ("tip", "1/kg**0.5"))
HEAT_COLUMNS = (("rate", "1/s"), ("tip", "K**0.5/J**0.5"))

_SPELLINGS = {
    "Hz": ("Hz",),
    "1": ("1", "-"),
    "1/kg**0.5": ("1/√kg", "1/sqrt(kg)", "1/kg**0.5"),
    "1/s": ("1/s",),
    "K**0.5/J**0.5": ("1/√(J/K)", "1/sqrt(J/K)", "(K/J)**0.5"),
}
"""Accepted spellings of a column's unit, in brackets after its name; messages use the first one."""

_HEADING = re.compile(r"(\w+)\s*(?:\[\s*(.*?)\s*\])?")

MOST_MODES = 2000
_MOST_BYTES = 2**25


def read_table(source: File | Rows, columns: Sequence[tuple[str, str]]) -> Array:
    """Return a table with a row for each mode and the columns in the given order, ``(mode, column)``.

    The header of a CSV file names them in any order, with or without their units: ``frequency [Hz]``.

    Raises
    ------
    UnusableMatricesError
        A column is missing, unknown, twice or in another unit, or a value is no number.
    """
    names = [name for name, _ in columns]
    if not isinstance(source, File):
        return _table("the table", source, len(names))
    head, *lines = _lines(source)
    parsed = [_HEADING.fullmatch(word.strip(' "')) for word in head.split(",")]
    written = {match[1]: match[2] for match in parsed if match}
    if sorted(written) != sorted(names) or len(parsed) != len(names):
        raise UnusableMatricesError(f"`{source.name}` has the columns {head[:80]}", f"write {', '.join(names)}")
    for name, unit in columns:
        if written[name] not in (None, *_SPELLINGS[unit]):
            problem = f"`{source.name}` has `{name}` in {written[name]}"
            raise UnusableMatricesError(problem, f"write `{name} [{_SPELLINGS[unit][0]}]`")
    table = _table(f"`{source.name}`", _numbers(source, lines), len(names))
    return _shaken(source, table[:, [list(written).index(name) for name in names]])


def read_matrix(source: File | Rows, shape: tuple[int, int]) -> Array:
    """Return a matrix of numbers from a CSV file without a header, or from rows.

    Raises
    ------
    UnusableMatricesError
        It has another shape.
    """
    if not isinstance(source, File):
        return _table("the coupling", source, shape[1], shape[0])
    return _shaken(source, _table(f"`{source.name}`", _numbers(source, _lines(source)), shape[1], shape[0]))


def _shaken(file: File, table: Array) -> Array:
    """Return a file's numbers perturbed by ``file.shaken``, relatively, with alternating signs along a row."""
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


def _table(name: str, rows: Rows | Array, width: int, height: int | None = None) -> Array:
    """Return rows as an array of finite numbers ``(height, width)``, of any height up to the limit where ``None``."""
    if not 0 < len(rows) <= MOST_MODES:
        raise UnusableMatricesError(f"{name} has {len(rows)} rows", f"write 1 to {MOST_MODES}")
    widths = sorted({len(row) for row in rows})
    if widths != [width] or len(rows) != (height or len(rows)):
        problem = f"{name} has {len(rows)} rows of {' and '.join(map(str, widths))} numbers"
        raise UnusableMatricesError(problem, f"write {height or 'rows'} of {width}, one for each mode")
    table = np.array(rows, dtype=np.float64)
    if not np.isfinite(table).all():
        raise UnusableMatricesError(f"{name} has a value that is not finite", "write finite numbers")
    return table
