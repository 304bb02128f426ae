"""A failure is a result that can be asked for again: it alone, and nothing of a neighbour's."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import workflow.run._study as studying
from quick import counted, interrupted, quick, same_values
from studies import cut_finely
from workflow.analysis import failures
from workflow.archive import _provenance, content_hash, open_archive, parts_of
from workflow.run import run_study
from workflow.schemes import Status
from workflow.solve import _solve


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
