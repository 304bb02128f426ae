"""Kinds of entries and mappings: how each is read, with every fault in it, and the JSON Schema of it."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pydantic_core import CoreSchema, ValidationError, core_schema

from workflow.declare import NUMBER, File, Quantity, Word, quantity_of, word_of
from workflow.study.mistakes import UNKNOWN, Fault, faults_of, nearest, one_of, quoted, refusal, wrong
from workflow.study.quantities import admissible, read_quantity, udunits

Schema = dict[str, Any]
LONGEST_TEXT = 1000
LONGEST_LIST = 100
"""Entries of a list of mappings."""


@dataclass(frozen=True)
class Kind:
    """A kind of entry."""

    core: CoreSchema
    """How pydantic reads an entry, in SI; the context are the ``Files`` of the study."""
    schema: Schema
    """JSON Schema of what may be written."""
    varies: bool = False
    """Whether its values can be those of an axis."""
    unit: str = ""
    """CF unit of its values; empty for words."""
    remark: str = ""
    """Unit and bounds in words, which follow the meaning of an entry."""

    def checked(self, check: Callable[[Any], Any]) -> Kind:
        """Return this kind, read from what a check makes of a value, or refuses."""
        return dataclasses.replace(self, core=core_schema.no_info_before_validator_function(check, self.core))

    def built(self, build: Callable[[Any], Any]) -> Kind:
        """Return the kind of what is built of this one's values."""
        return dataclasses.replace(self, core=core_schema.no_info_after_validator_function(build, self.core))


def leaf(read: Callable[[Any], Any], schema: Schema, varies: bool = False) -> Kind:
    """Return the kind of an entry that a function reads."""
    return Kind(core_schema.no_info_plain_validator_function(read), schema, varies)


def many(item: Kind, **limits: Any) -> Kind:
    """Return the kind of a list of entries of one kind, read as a tuple; ``limits`` are keywords of JSON Schema."""
    core = core_schema.tuple_schema([item.core], variadic_item_index=0)
    return Kind(core, {"type": "array", "items": item.schema, **limits})


def either(choose: Callable[[Any], int], *kinds: Kind) -> Kind:
    """Return the kind of a value that is of one of several kinds.

    ``choose(value)`` is the number of the kind that the value's form means: a mistake is one of that kind alone.
    """

    def judged(value: Any) -> Any:  # an error of the discriminator itself would lose its place
        choose(value)
        return value

    union = core_schema.tagged_union_schema(
        {-1 - k: kind.core for k, kind in enumerate(kinds)}, discriminator=lambda value: -1 - choose(value)
    )
    return Kind(union, {"anyOf": [kind.schema for kind in kinds]}).checked(judged)


def is_list(value: Any) -> int:
    """Return 1 for a list and 0 for any other value: the number of its kind in :func:`either`."""
    return int(isinstance(value, list))


def usable(fault: str | None, *place: str) -> None:
    """Refuse a model, scheme or basis that has a fault."""
    if fault is not None:
        raise wrong(f"cannot be used: {fault}", "mend that module, or name another", *place)


def name(what: str) -> Kind:
    """Return the kind of an identifier: the name of a study, the label of a scheme, the dimension of a zip."""

    def read(value: Any) -> str:
        if not isinstance(value, str) or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,63}", value):
            raise wrong(f"{quoted(value)} is no name", f"name {what} in at most 64 letters, digits and _")
        return value

    return leaf(read, {"type": "string", "pattern": "^[A-Za-z][A-Za-z0-9_]{0,63}$"})


def _line(value: Any) -> str:
    if not isinstance(value, str):
        raise wrong(f"{quoted(value)} is not a text", "write a line of text, in quotes if need be")
    if len(value) > LONGEST_TEXT:
        raise wrong(f"has {len(value)} characters", f"write at most {LONGEST_TEXT}")
    return " ".join(value.split())


LINE = leaf(_line, {"type": "string", "maxLength": LONGEST_TEXT})
"""Free text, whose spaces and line ends become single spaces."""


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise wrong(f"{quoted(value)} is neither true nor false", "write true or false")
    return value


