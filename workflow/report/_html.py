"""Pieces of a page: tables, pictures, style."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Sequence
from typing import Any

import numpy as np

STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; max-width: 80rem; margin: 2rem auto; padding: 0 1rem; color: #222; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2.2rem; } h3 { font-size: 1rem; }
table { border-collapse: collapse; margin: .6rem 0; }
th, td { padding: .25rem .7rem; text-align: left; border-bottom: 1px solid #ddd; vertical-align: top; }
td.tight { white-space: nowrap; } td.number { text-align: right; font-variant-numeric: tabular-nums; }
span { padding: 0 .3rem; border-radius: .2rem; white-space: nowrap; }
.accurate { background: #cfe8f5; } .rough { background: #fdeebf; }
.wrong, .gains, .diverged, .ill-posed, .failed { background: #f6d0bc; }
img { max-width: 100%; } pre { background: #f6f6f6; padding: .8rem; overflow-x: auto; font-size: 12px; }
.muted { color: #666; } .new td { border-top: 2px solid #999; }
"""

THEN = " → "
"""Between the verdicts of one cell."""

TIGHT = 20
"""Letters of a cell that is not broken over lines."""

VERDICTS = ("accurate", "rough", "wrong", "gains", "diverged", "ill-posed", "failed", "stable")


def page(title: str, body: list[str]) -> str:
    """Return a whole page."""
    return (
        "<!doctype html><html lang='en'><head><meta charset='utf-8'>"
        f"<title>{html.escape(title)}</title><style>{STYLE}</style></head><body>" + "\n".join(body) + "</body></html>\n"
    )


def image(figure: Any, about: str) -> str:
    """Return a figure as an inlined PNG."""
    buffer = io.BytesIO()
    figure.savefig(buffer, dpi=130, format="png")
    data = base64.b64encode(buffer.getvalue()).decode()
    return f'<p><img alt="{html.escape(about)}" src="data:image/png;base64,{data}"></p>'


def table(head: Sequence[str], rows: Sequence[Sequence[str]], new: Sequence[bool] = ()) -> str:
    """Return a table; numbers to the right, verdicts coloured, a line above each ``new`` row."""
    top = "".join(f"<th>{html.escape(text)}</th>" for text in head)
    body = "".join(
        f"<tr{' class=new' if k < len(new) and new[k] else ''}>{''.join(_cell(text) for text in row)}</tr>"
        for k, row in enumerate(rows)
    )
    return f"<table><tr>{top}</tr>{body}</table>"


def _cell(text: str) -> str:
    number = text.replace(".", "").replace("e", "").replace("-", "").replace("+", "").rstrip(" %").isdigit()
    words = [part.split(maxsplit=1)[0] if part else "" for part in text.split(THEN)]
    if all(word in VERDICTS for word in words):
        spans = (f"<span class={word}>{part}</span>" for word, part in zip(words, text.split(THEN), strict=True))
        return f"<td>{' '.join(spans)}</td>"
    kind = "number" if number else "tight" if len(text) <= TIGHT else ""
    return f"<td{f' class={kind}' if kind else ''}>{html.escape(text)}</td>"


def short(value: float, form: str = ".1e") -> str:
    """Return a number in few digits, a dash where there is none."""
    if np.isnan(value):
        return "–"
    return "0" if value == 0 else "∞" if np.isinf(value) else f"{value:{form}}"
