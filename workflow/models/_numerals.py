"""Numbers in text files: each is read whole, as C or Fortran writes it, or refused with file and line.

No reader is given a text that was not checked here: SciPy's drop what follows the part of a number that they know.
"""

from __future__ import annotations

import re

from workflow.declare import NUMBER
from workflow.models._semidefinite import UnusableMatricesError

INDEX, GAP = "[0-9]+", r"[ \t]+"

_PLAIN = NUMBER.replace("[-+]?", "-?", 1)
_ANY = NUMBER.replace("[eE][-+]?", "(?:[eE][-+]?|[-+])")
"""Also with a plus, or an exponent of a sign alone, as Fortran writes one of three digits: ``1.0-103``."""

_NOT_PLAIN = re.compile(r"(?<=[0-9.])(?=[-+])|(?<![0-9.eE])(\+)")
"""Where an e belongs, or (in a group) a plus that goes."""


def in_c(text: str, row: str, what: str, name: str, line: int = 1) -> str:
    """Return a text with its numbers as every reader takes them: exponents of e, no plus before a number.

    Parameters
    ----------
    text
        Lines, each with its line feed: the last number of a file without it may be cut off. Empty ones do not count.
    row
        Regular expression of a line, in which :data:`~workflow.declare.NUMBER` stands for a number.
    what, name
        What a line is, and the file's name, for the message.
    line
        Number of the first line in the file.

    Raises
    ------
    UnusableMatricesError
        A line is another one.
    """
    plain = text.replace("D", "e").replace("d", "e")
    for number in (_PLAIN, _ANY):
        rows = re.match(rf"(?:[ \t]*+(?:{row.replace(NUMBER, number)})?[ \t]*\n)*+", plain)
        end = rows.end() if rows else 0
        if end == len(text):
            return plain if number == _PLAIN else _NOT_PLAIN.sub(lambda found: "" if found[1] else "e", plain)
    (wrong, ended, _), place = text[end:].partition("\n"), line + text.count("\n", 0, end)
    problem = f"`{name}`, line {place}: `{wrong.strip()[:60]}` is not {what}" + (not ended) * " and the end of a line"
    raise UnusableMatricesError(problem, "write numbers whole, as -1.5e-3, and all lines to their ends")
