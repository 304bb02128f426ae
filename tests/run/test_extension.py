"""An archive grows with its study, and failures are asked for again: only what is new is run, to the same bits."""

from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

import workflow.run._study as studying
from quick import counted, hashes_of, interrupted, quick, room_for, same_values
from studies import cut_finely, solve_all
from workflow.analysis import failures
from workflow.archive import ArchiveError, _provenance, content_hash, open_archive, parts_of, provenance, stored_hashes
from workflow.cases import arrange
from workflow.plan import _template
from workflow.run import run_study
from workflow.schemes import Status
from workflow.solve import _solve
from workflow.study import Study


def from_nothing(study: Study, directory: Path) -> str:
    archive = directory / "from_nothing.nc"
    archive.unlink(missing_ok=True)
    run_study(study, archive, threads=1)
    return content_hash(archive)


def check_extension(old: Study, new: Study, directory: Path) -> None:
    """Extend the archive of one study to another and compare with the other from nothing."""
    archive = directory / "a.nc"
    archive.unlink(missing_ok=True)
    run_study(old, archive, threads=1)
    before = set(hashes_of(old))
    fresh = [case for case in hashes_of(new) if case not in before]
    with counted() as solved:
        outcome = run_study(new, archive, threads=1, drop=True)
    assert sum(map(len, solved)) == len(set(fresh))
    assert outcome.resumed == len(hashes_of(new)) - len(fresh)
    assert sorted(entry.name for entry in directory.iterdir() if entry.name != "from_nothing.nc") == ["a.nc"]
    assert content_hash(archive) == provenance(archive)["content_hash"] == from_nothing(new, directory)
    assert hashes_of(new) == [row.tobytes() for row in stored_hashes(archive)]


def values(of: list[float], least: int = 1) -> st.SearchStrategy[list[float]]:
    return st.lists(st.sampled_from(of), min_size=least, max_size=len(of), unique=True)


@st.composite
def grids(draw: st.DrawFn) -> dict[str, Any]:
    """Axes and parts of a small study that has at least e = 0.5, alpha = 5, h = 1e-4 and 1 kHz in it."""

    def axis(value: float, others: list[float]) -> Any:
        drawn = draw(st.permutations([value, *draw(values(others, 0))]))
        return drawn[0] if len(drawn) == 1 and draw(st.booleans()) else drawn

    axes: dict[str, Any] = {"h": axis(1e-4, [2e-4, 5e-5])}
    parts: dict[str, Any] = {}
    frequencies = axis(1000.0, [0.0, 500.0, 2000.0])
    if draw(st.booleans()):
        pairs = draw(
            st.permutations([(0.5, 5.0), *draw(st.lists(st.sampled_from([(0.0, 5.0), (0.9, 50.0)]), unique=True))])
        )
        axes |= {"e": None, "alpha": None}
        parts["zip"] = {"pair": {"e": [e for e, _ in pairs], "alpha": [alpha for _, alpha in pairs]}}
    else:
        axes |= {"e": axis(0.5, [0.0, 0.9]), "alpha": axis(5.0, [0.0, 20.0, 50.0])}
    axes["scene.load.frequency"] = frequencies
    order = draw(st.permutations(list(axes)))
    parts["axes"] = {name: axes[name] for name in order}
    return parts


DRAWN = {"old": grids(), "new": grids()} | dict.fromkeys(("narrow", "fewer", "referred", "cut"), st.booleans())


