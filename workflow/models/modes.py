"""Structure from a table of modes, as finite element codes print it, without matrices.

With mass-normalised modes x_n = Σ φ_j η_j, θ_n = Σ χ_l τ_l, and equation (1) is

    η_j'' + 2 ζ_j ω_j η_j' + ω_j² η_j + Σ G_jl τ_l = φ_j (f - λ),   τ_l' + μ_l τ_l = χ_l α λ.

Its tip is x_n, θ_n (:mod:`workflow.models._from_matrices`). Modes beyond the table are truncated: x_n lacks their
static response, which a mode of high frequency, or the residual flexibility of contacts without mass, may replace.
Tables are rows of a CSV file or of a study; one of several contacts has columns ``tip_1`` to ``tip_m``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from io import BytesIO
from pathlib import Path

import numpy as np

from workflow.declare import NUMBER, File, Rows, rows, speed
from workflow.kernels import Array
from workflow.models._from_matrices import structure_from_matrices, with_contacts
from workflow.models._matrix_entries import Chosen, given_by
from workflow.models._matrix_files import ENTRIES, in_c
from workflow.models._pair import UnusableMatricesError, turning_at
from workflow.models._sensors import Sensor
from workflow.models._structure import COLD, Matrices, Rayleigh, Structure

COLUMNS = (("frequency", "Hz"), ("damping_ratio", "1"), ("tip", "1/kg**0.5"))
HEAT_COLUMNS = (("rate", "1/s"), ("tip", "K**0.5/J**0.5"))

_SPELLINGS = {
    "Hz": ("Hz",),
    "1": ("1", "-"),
    "1/kg**0.5": ("1/√kg", "1/sqrt(kg)", "1/kg**0.5"),
    "1/s": ("1/s",),
    "K**0.5/J**0.5": ("1/√(J/K)", "1/sqrt(J/K)", "(K/J)**0.5"),
    **{unit: (unit,) for unit in ("deg", "m")},
}
"""Accepted spellings of a column's unit, in brackets after its name; messages use the first one."""

_HEADING = re.compile(r"([\w.-]+)\s*(?:\[\s*(.*?)\s*\])?")

_BLANK = " \t,"
"""What a line without numbers consists of, such as a spreadsheet writes."""

MOST_MODES = 2000

_NEARLY, _KNOWN = 0.8, {*dict(COLUMNS), *dict(HEAT_COLUMNS), "tip_1", "tangent"}
"""Likeness of a column's name to one of these from which it is misspelt, as difflib measures it."""


def read_table(
    source: File | Rows, columns: Sequence[tuple[str, str]], most: int = MOST_MODES, others: bool = False
) -> Array:
    """Return a table with at most so many rows and the columns in the given order, ``(row, column)``.

    The header of a CSV file names them in any order, with or without their units: ``frequency [Hz]``. It may have
    ``others``, of sensors, whose names are not nearly those of a column.

    Raises
    ------
    UnusableMatricesError
        A column is missing, unknown, twice or in another unit, or a value is no number.
    """
    names = [name for name, _ in columns]
    if not isinstance(source, File):
        return _table("the table", source, len(names), most=most)
    lines, start, written = _headed(source, most)
    width, more = lines[start].count(",") + 1, sorted(set(written) - set(names))
    misspelt = not others or any(get_close_matches(name, _KNOWN & {*names, "tangent"}, cutoff=_NEARLY) for name in more)
    if not set(names) <= set(written) or len(written) != width or (more and misspelt):
        problem = f"`{source.name}` has the columns {lines[start][:80]}"
        beside = others * ", and others of letters, digits, _, - and ."
        raise UnusableMatricesError(problem, f"write {', '.join(names)}{beside}")
    for name, unit in columns:
        if written[name] not in (None, *_SPELLINGS[unit]):
            problem = f"`{source.name}` has `{name}` in {written[name]}"
            raise UnusableMatricesError(problem, f"write `{name} [{_SPELLINGS[unit][0]}]`")
    table = _table(f"`{source.name}`", _numbers(source, lines, width, start + 1), width, most=most)
    return _shaken(source, table[:, [list(written).index(name) for name in names]])


