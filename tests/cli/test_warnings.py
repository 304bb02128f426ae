"""What a person is warned of, before a run by ``plan`` and after it by every command that shows results."""

import json
from pathlib import Path

import pytest
import xarray as xr

from studies import BLADE_SCENE, written
from terminal import workflow

RUB = f"study: rub{BLADE_SCENE}axes: {{scheme: event_driven, alpha: [0, 1, 30]}}\n"
RUB = RUB.replace("nodes: 20", "nodes: 30, tip_cell: 60 um").replace("gap: 20 um", "gap: 15 um")


def test_what_only_results_show_is_told_of_them(tmp_path: Path) -> None:
    """``run``, ``show`` and the page name the hottest case and the least settled; ``plan`` cannot know them."""
    study = written(RUB, tmp_path)
    planned = workflow("plan", study, cwd=tmp_path).stdout
    assert " 1000 K" not in planned
    assert "settled" not in planned
    ran, again = (workflow("run", study, cwd=tmp_path).stdout for _ in range(2))
    shown, shown_as_json = workflow("show", "rub.nc", cwd=tmp_path), workflow("show", "rub.nc", "--json", cwd=tmp_path)
    hot, unsettled = json.loads(shown_as_json.stdout)["warnings"]
    assert hot.startswith("1 of 3 ok cases are hotter than 1000 K, above which a linear model means nothing")
    assert hot.endswith("K: alpha = 30")
    assert " of 3 ok cases have not settled: " in unsettled
    assert all(f"  beware: {warning}\n" in text for text in (ran, again) for warning in (hot, unsettled))
    assert shown.stdout.splitlines()[1:3] == [f"  beware: {warning}" for warning in (hot, unsettled)]
    workflow("report", "rub.nc", cwd=tmp_path)
    page = (tmp_path / "rub.html").read_text(encoding="utf-8")
    assert all(f"<p>Beware: {warning}.</p>" in page.split("<h2>")[0] for warning in (hot, unsettled))


def test_a_run_repeats_what_plan_warns_of(tmp_path: Path) -> None:
    """A gap of 5 m that was meant in um: after a run, and where there is nothing left to do."""
    study = written(RUB.replace("15 um", "5"), tmp_path)
    planned = json.loads(workflow("plan", study, "--json", cwd=tmp_path).stdout)["warnings"]
    assert [line[:31] for line in planned] == ["the tip cannot reach the casing"]
    ran, again, shown = (
        workflow(*words, cwd=tmp_path).stdout for words in (("run", study), ("run", study), ("show", "rub.nc"))
    )
    assert [line for text in (ran, again, shown) for line in text.splitlines()[1:2]] == [f"  beware: {planned[0]}"] * 3
    with xr.open_dataset(tmp_path / "rub.nc") as archive:
        assert archive.attrs["warnings"].splitlines() == planned
    workflow("report", "rub.nc", cwd=tmp_path)
    assert f"<p>Beware: {planned[0]}.</p>" in (tmp_path / "rub.html").read_text(encoding="utf-8").split("<h2>")[0]


def test_a_run_repeats_at_most_ten_lines(tmp_path: Path) -> None:
    springs = ", ".join(f"spring_{k}: {{method: penalty, stiffness: {k}.0e4}}" for k in range(1, 15))
    axes = f"schemes: {{{springs}}}\naxes: {{scheme: [{', '.join(f'spring_{k}' for k in range(1, 15))}], h: 1e-5}}\n"
    scene = RUB.split("axes")[0].replace("2 s", "20 ms").replace("nodes: 30, tip_cell: 60 um", "nodes: 6")
    study = written(f"{scene}{axes}output: {{interval: 1 ms}}\n", tmp_path)
    planned = json.loads(workflow("plan", study, "--json", cwd=tmp_path).stdout)["warnings"]
    ran = workflow("run", study, cwd=tmp_path).stdout
    beware = [line.removeprefix("  beware: ") for line in ran.splitlines() if "beware: " in line]
    assert len(planned) == 14
    assert beware == [*planned[:9], "… and 5 more, which `workflow plan` names"]


def test_what_cannot_be_judged_ends_no_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A foreign scheme's amplification may raise, which no case needs."""

    def raises(*_: object) -> None:
        raise ValueError("no such step")

    monkeypatch.setattr("workflow.schemes.moreau.amplification", raises)
    study = written(RUB.replace("event_driven", "moreau, h: 1e-3"), tmp_path)
    ran = workflow("run", study, cwd=tmp_path)
    assert ran.returncode == 0
    assert "beware: warnings could not be determined: ValueError: no such step" in ran.stdout


def test_plan_says_that_steady_rubs_need_the_exact_scheme(tmp_path: Path) -> None:
    output = "\noutput: {steady: true}\n"
    for scheme, told in (("moreau, h: 1e-5", True), ("event_driven", False)):
        study = written(RUB.replace("event_driven", scheme) + output, tmp_path)
        warnings = json.loads(workflow("plan", study, "--json", cwd=tmp_path).stdout)["warnings"]
        assert any("only that one has steady rubs" in warning for warning in warnings) == told, warnings
