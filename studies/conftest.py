"""Notebooks are tests; one whose metadata says ``"slow": true`` takes ten seconds and more."""

from __future__ import annotations

import json

import pytest


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.suffix == ".ipynb" and json.loads(item.path.read_text(encoding="utf-8"))["metadata"].get("slow"):
            item.add_marker(pytest.mark.slow)
