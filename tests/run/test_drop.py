"""Stored cases that a study no longer asks for, or that an earlier version made, are never lost in silence."""

import json
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from quick import hashes_of, interrupted, quick
from studies import archived, cut_finely, written
from terminal import told
from workflow.archive import ArchiveError, _provenance, open_archive, parts_of, provenance
from workflow.cases import _identity
from workflow.run import _prepare, _verify, holdings, run_study
from workflow.schemes import SOLVER_VERSION
from workflow.study import Study, parse_study

NARROWED: dict[str, tuple[dict[str, Any], int]] = {
    "an axis shorter": ({"axes": {"e": [0.9]}}, 6),
    "an axis gone": ({"axes": {"e": 0.5}}, 6),
    "a value changed": ({"axes": {"e": [0.0, 0.5, 0.8]}}, 3),
    "two axes shorter": ({"axes": {"e": [0.0, 0.5], "alpha": [0.0, 5.0]}}, 5),
    "another scene": ({"scene": {"casing.gap": 1e-5}}, 9),
    "another interval": ({"output": {"interval": 1e-3}}, 9),
    "a reference": ({"reference": {"scheme": "moreau", "h": 2e-5}}, 9),
}


def refused(study: Study, archive: Path, text: str, **flags: bool) -> None:
    before, begun = archive.read_bytes() if archive.exists() else None, parts_of(archive).exists()
    with pytest.raises(ArchiveError, match=text) as caught:
        run_study(study, archive, threads=1, **flags)
    assert {"--drop", "-o"} <= set(str(caught.value).replace(",", "").split())
    assert (archive.read_bytes() if archive.exists() else None) == before
    assert parts_of(archive).exists() == begun  # a run that is refused leaves nothing behind


@pytest.mark.parametrize("what", NARROWED)
def test_a_run_that_would_lose_cases_is_refused(what: str, tmp_path: Path) -> None:
    parts, lost = NARROWED[what]
    study, archive = quick(**parts), tmp_path / "a.nc"
    run_study(quick(), archive, threads=1)
    for flags in ({}, {"retry": True}, {"recompute": True}):
        refused(study, archive, f"{lost} stored cases would be lost", **flags)
    count = len(hashes_of(study))
    holding = holdings(study, archive)
    assert (holding.stored, holding.missing, holding.dropped) == (9 - lost, count - 9 + lost, lost)
    assert f"{lost} stored cases would be lost" in holding.note
    outcome = run_study(study, archive, threads=1, drop=True)
    assert outcome.resumed == 9 - lost
    assert sum(outcome.counts.values()) == count
    assert run_study(study, archive, threads=1).resumed == count  # said once, not again


@pytest.mark.parametrize(
    ("narrower", "lost"),
    [
        ({"histories": []}, "contact_force, displacement"),
        ({"histories": ["displacement"]}, "contact_force"),
        ({"precision": "float32"}, "contact_force as float64, displacement as float64"),
    ],
)
def test_histories_that_a_study_no_longer_keeps_are_not_lost_in_silence(
    narrower: dict[str, Any], lost: str, tmp_path: Path
) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(), archive, threads=1)
    study = quick(output=narrower)
    refused(study, archive, f"holds {lost} of its cases, which this study no longer keeps")
    assert lost in holdings(study, archive).note
    assert run_study(study, archive, threads=1, drop=True).resumed == 9
    run_study(study, archive, threads=1)  # said once, not again
    for name in {"displacement", "contact_force"} - set(open_archive(archive).variables):
        assert name in lost


def test_what_differs_is_named(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(), archive, threads=1)
    for part, said in (
        ({"casing.gap": 1e-5}, r"scene.casing.gap: \S+ → 1e-05\)"),
        ({"chain.mass": 3e-3}, r"scene.chain.mass: \S+ → 0.003\)"),
    ):
        refused(quick(scene=part), archive, rf"\(differs in {said}")


def test_a_list_of_fewer_events_costs_no_case_without_one(tmp_path: Path) -> None:
    """The cases of moreau list no events; that a list was of another length was said to be a lack of variables."""
    archive = tmp_path / "a.nc"
    axes = {"scheme": ["event_driven", "moreau"]}
    run_study(quick(axes=axes, output={"events": 30}), archive, threads=1)
    count = len(hashes_of(quick(axes=axes)))
    for most in (20, 40):
        study = quick(axes=axes, output={"events": most})
        refused(study, archive, rf"{count // 2} of its {count} cases .*differs in output.events: \d+ → {most}\)")
    assert run_study(study, archive, threads=1, drop=True).resumed == count // 2
    assert open_archive(archive).sizes["event"] == 40


def test_what_grows_or_is_put_in_another_order_needs_no_word(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(), archive, threads=1)
    run_study(quick({"e": [0.9, 0.5, 0.0, 0.1]}), archive, threads=1)
    run_study(quick({"e": [0.9, 0.5, 0.0, 0.1]}), archive, threads=1, recompute=True)
    assert holdings(quick({"e": [0.0]}), archive).dropped == 9


def test_values_that_a_scheme_does_not_read_hold_nothing_to_lose(tmp_path: Path) -> None:
    """The exact solution does not depend on h: with one step less all of its results are still there."""
    archive = tmp_path / "a.nc"
    exact: dict[str, Any] = {"scheme": "event_driven", "e": 0.5, "alpha": 0.0}
    run_study(quick({**exact, "h": [1e-4, 2e-4]}), archive, threads=1)
    assert run_study(quick({**exact, "h": [1e-4]}), archive, threads=1).resumed == 1


