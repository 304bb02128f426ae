"""Write TRUTH.md: every number here beside the one that is known.

    python studies/truth/truth_page.py

It runs every scene anew, which takes a minute, and ends with status 1 where a number is off. ``tests/truth`` computes
the same rows and compares them with the page.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence

import workflow

workflow.pin()

import closed_forms  # noqa: F401  # each registers its scenes
import other_programs  # noqa: F401
import rubs  # noqa: F401
from comparison import COMPARISONS, TOPICS, TRUTH, Comparison, Row

PAGE = TRUTH / "TRUTH.md"
HEAD = """# Truth

{numbers} numbers of {scenes} scenes that are known from other sources, computed by this program.
`python studies/truth/truth_page.py` writes this page. The tests compute each number again and fail if one is off. To
repeat a scene with another program, take the data from its study; what comes as matrices is meshed by
[structures.py](structures.py).

- *known*: the number from a closed form, a publication or another program;
- *here*: the number of this program; the scheme is `event_driven`, the exact one, if none is named;
- *allowed*: the largest difference with which the tests pass;
- *decides*: what limits the agreement.

The scenes, by physics:

{contents}
"""


def link(study: str) -> str:
    """Return the link to a study, from the page."""
    place, _, name = study.partition("/")
    directory = {"truth": "", "studies": "../", "hard": "../hard/"}.get(place)
    return f"`{name}`" if directory is None else f"[{name}.yaml]({directory}{name}.yaml)"


def line(row: Row) -> str:
    """Return a row of the table."""
    numbers = (f"{row.known:.10g}", f"{row.here:.10g}", f"{abs(row.here - row.known):.1e}", f"{row.allowed:.1e}")
    return f"| {row.what} | {' | '.join(numbers)} | {row.decides} |"


def section(comparison: Comparison, rows: list[Row]) -> Iterator[str]:
    """Return the lines of a section of the page."""
    yield f"\n### {comparison.title}\n"
    yield f"{comparison.text}\n"
    studies = ", ".join(map(link, comparison.studies))
    yield f"Source: {comparison.source}." + (f" Studies: {studies}.\n" if studies else "\n")
    yield "| what | known | here | difference | allowed | decides |"
    yield "|---|---:|---:|---:|---:|---|"
    yield from map(line, rows)


def contents() -> Iterator[str]:
    """Return the lines of the table of contents: the scenes of each topic."""
    for topic, title in TOPICS.items():
        scenes = ", ".join(f"[{each.title}](#{anchor(each.title)})" for each in COMPARISONS if each.topic == topic)
        yield f"- **{title}**: {scenes}"


def anchor(heading: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def page(computed: Sequence[tuple[Comparison, list[Row]]]) -> str:
    """Return the page of comparisons with their rows, by topic."""
    lines = []
    for topic, title in TOPICS.items():
        lines.append(f"\n## {title}")
        lines += [text for each, rows in computed if each.topic == topic for text in section(each, rows)]
    count = sum(len(rows) for _, rows in computed)
    head = HEAD.format(numbers=count, scenes=len(computed), contents="\n".join(contents()))
    return head + "\n".join(lines) + "\n"


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
