"""Mappings of a study, with known keys or with names of its own, and those that declarations make."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass
from typing import Any, Literal, get_args, get_origin, get_type_hints

from pydantic_core import ValidationError, core_schema

from workflow.declare import quantity_of, word_of
from workflow.study.kinds import FLAG, Kind, Schema, keyword, list_of, number, text
from workflow.study.mistakes import UNKNOWN, Fault, faults_of, nearest, one_of, quoted, refusal, wrong


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
            comma = "write a point, not a comma, before decimals" if str(key)[:1].isdigit() else None
            faults.append(((key,), problem, elsewhere or comma or one_of(key, entries)))
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
    core = core_schema.dict_schema(key.core, kind.core)
    schema = {"type": "object", "propertyNames": key.schema, "additionalProperties": kind.schema}
    return Kind(core_schema.no_info_before_validator_function(is_mapping, core), schema)


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
    """Return how the fields of a declared dataclass are read, by name, without some that are read otherwise."""
    hints = get_type_hints(declared)
    fields = (field for field in dataclasses.fields(declared) if field.name not in without)
    return {field.name: _entry(field, hints[field.name]) for field in fields}


def _entry(field: dataclasses.Field[Any], hint: Any) -> Entry:
    """Return how a field of a declared dataclass is read.

    Raises
    ------
    TypeError
        It is not declared in a way that a study can set.
    """
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
