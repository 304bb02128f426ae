"""``workflow limits``, what others make of archives with steady rubs, and what `workflow run` shows while it runs."""

import html
import io
import json
import re
import threading
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console

import workflow.run
from studies import ILL, SINGLE, steady_study, written
from terminal import told
from workflow.archive import open_archive
from workflow.cli import _terminal
from workflow.cli._terminal import following
from workflow.run import Advance, Follower, run_study


@pytest.fixture(scope="module")
def steady(tmp_path_factory: pytest.TempPathFactory) -> Path:
    axes = {"alpha": [0, 2, 5, 30], "scene.casing.gap": [20e-6, 22e-6]}
    outcome = run_study(steady_study(axes), tmp_path_factory.mktemp("limits") / "a.nc")
    assert outcome.ok  # rubs that run away are ok cases
    return outcome.archive


@pytest.mark.parametrize(
    ("options", "status"), [((), 0), (("--max-temperature", "1e-9 K", "--max-displacement", "1e-9 m"), 1)]
)
def test_the_command_answers(steady: Path, options: tuple[str, ...], status: int) -> None:
    ended, said = told("limits", steady, *options, "--json")
    assert ended == status, said
    answer = json.loads(said)
    assert set(answer) == {"limits", "each", "cases", "within", "beyond", "remarks"}
    assert (answer["within"] > 0) == (status == 0)
    ends = {"from", "to", "next", "limited_by", "previous", "begun_by"}
    assert {"axis", "at", "state"} | ends == set(answer["limits"][0])


@pytest.mark.parametrize("bound", ["40 m", "-5K", "-5"])
def test_the_command_refuses(steady: Path, bound: str) -> None:
    status, said = told("limits", steady, "--max-temperature", bound)
    assert (status, bound.split()[0] in said) == (2, True)


@pytest.mark.parametrize("bound", ["40K", "40"])
def test_the_command_says_it_in_sentences(steady: Path, bound: str) -> None:
    status, said = told("limits", steady, "--max-temperature", bound)
    assert status == 0
    assert "alpha from 0 to 2 W/N: all cases are within; at 5 W/N the temperature exceeds 40 K" in said
    assert "gap = 2e-05 m: alpha from 0 to 2 W/N; at 5 W/N the temperature exceeds 40 K.\n" in said
    assert "5 of 8 within; 1 above the temperature, 2 runs_away." in said


def test_archives_without_steady_rubs_are_judged_by_their_periods(tmp_path: Path) -> None:
    plain = run_study(steady_study({"alpha": [0, 30]}, False), tmp_path / "b.nc").archive
    with open_archive(plain) as opened:
        largest = float(abs(opened["displacement"]).sel(alpha=0).max())
    status, said = told("limits", plain)
    assert status == 0
    assert "alpha from 0 to 0 W/N: all cases are within; at 30 W/N the rub has not settled.\n1 of 2 within" in said
    assert "from this start" in said
    for share, status in ((1.01, 0), (0.5, 1)):
        assert told("limits", plain, "--max-displacement", repr(share * largest))[0] == status


def test_the_page_begins_with_it(steady: Path, tmp_path: Path) -> None:
    first = told("limits", steady)[1].splitlines()[0]
    assert told("report", steady, "-o", tmp_path / "a.html")[0] == 0
    assert first in html.unescape((tmp_path / "a.html").read_text(encoding="utf-8").split("<h2>")[1])


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
    status, said = told("run", written(SINGLE, tmp_path), "-o", tmp_path / "a.nc")
    assert (status, "34 %" in said) == (0, False)
    line = next(line for line in lines if "34 %" in line)
    assert re.fullmatch(r"a\.nc: 34 %, \d:\d\d elapsed, [012]:\d\d left; 204 of 540 cases, 16/s, 2 diverged", line)


def test_a_bar_fits_in_a_terminal_and_shows_the_time_before_anything_is_known(monkeypatch: pytest.MonkeyPatch) -> None:
    for advances, line in (
        ([], "0:00 elapsed"),
        ([SLOW], "34 %, 0:00 elapsed, 2:0[45] left; 204 of 540 cases, 16/s, 2 diverged"),
    ):
        screen, follower = io.StringIO(), Follower()
        console = Console(file=screen, force_terminal=True, width=80, markup=False)
        monkeypatch.setattr(_terminal, "console", lambda console=console: console)
        with following(follower, "a.nc", False):
            for advance in advances:
                follower(advance)
        assert re.search(line, screen.getvalue())
        assert "failed" not in screen.getvalue()


def test_a_quiet_run_shows_nothing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(_terminal, "EVERY", 0.0)
    status, said = told("run", written(ILL, tmp_path), "-q", "-o", tmp_path / "a.nc")
    assert (status, "elapsed" in said) == (1, False)