FLAG = leaf(_flag, {"type": "boolean"})


def keyword(words: tuple[str, ...], labels: bool = False, fault: Callable[[str], str | None] | None = None) -> Kind:
    """Return the kind of one word of several.

    ``labels`` are words that a study may add to; ``fault`` tells why what a word names cannot be used.
    """

    def read(value: Any) -> str:
        if not isinstance(value, str) or value not in words:
            raise wrong(f"{quoted(value)} is none of the choices", one_of(str(value), words))
        usable(fault(value) if fault else None)
        return value

    return leaf(read, {"type": "string", "examples" if labels else "enum": list(words)}, varies=True)


def list_of(item: Kind, remedy: str, distinct: bool = False) -> Kind:
    """Return the kind of a list of moderate length, read as a tuple."""

    def check(value: Any) -> list[Any]:
        if not isinstance(value, list):
            raise wrong(f"{quoted(value)} is not a list", remedy)
        if len(value) > LONGEST_LIST:
            raise wrong(f"has {len(value)} entries", f"write at most {LONGEST_LIST}")
        return value

    def check_distinct(entries: tuple[Any, ...]) -> tuple[Any, ...]:
        if distinct and len(set(entries)) < len(entries):
            raise wrong("names one twice", "name each once")
        return entries

    return many(item, maxItems=LONGEST_LIST, uniqueItems=distinct).checked(check).built(check_distinct)


def text(declared: Word) -> Kind:
    """Return the kind of a text, or the name of a file, that a model or scheme declares; rows may stand for a file."""

    def read(value: Any, info: core_schema.ValidationInfo[Any]) -> str | int | File:
        if declared.number and isinstance(value, int | float) and not isinstance(value, bool):
            return value if type(value) is int else repr(value)  # one that is spelled otherwise is no index
        if not isinstance(value, str) or not value or len(value) > LONGEST_TEXT or not value.isprintable():
            raise wrong(f"{quoted(value)} is not a line of text", f"write up to {LONGEST_TEXT} printable characters")
        return info.context.read(value, declared) if declared.file else value

    written: Schema = {"type": "string", "minLength": 1, "maxLength": LONGEST_TEXT}
    schema = {"anyOf": [written, {"type": "number"}]} if declared.number else written
    one = Kind(core_schema.with_info_plain_validator_function(read), schema, varies=not declared.file)
    if declared.many:
        return dataclasses.replace(either(is_list, one, many(one, minItems=1)), varies=True)
    return one if declared.columns is None else either(is_list, one, many(_row(declared.columns)))


def _row(columns: tuple[tuple[str, str], ...]) -> Kind:
    """Return the kind of a row of a table: values in the order of its columns or by their names; else any numbers.

    The last column may be several, called ``tip_1``, ``tip_2``, … by name.
    """
    names = [column for column, _ in columns]

    def in_order(value: Any) -> list[Any]:
        if isinstance(value, dict) and names:
            several = [f"{names[-1]}_{k + 1}" for k in range(len(value) - len(names) + 1)]
            wanted = names if set(value) == set(names) else [*names[:-1], *several]
            others = (key for key in value if key not in names)
            unknown = next((key for key in others if not str(key).startswith(f"{names[-1]}_")), None)
            if unknown is not None:
                raise wrong(f"{quoted(unknown)} {UNKNOWN}", one_of(unknown, names), unknown)
            value = [value[column] for column in wanted] if set(value) == set(wanted) else value
        if not isinstance(value, list) or len(value) < max(1, len(names)):
            raise wrong("is no row of the table", f"write {', '.join(names) or 'numbers'}, as a list")
        return value

    cells = {column: number(Quantity(unit, column)) for column, unit in columns}
    row = many(number(Quantity("1", "number")))
    properties = {name: cell.schema for name, cell in cells.items()}
    by_name = {"type": "object", "properties": properties, "required": names[:-1]}
    forms = [row.schema, *([by_name] if names else [])]
    each = core_schema.tuple_schema([cell.core for cell in cells.values()], variadic_item_index=len(cells) - 1)
    return Kind(each if cells else row.core, {"anyOf": forms}).checked(in_order)


