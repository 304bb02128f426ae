"""An archive of an earlier version of the solver opens, is shown and verified; what cannot be done with it is said."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from quick import quick
from workflow.archive import ArchiveError, _provenance, open_archive, provenance
from workflow.cases import _identity
from workflow.run import _prepare, _verify, holdings, run_study
from workflow.schemes import SOLVER_VERSION
from workflow.study import Study, parse_study

NOW = 1000
"""A later version of the solver than any that is."""

STUDY = quick({"e": [0.0, 0.5], "alpha": [0.0, 1e9, 5.0]})
"""Two of its six cases are not ok."""


@pytest.fixture(scope="module")
def earlier(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("earlier") / "quick.nc"
    run_study(STUDY, path)
    return path


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
