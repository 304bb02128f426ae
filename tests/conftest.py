"""Tests mirror the package; what several of them need stands in ``scenes.py`` and ``studies.py``."""

from __future__ import annotations

import signal

import pytest


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--regenerate", action="store_true", help="write the kept archives of data/ anew")
    parser.addoption("--kills", type=int, default=30, help="how often runs are killed at random moments")


def pytest_configure() -> None:
    """Let commands under test be interrupted: jobs in the background of a shell ignore Ctrl-C, and so would they."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
