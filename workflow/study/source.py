"""A study's text as plain values with line numbers: YAML 1.2, read event by event.

ruamel.yaml's pure parser delivers the events; they are composed here without recursion, so that
depth and tags are judged before anything grows. An alias repeats the events of its anchor, which count as if they were
written again. Plain scalars follow the core schema of
YAML 1.2: ``1e-6`` and ``2.0e7`` are numbers, ``yes`` and ``010`` are no booleans and no octals.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workflow.study.mistakes import Mistake, Place, StudyError, quoted

DEEPEST = 40
"""Levels of nesting; a study needs five."""

LARGEST = 2**20
"""Bytes of a study."""

MOST_ENTRIES = 50_000
"""Keys, values and brackets of a study, which take about 30 us each to read: a second and a half."""

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


@dataclass
class Source:
    """A study as composed from its text.

    Attributes
    ----------
    file, text
        Name of the file and what it holds.
    tree
        Plain mappings, lists and scalars.
    lines
        Line (from 1) of the entry at every place.
    mistakes
        What is wrong already: duplicate keys, tags.
    named
        What the user calls values that do not stand in the file, by their place: ``-s scene.casing.gap``.
    """

    file: str
    text: str
    tree: Any = None
    lines: dict[Place, int] = field(default_factory=dict)
    mistakes: list[Mistake] = field(default_factory=list)
    named: dict[Place, str] = field(default_factory=dict)

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


def dotted(place: Place) -> str:
    """Return a place as users write it: ``scene.chain.mass[2]``."""
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in place)
    return text.removeprefix(".")


def read_text(path: str | Path) -> str:
    """Return the text of a study's file.

    Raises
    ------
    StudyError
        No such file, not a regular file, not readable, too large, or not UTF-8.
    """

    def refusal(problem: str, remedy: str, line: int | None = None) -> StudyError:
        return StudyError([Mistake(str(path), line, "", problem, remedy)])

    try:
        if Path(path).exists() and not Path(path).is_file():
            raise refusal("is not a file", "give the path of a study, a YAML file")
        with Path(path).open("rb") as stream:
            content = stream.read(LARGEST + 1)
    except (OSError, ValueError) as error:  # ValueError: a null character in the path
        reason = getattr(error, "strerror", None) or str(error)
        raise refusal(f"cannot be read ({reason})", "give the path of a readable study") from None
    if len(content) > LARGEST:
        raise refusal("is larger than 1 MiB", "write long axes as {lin: [first, last, count]}")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise refusal("is not UTF-8 text", "save the study as UTF-8", line) from None


def compose(text: str, file: str) -> Source:
    """Return the values of a study's text with their lines; duplicate keys are noted as mistakes.

    Raises
    ------
    StudyError
        The text is not YAML, is empty, nests too deeply, is too long, has more than one document or too many entries,
        or uses tags, keys that are no words or aliases without an anchor.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    source = Source(file, text)
    if len(text.encode(errors="replace")) > LARGEST:
        raise StudyError([Mistake(file, None, "", "is larger than 1 MiB", "write long axes as {lin: [...]}")])
    composer = _Composer(source)
    try:
        for event in YAML(typ="safe", pure=True).parse(text):
            composer.take(event)
    except YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        problem = getattr(error, "problem", None) or "a character that YAML does not allow"
        source.report((), f"is not YAML: {problem}", "mend the text here or above", mark and mark.line + 1)
        raise StudyError(source.mistakes) from None
    except (ValueError, OverflowError):  # an escape beyond Unicode
        source.report((), "is not YAML: an escape that is no character", "mend the text")
        raise StudyError(source.mistakes) from None
    if composer.unread:
        raise StudyError(source.mistakes)
    if source.tree is None:
        source.report((), "is empty", "begin with `study: NAME` and `scene:`")
        raise StudyError(source.mistakes)
    return source


@dataclass
class _Open:
    """A collection that is being composed; ``key`` is the one whose value comes next."""

    place: Place
    value: dict[str, Any] | list[Any]
    key: str | None = None
    dropped: bool = False
    anchor: str | None = None
    events: list[Any] = field(default_factory=list)
    """What it is made of, for aliases; kept where it has an anchor."""


