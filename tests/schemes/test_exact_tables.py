"""Rows of the tables of the exact solver: each has its own place, and is used on its own table only."""

from __future__ import annotations

import ast
from importlib import import_module
from pathlib import Path

import pytest

from workflow.schemes import _exact

TABLES = {
    "block": {"b", "m.block", "memory.block", "regime.block"},
    "first": {"f", "m.first", "memory.first"},
    "wave": {"w", "waves", "m.waves", "load.waves", "memory.waves"},
    "state": {"y", "out", "m.now"},
    "expansion": {"sums", "d", "x.sums", "m.expansion.sums", "held.expansion.sums", "free.expansion.sums"},
}
"""The arrays that are laid out by each table."""

SIZES = {"ROWS", "COLUMNS", "WAVE", "GIVEN"}
"""Numbers of rows or columns: of all, of each wave, of those that a case gives."""


@pytest.mark.parametrize("name", TABLES)
def test_rows_have_places_of_their_own(name: str) -> None:
    table = vars(import_module(f"workflow.schemes._exact.tables.{name}"))
    rows = {word: value for word, value in table.items() if word.isupper() and word not in SIZES}
    size = table.get("ROWS", 0) + table.get("COLUMNS", 0) + table.get("WAVE", 0)
    assert sorted(rows.values()) == list(range(size))


def test_a_row_is_used_on_its_own_table_only() -> None:
    used = set()
    for source in sorted(Path(_exact.__path__[0]).glob("*.py")):
        for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
            if not isinstance(node, ast.Subscript):
                continue
            for part in ast.walk(node.slice):
                if isinstance(part, ast.Attribute) and isinstance(part.value, ast.Name) and part.value.id in TABLES:
                    array = ast.unparse(node.value)
                    assert array in TABLES[part.value.id], f"{source.name}:{node.lineno}: {ast.unparse(node)}"
                    used.add(part.value.id)
    assert used == set(TABLES)
