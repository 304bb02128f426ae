"""How models and schemes declare what a study may set: unit, bounds, shape, meaning.

A model's ``Parameters`` and a scheme's ``Options`` are frozen dataclasses whose fields come from
:func:`quantity`. The study floor reads the declarations to check values, to convert units, to
write the JSON Schema and to say what would have been right; physics itself only sees numbers.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, Field, dataclass, field
from pathlib import Path
from typing import Any, Literal

Values = float | tuple[float, ...]
"""A scalar for every node (or spring), or one value per node (or spring), root to tip."""


Rows = tuple[tuple[float, ...], ...]
"""Rows of a table."""

NUMBER = r"[-+]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
"""A number as C, Python and spreadsheets write it, as a regular expression."""


_LONGEST_UNIT = 40
_UNIT_FACTOR = re.compile(r"([A-Za-zµμΩ_]+)(?:(?:\*\*|\^)?([-+]?[0-9]{1,2}(?:\.[0-9]{1,2})?)(?![0-9]))?|1(?![0-9])")
_UNIT_JOINT = re.compile(r"\s*(?:(?<!\*)\*(?!\*)|·|(/))\s*|\s+")
_UNDER = re.compile(r"/\s*\(\s*([^()]*?)\s*\)(?=\s*(?:[*/·](?!\*)|$))")
_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


class UnitError(ValueError):
    """A unit that cannot be read; the message says why."""


def unit_factors(unit: str) -> list[tuple[str, float]]:
    """Split a unit into names and exponents: ``N/m**1.5`` is N, m^-1.5, ``J/(kg K)`` J/kg/K; ``1`` has none.

    Raises
    ------
    UnitError
        The text is not made of names, exponents, ``*``, ``/`` and spaces, or is too long.
    """
    powers: list[tuple[str, float]] = []
    position, sign = 0, 1
    flat = "" if len(unit) > _LONGEST_UNIT else _UNDER.sub(_each_under, unit).translate(_RAISED)
    while factor := _UNIT_FACTOR.match(flat, position):
        if factor[1]:
            powers.append((factor[1], sign * float(factor[2] or 1)))
        elif position:
            break  # a one stands first or not at all: 1/s, not um/1
        if factor.end() == len(flat):
            return powers
        joint = _UNIT_JOINT.match(flat, factor.end())
        if joint is None:
            break
        position, sign = joint.end(), -1 if joint[1] else 1
    raise UnitError(f"`{unit if len(unit) <= _LONGEST_UNIT else unit[:37] + '...'}` is not a unit")


def _each_under(group: re.Match[str]) -> str:
    return "/" + _UNIT_JOINT.sub(lambda joint: "*" if joint[1] else "/", group[1])


def measure(value: float, unit: str, digits: int = 12) -> str:
    """Return a number with its unit as it is written by hand: lengths below a millimetre in µm."""
    if unit == "m" and 0 < abs(value) < 1e-3:
        value, unit = 1e6 * value, "µm"
    return f"{value:.{digits}g} {unit}".rstrip()


@dataclass(frozen=True)
class Quantity:
    """What one declared value means and which values are admissible."""

    unit: str
    """SI unit in pint's spelling (``"W/m**2/K"``), ``"1"`` for a pure number."""
    description: str
    """One line for messages, the JSON Schema and the documentation."""
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    """``above``, ``at_least``, ``at_most``: bounds: ``value > above``, ``value >= at_least``, ``value <= at_most``."""
    per: Literal["node", "spring", "temperature", "contact"] | None = None
    """``"node"``, ``"spring"``, ``"temperature"`` or ``"contact"`` where a list of one value for each is welcome beside
    a scalar."""
    later: bool = False
    """Whether it was declared when archives without it were there: at its default it enters no identity."""


def quantity(
    unit: str,
    description: str,
    *,
    default: Any = MISSING,
    above: float | None = None,
    at_least: float | None = None,
    at_most: float | None = None,
    per: Literal["node", "spring", "temperature", "contact"] | None = None,
    later: bool = False,
) -> Any:
    """Declare a dataclass field as a :class:`Quantity`; without ``default`` it is required.

    Raises
    ------
    UnitError
        The unit is not written as one.
    """
    unit_factors(unit)
    declared = Quantity(unit, description, above, at_least, at_most, per, later)
    return field(default=default, metadata={"quantity": declared})