@dataclass(frozen=True, kw_only=True)
class Number(Kind):
    """A quantity: a number in SI or ``number unit``; where declared, a list per node or spring."""

    declared: Quantity
    whole: bool

    @property
    def single(self) -> Number:
        """The kind of one number; it has no list, and no word beside it."""
        return number(dataclasses.replace(self.declared, per=None), self.whole)


def number(declared: Quantity, whole: bool = False, words: tuple[str, ...] = ()) -> Number:
    """Return the kind of a quantity; ``words`` are admitted beside a number: ``full``, ``auto``."""

    def read(value: Any) -> Any:
        if words and isinstance(value, str):
            if value in words:
                return value
            listed = " or ".join(["a whole number", *(f"`{word}`" for word in words)])
            raise wrong(f"{quoted(value)} is not a number of modes", f"write {listed}")
        return read_quantity(value, declared, whole)

    bounds = {"exclusiveMinimum": declared.above, "minimum": declared.at_least, "maximum": declared.at_most}
    numbers: Schema = {"type": "integer" if whole else "number"}
    forms: list[Schema] = [numbers | {word: bound for word, bound in bounds.items() if bound is not None}]
    if words:
        forms += [{"const": word} for word in words]
    elif not whole:
        forms.append({"type": "string", "pattern": rf"^\s*{NUMBER}\s*[^\s0-9].*$|^\s*{NUMBER}\s*$"})
    kind = leaf(read, {"anyOf": forms} if len(forms) > 1 else forms[0])
    if declared.per is not None:
        kind = either(is_list, kind, many(kind, minItems=1))
    unit, limits = udunits(declared.unit), admissible(declared)
    each = f", or one value per {declared.per}" if declared.per else ""
    remark = f" [{unit}]{each}{limits and f'; {limits}'}"
    return Number(kind.core, kind.schema, True, unit, remark, declared=declared, whole=whole)


@dataclass(frozen=True)
class Entry:
    """An entry of a mapping: its kind, its meaning, and its default, ``MISSING`` where it has to be written."""

    kind: Kind
    meaning: str
    default: Any = None

    @property
    def described(self) -> str:
        """The meaning with what it may hold."""
        return self.meaning + self.kind.remark

    @property
    def schema(self) -> Schema:
        """JSON Schema with meaning and default."""
        known = isinstance(self.default, bool | int | float | str | tuple)
        default = list(self.default) if isinstance(self.default, tuple) else self.default
        return self.kind.schema | {"description": self.described} | ({"default": default} if known else {})


@dataclass(frozen=True, kw_only=True)
class RecordKind(Kind):
    """A mapping with known keys."""

    entries: Mapping[str, Entry]


def record(
    about: str,
    entries: Mapping[str, Entry],
    build: Callable[[dict[str, Any]], Any] = dict,
    moved: Mapping[str, str] | None = None,
    more: str = "",
) -> RecordKind:
    """Return the kind of a mapping with known keys.

    Parameters
    ----------
    about
        What it is, in a line.
    entries
        By key.
    build
        Makes of the entries that are written, in their order, what is read.
    moved
        Keys that are known, but not here, with what to write instead.
    more
        Pattern of further keys that some study may have, for the JSON Schema of all.
    """

    def read(value: Any, read_known: core_schema.ValidatorFunctionWrapHandler) -> Any:
        is_mapping(value)
        unknown = [key for key in value if key not in entries]
        meant = {nearest(key, entries) for key in unknown}  # misspelt is not missing, too
        faults: list[Fault] = [
            ((key,), "is missing", f"write it: {entry.described}")
            for key, entry in entries.items()
            if entry.default is MISSING and key not in value and key not in meant
        ]
        for key in unknown:
            elsewhere = (moved or {}).get(key)
            problem = "does not belong here" if elsewhere else f"{quoted(key)} {UNKNOWN}"
            sign = (
                "write a point, not a comma, before decimals, or a list in brackets" if str(key)[:1].isdigit() else None
            )
            sign = "write a space after the colon, and a value" if ":" in str(key) else sign
            faults.append(((key,), problem, elsewhere or sign or one_of(key, entries)))
        try:
            given = read_known(value)
        except ValidationError as error:
            faults += faults_of(error)
        if faults:
            raise refusal(faults)
        return build({key: given[key] for key in value})

    fields = {key: core_schema.typed_dict_field(entry.kind.core, required=False) for key, entry in entries.items()}
    core = core_schema.no_info_wrap_validator_function(read, core_schema.typed_dict_schema(fields))
    schema = {
        "type": "object",
        "description": about,
        "properties": {key: entry.schema for key, entry in entries.items()},
        "required": [key for key, entry in entries.items() if entry.default is MISSING],
        "additionalProperties": False,
        **({"patternProperties": {more: {}}} if more else {}),
    }
    return RecordKind(core, schema, entries=entries)


