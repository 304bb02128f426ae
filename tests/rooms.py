"""Writes the rooms of ARCHITECTURE.md from the first sentence of each module: ``python tests/rooms.py``."""

from __future__ import annotations

import ast
from pathlib import Path

import workflow

ROOT = Path(workflow.__file__).parent
DOCUMENT = Path(__file__).parents[1] / "ARCHITECTURE.md"
BEGIN, END = "<!-- rooms -->\n", "<!-- end of rooms -->\n"
ROOMS = (
    ("Physics", ("declare", "variables", "registry", "kernels", "models", "reduction", "schemes", "judges")),
    ("Workflow", ("study", "grid", "archive", "run", "analysis", "plots", "report", "cli")),
)
"""The two floors, each from left to right."""


def sentence(path: Path) -> str:
    """Return the first sentence of a module's docstring."""
    words = " ".join((ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or "").split("\n\n")[0].split())
    return words.split(". ")[0].rstrip(".")


def modules(room: str) -> list[Path]:
    """Return the modules of a room; a package's own docstring comes first."""
    if (ROOT / f"{room}.py").exists():
        return [ROOT / f"{room}.py"]
    return sorted((ROOT / room).rglob("*.py"), key=lambda p: (p.parent, p.name != "__init__.py", p.name))


def text() -> str:
    """Return the rooms, a table for each floor."""
    lines = []
    for floor, rooms in ROOMS:
        lines += [f"### {floor}", "", "| module | what is in it |", "|---|---|"]
        for room in rooms:
            for path in modules(room):
                place = path.relative_to(ROOT)
                name = f"**`{place.parent}/`**" if path.name == "__init__.py" else f"`{place}`"
                lines.append(f"| {name} | {sentence(path)} |")
        lines.append("")
    return "\n".join(lines)


def written() -> str:
    """Return the document with today's rooms."""
    before, rest = DOCUMENT.read_text(encoding="utf-8").split(BEGIN)
    return before + BEGIN + text() + END + rest.split(END)[1]


if __name__ == "__main__":
    DOCUMENT.write_text(written(), encoding="utf-8")
