"""A study with some values replaced by their dotted path, in what it holds and in its text alike."""

from __future__ import annotations

import copy
import io
import json
import re
from collections.abc import Mapping
from typing import Any

from workflow.study.mistakes import Mistake, Place, StudyError
from workflow.study.quantities import NUMBER
from workflow.study.source import StudyText, compose, dotted, written_axes

OPTION = "-s"
"""How replaced values are named in messages, unless another word is given: the option of the command line."""


TEXTS = ("study", "title", "license")
"""Sections of a study that are words whatever they look like."""

_POWER = re.compile(rf"(?=.*[eE]){NUMBER}")


def setting(words: str) -> tuple[str, Any]:
    """Return key and value of ``KEY=VALUE``; the value is YAML, or it is a ``StudyError``."""
    key, equals, text = words.partition("=")
    if not equals or not key.strip():
        remedy = 'write -s KEY=VALUE, e.g. -s scene.casing.gap="10 um"'
        raise StudyError([Mistake(f"{OPTION} {words}", None, "", "is not KEY=VALUE", remedy)])
    if text.strip() in ("", "~", "null"):
        return key.strip(), None
    source = compose(text, f"{OPTION} {key.strip()}")
    if source.mistakes:
        raise StudyError(source.mistakes)
    return key.strip(), source.tree


def replaced(source: StudyText, settings: Mapping[str, Any], option: str = OPTION) -> StudyText:
    """Return a study's source with values replaced by their dotted path, as if they had been written in it.

    What follows ``axes.`` or ``zip.NAME.`` is one key. ``option`` names the values in messages, before their key.

    Raises
    ------
    StudyError
        A path leads nowhere, an axis or a zip varies it, or a value is none that YAML has.
    """
    tree = copy.deepcopy(source.tree)
    new = StudyText(source.file, source.text, tree, dict(source.lines), list(source.mistakes))
    for key, value in settings.items():
        place, name = _place(key), f"{option} {key}"
        fault = _put(tree, place, _plain(value, name))
        if fault:
            raise StudyError([Mistake(name, None, "", *fault)])
        new.named[tuple(int(step) if str(step).isdigit() else step for step in place)] = name
    for place, path, content in written_axes(tree):
        if path in settings and content is not None:
            varied, name = dotted(place), f"{option} {path}"
            problem = f"has no effect, as {varied} varies this value"
            raise StudyError([Mistake(name, None, "", problem, f"set {varied} instead")])
    new.text = text_of(tree, source.text, {key: _plain(value, key) for key, value in settings.items()})
    return new


def text_of(tree: Any, written: str = "", settings: Mapping[str, Any] | None = None) -> str:
    """Return YAML that is read as a tree: the text as written with its comments where that can be kept, else JSON."""
    if written and settings:
        try:
            text = _round_trip(written, settings)
            if compose(text, "").tree == tree:
                return text
        except Exception:  # what the text has in it that ruamel.yaml cannot write again
            pass
    return json.dumps(tree, indent=2, ensure_ascii=False) + "\n"


def _round_trip(written: str, settings: Mapping[str, Any]) -> str:
    """Return a text in which values are replaced and all else, comments too, is as it was."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="rt")
    yaml.preserve_quotes, yaml.width = True, 2**20
    data = yaml.load(written)
    for key, value in settings.items():
        _put(data, _place(key), value)
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()


def plain_tree(content: Mapping[str, Any]) -> Any:
    """Return a study given as a mapping as the plain values that its text would have.

    A YAML 1.1 loader such as PyYAML leaves ``1e-6`` and ``2.0e7`` as texts: they become the numbers of YAML 1.2.

    Raises
    ------
    StudyError
        It holds a value that YAML does not have.
    """
    return {key: value if key in TEXTS else _numbers(value) for key, value in _plain(content, "study").items()}


def _numbers(value: Any) -> Any:
    """Return a tree with its texts that are numbers with an exponent as numbers."""
    if isinstance(value, dict):
        return {key: _numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_numbers(item) for item in value]
    return float(value) if isinstance(value, str) and _POWER.fullmatch(value) else value


def _place(key: str) -> Place:
    """Return where a dotted path leads; what follows ``axes.``, ``zip.NAME.`` or ``zip.NAME.of.`` is one key."""
    head, _, rest = key.partition(".")
    if head == "axes" and rest:
        return (head, rest)
    if head == "zip" and "." in rest:
        name, path = rest.split(".", 1)
        return (head, name, "of", path[3:]) if path.startswith("of.") else (head, name, path)
    return tuple(key.split("."))


def _put(tree: Any, place: Place, value: Any) -> tuple[str, str] | None:
    """Put a value in a tree, in new mappings where there are none; return problem and remedy if that cannot be."""
    owner = tree
    for k, step in enumerate(place):
        last = k == len(place) - 1
        if isinstance(owner, list):
            if not str(step).isdigit() or int(step) >= len(owner):
                return f"has no entry {step!r} in its list", f"give a number up to {len(owner) - 1}"
            step = int(step)
        elif not isinstance(owner, dict):
            return f"leads through {'.'.join(map(str, place[:k]))}, which is no mapping", "name a value that can be set"
        elif not step:
            return "has an empty word in its path", "write the words of the path with one dot between them"
        if last:
            owner[step] = value
        elif isinstance(owner, dict) and owner.get(step) is None:
            owner[step] = {}
        owner = owner[step]
    return None


def _plain(value: Any, name: str) -> Any:
    """Return a value as YAML has it: arrays and tuples as lists, numbers of NumPy as numbers."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item, name) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item, name) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return value
    problem = f"holds a value of the type {type(value).__name__}"
    raise StudyError([Mistake(name, None, "", problem, "give numbers, texts, lists and mappings")])
