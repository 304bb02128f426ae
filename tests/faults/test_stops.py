"""Ctrl-C, SIGTERM and SIGKILL at any moment: the right exit status, one line, no traceback, nothing lost."""

from __future__ import annotations

import random
import signal
from pathlib import Path

import pytest
from stops import STUDY, outcomes, stopped

EXPECTED = {"stopped", "done", "killed", "verified"}


@pytest.mark.parametrize("after", [0, 0.03, 0.1])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_while_libraries_are_imported(number: signal.Signals, after: float, tmp_path: Path) -> None:
    study = tmp_path / "stopped.yaml"
    study.write_text(STUDY, encoding="utf-8")
    how, said = stopped(["run", study, "-o", tmp_path / "a.nc"], number, after)
    assert how == "stopped", said


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_stopped_at_a_hundred_random_moments(number: signal.Signals, tmp_path: Path) -> None:
    counts = outcomes(number, 100, random.Random(1), tmp_path)
    assert set(counts) <= EXPECTED, counts
    assert counts["stopped"] + counts["killed"] > 50
