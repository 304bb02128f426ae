"""What `workflow run` shows while it runs: a bar in a terminal, a line every minute elsewhere."""

from __future__ import annotations

import io
import re
import threading
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

import workflow.run
from studies import ILL, SINGLE, written
from workflow.cli import _terminal, app
from workflow.cli._terminal import following
from workflow.run import Advance, Follower, run_study

SLOW = Advance(540, 204, {"diverged": 2}, 0.349, 12.4, 16.45, 125.0)


def test_a_line_comes_again_and_again_without_a_terminal(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The run waits until two lines were written; nothing of them is on the standard output."""
    lines: list[str] = []
    twice = threading.Event()

    def print_error(line: str) -> None:
        lines.append(line)
        if len([line for line in lines if "34 %" in line]) >= 2:
            twice.set()

    def slow_run(study: Any, archive: Path, threads: Any, progress: Any, **others: Any) -> Any:
        progress(SLOW)
        assert twice.wait(60)
        return run_study(study, archive, threads, progress, **others)

    assert _terminal.EVERY == 60
    monkeypatch.setattr(_terminal, "EVERY", 0.01)
    monkeypatch.setattr(_terminal, "print_error", print_error)
    monkeypatch.setattr(workflow.run, "run_study", slow_run)
    result = CliRunner().invoke(app, ["run", str(written(SINGLE, tmp_path)), "-o", str(tmp_path / "a.nc")])
    assert result.exit_code == 0
    assert "34 %" not in result.stdout
    line = next(line for line in lines if "34 %" in line)
    assert re.fullmatch(r"a\.nc: 34 %, \d:\d\d elapsed, [012]:\d\d left; 204 of 540 cases, 16/s, 2 diverged", line)


def test_a_bar_fits_in_a_terminal_and_shows_the_time_before_anything_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    for told, line in (
        ([], "0:00 elapsed"),
        ([SLOW], "34 %, 0:00 elapsed, 2:0[45] left; 204 of 540 cases, 16/s, 2 diverged"),
    ):
        screen, follower = io.StringIO(), Follower()
        console = Console(file=screen, force_terminal=True, width=80, markup=False)
        monkeypatch.setattr(_terminal, "console", lambda console=console: console)
        with following(follower, "a.nc", False):
            for advance in told:
                follower(advance)
        assert re.search(line, screen.getvalue())
        assert "failed" not in screen.getvalue()


def test_a_quiet_run_shows_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(_terminal, "EVERY", 0.0)
    words = ["run", str(written(ILL, tmp_path)), "-q", "-o", str(tmp_path / "a.nc")]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 1
    assert "elapsed" not in result.output
