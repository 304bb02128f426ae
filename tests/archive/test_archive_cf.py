"""CF-1.11 as the IOOS compliance checker judges it, offline: no finding in its report."""

import json
import socket
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray as xr
from archive_samples import make_archive, sample_results, sample_template

from studies import SINGLE, SMALL, parsed
from workflow.archive import content_hash, study_key
from workflow.run import run_study

FINDINGS = ("high_priorities", "medium_priorities", "low_priorities")


@pytest.fixture(autouse=True)
def _offline(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise OSError("the checker went on line")

    monkeypatch.setattr(socket.socket, "connect", refuse)


def report(path: Path) -> dict[str, Any]:
    """Run the checker; its packaged table of standard names is used, as none is named in the file.

    Its exit status is 2 for any dimension of strings, so the report alone counts.
    """
    file = path.with_suffix(".json")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        from compliance_checker.runner import CheckSuite, ComplianceChecker

        CheckSuite.load_all_available_checkers()
        ComplianceChecker.run_checker(
            str(path), ["cf:1.11"], 0, "strict", output_filename=str(file), output_format="json"
        )
    content: dict[str, Any] = json.loads(file.read_text())["cf:1.11"]
    return content


def findings(content: dict[str, Any]) -> list[Any]:
    faults = [
        (entry["name"], entry["msgs"])
        for level in FINDINGS
        for entry in content[level]
        if entry["msgs"] or entry["value"][0] != entry["value"][1]
    ]
    if content["scored_points"] != content["possible_points"]:
        faults.append(("points", content["scored_points"]))
    return faults


LABELLED = SMALL.replace("h: [1e-4, 2e-4]", "scheme: [moreau, event_driven]").replace(
    "1 ms,", "1 ms, precision: float32,"
)


@pytest.mark.parametrize("text", [SMALL, LABELLED, SINGLE], ids=["numbers", "texts", "one cell"])
def test_the_checker_finds_nothing(tmp_path: Path, text: str) -> None:
    run_study(parsed(text), tmp_path / "a.nc")
    content = report(tmp_path / "a.nc")
    assert content["possible_points"] > 100
    assert findings(content) == []


def test_no_licence_is_written_that_a_study_does_not_state(tmp_path: Path) -> None:
    run_study(parsed(SINGLE), tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        assert "license" not in dataset.attrs
    before = content_hash(tmp_path / "a.nc")
    run_study(parsed(SINGLE + "license: CC-BY-4.0\n"), tmp_path / "a.nc")  # nothing is run for it, nor asked for
    with xr.open_dataset(tmp_path / "a.nc") as dataset:
        assert dataset.attrs["license"] == "CC-BY-4.0"
    assert content_hash(tmp_path / "a.nc") == before
    assert findings(report(tmp_path / "a.nc")) == []


def test_what_the_checker_does_not_ask(tmp_path: Path) -> None:
    template = sample_template()
    path = make_archive(tmp_path / "a.nc", template, sample_results(template))
    with netCDF4.Dataset(path) as file:
        assert file.getncattr("Conventions") == "CF-1.11"
        assert {"title", "summary", "license", "history"} <= set(file.ncattrs())
        for name in template.coords:
            assert "_FillValue" not in file[name].ncattrs()
            assert "long_name" in file[name].ncattrs()
        for name, variable in template.data_vars.items():
            stored = file[name]
            filters = stored.filters()
            assert (filters["zlib"], filters["complevel"], filters["shuffle"]) == (True, 1, True)
            assert ("_FillValue" in stored.ncattrs()) == (variable.dtype != "i1")
            assert stored.getncattr("coordinates").split() == ["scheme", "h", "lumping"]
        assert np.isnan(file["impacts"].getncattr("_FillValue"))
        assert file["status"].getncattr("flag_values").dtype == np.int8
    with xr.open_dataset(path) as dataset:
        assert dataset["processor_time"].dtype == float  # seconds, not a timedelta
        assert dataset["t"].dtype == float


def test_a_study_is_the_same_however_its_axes_are_described() -> None:
    study = parsed(SMALL)
    axes = tuple(replace(axis, description="in other words") for axis in study.scalars)
    groups = tuple(
        replace(group, axes=tuple(replace(axis, description="as well") for axis in group.axes))
        for group in study.dimensions
    )
    assert study_key(replace(study, scalars=axes, dimensions=groups)) == study_key(study)
    assert study_key(replace(study, scalars=axes[1:])) != study_key(study)