def columns_of_contacts(
    source: File | Rows, columns: Sequence[tuple[str, str]], beside: str = ""
) -> tuple[tuple[str, str], ...]:
    """Return the columns of a table, the last as often as it is numbered, and then those ``beside`` it, if any."""
    *others, (last, unit) = columns
    written = _headed(source)[2] if isinstance(source, File) else {}
    count = sum(bool(re.fullmatch(rf"{last}_\d+", name)) for name in written)
    if not isinstance(source, File) and source and len(source[0]) > len(columns):
        count = len(source[0]) - len(others)
    ends = [f"_{k + 1}" for k in range(count)] or [""]
    names = (last, beside) if beside and any(name.startswith(beside) for name in written) else (last,)
    return (*others, *((f"{name}{end}", unit) for name in names for end in ends))


def _headed(source: File, most: int = MOST_MODES) -> tuple[list[str], int, dict[str, str | None]]:
    """Return the lines of a file, the place of its header among them, and the units of its columns by name."""
    lines = _lines(source, most)
    start = next(k for k, line in enumerate(lines) if line.strip(_BLANK))
    parsed = (_HEADING.fullmatch(word.strip(' "')) for word in lines[start].split(","))
    return lines, start, {match[1]: match[2] for match in parsed if match}


def read_matrix(source: File | Rows, shape: tuple[int, int], name: str = "coupling", of: str = "mode") -> Array:
    """Return a matrix of numbers from a CSV file without a header, or from rows.

    Raises
    ------
    UnusableMatricesError
        It has another shape.
    """
    if not isinstance(source, File):
        return _table(f"the {name}", source, shape[1], shape[0], of=of)
    numbers = _numbers(source, _lines(source, MOST_MODES), shape[1])
    return _shaken(source, _table(f"`{source.name}`", numbers, shape[1], shape[0], of=of))


def _shaken(file: File, table: Array) -> Array:
    """Return a file's numbers perturbed by ``file.shaken``, relatively, with alternating signs along a row."""
    return np.asarray(table * (1 + file.shaken * (-1.0) ** np.arange(table.shape[1])))


def _lines(file: File, most: int) -> list[str]:
    """Return the lines of a file, of which one at least is not empty, and one more than so many at most."""
    content = next(iter(file.contents.values())) if file.contents else Path(file.place).read_bytes()
    if content.count(b"\n") + content.count(b"\r") > most:  # counted as bytes: a text takes ten times their memory
        count = sum(bool(line.strip(_BLANK.encode() + b"\n")) for line in BytesIO(content.replace(b"\r", b"\n")))
        if count > most + 1:
            raise UnusableMatricesError(f"`{file.name}` has {count} lines", f"write 1 to {most} rows")
    try:
        lines = content.decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise UnusableMatricesError(
            f"`{file.name}` is no CSV file: {error}", "write values with commas between"
        ) from None
    if not any(line.strip(_BLANK) for line in lines):
        raise UnusableMatricesError(f"`{file.name}` is empty", "write its rows")
    return lines


def _numbers(file: File, lines: list[str], width: int, start: int = 0) -> Array:
    """Return lines from one on as rows of so many numbers."""
    cell = rf'"?[ \t]*{NUMBER}[ \t]*"?'
    row = rf"{cell}(?:[ \t]*,[ \t]*{cell}){{{width - 1}}}|,[{_BLANK}]*"
    text = in_c("\n".join([*lines[start:], ""]), row, f"{width} numbers with commas between", file.name, start + 1)
    return np.fromstring(text.translate({ord(mark): " " for mark in '",'}), sep=" ").reshape(-1, width)


def _table(
    name: str, rows: Rows | Array, width: int, height: int | None = None, most: int = MOST_MODES, of: str = "mode"
) -> Array:
    """Return rows as an array of finite numbers ``(height, width)``, of any height up to the limit where ``None``."""
    if not 0 < len(rows) <= most:
        raise UnusableMatricesError(f"{name} has {len(rows)} rows", f"write 1 to {most}")
    widths = sorted({len(row) for row in rows})
    if widths != [width] or len(rows) != (height or len(rows)):
        problem = f"{name} has {len(rows)} rows of {' and '.join(map(str, widths))} numbers"
        raise UnusableMatricesError(problem, f"write {height or 'rows'} of {width}, a row for each {of}")
    table = np.array(rows, dtype=np.float64)
    if not np.isfinite(table).all():
        raise UnusableMatricesError(f"{name} has a value that is not finite", "write finite numbers")
    return table


