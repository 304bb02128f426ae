"""A study's text as plain values with line numbers, and with some of them replaced by their dotted path.

It is YAML 1.2 as ruamel.yaml composes it; an alias counts as if its anchor were written again. Plain scalars follow the
core schema of YAML 1.2: ``1e-6`` and ``2.0e7`` are numbers, ``yes`` and ``010`` are no booleans and no octals.
"""

from __future__ import annotations

import copy
import io
import json
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from workflow.study.mistakes import Mistake, Place, StudyError, place_of_path, quoted
from workflow.study.quantities import NUMBER

DEEPEST = 40
"""Levels of nesting; a study needs five."""

LARGEST = 2**20
"""Bytes of a study."""

MOST_ENTRIES = 50_000
"""Keys and values of a study, which take about 30 us each to read: a second and a half."""

_NO_STUDIES = (".npz", ".mat", ".op4", ".pch", ".mtx", ".rua", ".rsa", ".hb", ".sti", ".mas", ".dof", ".csv")
"""Endings of files of matrices and tables, which a study names."""

_NO_YAML = (
    "look for wrong indentation or a tab, a colon without a space after it, a bracket or a quote that is not closed, "
    "and a text that needs quotes, as one with `: ` in it"
)
"""What most often keeps a text from being YAML; the parser names what it stumbled over, not what is wrong."""

_TOO_DEEP = (f"nests deeper than {DEEPEST} levels", "a study needs five")
_TOO_LARGE = ("is larger than 1 MiB", "write long axes as {lin: [first, last, count]}")
_TOO_MANY = (
    f"has more than {MOST_ENTRIES} keys and values",
    "write long axes as {lin: [first, last, count]} or {log: [...]}",
)

_WORDS = {
    **dict.fromkeys(["", "~", "null", "Null", "NULL"], None),
    **dict.fromkeys(["true", "True", "TRUE"], True),
    **dict.fromkeys(["false", "False", "FALSE"], False),
    **dict.fromkeys([".nan", ".NaN", ".NAN"], math.nan),
    **{sign + word: float(sign + "inf") for sign in ("", "+", "-") for word in (".inf", ".Inf", ".INF")},
}
_INTEGER = re.compile(r"[-+]?[0-9]{1,300}")
_FLOAT = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
_OTHER_BASE = re.compile(r"0o[0-7]{1,60}|0x[0-9a-fA-F]{1,60}")


class Spelled:
    """A number that Python would spell otherwise: a label ``007`` or ``3.10`` is looked up as it is written."""

    spelling = ""

    def __repr__(self) -> str:
        return self.spelling


class SpelledInt(Spelled, int):
    """A whole number."""


class SpelledFloat(Spelled, float):
    """A number."""


def spelled(text: str, value: float) -> float:
    """Return a number with its spelling where Python has another one."""
    if repr(value) == text:
        return value
    number = SpelledInt(value) if isinstance(value, int) else SpelledFloat(value)
    number.spelling = text
    return number


@dataclass
class StudyText:
    """A study as composed from its text."""

    file: str
    text: str
    """``file``, ``text``: name of the file and what it holds."""
    tree: Any = None
    """Plain mappings, lists and scalars."""
    lines: dict[Place, int] = field(default_factory=dict)
    """Line (from 1) of the entry at every place."""
    mistakes: list[Mistake] = field(default_factory=list)
    """What is wrong already: duplicate keys, tags, merge keys."""
    named: dict[Place, str] = field(default_factory=dict)
    """What the user calls values that do not stand in the file, by their place: ``-s scene.casing.gap``."""

    @cached_property
    def given(self) -> frozenset[str]:
        """Dotted paths of the entries of all mappings."""
        return frozenset(_given_paths(self.tree))

    @cached_property
    def axes(self) -> dict[str, Place]:
        """Places of axes by path, those of zips too."""
        return {path: place for place, path, _ in written_axes(self.tree)}

    def has(self, path: str) -> bool:
        """Tell whether a scene value is written, in the scene or as an axis."""
        return path in self.axes or path in self.given

    def place_of(self, *paths: str) -> Place:
        """Return where the first of some scene values is written, as an axis or in the scene."""
        path = next(filter(self.has, paths), paths[-1])
        return self.axes.get(path, place_of_path(path))

    def report(self, place: Place, problem: str, remedy: str, line: int | None = None) -> None:
        """Note a mistake at a place; a place that is not written has the line of what surrounds it."""
        for length in range(len(place), 0, -1):
            if place[:length] in self.named:
                below = dotted(place[length:])
                self.mistakes.append(Mistake(self.named[place[:length]], None, below, problem, remedy))
                return
        written = place
        while written and written not in self.lines:
            written = written[:-1]
        line = self.lines.get(written, 1) if line is None else line
        self.mistakes.append(Mistake(self.file, line, dotted(place), problem, remedy))

    def refuse(self) -> None:
        """Refuse the study if it has mistakes."""
        if self.mistakes:
            raise StudyError(self.mistakes)

    def refusal(self, problem: str, remedy: str, line: int | None = None) -> StudyError:
        """Return the error of a text that cannot be read further."""
        self.report((), problem, remedy, line)
        return StudyError(self.mistakes)


