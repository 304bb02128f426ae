"""Reports of one archive and of several: what stands in them and what they refuse."""

from __future__ import annotations

from pathlib import Path

import pytest
from typer.testing import CliRunner

from studies import SCENE, parsed
from workflow.archive import ArchiveError
from workflow.cli import app
from workflow.report import duration_of, write_report
from workflow.run import run_study

REFERRED = (
    "study: referred\ntitle: Two weights and the exact solution\n"
    + SCENE
    + """
schemes: {implicit_euler: {method: moreau, theta: 1}, unstable: {method: moreau, theta: 0.3}}
axes: {scheme: [implicit_euler, unstable, event_driven], h: [5e-5, 1e-4, 2e-4], e: [0, 0.5], alpha: 2}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}
output: {interval: 1 ms, histories: []}
"""
)
PRESSED = (
    "study: pressed\ntitle: 'Pressed <tips> & heat'\n"
    + SCENE.replace("gap: 50 um", "gap: 0").replace("{amplitude: 100, frequency: 50 Hz}", "{mean: 10}")
    + """
axes: {alpha: [0, 1000, 2000]}
output: {interval: 1 ms}
"""
)


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    directory = tmp_path_factory.mktemp("archives")
    made = [directory / "referred.nc", directory / "pressed.nc"]
    run_study(parsed(REFERRED), made[0])
    run_study(parsed(PRESSED), made[1])
    return made


def test_a_report_draws_speed_against_error(archives: list[Path], tmp_path: Path) -> None:
    written = write_report(archives[0], tmp_path / "page.html")
    text = written.page.read_text(encoding="utf-8")
    assert written.figure == tmp_path / "page.png"  # speed against error, as there are no histories
    assert written.figure.stat().st_size > 10_000
    for part in ("Who stays stable", "Speed against error", "Observed orders", "What the axes do", "Errors"):
        assert f"{part}" in text, part
    assert "<span class=diverged>diverged</span>" in text
    assert "<td>unstable</td>" in text or ">unstable<" in text
    assert text.count("data:image/png;base64,") == 4


def test_a_report_draws_growth_in_permanent_contact(archives: list[Path], tmp_path: Path) -> None:
    text = write_report(archives[1], tmp_path / "page.html").page.read_text(encoding="utf-8")
    assert "Growth in permanent contact" in text
    assert "Pressed &lt;tips&gt; &amp; heat" in text
    assert "Speed against error" not in text


def test_several_archives_share_a_page(archives: list[Path], tmp_path: Path) -> None:
    written = write_report(archives, tmp_path / "joint.html")
    text = written.page.read_text(encoding="utf-8")
    assert written.figure is None
    assert "2 studies" in text
    assert text.index(">referred<") < text.index(">pressed<")
    assert "no h" in text  # theta = 0.3
    assert list(tmp_path.iterdir()) == [written.page]


def test_the_command_takes_several_archives(
    archives: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    told = CliRunner().invoke(app, ["report", *map(str, archives), "-o", "all.html"])
    assert told.exit_code == 0, told.output
    assert told.stdout.splitlines() == ["page   all.html"]
    missing = CliRunner().invoke(app, ["report", str(archives[0]), "none.nc", "-o", "other.html"])
    assert missing.exit_code == 2
    assert "none.nc: no such archive" in missing.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["all.html"]


def test_a_joint_report_never_overwrites_an_archive(archives: list[Path]) -> None:
    before = archives[1].read_bytes()
    with pytest.raises(ArchiveError, match="would be one file"):
        write_report(archives, archives[1])
    assert archives[1].read_bytes() == before


def test_the_duration_is_the_study_s(archives: list[Path]) -> None:
    assert duration_of(archives[0]) == 0.06