@settings(max_examples=3, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(**DRAWN)
def test_any_study_from_any_other(
    old: dict[str, Any], new: dict[str, Any], narrow: bool, fewer: bool, referred: bool, cut: bool
) -> None:
    both: dict[str, Any] = {"reference": {"scheme": "moreau", "h": 2e-5}} if referred else {}
    output = {"precision": "float32"} if narrow else {}
    output |= {"histories": ["displacement"]} if fewer else {}
    with TemporaryDirectory() as directory, pytest.MonkeyPatch.context() as patch:
        if cut:
            cut_finely(patch)
        check_extension(quick(**old, **both), quick(**new, **both, output=output), Path(directory))


@pytest.mark.slow
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(**DRAWN)
def test_many_studies_from_many_others(**drawn: Any) -> None:
    test_any_study_from_any_other.hypothesis.inner_test(**drawn)  # type: ignore[attr-defined]


STEPS = {
    "a value more": ({}, {"axes": {"e": [0.0, 0.5, 0.7, 0.9]}}),
    "a value less": ({}, {"axes": {"e": [0.0, 0.9]}}),
    "another order": ({}, {"axes": {"e": [0.9, 0.0, 0.5], "alpha": [50.0, 0.0, 5.0]}}),
    "a new axis": ({}, {"axes": {"scene.casing.gap": [20e-6, 15e-6]}}),
    "an axis less": ({}, {"axes": {"e": 0.5}}),
    "a scheme with metrics of its own": ({}, {"axes": {"scheme": ["moreau", "penalty"]}}),
    "that scheme less": ({"axes": {"scheme": ["moreau", "penalty"]}}, {}),
    "load periods where there were none": (
        {"scene": {"load.frequency": 0.0}},
        {"axes": {"scene.load.frequency": [0.0, 1000.0]}},
    ),
    "one case of all": ({}, {"axes": {"e": 0.5, "alpha": 5.0}}),
    "all of one case": ({"axes": {"e": 0.5, "alpha": 5.0}}, {}),
    "a grid as a zip": (
        {"axes": {"e": [0.0, 0.5], "alpha": [0.0, 5.0, 50.0]}},
        {"axes": {"e": None, "alpha": None}, "zip": {"p": {"e": [0.0] * 3 + [0.5] * 3, "alpha": [0.0, 5.0, 50.0] * 2}}},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("old", "new"), STEPS.values(), ids=STEPS.keys())
def test_steps_from_a_study_to_its_next(
    old: dict[str, Any], new: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With partial chunks at the end of rows."""
    monkeypatch.setattr(_template, "CHUNK_BYTES", 8 * 9 * 2)
    check_extension(quick(**old), quick(**new), tmp_path)


STUDIES = [quick({"e": e, "alpha": [0.0, 5.0, 50.0]}) for e in ([0.0, 0.5], [0.5, 0.9, 0.2], [0.0, 0.2, 0.5, 0.9])]


@pytest.mark.parametrize("seed", range(2))
def test_whatever_was_interrupted_before(seed: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Extensions, retries, runs anew and narrowed ones, each stopped after some shards or none: one content."""
    cut_finely(monkeypatch)
    archive, random = tmp_path / "a.nc", np.random.default_rng(seed)
    for _ in range(8):
        study = STUDIES[random.integers(len(STUDIES))]
        options = [{}, {"retry": True}, {"recompute": True}][random.integers(3)]
        with suppress(ArchiveError), room_for(int(random.integers(5))):
            run_study(study, archive, threads=1, drop=True, **options)
        if archive.exists():
            assert content_hash(archive) == provenance(archive)["content_hash"]
    expected = {
        case: values for study in STUDIES for case, values in zip(hashes_of(study), of_cases(study), strict=True)
    }
    for study in (*STUDIES, STUDIES[-1]):
        with counted() as solved:
            outcome = run_study(study, archive, threads=1, drop=True)
        assert sum(map(len, solved)) + outcome.resumed == len(hashes_of(study))
        with open_archive(archive) as data:
            assert [expected[case] for case in hashes_of(study)] == data["contact_impulse"].values.ravel().tolist()
    assert solved == []
    assert content_hash(archive) == from_nothing(STUDIES[-1], tmp_path)
    assert sorted(entry.name for entry in tmp_path.iterdir()) == ["a.nc", "from_nothing.nc"]


def of_cases(study: Study) -> list[float]:
    """Return the contact impulse of each case."""
    return [value for solved in solve_all(study.text) for value in solved.values["contact_impulse"].tolist()]


def test_a_title_is_changed_without_running_anything(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(), archive)
    before = content_hash(archive)
    with counted() as solved:
        assert run_study(quick(title="Renamed"), archive).resumed == 9
    assert solved == []
    assert content_hash(archive) == before
    with open_archive(archive) as data:
        assert data.attrs["title"] == "Renamed"


def test_the_error_of_the_reference_is_that_of_the_study_as_it_is_now(tmp_path: Path) -> None:
    """It is of the worst corner of the scene, which an axis that grows moves."""
    auto = {"scheme": "event_driven", "mechanical_modes": "auto", "thermal_modes": "auto", "tolerance": 0.02}
    old, new = (
        quick({"e": 0.0, "alpha": alphas}, scene={"chain.nodes": 4}, reference=auto)
        for alphas in ([0.0, 20.0], [0.0, 20.0, 40.0])
    )
    [before], [now] = (arrange(study).choices.values() for study in (old, new))
    assert before.counts == now.counts
    assert before.error != now.error
    check_extension(old, new, tmp_path)


def test_orbits_of_other_samples_leave_the_cases_of_other_schemes(tmp_path: Path) -> None:
    axes = {"scheme": ["event_driven", "moreau"], "e": 0.5, "alpha": 0.0}
    fine, coarse = (quick(axes, output={"steady": {"samples": samples}}) for samples in (20, 10))
    check_extension(fine, coarse, tmp_path)
    check_extension(coarse, fine, tmp_path)


def refused(study: Study, archive: Path, match: str) -> None:
    before = archive.read_bytes()
    for retry in (False, True):
        with pytest.raises(ArchiveError, match=match):
            run_study(study, archive, retry=retry)
    assert archive.read_bytes() == before
    assert [e.name for e in archive.parent.iterdir() if e.suffix != ".parts"] == [archive.name]


def test_what_cannot_be_extended_is_refused(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(output={"precision": "float32"}), archive)
    refused(quick(study="other"), archive, "another study, 'quick' and not 'other'")
    refused(quick(scene={"casing.gap": 1e-5}), archive, "none of its cases is asked for by this study .* --drop")
    refused(quick(), archive, "without displacement as float64, contact_force as float64")
    refused(quick(output={"histories": ["velocity"]}), archive, "without velocity")
    run_study(quick(output={"histories": ["velocity"]}), archive, recompute=True)
    with open_archive(archive) as data:
        assert "velocity" in data


def test_nothing_is_taken_from_a_damaged_archive(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(), archive)
    with h5py.File(archive) as file:
        place = file["provenance/case_hash"].id.get_chunk_info(0).byte_offset
    image = bytearray(archive.read_bytes())
    image[place + 3] ^= 1
    archive.write_bytes(image)
    refused(quick({"e": [0.0, 0.1]}), archive, "damaged, its bytes are not those that were written")
    run_study(quick({"e": [0.0, 0.1]}), archive, recompute=True, drop=True)


@pytest.fixture
def broken(monkeypatch: pytest.MonkeyPatch) -> set[float]:
    """Values of alpha whose cases raise."""
    alphas = {5.0}
    run = _solve.run_batch

    def failing(cell: Any, cases: Any, sampling: Any, **asked: Any) -> Any:
        if set(cases.alpha.tolist()) & alphas:
            raise FloatingPointError("the blade is gone")
        return run(cell, cases, sampling, **asked)

    monkeypatch.setattr(_solve, "run_batch", failing)
    return alphas


@pytest.fixture
def solved() -> Iterator[list[list[int]]]:
    with counted() as asked:
        yield asked


def test_only_what_failed_is_run_again(tmp_path: Path, broken: set[float], solved: list[list[int]]) -> None:
    archive = tmp_path / "a.nc"
    outcome = run_study(quick(), archive)
    assert not outcome.ok
    assert outcome.counts == {"ok": 6, "failed": 3}
    assert failures(outcome.dataset)[0].message == "FloatingPointError: the blade is gone"
    with open_archive(archive) as data:
        before = data.load()
    solved.clear()
    assert run_study(quick(), archive).resumed == 9  # without --retry a failure is a result
    assert solved == []
    assert run_study(quick(), archive, retry=True).counts == {"ok": 6, "failed": 3}
    assert sum(map(len, solved)) == 3
    broken.clear()
    outcome = run_study(quick(), archive, retry=True)
    assert (outcome.ok, outcome.resumed) == (True, 6)
    assert sum(map(len, solved)) == 6
    with open_archive(archive) as data:
        for name in before.data_vars:
            kept = [before[name].sel(alpha=[0.0, 50.0]).values, data[name].sel(alpha=[0.0, 50.0]).values]
            assert name == "message" or same_values(*kept)
        assert set(data["message"].values.ravel()) == {""}
    run_study(quick(), tmp_path / "b.nc")
    assert content_hash(archive) == content_hash(tmp_path / "b.nc")


@pytest.mark.parametrize("finely", [False, True])
def test_a_failed_case_has_no_value_of_another_s(
    finely: bool, tmp_path: Path, broken: set[float], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither of its neighbours nor of the archive that was extended."""
    if finely:
        cut_finely(monkeypatch)
    archive = tmp_path / "a.nc"
    run_study(quick({"alpha": [0.0, 50.0]}), archive)
    run_study(quick({"alpha": [0.0, 5.0, 50.0]}), archive)
    with open_archive(archive) as data:
        assert (data["status"].sel(alpha=5.0) == Status.FAILED).all()
        assert (data["status"].sel(alpha=[0.0, 50.0]) == Status.OK).all()
        for name, variable in data.data_vars.items():
            if variable.dtype.kind == "f":
                assert variable.sel(alpha=5.0).isnull().all(), name
        assert np.isfinite(data["contact_impulse"].sel(alpha=[0.0, 50.0])).all()


def test_failures_of_an_archive_that_is_extended_stay_until_they_are_retried(
    tmp_path: Path, broken: set[float], solved: list[list[int]]
) -> None:
    archive = tmp_path / "a.nc"
    run_study(quick(), archive)
    broken.clear()
    solved.clear()
    outcome = run_study(quick({"e": [0.0, 0.5, 0.9, 1.0]}), archive)
    assert outcome.counts == {"ok": 9, "failed": 3}
    assert sum(map(len, solved)) == 3
    assert failures(outcome.dataset)[0].message == "FloatingPointError: the blade is gone"
    outcome = run_study(quick({"e": [0.0, 0.5, 1.0]}), archive, retry=True, drop=True)
    assert outcome.ok
    assert sum(map(len, solved)) == 3 + 2


@pytest.mark.parametrize("again", [{"retry": True}, {"recompute": True}], ids=["retry", "recompute"])
def test_what_was_stored_before_the_program_was_edited_is_run_again(
    again: dict[str, bool], tmp_path: Path, broken: set[float], solved: list[list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    cut_finely(monkeypatch, 1 if "retry" in again else None)
    archive = tmp_path / "a.nc"
    run_study(quick(), archive)
    interrupted(quick(), archive, 2, **again)
    broken.clear()
    solved.clear()
    monkeypatch.setattr(_provenance, "code_revision", lambda: "edited")
    assert run_study(quick(), archive, threads=1, **again).ok  # type: ignore[arg-type]
    assert sum(map(len, solved)) == (3 if "retry" in again else 9)


@pytest.mark.parametrize("again", [{"retry": True}, {"recompute": True}], ids=["retry", "recompute"])
def test_shards_of_a_run_that_was_killed_before_it_removed_them_are_not_taken_again(
    again: dict[str, bool], tmp_path: Path, broken: set[float], solved: list[list[int]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """The archive was in place, its shards not yet removed, and what was retried has failed once more."""
    archive = tmp_path / "a.nc"
    run_study(quick(), archive)

    def killed(parts: Path) -> None:
        raise SystemExit(9)

    with monkeypatch.context() as patch:
        patch.setattr(studying.archive, "remove_parts", killed)
        with pytest.raises(SystemExit):
            run_study(quick(), archive, **again)  # type: ignore[arg-type]
    assert list(parts_of(archive).glob("*.shard"))
    broken.clear()
    solved.clear()
    assert run_study(quick(), archive, **again).ok  # type: ignore[arg-type]
    assert sum(map(len, solved)) == (3 if "retry" in again else 9)
    assert not parts_of(archive).exists()
