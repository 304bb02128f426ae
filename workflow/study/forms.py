"""Pydantic forms built from declarations, with mistakes in the words of a study."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from types import GenericAlias
from typing import Annotated, Any, ClassVar, Literal, get_args, get_origin, get_type_hints

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import CoreSchema, InitErrorDetails, core_schema

from workflow.declare import quantity_of, word_of
from workflow.study.field_types import FieldType, Flag, Keyword, Reading, Text, is_whole
from workflow.study.mistakes import details, nearest, one_of, quoted, wrong


class Form(BaseModel):
    """A mapping with known keys, which explains its mistakes in the words of a study."""

    model_config = ConfigDict(extra="forbid", protected_namespaces=())
    moved: ClassVar[Mapping[str, str]] = {}
    """Keys that are known, but not here, with what to write instead."""

    @model_validator(mode="wrap")
    @classmethod
    def _explain(cls, value: Any, handler: Any) -> Any:
        try:
            return handler(value)
        except ValidationError as error:
            errors = error.errors(include_url=False)
            unknown = [str(line["loc"][-1]) for line in errors if line["type"] == "extra_forbidden"]
            meant = {nearest(key, cls.model_fields) for key in unknown}  # misspelt is not missing, too
            lines = [
                cls._explained(line) for line in errors if line["type"] != "missing" or line["loc"][-1] not in meant
            ]
            raise ValidationError.from_exception_data(cls.__name__, lines) from None

    @classmethod
    def _explained(cls, line: Any) -> InitErrorDetails:
        place, value, last = line["loc"], line["input"], str(line["loc"][-1] if line["loc"] else "")
        match line["type"]:
            case "study":
                mistake = wrong(**line["ctx"])
            case "missing":
                meaning = cls.model_fields[last].description
                mistake = wrong("is missing", f"write it: {meaning}")
            case "extra_forbidden" if last in cls.moved:
                mistake = wrong("does not belong here", cls.moved[last])
            case "extra_forbidden":
                mistake = wrong(f"{quoted(last)} is not known here", one_of(last, cls.model_fields))
            case _ if value is None:
                mistake = wrong("has nothing in it", "write `key: value` entries, or leave it out")
            case _:
                mistake = wrong(f"{quoted(value)} is not a mapping", "write `key: value` entries, or leave it out")
        return details(mistake, place, value)


def annotated(annotation: Any, metadata: Any) -> Any:
    """Return ``Annotated[annotation, metadata]`` for what is known only when the program runs."""
    return Annotated[annotation, metadata]


def form(declared: Any, name: str = "") -> Any:
    """Return the annotation that reads a mapping into an instance of a declared dataclass."""
    return annotated(keys_form(declared, name), AfterValidator(lambda read: declared(**dict(read))))


def keys_form(declared: Any, name: str = "", **other: Any) -> type[Form]:
    """Return the form with the fields of a declared dataclass, and others that replace or follow them."""
    hints = get_type_hints(declared)
    declared_entries = [entry for entry in dataclasses.fields(declared) if entry.name not in other]
    entries: dict[str, Any] = {entry.name: entry_of(entry, hints[entry.name]) for entry in declared_entries}
    return create_model(name or declared.__name__, __base__=Form, __doc__=summary(declared), **entries | other)


def explicit_entries(read: Form) -> dict[str, Any]:
    """Return the entries that a study gives, in the order of the form."""
    return {name: getattr(read, name) for name in type(read).model_fields if name in read.model_fields_set}


def entry_of(entry: dataclasses.Field[Any], hint: Any) -> tuple[Any, FieldInfo]:
    """Return the pydantic field of a field of a dataclass."""
    reading, description = _annotation(entry, hint)
    annotation = annotated(Any, reading) if isinstance(reading, FieldType) else reading
    if entry.default_factory is not dataclasses.MISSING:
        return annotation, Field(default_factory=entry.default_factory, description=description)
    if entry.default is not dataclasses.MISSING:
        return annotation, Field(default=entry.default, description=description)
    return annotation, Field(description=description)


def _annotation(entry: dataclasses.Field[Any], hint: Any) -> tuple[Any, str]:
    """Return how a field is read, and what it means."""
    declared = quantity_of(entry)
    if declared is not None:
        reading = Reading(declared, whole=is_whole(hint))
        return reading, reading.described()
    text = word_of(entry)
    if text is not None:
        return Text(text), text.description
    if isinstance(hint, type) and dataclasses.is_dataclass(hint):
        return form(hint), summary(hint)
    if get_origin(hint) is tuple:
        item = get_args(hint)[0]
        if dataclasses.is_dataclass(item):
            entries = annotated(GenericAlias(list, form(item)), BeforeValidator(_listed))
            return annotated(entries, AfterValidator(tuple)), summary(item)
        return Keyword(get_args(item), several=True), spoken(entry.name)
    if get_origin(hint) is Literal:
        return Keyword(get_args(hint)), spoken(entry.name)
    if hint is bool:
        return Flag(), str(entry.metadata.get("meaning", spoken(entry.name)))
    raise TypeError(f"{entry.name}: declare a quantity, a word, a file, a dataclass, a bool or a Literal, not {hint}")


LONGEST_LIST = 100
"""Entries of a list of mappings."""


def _listed(value: Any) -> Any:
    """Refuse what is no list of a moderate length."""
    if not isinstance(value, list):
        raise wrong(f"{quoted(value)} is not a list", "write a list of `{key: value}` entries")
    if len(value) > LONGEST_LIST:
        raise wrong(f"has {len(value)} entries", f"write at most {LONGEST_LIST}")
    return value


def spoken(name: str) -> str:
    """Return a name as words."""
    return name.replace("_", " ")


def summary(described: object) -> str:
    """Return the first paragraph of a docstring in one line."""
    return " ".join((described.__doc__ or "").split("\n\n")[0].split())


@dataclasses.dataclass(frozen=True)
class ByShape:
    """Chooses the branch of a union by shape: by the word under ``key``, or a bare ``word``.

    Tags stand in angle brackets, which no key of a study has, so that they differ from keys
    in the place of an error.
    """

    branches: tuple[tuple[str, Any], ...]
    key: str | None = None
    word: str | None = None

    def _judge(self, value: Any) -> Any:
        """Refuse what is none of the branches, in one message."""
        names = [name for name, _ in self.branches]
        if not isinstance(value, dict):
            if self.word is not None and value == self.word:
                return value
            other = "" if self.word is None else f" or `{self.word}`"
            raise wrong(f"{quoted(value)} is not a mapping{other}", f"write a mapping{other}")
        if self.key is not None and self.key not in value:
            raise wrong(f"`{self.key}` is missing", one_of("", names))
        if self.key is not None and value[self.key] not in names:
            chosen = value[self.key]
            mistake = wrong(f"{quoted(chosen)} is no {self.key}", one_of(str(chosen), names))
            raise ValidationError.from_exception_data("branch", [details(mistake, (self.key,), chosen)])
        return value

    def _tag(self, value: Any) -> str:
        if not isinstance(value, dict):
            return f"<{self.word}>"
        return f"<{self.branches[0][0] if self.key is None else value[self.key]}>"

    def __get_pydantic_core_schema__(self, _source: Any, handler: Any) -> CoreSchema:
        choices = {f"<{name}>": handler.generate_schema(branch) for name, branch in self.branches}
        if self.word is not None:
            choices[f"<{self.word}>"] = core_schema.literal_schema([self.word])
        union = core_schema.tagged_union_schema(choices, discriminator=self._tag)
        return core_schema.no_info_before_validator_function(self._judge, union)


def entries_of(read: Any) -> Any:
    """Return the entries of a form, and those of the forms in it."""
    if isinstance(read, Form):
        return {key: entries_of(value) for key, value in read}
    return {key: entries_of(value) for key, value in read.items()} if isinstance(read, dict) else read
