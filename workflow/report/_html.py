"""Pieces of a page: tables, pictures, style.

What stands in a page comes from files: it is data and escaped, by :func:`escaped` alone, on its way into an element.
"""

from __future__ import annotations

import base64
import hashlib
import html
import io
import json
import re
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np

from workflow.analysis import json_value
from workflow.plots import MADE_BY, write_figure

STYLE = files("workflow.report").joinpath("page.css").read_text(encoding="utf-8")

THEN = " → "
"""Between the verdicts of one cell."""

TIGHT = 20
"""Letters of a cell that is not broken over lines."""

VERDICTS = ("accurate", "rough", "wrong", "gains", "diverged", "ill-posed", "failed", "stable")


_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; connect-src 'none'; base-uri 'none'; "
    "form-action 'none'"
)
"""Content-Security-Policy: nothing is fetched, pictures and styles stand in the page, no script runs but by its hash.

Bokeh needs no ``unsafe-eval``: it makes functions of texts only where a figure carries code, and none here does. It
sets styles of its own, hence ``unsafe-inline`` for them.
"""

_INVALID = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters but tab and line feed, changes of the order of writing, halves of a pair of surrogates."""

_FORMULA = re.compile(r"(?<=\$)(?=\$)|(?<=\\)(?=[\[(])")
"""Between the two signs with which TeX begins a formula."""


class Html(str):
    """Text that is markup already; :func:`escaped` and :func:`tag` alone make it."""


def escaped(text: str) -> Html:
    """Return text as markup: what is not markup yet is data, whose characters mean themselves."""
    return text if isinstance(text, Html) else Html(html.escape(_INVALID.sub("", text)))


def tag(name: str, *content: str, **attributes: str) -> Html:
    """Return an element; content and attributes that are no markup are escaped.

    Attributes are named as in HTML; ``kind`` stands for ``class``.
    """
    named = {"class" if key == "kind" else key: value for key, value in attributes.items() if value}
    words = "".join(f' {key}="{html.escape(_INVALID.sub("", value))}"' for key, value in named.items())
    return Html(f"<{name}{words}>{''.join(map(escaped, content))}</{name}>")


def prose(text: str) -> Html:
    """Return a text as markup in which what stands between backticks is code."""
    return Html("".join(tag("code", part) if k % 2 else escaped(part) for k, part in enumerate(text.split("`"))))


def paragraph(text: str) -> Html:
    """Return a paragraph."""
    return tag("p", text)


def note(text: str, **attributes: str) -> Html:
    """Return a paragraph that explains what stands beside it, in grey."""
    return tag("p", text, kind="muted", **attributes)


def page(title: str, body: Sequence[str], scripts: Sequence[str] = ()) -> str:
    """Return a whole page; whatever of the body is no markup is escaped, and only the scripts given run.

    Raises
    ------
    ValueError
        A script would end its own element.
    """
    if any("</script" in script.lower() for script in scripts):
        raise ValueError("a script of the page holds the end of a script")
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    policy = _POLICY + ("; script-src " + " ".join(f"'sha256-{one}'" for one in hashes) if hashes else "")
    return (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        f'<meta http-equiv="Content-Security-Policy" content="{policy}"><meta name="generator" content="{MADE_BY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"{tag('title', title)}<style>{STYLE}</style></head><body>"
        + "\n".join(map(escaped, body))
        + "".join(f"<script>{script}</script>" for script in scripts)
        + "</body></html>\n"
    )


def block(name: str, value: Any) -> Html:
    """Return plain values as JSON in an element that is no script and holds no markup.

    Texts lose what :func:`escaped` takes from them, and what Bokeh would read as the beginning of a formula; numbers
    that are not finite are null.
    """
    plain = json_value(value, lambda text: _FORMULA.sub("\u2060", _INVALID.sub("", text)))
    text = json.dumps(plain, allow_nan=False, separators=(",", ":"))
    for sign in "<>&":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return tag("script", Html(text), id=name, type="application/json")


def image(figure: Any, about: str) -> Html:
    """Return a figure as an inlined PNG."""
    buffer = io.BytesIO()
    write_figure(figure, buffer, 130)
    data = base64.b64encode(buffer.getvalue()).decode()
    return tag("div", Html(f'<img alt="{escaped(about)}" src="data:image/png;base64,{data}">'), kind="scroll")


def table(head: Sequence[str], rows: Sequence[Sequence[str]], new: Sequence[bool] = ()) -> Html:
    """Return a table; numbers to the right, verdicts coloured, a line above each ``new`` row."""
    top = tag("tr", *(tag("th", text) for text in head))
    body = (tag("tr", *map(_cell, row), kind="new" if k < len(new) and new[k] else "") for k, row in enumerate(rows))
    return tag("div", tag("table", top, *body), kind="scroll")


def _cell(text: str) -> Html:
    number = text.replace(".", "").replace("e", "").replace("-", "").replace("+", "").rstrip(" %").isdigit()
    parts = text.split(THEN)
    words = [part.split(maxsplit=1)[0] if part else "" for part in parts]
    if all(word in VERDICTS for word in words):
        spans = [tag("span", part, kind=word) for word, part in zip(words, parts, strict=True)]
        return tag("td", Html(" ".join(spans)))
    return tag("td", text, kind="number" if number else "tight" if len(text) <= TIGHT else "")


def short(value: float, form: str = ".1e") -> str:
    """Return a number in few digits, a dash where there is none."""
    if np.isnan(value):
        return "–"
    return "0" if value == 0 else "∞" if np.isinf(value) else f"{value:{form}}"