@dataclass(frozen=True)
class Parameters:
    """Modes of a structure with its tip free, and optionally its thermal modes."""

    table: File | Rows = rows(
        "CSV file, or rows, with columns frequency [Hz], damping_ratio and tip: the tip's displacement in the mode of "
        "unit modal mass [1/√kg], positive towards the casing; of several contacts tip_1, tip_2, …; in a "
        "file also tangent, or tangent_1, …, along which the casing slides",
        COLUMNS,
    )
    heat: File | Rows | None = rows(
        "CSV file, or rows, with columns rate [1/s] and tip: the tip's temperature in the thermal mode of unit modal "
        "heat capacity [1/√(J/K)]; tip_1, tip_2, … of several contacts, or one tip for all",
        HEAT_COLUMNS,
        default=None,
    )
    coupling: File | Rows | None = rows(
        "CSV file, or rows, of φᵀK12χ [N/K/√kg/√(J/K)]: a row for each mode, a column for each thermal mode",
        default=None,
    )
    residual: File | Rows | None = rows(
        "CSV file, or rows, of w ΔF wᵀ [m/N], the static flexibility that the modes lack: a row and a column for each "
        "contact, which has no mass then",
        default=None,
        later=True,
    )
    residual_tangent: File | Rows | None = rows(
        "CSV file, or rows, of w ΔF tᵀ [m/N], to tangential forces; 0 where left out", default=None, later=True
    )
    stiffness_speed2: File | Rows | None = rows(
        "CSV file, or rows, of φᵀK_Ωφ [1/rad²], a row and a column for each mode at rest: K1 + Ω² K_Ω at the scene's "
        "speed",
        default=None,
        later=True,
    )
    load_speed2: File | Rows | None = rows(
        "CSV file, or rows, of φᵀr [N s²/rad²/√kg], one number for each mode: the constant load Ω² r",
        default=None,
        later=True,
    )
    speed: float = speed()

    @property
    def damping_ratio(self) -> float:
        """The largest of the table."""
        columns = columns_of_contacts(self.table, COLUMNS, "tangent")
        return float(read_table(self.table, columns, others=True)[:, 1].max())


def depends_on_speed(parameters: Parameters) -> bool:
    """Tell whether the structure depends on the scene's speed."""
    return parameters.stiffness_speed2 is not None or parameters.load_speed2 is not None


def assemble(parameters: Parameters) -> Matrices:
    """Return the structure of equations (1a) and (1b), its last coordinate the tip, or a contact of the table.

    Raises
    ------
    UnusableMatricesError
        A table is not one of modes.
    """
    columns = columns_of_contacts(parameters.table, COLUMNS, "tangent")
    frequency, ratio, *tips = read_table(parameters.table, columns, others=True).T
    count = sum(name.startswith("tip") for name, _ in columns)
    _check(np.all(frequency >= 0), "frequency", "at least 0")
    _check(np.all(ratio >= 0), "damping_ratio", "at least 0")
    for (name, _), row in zip(columns[2 : 2 + count], tips, strict=False):
        _check(np.any(row != 0), name, "other than 0 in some mode")
    rate, shares = _heat(parameters, count)
    heat, omega = np.array(shares * (count if len(shares) == 1 else 1)), 2 * np.pi * frequency
    even = bool(np.all(ratio[omega > 0] == ratio.max()))
    entries = {
        "mass": np.eye(frequency.size),
        "stiffness": np.diag(omega**2),
        "heat_capacity": np.eye(rate.size),
        "conductance": np.diag(rate),
        "contact": np.array(tips[:count]),
        "thermal_contact": heat,
        **({"tangent": np.array(tips[count:])} if np.any(tips[count:]) else {}),
        **({} if even else {"damping": np.diag(2 * ratio * omega)}),
        **_beside(parameters, frequency.size, rate.size, count),
    }
    damping = Rayleigh(ratio=float(ratio.max())) if even else Rayleigh()
    angular = 2 * np.pi * parameters.speed
    given, contacts = given_by(entries, Chosen(), damping, angular, _warmth(heat), "residual")
    with turning_at(parameters.speed):
        return with_contacts(structure_from_matrices(given), contacts)


