"""Write TRUTH.md: every number here beside the one that is known.

    python studies/truth/truth_page.py

It runs every scene anew, which takes a minute, and ends with status 1 where a number is off. ``tests/truth`` computes
the same rows and compares them with the page.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence

import workflow

workflow.pin()

import closed_forms  # noqa: F401  # each registers its scenes
import other_programs  # noqa: F401
from comparison import COMPARISONS, TRUTH, Comparison, Row

PAGE = TRUTH / "TRUTH.md"
HEAD = """# Truth

What is known from elsewhere, computed again: {numbers} numbers of {scenes} scenes. `python studies/truth/truth_page.py`
writes this page; the tests compute each number anew and fail where one is off. Who has another program finds all data
in the studies.

- *known*: the closed form, or what was published or made by another program;
- *here*: what this program gives, by `event_driven`, the exact scheme, where none is named;
- *allowed*: the largest difference with which the tests pass, and *decides*: what makes it.
"""


def link(study: str) -> str:
    """Return the link to a study, from the page."""
    place, _, name = study.partition("/")
    directory = {"truth": "", "hard": "../hard/"}.get(place)
    return f"`{name}`" if directory is None else f"[{name}.yaml]({directory}{name}.yaml)"


def line(row: Row) -> str:
    """Return a row of the table."""
    numbers = (f"{row.known:.10g}", f"{row.here:.10g}", f"{abs(row.here - row.known):.1e}", f"{row.allowed:.1e}")
    return f"| {row.what} | {' | '.join(numbers)} | {row.decides} |"


def section(comparison: Comparison, rows: list[Row]) -> Iterator[str]:
    """Return the lines of a section of the page."""
    yield f"\n## {comparison.title}\n"
    yield f"{comparison.text}\n"
    studies = ", ".join(map(link, comparison.studies))
    yield f"Source: {comparison.source}." + (f" Studies: {studies}.\n" if studies else "\n")
    yield "| what | known | here | difference | allowed | decides |"
    yield "|---|---:|---:|---:|---:|---|"
    yield from map(line, rows)


def page(computed: Sequence[tuple[Comparison, list[Row]]]) -> str:
    """Return the page of comparisons with their rows."""
    count = sum(len(rows) for _, rows in computed)
    sections = (text for comparison, rows in computed for text in section(comparison, rows))
    return HEAD.format(numbers=count, scenes=len(computed)) + "\n".join(sections) + "\n"


def main() -> int:
    """Write the page; 1 where a number is off."""
    computed = [(comparison, comparison.rows()) for comparison in COMPARISONS]
    PAGE.write_text(page(computed), encoding="utf-8")
    off = [(comparison.title, row) for comparison, rows in computed for row in rows if not row.agrees]
    for title, row in off:
        print(f"{title}: {row}", file=sys.stderr)
    return 1 if off else 0


if __name__ == "__main__":
    sys.exit(main())
