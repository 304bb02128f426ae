"""What is wrong in a study, where, and what would be right."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from pydantic_core import InitErrorDetails, PydanticCustomError, ValidationError

Place = tuple[str | int, ...]
"""Keys and positions that lead from the top of a study to an entry."""


def place_of_path(path: str) -> Place:
    """Return where a dotted path leads; words that are numbers count the entries of lists."""
    return tuple(int(word) if word.isdigit() else word for word in path.split("."))


@dataclass(frozen=True)
class Mistake:
    """One mistake of a study."""

    file: str
    """The file as it was named by the user."""
    line: int | None
    """Line of the entry, counted from 1; ``None`` where the file has no lines to speak of."""
    key: str
    """Dotted path of the entry, empty for the file as a whole."""
    problem: str
    remedy: str
    """``problem``, ``remedy``: what is wrong, and what would be right."""

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        key = f"{self.key}: " if self.key else ""
        return f"{place}: {key}{self.problem}; {self.remedy}"


class StudyError(Exception):
    """A study is refused; ``mistakes`` holds every one of its mistakes, in the order of the file."""

    def __init__(self, mistakes: Iterable[Mistake]) -> None:
        self.mistakes = tuple(sorted(mistakes, key=lambda mistake: (mistake.line or 0, mistake.key)))
        super().__init__(self.mistakes)

    def __str__(self) -> str:
        return "\n".join(map(str, self.mistakes))


UNKNOWN = "is not known here"

Fault = tuple[Place, str, str]
"""Where something is wrong, what, and what would be right."""


def wrong(problem: str, remedy: str, *place: str | int) -> ValidationError:
    """Return the error of one fault, in the value that is being read or at a place below it."""
    return refusal([(place, problem, remedy)])


def refusal(faults: Iterable[Fault]) -> ValidationError:
    """Return the error of some faults, to which pydantic adds the place of the value and the faults of others."""
    details: list[InitErrorDetails] = []
    for place, problem, remedy in faults:
        error = PydanticCustomError("wrong", "{problem}; {remedy}", {"problem": problem, "remedy": remedy})
        details.append(InitErrorDetails(type=error, loc=place, input=None))
    return ValidationError.from_exception_data("study", details)


def faults_of(error: ValidationError) -> list[Fault]:
    """Return the faults of an error, each where it is in the study."""
    faults: list[Fault] = []
    for line in error.errors(include_url=False, include_input=False):
        steps = line["loc"][:-1] if line["loc"][-1:] == ("[key]",) else line["loc"]  # a name that is refused
        place = tuple(step for step in steps if isinstance(step, str) or step >= 0)  # below 0 is the form of a value
        faults.append((place, line["ctx"]["problem"], line["ctx"]["remedy"]))
    return faults


_SYNONYMS = {"restitution": "e", "step": "h", "time_step": "h", "dt": "h", "clearance": "gap"}
"""What people write, and the word of a study."""


def nearest(word: str, choices: Iterable[str]) -> str | None:
    """Return the known word that means the same or looks most like ``word``, ``None`` where none does."""
    choices = list(choices)
    if _SYNONYMS.get(word) in choices:
        return _SYNONYMS[word]
    matches = difflib.get_close_matches(word, choices, n=1, cutoff=0.6)
    return matches[0] if matches else None


def one_of(word: str, choices: Iterable[str]) -> str:
    """Return a remedy that names the nearest known word and the others there are."""
    words = list(choices)
    guess = nearest(word, words)
    listed = ", ".join(f"`{choice}`" for choice in words[:20]) + ", …" * (len(words) > 20) or "nothing: there is none"
    return f"did you mean `{guess}`?" if guess else f"what can stand here: {listed}"


def quoted(value: Any) -> str:
    """Return a short quotation of a value as a study writes it."""
    match value:
        case None:
            return "nothing"
        case bool():
            return f"`{str(value).lower()}`"
        case dict():
            return "a mapping"
        case list() | tuple():
            return "a list"
    text = " ".join(str(value).split()) if isinstance(value, str) else repr(value)
    return f"`{text if len(text) <= 40 else text[:37] + '...'}`"