def _warmth(heat: Array) -> Array:
    """Return the thermal modes of a uniform rise by 1 K, which each contact shows, ``(thermal mode,)``."""
    if np.all(heat == heat[0]):
        return np.asarray(heat[0] / float(heat[0] @ heat[0]))
    return np.asarray(np.linalg.lstsq(heat, np.ones(len(heat)))[0], dtype=np.float64)


def _beside(parameters: Parameters, modes: int, heats: int, contacts: int) -> dict[str, Array]:
    """Return the entries that a table of modes may have beside it, by their names in a file of matrices."""
    for name, beside in (("coupling", "heat"), ("residual_tangent", "residual")):
        if getattr(parameters, beside) is None and getattr(parameters, name) is not None:
            raise UnusableMatricesError(f"`{name}` is given without `{beside}`", "give both, or neither")
    lengths, read = {"displacement": modes, "temperature": heats, "contact": contacts}, {}
    for name in ("coupling", "residual", "residual_tangent", "stiffness_speed2", "load_speed2"):
        entry = "residual_flexibility" if name == "residual" else name
        own, (rows, *columns) = getattr(parameters, name), ENTRIES[entry].axes
        if own is not None:
            shape = lengths[rows], lengths[columns[0]] if columns else 1
            read[entry] = read_matrix(own, shape, name, "contact" if rows == "contact" else "mode")
    return read


def sensor_rows(parameters: Parameters, sensors: tuple[Sensor, ...], structure: Structure) -> list[Array]:
    """Return the columns of sensors, of the table or, for temperatures, of ``heat``, ``(mode,)`` each.

    Raises
    ------
    UnusableMatricesError
        There is no such column.
    """
    rows = []
    for sensor in sensors:
        source, known = (parameters.heat, HEAT_COLUMNS) if sensor.of_heat else (parameters.table, COLUMNS)
        written = _headed(source)[2] if isinstance(source, File) else {}
        names = [name for name in written if name not in {name for name, _ in known[:-1]}]
        at = str(sensor.at)
        if not isinstance(source, File) or at not in names:
            problem = f"`{sensor.at}` is no column of `{'heat' if sensor.of_heat else 'table'}`"
            raise UnusableMatricesError(problem, f"write {' or '.join(names) or 'the table as a file with columns'}")
        columns = {**dict(columns_of_contacts(source, known, "tangent")), at: known[-1][1]}
        table = read_table(source, tuple(columns.items()), others=True)
        rows.append(table[:, list(columns).index(at)])
    return rows


def _heat(parameters: Parameters, count: int) -> tuple[Array, list[Array]]:
    """Return rates and the rows of tips of the thermal modes; of a structure that stays cold one mode."""
    warm: File | Rows = ((0.0, 1 / float(np.sqrt(COLD))),) if parameters.heat is None else parameters.heat
    columns = columns_of_contacts(warm, HEAT_COLUMNS)
    rate, *shares = read_table(warm, columns, others=True).T
    names = [name for name, _ in columns[1:]]
    _check(np.all(rate >= 0), "rate", "at least 0")
    for name, row in zip(names, shares, strict=True):
        _check(np.any(row != 0), name, "other than 0 in some thermal mode")
    if len(shares) not in (1, count):
        problem = f"`heat` has the tips {', '.join(names)}, and `table` has {count}"
        raise UnusableMatricesError(problem, "write one for each, or one `tip` for all")
    return rate, shares


def _check(holds: bool | np.bool_, column: str, what: str) -> None:
    if not holds:
        raise UnusableMatricesError(f"column `{column}` has an impossible value", f"write values {what}")