def speed() -> Any:
    """Declare the ``speed`` of a model's parameters, revolutions per second, which a study takes from its scene."""
    return field(default=0.0, metadata={"quantity": Quantity("Hz", "of the scene", later=True), "of_scene": True})


def quantity_of(declared: Field[Any]) -> Quantity | None:
    """Return the :class:`Quantity` of a dataclass field, ``None`` for nested dataclasses and choices."""
    declaration: Quantity | None = declared.metadata.get("quantity")
    return declaration


@dataclass(frozen=True)
class File:
    """A file that a parameter names; what a case depends on is its content."""

    digest: str
    """SHA-256 of the content, hexadecimal; of several files that of their names and digests."""
    name: str = field(compare=False)
    """As the study writes it."""
    place: str = field(compare=False)
    """Where it lies; while a model assembles, where what was read lies."""
    contents: Mapping[str, bytes] = field(default_factory=dict, compare=False, repr=False)
    """What was read, by file name: of a directory or of files that belong together that of each."""
    shaken: float = 0.0
    """Share by which a model changes the numbers that it reads from it, to see what rounding makes of results; 0 in
    every study."""


def files_of(declared: Any) -> Iterator[File]:
    """Yield the files that declared values name."""
    if isinstance(declared, File):
        yield declared
    elif dataclasses.is_dataclass(declared):
        for entry in dataclasses.fields(declared):
            yield from files_of(getattr(declared, entry.name))


@dataclass(frozen=True)
class Word:
    """What a declared text means."""

    description: str
    """One line for messages, the JSON Schema and the documentation."""
    file: bool = False
    """Whether it is the name of a file, relative to the study."""
    files: Callable[[Path], tuple[Path, ...]] | None = None
    """Of the place that is named, all files that belong to it; ``None`` where it is one file by itself."""
    number: bool = False
    """Whether numbers are welcome beside texts."""
    columns: tuple[tuple[str, str], ...] | None = None
    """Where rows of numbers are welcome instead of a file, name and unit of each column; none for any number of
    them."""
    later: bool = False
    """Whether it was added later, so that its default does not count among what results depend on."""
    many: bool = False
    """Whether a list of them is welcome."""


def word(description: str, *, default: Any = MISSING) -> Any:
    """Declare a dataclass field of type ``str`` as a :class:`Word`; without ``default`` it is required."""
    return field(default=default, metadata={"word": Word(description)})


def label(description: str, *, default: Any = MISSING, later: bool = False, many: bool = False) -> Any:
    """Declare a dataclass field of type ``str | int``: a label, or an index; without ``default`` it is required.

    With ``many`` a list of them is welcome, read as a tuple.
    """
    return field(default=default, metadata={"word": Word(description, number=True, later=later, many=many)})


def file(description: str, *, default: Any = MISSING, files: Callable[[Path], tuple[Path, ...]] | None = None) -> Any:
    """Declare a dataclass field of type :class:`File`; without ``default`` it is required.

    ``files`` returns all that belongs to the named place, which may be a directory: the content of each counts. It
    raises ``ValueError`` where something is missing.
    """
    return field(default=default, metadata={"word": Word(description, file=True, files=files)})


def rows(
    description: str, columns: tuple[tuple[str, str], ...] = (), *, default: Any = MISSING, later: bool = False
) -> Any:
    """Declare a field of type ``File | Rows``: a file, or rows of numbers with some columns, or with any."""
    return field(default=default, metadata={"word": Word(description, file=True, columns=columns, later=later)})


def word_of(declared: Field[Any]) -> Word | None:
    """Return the :class:`Word` of a dataclass field, ``None`` for other kinds."""
    declaration: Word | None = declared.metadata.get("word")
    return declaration


def _silent(declared: Any, entry: Field[Any]) -> bool:
    later = getattr(quantity_of(entry) or word_of(entry), "later", entry.metadata.get("later", False))
    return later and bool(getattr(declared, entry.name) == entry.default)


def plain(declared: Any) -> Any:
    """Return declared values as nested dictionaries: what results depend on, of a file its content alone."""
    if isinstance(declared, File):
        return {"sha256": declared.digest}
    if isinstance(declared, tuple):
        return tuple(map(plain, declared))
    if isinstance(declared, Mapping):
        return {name: plain(value) for name, value in declared.items()}
    if dataclasses.is_dataclass(declared):
        entries = {entry.name: entry for entry in dataclasses.fields(declared)}
        return {name: plain(getattr(declared, name)) for name, entry in entries.items() if not _silent(declared, entry)}
    return declared
