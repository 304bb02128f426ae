"""An archive that an earlier version wrote opens, is shown and verified; what cannot be done with it is said.

``data/version_N.nc``: six cases by version N of the solver, two of them not ok. That of version 2 has messages in
characters, one set of chunks per row, and a licence that its study does not state.
"""

from __future__ import annotations

import dataclasses
import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from typer.testing import CliRunner

from workflow.archive import ArchiveError, StoredCells, _describe, content_hash, describe, open_archive, provenance
from workflow.cli import app
from workflow.grid import _identity, arrange, units_of
from workflow.run import _earlier, _verify, holdings, run_study
from workflow.study import Study, parse_study

KEPT = Path(__file__).parent / "data"
NOW = 1000
"""A later version of the solver than any that is."""


@pytest.fixture(params=sorted(path.stem.removeprefix("version_") for path in KEPT.glob("version_*.nc")))
def version(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def archive(version: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for module in (_earlier, _verify, _describe, _identity):
        monkeypatch.setattr(module, "SOLVER_VERSION", NOW)
    return Path(shutil.copy(KEPT / f"version_{version}.nc", tmp_path / "quick.nc"))


def study_of(path: Path) -> Study:
    return parse_study(provenance(path)["study"], "study.yaml")


def command(*words: str | Path) -> tuple[int, str]:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exception is None or isinstance(result.exception, SystemExit)
    return result.exit_code, result.output + result.stderr


@pytest.mark.parametrize("opened", [open_archive, xr.open_dataset])
def test_it_opens(archive: Path, opened: object) -> None:
    with opened(archive) as dataset:  # type: ignore[operator]
        assert dict(dataset.sizes) == {"e": 2, "alpha": 3, "t": 9, "period": 4}
        assert dataset["status"].values.tolist() == [[0, 2, 0]] * 2
        messages = dataset["message"].values
        assert (messages != "").tolist() == [[False, True, False]] * 2
        assert "largest admissible h" in str(messages[0, 1])
        assert dataset["contact_impulse"].sel(e=0.5, alpha=5.0) > 0


@pytest.mark.parametrize("chunks", [{}, "auto"])
def test_dask_takes_it(archive: Path, chunks: object) -> None:
    with open_archive(archive, chunks=chunks) as dataset, open_archive(archive) as plain:
        assert dataset.compute().equals(plain.compute())


def test_it_is_as_it_was_written(archive: Path, version: str) -> None:
    assert content_hash(archive) == provenance(archive)["content_hash"]
    status, text = command("verify", archive)
    assert status == 1
    assert "bytes    ok" in text
    assert "content  ok" in text
    assert f"version {version}, this is {NOW}" in text
    assert "as it was written, by another version of the solver" in text


def test_it_is_shown_and_reported(archive: Path, tmp_path: Path) -> None:
    status, text = command("show", archive)
    assert status == 0
    assert "4 ok, 2 ill_posed" in text
    assert "contact has no unique solution" in text
    assert command("report", archive, "-o", tmp_path / "page.html")[0] == 0


def test_its_cases_can_be_read_one_by_one(archive: Path) -> None:
    grid = arrange(study_of(archive))
    layout = describe(grid.study, grid, units_of(grid))
    only = tuple(v for v in layout.variables if v.name in ("status", "contact_impulse", "displacement"))
    stored_cells = StoredCells(archive, np.arange(6))
    values, messages = stored_cells.take(dataclasses.replace(layout, variables=only), np.arange(6))
    assert values["status"].tolist() == [0, 2, 0] * 2
    assert values["displacement"].shape == (6, 9)
    assert sorted(messages) == [1, 4]
    assert stored_cells.messages(np.arange(6)) == messages


def test_why_it_is_not_extended_is_said(archive: Path, version: str) -> None:
    before = archive.read_bytes()
    study = study_of(archive)
    for requested in (study, parse_study(study.text.replace("[0.0, 0.5]", "[0.0, 0.5, 0.9]"), "study.yaml")):
        reason = rf"made by version {version} of the solver, this is 1000.*--recompute.*-o"
        with pytest.raises(ArchiveError, match=reason):
            run_study(requested, archive, threads=1)
    holding = holdings(study, archive)
    assert (holding.stored, holding.missing, holding.dropped) == (0, 6, 0)
    assert f"made by version {version}" in holding.note
    assert archive.read_bytes() == before


def test_what_running_its_study_anew_would_lose_is_said(archive: Path) -> None:
    narrowed = parse_study(study_of(archive).text.replace("[0.0, 0.5]", "[0.5]"), "study.yaml")
    with pytest.raises(ArchiveError, match=r"3 of its 6 cases .*--drop"):
        run_study(narrowed, archive, threads=1, recompute=True)


def test_its_study_is_run_anew_when_it_is_asked_for(archive: Path, tmp_path: Path) -> None:
    with open_archive(archive) as dataset:
        before = dataset["contact_impulse"].load()
    run_study(study_of(archive), archive, threads=1, recompute=True)
    assert provenance(archive)["solver_version"] == str(NOW)
    with open_archive(archive) as dataset:
        assert "license" not in dataset.attrs
        again = dataset["contact_impulse"].sel(alpha=[0.0, 5.0])
        np.testing.assert_allclose(again.values, before.sel(alpha=[0.0, 5.0]).values, rtol=1e-9)
