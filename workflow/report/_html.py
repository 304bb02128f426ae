"""Pages from a template: tables, pictures, style.

What stands in a page comes from files: it is data, and jinja2 escapes it on its way into the page.
"""

from __future__ import annotations

import base64
import hashlib
import io
import re
import zlib
from collections.abc import Sequence
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from workflow.plots import MADE_BY, write_figure

TIGHT = 20
"""Letters of a cell that is not broken over lines."""

_POLICY = (
    "default-src 'none'; img-src data:; style-src 'unsafe-inline'; connect-src 'none'; base-uri 'none'; "
    "form-action 'none'"
)
"""Content-Security-Policy: nothing is fetched, pictures and styles stand in the page, no script runs but by its hash.

Bokeh needs no ``unsafe-eval``: it makes functions of texts only where a figure carries code (``CustomJS``), and none
here does. It sets styles of its own, hence ``unsafe-inline`` for them.
"""

_INVALID = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069\ud800-\udfff]")
"""Control characters but tab and line feed, changes of the order of writing, halves of a pair of surrogates."""

_FORMULA = re.compile(r"(?<=\$)(?=\$)|(?<=\\)(?=[\[(])")
"""Between the two signs with which TeX begins a formula."""


def valid(value: Any) -> Any:
    """Return a value of the page, a text without characters that are none of it."""
    return _INVALID.sub("", value) if isinstance(value, str) and not isinstance(value, Markup) else value


def prose(text: str) -> Markup:
    """Return a text as markup in which what stands between backticks is code."""
    parts = valid(text).split("`")
    return Markup("").join(Markup("<code>{}</code>").format(p) if k % 2 else escape(p) for k, p in enumerate(parts))


def kind(cell: str) -> str:
    """Return how a cell of a table is set: numbers to the right, what is short on one line."""
    number = cell.replace(".", "").replace("e", "").replace("-", "").replace("+", "").rstrip(" %").isdigit()
    return "number" if number else "tight" if len(cell) <= TIGHT else ""


_TEMPLATES = Environment(
    autoescape=True,
    finalize=valid,
    loader=PackageLoader("workflow.report", "."),
    lstrip_blocks=True,
    trim_blocks=True,
    undefined=StrictUndefined,
)
_TEMPLATES.filters |= {"prose": prose, "kind": kind}


def page(title: str, scripts: Sequence[str] = (), **values: Any) -> str:
    """Return a whole page, ``page.html`` with some values; only the scripts given run."""
    if any("</script" in script.lower() for script in scripts):
        raise ValueError("a script of the page holds the end of a script")
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    text = _TEMPLATES.get_template("page.html").render(
        title=title,
        policy=Markup(_POLICY + ("; script-src " + " ".join(f"'sha256-{one}'" for one in hashes) if hashes else "")),
        made_by=MADE_BY,
        style=Markup(_text_of("page.css")),
        scripts=map(Markup, scripts),
        **values,
    )
    return text.strip() + "\n"


def interactive_scripts() -> list[str]:
    """Return the scripts of a page with Bokeh's figures: Bokeh's own and ``explorer.js``."""
    from bokeh.resources import Resources

    library = Resources(mode="inline", components=["bokeh", "bokeh-widgets"], log_level="error").js_raw
    return [*library, _text_of("explorer.js")]


def _text_of(name: str) -> str:
    return files("workflow.report").joinpath(name).read_text(encoding="utf-8")


def block(value: Any) -> str:
    """Return plain values and arrays as compressed JSON in base64; numbers that are not finite are null.

    Texts lose the characters that are none of a page, and what Bokeh would read as the beginning of a formula.
    """
    from pydantic_core import to_json

    text = to_json(_without_formulas(value), inf_nan_mode="null", fallback=lambda array: array.tolist())
    return base64.b64encode(zlib.compress(text, 6)).decode()


def _without_formulas(value: Any) -> Any:
    if isinstance(value, dict):
        return {_without_formulas(key): _without_formulas(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_formulas(item) for item in value]
    return _FORMULA.sub("\u2060", valid(value)) if isinstance(value, str) else value


def picture(figure: Any, about: str) -> dict[str, str]:
    """Return a figure as a PNG in base64, and what stands in its place where no picture is shown."""
    buffer = io.BytesIO()
    write_figure(figure, buffer, 130)
    return {"about": about, "png": base64.b64encode(buffer.getvalue()).decode()}


def short(value: float, form: str = ".1e") -> str:
    """Return a number in few digits, a dash where there is none."""
    if np.isnan(value):
        return "–"
    return "0" if value == 0 else "∞" if np.isinf(value) else f"{value:{form}}"
