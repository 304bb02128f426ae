"""``workflow limits``, and what other commands make of archives with steady rubs."""

from __future__ import annotations

import html
import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from steady_studies import steady_study
from workflow import run_study
from workflow.cli import app


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
    told = CliRunner().invoke(app, ["limits", str(steady), *options, "--json"])
    assert told.exit_code == status, told.output
    answer = json.loads(told.output)
    assert set(answer) == {"limits", "each", "cases", "within", "beyond"}
    assert (answer["within"] > 0) == (status == 0)
    assert {"axis", "from", "to", "next", "limited_by", "at"} == set(answer["limits"][0])


@pytest.mark.parametrize("bound", ["40 m", "-5K", "-5"])
def test_the_command_refuses(steady: Path, bound: str) -> None:
    told = CliRunner().invoke(app, ["limits", str(steady), "--max-temperature", bound])
    assert told.exit_code == 2
    assert bound.split()[0] in told.output


@pytest.mark.parametrize("bound", ["40K", "40"])
def test_the_command_says_it_in_sentences(steady: Path, bound: str) -> None:
    told = CliRunner().invoke(app, ["limits", str(steady), "--max-temperature", bound])
    assert told.exit_code == 0
    assert "alpha from 0 to 2 W/N: all cases are within; at 5 W/N the temperature exceeds 40 K" in told.output
    assert "gap = 2e-05 m: alpha from 0 to 2 W/N; at 5 W/N the temperature exceeds 40 K.\n" in told.output
    assert "5 of 8 within; 1 above the temperature, 2 runs_away." in told.output


def test_archives_without_steady_rubs_are_refused(tmp_path: Path) -> None:
    plain = run_study(steady_study({"alpha": 0}, False), tmp_path / "b.nc").archive
    told = CliRunner().invoke(app, ["limits", str(plain)])
    assert told.exit_code == 2
    assert "output: {steady: true}" in told.output


def test_the_page_begins_with_it(steady: Path, tmp_path: Path) -> None:
    told = CliRunner().invoke(app, ["limits", str(steady)]).output.splitlines()
    assert CliRunner().invoke(app, ["report", str(steady), "-o", str(tmp_path / "a.html")]).exit_code == 0
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert told[0] in html.unescape(page.split("<h2>")[1])