def mapping(value: Any, *keys: str) -> dict[str, Any]:
    """Return the mapping at some keys of a tree, an empty one where there is none."""
    for key in keys:
        value = value.get(key) if isinstance(value, dict) else None
    return value if isinstance(value, dict) else {}


def _given_paths(tree: Any, above: str = "") -> Iterator[str]:
    """Yield the dotted path of every entry of a mapping in a tree."""
    items = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    for step, below in items:
        path = f"{above}.{step}" if above else str(step)
        if isinstance(tree, dict):
            yield path
        yield from _given_paths(below, path)


def written_axes(tree: Any) -> Iterator[tuple[Place, str, Any]]:
    """Yield place, path and content of all axes of a study as written, those of zips too."""
    sections: list[tuple[str, ...]] = [("axes",)]
    for name in mapping(tree, "zip"):
        sections.append(("zip", name, "of") if "of" in mapping(tree, "zip", name) else ("zip", name))
    for section in sections:
        for path, content in mapping(tree, *section).items():
            yield (*section, path), path, content


def dotted(place: Place) -> str:
    """Return a place as users write it: ``scene.chain.mass[2]``."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
    return text.removeprefix(".")


def read_text(path: str | Path) -> str:
    """Return the text of a study's file; a ``StudyError`` tells why it cannot be read."""

    def refusal(problem: str, remedy: str, line: int | None = None) -> StudyError:
        return StudyError([Mistake(str(path), line, "", problem, remedy)])

    if Path(path).suffix.lower() in _NO_STUDIES:
        raise refusal("is no study", f"write one that names it, as `scene: {{matrices: {{file: {Path(path).name}}}}}`")
    try:
        if Path(path).exists() and not Path(path).is_file():
            raise refusal("is not a file", "give the path of a study, a YAML file")
        with Path(path).open("rb") as stream:
            content = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise refusal(f"cannot be read ({reason})", "give the path of a readable study") from None
    if len(content) > LARGEST:
        raise refusal(*_TOO_LARGE)
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise refusal("is not UTF-8 text", "save the study as UTF-8", line) from None


def compose(text: str, file: str) -> StudyText:
    """Return the values of a study's text with their lines; duplicate keys, tags and merge keys are noted as mistakes.

    Raises :class:`StudyError` for a text that is not YAML, is empty, nests too deeply or has too much in it.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.composer import Composer
    from ruamel.yaml.error import YAMLError

    source = StudyText(file, text)
    if len(text.encode(errors="replace")) > LARGEST:
        raise StudyError([Mistake(file, None, "", *_TOO_LARGE)])

    class Bounded(Composer):
        """Refuses more entries than a study has."""

        warn_double_anchors = False
        nodes = 0

        def compose_node(self, parent: Any, index: Any) -> Any:
            self.nodes += 1
            if self.nodes > MOST_ENTRIES:
                raise source.refusal(*_TOO_MANY, self.parser.peek_event().start_mark.line + 1)
            return super().compose_node(parent, index)

    yaml = YAML(typ="safe", pure=True)
    yaml.Composer = Bounded
    try:
        root = yaml.compose(text)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or "a character that YAML does not allow"
        line = mark and mark.line + 1
        raise source.refusal(f"is not YAML, here or just above ({problem})", _NO_YAML, line) from None
    except (ValueError, OverflowError):  # an escape beyond Unicode
        raise source.refusal("is not YAML: an escape that is no character", "mend the text") from None
    except RecursionError:
        raise source.refusal(*_TOO_DEEP) from None
    source.tree = None if root is None else _value(source, root, (), yaml.resolver)
    if source.tree is None:
        raise source.refusal("is empty", "begin with `study: NAME` and `scene:`")
    return source


def _value(source: StudyText, node: Any, place: Place, resolver: Any) -> Any:
    """Return the value of a node of YAML and note the line of each entry in it."""
    if len(place) > DEEPEST:
        raise source.refusal(*_TOO_DEEP)
    if len(source.lines) > MOST_ENTRIES:  # of aliases that repeat aliases
        raise source.refusal(*_TOO_MANY, node.start_mark.line + 1)
    is_plain = getattr(node, "style", "") is None
    if str(node.ctag) != str(resolver.resolve(type(node), node.value, (is_plain, not is_plain))):
        problem = f"has the tag {quoted(str(node.ctag))}"
        source.report(place, problem, "write the value without a tag", node.start_mark.line + 1)
    if node.id == "scalar":
        text = _characters(source, node, place)
        return _resolved(text) if is_plain else text
    if node.id == "sequence":
        source.lines |= {(*place, k): item.start_mark.line + 1 for k, item in enumerate(node.value)}
        return [_value(source, item, (*place, k), resolver) for k, item in enumerate(node.value)]
    values: dict[str, Any] = {}
    for key, item in node.value:
        line = key.start_mark.line + 1
        if key.id != "scalar":
            source.report(place, "has a key that is no word", "write each key as one word before its colon", line)
            continue
        name = _characters(source, key, place)
        below = (*place, name)
        if name == "<<":
            source.report(below, "is a merge key", "write the keys out: merge keys are not read", line)
        elif below in source.lines:
            problem = f"stands twice, first in line {source.lines[below]}"
            source.report(below, problem, "keep one of the two", line)
        else:
            source.lines[below] = line
            values[name] = _value(source, item, below, resolver)
    return values


def _characters(source: StudyText, node: Any, place: Place) -> str:
    """Return the text of a scalar without halves of surrogate pairs, which are no characters."""
    text = str(node.value)
    sound = text.encode(errors="ignore").decode()
    if sound != text:
        problem, remedy = "has an escape that is no character", "write the character itself"
        source.report(place, problem, remedy, node.start_mark.line + 1)
    return sound


def _resolved(text: str) -> Any:
    """Return what a plain scalar means in the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if _OTHER_BASE.fullmatch(text):
        return spelled(text, int(text, 0))
    read = int if _INTEGER.fullmatch(text) else float if _FLOAT.fullmatch(text) else None
    return text if read is None else spelled(text, read(text))