class _Composer:
    """Puts events together to values; ``unread`` says that something could not be."""

    def __init__(self, source: Source) -> None:
        self.source = source
        self.open: list[_Open] = []
        self.anchored: dict[str, list[Any]] = {}
        self.documents = 0
        self.entries = 0
        self.unread = False

    def take(self, event: Any) -> None:
        """Take the next event of the parser."""
        self.entries += 1
        if self.entries > MOST_ENTRIES:
            remedy = "write long axes as {lin: [first, last, count]} or {log: [...]}"
            self._refuse((), f"has more than {MOST_ENTRIES} keys and values", remedy, event)
            raise StudyError(self.source.mistakes)
        kind = type(event).__name__
        if kind == "AliasEvent":
            self._repeat(event)
            return
        for collection in self.open:
            if collection.anchor:
                collection.events.append(event)
        match kind:
            case "DocumentStartEvent":
                self.documents += 1
                if self.documents == 2:
                    self._refuse((), "holds more than one document", "keep one study per file", event)
            case "ScalarEvent":
                self._scalar(event)
            case "MappingStartEvent":
                self._start({}, event)
            case "SequenceStartEvent":
                self._start([], event)
            case "MappingEndEvent" | "SequenceEndEvent":
                ended = self.open.pop()
                if ended.anchor:
                    self.anchored[ended.anchor] = ended.events

    def _repeat(self, alias: Any) -> None:
        """Take the events of an anchor again."""
        events = self.anchored.get(alias.anchor)
        if events is None:
            remedy = f"write `&{alias.anchor}` before the value that it repeats, above"
            self._refuse(self._next(), f"`*{alias.anchor}` has no anchor", remedy, alias)
            raise StudyError(self.source.mistakes)
        for event in events:
            self.take(event)

    def _refuse(self, place: Place, problem: str, remedy: str, event: Any) -> None:
        self.unread = True
        self.source.report(place, problem, remedy, event.start_mark.line + 1)

    def _next(self) -> Place:
        """Return the place of the value that comes next."""
        if not self.open:
            return ()
        top = self.open[-1]
        if isinstance(top.value, list):
            return (*top.place, len(top.value))
        return top.place if top.key is None else (*top.place, top.key)

    def _put(self, value: Any, event: Any) -> None:
        """Put a value where it belongs; the second value of a key is dropped."""
        if not self.open:
            if self.documents == 1:
                self.source.tree = value
            return
        top = self.open[-1]
        if isinstance(top.value, list):
            self._mark(self._next(), event)
            top.value.append(value)
        elif top.key is None:
            problem, remedy = "has a key that is no word", "write each key as one word before its colon"
            self._refuse(top.place, problem, remedy, event)
            raise StudyError(self.source.mistakes)
        else:
            if not top.dropped:
                top.value[top.key] = value
            top.key = None

    def _mark(self, place: Place, event: Any) -> None:
        self.source.lines.setdefault(place, event.start_mark.line + 1)

    def _judge_tag(self, event: Any) -> None:
        if event.tag is not None:
            self._refuse(self._next(), f"has the tag {quoted(str(event.tag))}", "write the value without a tag", event)

    def _start(self, value: dict[str, Any] | list[Any], event: Any) -> None:
        self._judge_tag(event)
        place = self._next()
        self._put(value, event)
        self.open.append(_Open(place, value, anchor=event.anchor, events=[event]))
        if len(self.open) > DEEPEST:
            self._refuse((), f"nests deeper than {DEEPEST} levels", "a study needs five", event)
            raise StudyError(self.source.mistakes)

    def _scalar(self, event: Any) -> None:
        self._judge_tag(event)
        if event.anchor:
            self.anchored[event.anchor] = [event]
        if any("\ud800" <= character <= "\udfff" for character in event.value):
            self._refuse(self._next(), "has an escape that is no character", "write the character itself", event)
            event.value = "".join(c for c in event.value if not "\ud800" <= c <= "\udfff")
        top = self.open[-1] if self.open else None
        if top is None or isinstance(top.value, list) or top.key is not None:
            self._put(_resolved(event.value) if event.style is None else event.value, event)
            return
        top.key = event.value
        top.dropped = event.value in top.value
        place = (*top.place, event.value)
        if event.value == "<<":
            self._refuse(place, "is a merge key", "write the keys out: merge keys are not read", event)
        elif top.dropped:
            first = self.source.lines[place]
            problem = f"stands twice, first in line {first}"
            self.source.report(place, problem, "keep one of the two", event.start_mark.line + 1)
        self._mark(place, event)


def _resolved(text: str) -> Any:
    """Return what a plain scalar means in the core schema of YAML 1.2."""
    if text in _WORDS:
        return _WORDS[text]
    if _INTEGER.fullmatch(text):
        return int(text)
    if _FLOAT.fullmatch(text):
        return float(text)
    if _OTHER_BASE.fullmatch(text):
        return int(text, 0)
    return text
