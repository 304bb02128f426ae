"""Tests mirror the package; what several of them need stands in ``scenes.py`` and ``studies.py``."""

from __future__ import annotations

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true", help="write the kept archives of data/ anew")
    parser.addoption("--kills", type=int, default=30, help="how often runs are killed at random moments")
