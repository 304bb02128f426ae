"""Kinds of entries: how each is read, with every fault in it, and the JSON Schema of what may be written."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from workflow.declare import File, Quantity, Rows, Word
from workflow.study.files import Files
from workflow.study.mistakes import Fault, WrongValueError, one_of, quoted, wrong
from workflow.study.quantities import NUMBER, admissible, read_quantity, udunits

Schema = dict[str, Any]
LONGEST_TEXT = 1000
LONGEST_LIST = 100
"""Entries of a list of mappings."""


@dataclass(frozen=True)
class Kind:
    """A kind of entry.

    Attributes
    ----------
    read
        Returns the value of an entry in SI; raises ``WrongValueError``.
    schema
        JSON Schema of what may be written.
    varies
        Whether its values can be those of an axis.
    """

    read: Callable[[Any, Files], Any]
    schema: Schema
    varies: bool = False

    @property
    def unit(self) -> str:
        """CF unit of its values; empty for words."""
        return ""

    def described(self, meaning: str) -> str:
        """Return the meaning of an entry of this kind with what it may hold."""
        return meaning


def read_each(reads: Iterable[tuple[str | int, Kind, Any]], files: Files, *place: str) -> list[Any]:
    """Read values, each of its kind at its key or position; all faults are raised together."""
    values: list[Any] = []
    faults: list[Fault] = []
    for step, kind, value in reads:
        try:
            values.append(kind.read(value, files))
        except WrongValueError as error:
            faults += error.below(*place, step)
    if faults:
        raise WrongValueError(faults)
    return values


def read_list(values: list[Any], kind: Kind, files: Files, *place: str) -> tuple[Any, ...]:
    """Read a list of entries of one kind."""
    return tuple(read_each(((k, kind, value) for k, value in enumerate(values)), files, *place))


def usable(fault: str | None, *place: str) -> None:
    """Refuse a model, scheme or basis that has a fault."""
    if fault is not None:
        raise wrong(f"cannot be used: {fault}", "mend that module, or name another", *place)


def name(what: str) -> Kind:
    """Return the kind of an identifier: the name of a study, the label of a scheme, the dimension of a zip."""

    def read(value: Any, files: Files) -> str:
        if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", value):
            raise wrong(f"{quoted(value)} is no name", f"name {what} in at most 64 letters, digits and _")
        return value

    return Kind(read, {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]{0,63}$"})


def _line(value: Any, files: Files) -> str:
    if not isinstance(value, str):
        raise wrong(f"{quoted(value)} is not a text", "write a line of text, in quotes if need be")
    if len(value) > LONGEST_TEXT:
        raise wrong(f"has {len(value)} characters", f"write at most {LONGEST_TEXT}")
    return " ".join(value.split())


LINE = Kind(_line, {"type": "string", "maxLength": LONGEST_TEXT})
"""Free text, whose spaces and line ends become single spaces."""


def _flag(value: Any, files: Files) -> bool:
    if not isinstance(value, bool):
        raise wrong(f"{quoted(value)} is neither true nor false", "write true or false")
    return value


FLAG = Kind(_flag, {"type": "boolean"})


def keyword(words: tuple[str, ...], labels: bool = False, fault: Callable[[str], str | None] | None = None) -> Kind:
    """Return the kind of one word of several.

    ``labels`` are words that a study may add to; ``fault`` tells why what a word names cannot be used.
    """

    def read(value: Any, files: Files) -> str:
        if not isinstance(value, str) or value not in words:
            raise wrong(f"{quoted(value)} is none of the choices", one_of(str(value), words))
        usable(fault(value) if fault else None)
        return value

    return Kind(read, {"type": "string", "examples" if labels else "enum": list(words)}, varies=True)


def list_of(item: Kind, remedy: str, distinct: bool = False) -> Kind:
    """Return the kind of a list of moderate length, read as a tuple."""

    def read(value: Any, files: Files) -> tuple[Any, ...]:
        if not isinstance(value, list):
            raise wrong(f"{quoted(value)} is not a list", remedy)
        if len(value) > LONGEST_LIST:
            raise wrong(f"has {len(value)} entries", f"write at most {LONGEST_LIST}")
        entries = read_list(value, item, files)
        if distinct and len(set(entries)) < len(entries):
            raise wrong("names one twice", "name each once")
        return entries

    return Kind(read, {"type": "array", "items": item.schema, **({"uniqueItems": True} if distinct else {})})


def text(declared: Word) -> Kind:
    """Return the kind of a text, or the name of a file, that a model or scheme declares; rows may stand for a file."""
    columns = declared.columns
    row = None if columns is None else _row(columns)

    def read(value: Any, files: Files) -> str | int | File | Rows:
        if row is not None and isinstance(value, list):
            return read_list(value, row, files)
        if declared.number and isinstance(value, int | float) and not isinstance(value, bool):
            return value if isinstance(value, int) else repr(value)
        if not isinstance(value, str) or not value or len(value) > LONGEST_TEXT or not value.isprintable():
            raise wrong(f"{quoted(value)} is not a line of text", f"write up to {LONGEST_TEXT} printable characters")
        return files.read(value, declared) if declared.file else value

    forms: list[Schema] = [{"type": "string", "minLength": 1, "maxLength": LONGEST_TEXT}]
    forms += [{"type": "number"}] if declared.number else []
    forms += [] if row is None else [{"type": "array", "items": row.schema}]
    return Kind(read, {"anyOf": forms} if len(forms) > 1 else forms[0], varies=not declared.file)


def _row(columns: tuple[tuple[str, str], ...]) -> Kind:
    """Return the kind of a row of a table: values in the order of its columns or by their names; else any numbers."""
    names = [column for column, _ in columns]

    def read(value: Any, files: Files) -> tuple[float, ...]:
        if isinstance(value, dict) and names and set(value) == set(names):
            value = [value[column] for column in names]
        if not isinstance(value, list) or not value or (names and len(value) != len(names)):
            raise wrong("is no row of the table", f"write {', '.join(names) or 'numbers'}, as a list")
        kinds = [number(Quantity(unit, column)) for column, unit in columns or (("number", "1"),) * len(value)]
        return tuple(read_each(zip(range(len(value)), kinds, value, strict=True), files))

    cell: Schema = {"anyOf": [{"type": "number"}, {"type": "string"}]}
    by_name = {"type": "object", "properties": dict.fromkeys(names, cell), "required": names}
    return Kind(read, {"anyOf": [{"type": "array", "items": cell}, *([by_name] if names else [])]})


@dataclass(frozen=True, kw_only=True)
class Number(Kind):
    """A quantity: a number in SI or ``number unit``; where declared, a list per node or spring."""

    declared: Quantity
    whole: bool

    @property
    def unit(self) -> str:
        """CF unit."""
        return udunits(self.declared.unit)

    @property
    def single(self) -> Number:
        """The kind of one number; it has no list, and no word beside it."""
        return number(dataclasses.replace(self.declared, per=None), self.whole)

    def described(self, meaning: str) -> str:
        """Return meaning, unit and bounds in a line."""
        where = f", or one value per {self.declared.per}" if self.declared.per else ""
        bounds = admissible(self.declared)
        return f"{meaning} [{self.unit}]{where}{bounds and f'; {bounds}'}"


def number(declared: Quantity, whole: bool = False, words: tuple[str, ...] = ()) -> Number:
    """Return the kind of a quantity; ``words`` are admitted beside a number: ``full``, ``auto``."""

    def one(value: Any, files: Files) -> Any:
        if words and isinstance(value, str):
            if value in words:
                return value
            listed = " or ".join(["a whole number", *(f"`{word}`" for word in words)])
            raise wrong(f"{quoted(value)} is not a number of modes", f"write {listed}")
        return read_quantity(value, declared, whole)

    def read(value: Any, files: Files) -> Any:
        if isinstance(value, list) and declared.per is not None:
            return read_list(value, Kind(one, {}), files)
        return one(value, files)

    bounds = {"exclusiveMinimum": declared.above, "minimum": declared.at_least, "maximum": declared.at_most}
    numbers: Schema = {"type": "integer" if whole else "number"}
    forms: list[Schema] = [numbers | {word: bound for word, bound in bounds.items() if bound is not None}]
    if words:
        forms += [{"const": word} for word in words]
    elif not whole:
        forms.append({"type": "string", "pattern": rf"^\s*{NUMBER}\s*[^\s0-9].*$|^\s*{NUMBER}\s*$"})
    if declared.per is not None:
        forms.append({"type": "array", "items": {"anyOf": forms[:2]}, "minItems": 1})
    schema = {"anyOf": forms} if len(forms) > 1 else forms[0]
    return Number(read, schema, varies=True, declared=declared, whole=whole)