GAP, GAP_OF = "scene.casing.gap", "scene.casing.gap."
"""Path of the gap, and how that of one of several contacts begins, which its label follows."""

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
    Raises :class:`StudyError` for paths that lead nowhere or that an axis or a zip varies, and for values YAML has not.
    """
    tree = copy.deepcopy(source.tree)
    new = StudyText(source.file, source.text, tree, dict(source.lines), list(source.mistakes))
    for key, value in settings.items():
        place, name = _place(key), f"{option} {key}"
        fault = _put(tree, place, _plain(value, name))
        if fault:
            raise StudyError([Mistake(name, None, "", *fault)])
        new.named[tuple(int(step) if str(step).isdigit() else step for step in place)] = name
    written = {path: content for _, path, content in written_axes(source.tree)}
    for place, path, content in written_axes(tree):
        is_set = place == _place(path) and not isinstance(written.get(path), list | dict)  # the gap of a contact
        if path in settings and content is not None and not is_set:
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
            if repr(compose(text, "").tree) == repr(tree):  # spellings too
                return text
        except Exception:  # what the text has in it that ruamel.yaml cannot write again
            pass
    return _as_json(tree) + "\n"


def _as_json(value: Any, line: str = "\n") -> str:
    """Return a tree in indented lines of JSON, but numbers as they are spelled."""
    if not value or not isinstance(value, dict | list):
        return repr(value) if isinstance(value, Spelled) else json.dumps(value, ensure_ascii=False)
    below = f"{line}  "
    if isinstance(value, list):
        return f"[{below}{f',{below}'.join(_as_json(item, below) for item in value)}{line}]"
    items = (f"{_as_json(key)}: {_as_json(item, below)}" for key, item in value.items())
    return f"{{{below}{f',{below}'.join(items)}{line}}}"


def _round_trip(written: str, settings: Mapping[str, Any]) -> str:
    """Return a text in which values are replaced and all else, comments too, is as it was."""
    from ruamel.yaml import YAML

    yaml = YAML(typ="rt")
    yaml.preserve_quotes, yaml.width = True, 2**20
    for kind, tag in ((SpelledInt, "tag:yaml.org,2002:int"), (SpelledFloat, "tag:yaml.org,2002:float")):
        yaml.representer.add_representer(kind, lambda to, x, tag=tag: to.represent_scalar(tag, repr(x)))
    data = yaml.load(written)
    for key, value in settings.items():
        _put(data, _place(key), value)
    stream = io.StringIO()
    yaml.dump(data, stream)
    return stream.getvalue()


def plain_tree(content: Mapping[str, Any]) -> Any:
    """Return a study given as a mapping as the plain values that its text would have; refuse other ones.

    A YAML 1.1 loader such as PyYAML leaves ``1e-6`` and ``2.0e7`` as texts: they become the numbers of YAML 1.2.
    """
    return {key: value if key in TEXTS else _numbers(value) for key, value in _plain(content, "study").items()}


def _numbers(value: Any) -> Any:
    """Return a tree with its texts that are numbers with an exponent as numbers."""
    if isinstance(value, dict):
        return {key: _numbers(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_numbers(item) for item in value]
    return spelled(value, float(value)) if isinstance(value, str) and _POWER.fullmatch(value) else value


def _place(key: str) -> Place:
    """Return where a dotted path leads; what follows ``axes.``, ``zip.NAME.`` or ``zip.NAME.of.`` is one key.

    The gap of one of several contacts is an axis of one value.
    """
    if key.startswith(GAP_OF):
        return ("axes", key)
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
