"""Scenes of an independent audit: event solver in 80-bit arithmetic, or closed forms."""

from __future__ import annotations

from pathlib import Path

import pytest
import xarray as xr

from workflow import read_study, run_study
from workflow.schemes import Status

SCENES = Path(__file__).parent / "audit"


def solved(name: str, tmp_path: Path, **settings: object) -> xr.Dataset:
    """Run a scene of the audit."""
    study = read_study(SCENES / f"{name}.yaml").with_(settings)
    return run_study(study, tmp_path / "x.nc", threads=1).dataset.load()


def test_the_hottest_moment_of_a_held_tip_whose_poles_are_all_complex(tmp_path: Path) -> None:
    archive = solved("hottest_moment", tmp_path).sel(scheme="event_driven")
    assert float(archive["max_temperature"].squeeze()) == pytest.approx(6.521667013224, rel=1e-9)
    assert float(archive["temperature"].isel(t=-1).squeeze()) == pytest.approx(5.697016726177, rel=1e-9)


def test_a_state_that_leaves_the_numbers_ends_its_case(tmp_path: Path) -> None:
    """Growth rate times duration is 943: the exponential overflows."""
    archive = solved("never_ends", tmp_path)
    assert int(archive["status"]) == int(Status.DIVERGED)
    assert int(archive["runaway"]) == 1
    assert "left the finite numbers" in str(archive["message"].values)


def test_heat_on_a_temperature_without_heat_capacity_pushes_the_structure(tmp_path: Path) -> None:
    archive = solved("heated_without_capacity", tmp_path)
    exact = archive.sel(scheme="event_driven").squeeze()
    assert float(exact["contact_impulse"]) == pytest.approx(0.06404588799630, rel=1e-9)
    assert float(exact["temperature"].isel(t=-1)) == pytest.approx(1.606764362717, rel=1e-9)
    assert float(archive["contact_impulse"].sel(scheme="moreau").squeeze()) == pytest.approx(0.06404588799630, rel=0.02)
