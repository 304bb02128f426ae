"""Pydantic annotations for single entries: quantities, choices, names, spread axes.

Each reads its value with :func:`~workflow.study.mistakes.wrong` for what it refuses, and writes its
own JSON Schema. The branch of a union is chosen by the value's shape, so that one mistake gives
one message.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal, get_args

from pydantic import ValidationError
from pydantic_core import CoreSchema, InitErrorDetails, PydanticCustomError, core_schema

from workflow.declare import File, Quantity, Rows, Word
from workflow.study.files import read_file
from workflow.study.mistakes import details, one_of, quoted, wrong
from workflow.study.quantities import NUMBER, admissible, read_quantity, udunits

Schema = dict[str, Any]
MOST_VALUES = 10**6
MOST_POINTS = 10_000
"""Values of one spread axis, and points of a branch."""


def read_each(values: list[Any], read: Callable[[Any], Any], *place: str) -> tuple[Any, ...]:
    """Read every item of a list; all mistakes are raised together, each with its position."""
    items: list[Any] = []
    errors: list[InitErrorDetails] = []
    for index, value in enumerate(values):
        try:
            items.append(read(value))
        except PydanticCustomError as error:
            errors.append(details(error, (*place, index), value))
    if errors:
        raise ValidationError.from_exception_data("list", errors)
    return tuple(items)


def at(place: str, error: PydanticCustomError, value: Any) -> ValidationError:
    """Return an error that belongs to an entry below the one that is being read."""
    return ValidationError.from_exception_data("entry", [details(error, (place,), value)])


class FieldType:
    """Base of the annotations: validates with ``read`` and describes itself with ``schema``."""

    def read(self, value: Any, context: Mapping[str, Any]) -> Any:
        """Return the value in SI; raises ``PydanticCustomError`` or ``ValidationError``."""
        raise NotImplementedError

    def schema(self) -> Schema:
        """Return the JSON Schema of what may be written."""
        raise NotImplementedError

    def __get_pydantic_core_schema__(self, _source: Any, _handler: Any) -> CoreSchema:
        def validate(value: Any, info: core_schema.ValidationInfo[Any]) -> Any:
            return self.read(value, info.context or {})

        return core_schema.with_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(self, _schema: Any, _handler: Any) -> Schema:
        return self.schema()


@dataclass(frozen=True)
class Name(FieldType):
    """An identifier: the name of a study, the label of a scheme, the dimension of a zip."""

    what: str

    def read(self, value: Any, context: Mapping[str, Any]) -> str:
        """Return the name."""
        if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", value):
            raise wrong(f"{quoted(value)} is no name", f"name {self.what} in at most 64 letters, digits and _")
        return value

    def schema(self) -> Schema:
        """Return the pattern."""
        return {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]{0,63}$"}


@dataclass(frozen=True)
class Line(FieldType):
    """Free text of limited length."""

    longest: int

    def read(self, value: Any, context: Mapping[str, Any]) -> str:
        """Return the text, with its spaces and line ends made single spaces."""
        if not isinstance(value, str):
            raise wrong(f"{quoted(value)} is not a text", "write a line of text, in quotes if need be")
        if len(value) > self.longest:
            raise wrong(f"has {len(value)} characters", f"write at most {self.longest}")
        return " ".join(value.split())

    def schema(self) -> Schema:
        """Return type and length."""
        return {"type": "string", "maxLength": self.longest}


@dataclass(frozen=True)
class Keyword(FieldType):
    """One word of several, or a list of some of them; ``labels`` are words that a study defines."""

    words: tuple[str, ...]
    several: bool = False
    labels: bool = False

    def read(self, value: Any, context: Mapping[str, Any]) -> Any:
        """Return the word, or the words as a tuple."""
        if not self.several:
            return self._word(value)
        if not isinstance(value, list):
            raise wrong(f"{quoted(value)} is not a list", "write a list, [] for none")
        words = read_each(value, self._word)
        if len(set(words)) < len(words):
            raise wrong("names one twice", "name each once")
        return words

    def _word(self, value: Any) -> str:
        if not isinstance(value, str) or value not in self.words:
            raise wrong(f"{quoted(value)} is none of the choices", one_of(str(value), self.words))
        return value

    def schema(self) -> Schema:
        """Return the enumeration."""
        word: Schema = {"type": "string", "examples" if self.labels else "enum": list(self.words)}
        return {"type": "array", "items": word, "uniqueItems": True} if self.several else word


LONGEST_TEXT = 1000


@dataclass(frozen=True)
class Text(FieldType):
    """A text, or the name of a file relative to the study, that a model or scheme declares."""

    declared: Word

    def read(self, value: Any, context: Mapping[str, Any]) -> str | int | File | Rows:
        """Return the text, the index, the rows, or the file with the digest of its content."""
        if self.declared.columns is not None and isinstance(value, list):
            return read_each(value, self._row)
        if self.declared.number and isinstance(value, int | float) and not isinstance(value, bool):
            return value if isinstance(value, int) else repr(value)
        if not isinstance(value, str) or not value or len(value) > LONGEST_TEXT or not value.isprintable():
            raise wrong(f"{quoted(value)} is not a line of text", f"write up to {LONGEST_TEXT} printable characters")
        return read_file(value, context, self.declared) if self.declared.file else value

    def schema(self) -> Schema:
        """Return type and length."""
        text: Schema = {"type": "string", "minLength": 1, "maxLength": LONGEST_TEXT}
        if self.declared.columns is not None:
            cell: Schema = {"anyOf": [{"type": "number"}, {"type": "string"}]}
            forms: list[Schema] = [{"type": "array", "items": cell}]
            if self.declared.columns:
                names = [name for name, _ in self.declared.columns]
                forms.append({"type": "object", "properties": dict.fromkeys(names, cell), "required": names})
            return {"anyOf": [text, {"type": "array", "items": {"anyOf": forms}}]}
        return {"anyOf": [text, {"type": "number"}]} if self.declared.number else text

    def _row(self, row: Any) -> tuple[float, ...]:
        """Return a row of a table: values in the order of its columns, or by their names."""
        columns = self.declared.columns or ()
        names = [name for name, _ in columns]
        if isinstance(row, dict) and columns and set(row) == set(names):
            row = [row[name] for name in names]
        if not isinstance(row, list) or not row or (columns and len(row) != len(columns)):
            raise wrong("is no row of the table", f"write {', '.join(names) or 'numbers'}, as a list")
        units = columns or [("number", "1")] * len(row)
        reads = iter([Reading(Quantity(unit, name)) for name, unit in units])
        return read_each(row, lambda entry: next(reads).scalar(entry))


@dataclass(frozen=True)
class Flag(FieldType):
    """A Boolean."""

    def read(self, value: Any, context: Mapping[str, Any]) -> bool:
        """Return the value."""
        if not isinstance(value, bool):
            raise wrong(f"{quoted(value)} is neither true nor false", "write true or false")
        return value

    def schema(self) -> Schema:
        """Return the type."""
        return {"type": "boolean"}


@dataclass(frozen=True)
class Reading(FieldType):
    """A quantity: a number in SI or ``number unit``; where declared, a list per node or spring.

    ``words`` are admitted beside a number: ``full``, ``auto``. The context holds, by what a list is for
    each of, the counts that the study's cases have.
    """

    declared: Quantity
    whole: bool = False
    words: tuple[str, ...] = ()

    def read(self, value: Any, context: Mapping[str, Any]) -> Any:
        """Return the value in SI, a tuple where a list was given."""
        if not isinstance(value, list) or self.declared.per is None:
            return self.scalar(value)
        counts: tuple[int, ...] = context.get(self.declared.per) or ()
        for count in counts:
            if len(value) != count:
                also = "" if len(set(counts)) == 1 else ", whatever their number is in a case"
                problem = f"has {len(value)} values where the model has {count} {self.declared.per}s{also}"
                raise wrong(problem, f"write a scalar or {count} values" if not also else "write a scalar")
        return read_each(value, self.scalar)

    def scalar(self, value: Any) -> Any:
        """Return a single value in SI."""
        if self.words and isinstance(value, str):
            if value in self.words:
                return value
            listed = " or ".join(["a whole number", *(f"`{word}`" for word in self.words)])
            raise wrong(f"{quoted(value)} is not a number of modes", f"write {listed}")
        return read_quantity(value, self.declared, self.whole)

    def schema(self) -> Schema:
        """Return number or string, with bounds."""
        bounds = {
            "exclusiveMinimum": self.declared.above,
            "minimum": self.declared.at_least,
            "maximum": self.declared.at_most,
        }
        number: Schema = {"type": "integer" if self.whole else "number"}
        number |= {word: bound for word, bound in bounds.items() if bound is not None}
        forms: list[Schema] = [number]
        if self.words:
            forms += [{"const": word} for word in self.words]
        elif not self.whole:
            forms.append({"type": "string", "pattern": rf"^\s*{NUMBER}\s*[^\s0-9].*$|^\s*{NUMBER}\s*$"})
        if self.declared.per is not None:
            forms.append({"type": "array", "items": {"anyOf": forms[:2]}, "minItems": 1})
        return {"anyOf": forms} if len(forms) > 1 else number

    def described(self) -> str:
        """Return meaning, unit and bounds in a line."""
        where = f", or one value per {self.declared.per}" if self.declared.per else ""
        bounds = admissible(self.declared)
        return f"{self.declared.description} [{udunits(self.declared.unit)}]{where}{bounds and f'; {bounds}'}"


def is_whole(hint: Any) -> bool:
    """Whether a field of a declared dataclass holds whole numbers, by its type hint."""
    return int in (hint, *get_args(hint))


@dataclass(frozen=True)
class Single:
    """An axis of one value that is no dimension."""

    value: float | int | str


@dataclass(frozen=True)
class Listed:
    """An axis of listed values."""

    values: tuple[float | int | str, ...]

    @property
    def count(self) -> int:
        """Number of values."""
        return len(self.values)


@dataclass(frozen=True)
class Spread:
    """An axis of values at equal distances or ratios, not yet expanded, or one that is followed as a curve."""

    law: Literal["lin", "log", "branch"]
    first: float
    last: float
    count: int


@dataclass(frozen=True)
class AxisValues(FieldType):
    """The values of an axis: a scalar, a list, or ``{LAW: [first, last, count]}``, LAW lin, log or branch."""

    value: Reading | Keyword | Text
    zipped: bool = False

    def read(self, value: Any, context: Mapping[str, Any]) -> Single | Listed | Spread:
        """Return the values as they are written, in SI and not expanded."""
        if isinstance(value, dict):
            return self._spread(value)
        if isinstance(value, list):
            if not value:
                raise wrong("is empty", "write at least one value, or leave the axis out")
            return Listed(read_each(value, lambda one: self._one(one, context)))
        if self.zipped:
            raise wrong(f"{quoted(value)} is not a list", "write a list as long as the others of this zip")
        return Single(self._one(value, context))

    def _one(self, value: Any, context: Mapping[str, Any]) -> Any:
        if isinstance(value, list | dict):
            raise wrong(f"{quoted(value)} is not a single value", "an axis has single values")
        return self.value.scalar(value) if isinstance(self.value, Reading) else self.value.read(value, context)

    def _spread(self, value: dict[str, Any]) -> Spread:
        form = "write a list, {lin: [first, last, count]} or {log: [first, last, count]}"
        law: Literal["lin", "log", "branch"] = "branch" if "branch" in value else "log" if "log" in value else "lin"
        if set(value) != {law}:
            raise wrong("is neither a list nor `lin`, `log` or `branch`", form)
        if not isinstance(self.value, Reading):
            raise wrong("has words for values, which cannot be spread", "write a list")
        if law == "branch" and (self.zipped or self.value.whole):
            raise at(law, wrong("is followed along a real-valued axis of its own alone", "write a list or lin"), value)
        entries = value[law]
        if not isinstance(entries, list) or len(entries) != 3:
            raise at(law, wrong(f"{quoted(entries)} is not first, last and count", form), entries)
        reading = Reading(self.value.declared, self.value.whole)
        count = Quantity("1", "number of values", at_least=2, at_most=MOST_POINTS if law == "branch" else MOST_VALUES)
        reads = iter([reading, reading, Reading(count, whole=True)])
        first, last, number = read_each(entries, lambda entry: next(reads).scalar(entry), law)
        if first == last:
            raise at(law, wrong("begins and ends with the same value", "write a list of one"), entries)
        if law == "log" and not min(first, last) > 0:
            raise at(law, wrong("a logarithmic axis needs positive ends", "write above 0, or use lin"), entries)
        return Spread(law, first, last, number)

    def schema(self) -> Schema:
        """Return the forms that an axis may have."""
        one = self.value.schema()
        forms: list[Schema] = [*([] if self.zipped else [one]), {"type": "array", "items": one, "minItems": 1}]
        if isinstance(self.value, Reading):
            numbers = Reading(self.value.declared, self.value.whole).schema()
            forms += [spread_schema(law, numbers) for law in ("lin", "log", *(() if self.zipped else ("branch",)))]
        return {"anyOf": forms}


def spread_schema(law: str, number: Schema) -> Schema:
    """Return the JSON Schema of ``{lin: [first, last, count]}``."""
    count = {"type": "integer", "minimum": 2, "maximum": MOST_VALUES}
    entries = {"type": "array", "prefixItems": [number, number, count], "minItems": 3, "maxItems": 3}
    return {"type": "object", "properties": {law: entries}, "required": [law], "additionalProperties": False}