def is_mapping(value: Any) -> dict[str, Any]:
    """Return a mapping and refuse what is none."""
    if not isinstance(value, dict):
        problem = "has nothing in it" if value is None else f"{quoted(value)} is not a mapping"
        raise wrong(problem, "write `key: value` entries, or leave it out")
    return value


def named(key: Kind, kind: Kind) -> Kind:
    """Return the kind of a mapping whose entries have one kind, and names that the study gives them."""
    schema = {"type": "object", "propertyNames": key.schema, "additionalProperties": kind.schema}
    return Kind(core_schema.dict_schema(key.core, kind.core), schema).checked(is_mapping)


def no_mapping(value: Any) -> int:
    """Return 0 for a mapping and 1 for any other value: the number of its kind in :func:`.either`."""
    return int(not isinstance(value, dict))


def summary(described: object) -> str:
    """Return the first paragraph of a docstring in one line."""
    return " ".join((described.__doc__ or "").split("\n\n")[0].replace("``", "`").split())


def record_of(declared: Any) -> RecordKind:
    """Return the kind of a mapping that is read into an instance of a declared dataclass."""
    return record(summary(declared), entries_of(declared), lambda given: declared(**given))


def entries_of(declared: Any, without: tuple[str, ...] = ()) -> dict[str, Entry]:
    """Return how the fields of a declared dataclass are read, by name, without some that are read otherwise.

    Without what the scene gives, too.
    """
    hints = get_type_hints(declared)
    own = (field for field in dataclasses.fields(declared) if not field.metadata.get("of_scene"))
    fields = (field for field in own if field.name not in without)
    return {field.name: _entry(field, hints[field.name]) for field in fields}


def _entry(field: dataclasses.Field[Any], hint: Any) -> Entry:
    """Return how a field of a declared dataclass is read; raises :class:`TypeError` where no study could set it."""
    default = field.default if field.default_factory is MISSING else None
    if (quantity := quantity_of(field)) is not None:
        return Entry(number(quantity, whole=int in (hint, *get_args(hint))), quantity.description, default)
    if (word := word_of(field)) is not None:
        return Entry(text(word), word.description, default)
    if type(None) in get_args(hint):  # what may be left out
        hint = get_args(hint)[0]
    meaning = str(field.metadata.get("meaning", field.name.replace("_", " ")))
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return Entry(record_of(hint), summary(hint), default)
    if get_origin(hint) is tuple:
        item = get_args(hint)[0]
        if dataclasses.is_dataclass(item):
            return Entry(list_of(record_of(item), "write a list of `{key: value}` entries"), summary(item), default)
        return Entry(list_of(keyword(get_args(item)), "write a list, [] for none", distinct=True), meaning, default)
    if get_origin(hint) is Literal:
        return Entry(keyword(get_args(hint)), meaning, default)
    if hint is bool:
        return Entry(FLAG, meaning, default)
    raise TypeError(f"{field.name}: declare a quantity, a word, a file, a dataclass, a bool or a Literal, not {hint}")