def test_a_run_that_may_drop_goes_on_where_it_was_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cut_finely(monkeypatch)
    archive, study = tmp_path / "a.nc", quick({"e": [0.1, 0.2, 0.9]})
    run_study(quick(), archive, threads=1)
    interrupted(study, archive, 1, drop=True)
    outcome = run_study(study, archive, threads=1)  # --drop was given when it began
    assert outcome.resumed > 3
    with open_archive(archive) as data:
        assert data["e"].values.tolist() == [0.1, 0.2, 0.9]


def test_an_unfinished_run_without_a_case_gives_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cut_finely(monkeypatch)
    archive, narrowed = tmp_path / "a.nc", quick({"alpha": [5.0]})
    interrupted(quick(), archive, 0)
    assert parts_of(archive).exists()
    assert run_study(narrowed, archive, threads=1).counts == {"ok": 3}


def test_an_unfinished_run_of_the_study_as_it_was_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cut_finely(monkeypatch)
    archive, narrowed = tmp_path / "a.nc", quick({"alpha": [5.0]})
    interrupted(quick(), archive, 2)
    with open_archive(archive) as data:
        there = int((data["status"] != 4).sum())
        of_narrowed = int((data["status"].sel(alpha=5.0) != 4).sum())
    assert 0 < of_narrowed < there < 9
    shards = sorted(parts_of(archive).glob("*.shard"))
    refused(narrowed, archive, f"holds {there} cases of an unfinished run .* asks for {there - of_narrowed} of them")
    assert sorted(parts_of(archive).glob("*.shard")) == shards
    holding = holdings(narrowed, archive)
    assert (holding.stored, holding.missing, holding.dropped) == (of_narrowed, 3 - of_narrowed, there - of_narrowed)
    holding = holdings(quick(), archive)
    assert (holding.stored, holding.missing, holding.dropped) == (there, 9 - there, 0)
    assert run_study(narrowed, archive, threads=1, drop=True).resumed == of_narrowed
    with open_archive(archive) as data:
        assert data["alpha"].values.tolist() == [5.0]


def test_the_command_line(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    assert told("run", written(quick().text, tmp_path), "-o", archive)[0] == 0
    narrowed = written(quick({"e": [0.9]}).text, tmp_path)
    status, said = told("run", narrowed, "-o", archive)
    assert (status, "6 stored cases would be lost; --drop" in said) == (2, True)
    _, planned = told("plan", narrowed, "-o", archive)
    assert "3 stored, 0 missing, 6 no longer asked for" in planned
    assert "beware: " in planned
    assert "6 stored cases would be lost; --drop" in planned
    held = json.loads(told("plan", narrowed, "-o", archive, "--json")[1])["archive"]
    assert (held["stored"], held["missing"], held["dropped"]) == (3, 0, 6)
    assert "all of them stored before" in told("run", narrowed, "-o", archive, "--drop")[1]


NOW = 1000
"""A later version of the solver than any that is."""

STUDY = quick({"e": [0.0, 0.5], "alpha": [0.0, 1e9, 5.0]})
"""Two of its six cases are not ok."""


earlier = archived(STUDY)


@pytest.fixture
def archive(earlier: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for module in (_prepare, _verify, _provenance, _identity):
        monkeypatch.setattr(module, "SOLVER_VERSION", NOW)
    return Path(shutil.copy(earlier, tmp_path / "quick.nc"))


def study_of(path: Path) -> Study:
    return parse_study(provenance(path)["study"], "study.yaml")


def test_why_it_is_not_extended_is_said(archive: Path) -> None:
    before = archive.read_bytes()
    study = study_of(archive)
    for requested in (study, parse_study(study.text.replace("[0.0, 0.5]", "[0.0, 0.5, 0.9]"), "study.yaml")):
        reason = rf"made by version {SOLVER_VERSION} of the solver, this is 1000.*--recompute.*-o"
        with pytest.raises(ArchiveError, match=reason):
            run_study(requested, archive, threads=1)
    holding = holdings(study, archive)
    assert (holding.stored, holding.missing, holding.dropped) == (0, 6, 0)
    assert f"made by version {SOLVER_VERSION}" in holding.note
    assert archive.read_bytes() == before


def test_what_running_its_study_anew_would_lose_is_said(archive: Path) -> None:
    narrowed = parse_study(study_of(archive).text.replace("[0.0, 0.5]", "[0.5]"), "study.yaml")
    holding = holdings(narrowed, archive)
    assert (holding.stored, holding.missing, holding.dropped) == (0, 3, 3)
    with pytest.raises(ArchiveError, match=r"3 of its 6 cases .*--drop"):
        run_study(narrowed, archive, threads=1, recompute=True)


def test_its_study_is_run_anew_when_it_is_asked_for(archive: Path, tmp_path: Path) -> None:
    with open_archive(archive) as dataset:
        before = dataset["contact_impulse"].load()
    run_study(study_of(archive), archive, threads=1, recompute=True)
    assert provenance(archive)["solver_version"] == str(NOW)
    assert run_study(study_of(archive), archive, threads=1).resumed == 6
    with open_archive(archive) as dataset:
        again = dataset["contact_impulse"].sel(alpha=[0.0, 5.0])
        np.testing.assert_allclose(again.values, before.sel(alpha=[0.0, 5.0]).values, rtol=1e-9)
