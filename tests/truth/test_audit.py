"""Scenes of an independent audit: what ends, what is refused and what has no limit. Their numbers are in TRUTH.md."""

from pathlib import Path

import pytest
import xarray as xr

from workflow import read_study, run_study
from workflow.schemes import Status

SCENES = Path(__file__).parent / "audit"


def solved(name: str, tmp_path: Path, **settings: object) -> xr.Dataset:
    study = read_study(SCENES / f"{name}.yaml").with_(settings)
    return run_study(study, tmp_path / "x.nc", threads=1).dataset.load()


@pytest.mark.parametrize("alpha", [6e4, 7e4, 7.4e4, 8e4, 8.2e4])
def test_a_state_that_leaves_the_numbers_ends_its_case(alpha: float, tmp_path: Path) -> None:
    """Growth rate times duration is 943 at 8e4: the exponential overflows, at last or before the bounds of a step."""
    archive = solved("never_ends", tmp_path, **{"axes.alpha": alpha})
    assert int(archive["status"]) == int(Status.DIVERGED)
    assert int(archive["runaway"]) == 1
    assert "left the finite numbers" in str(archive["message"].values)


def test_heat_on_a_temperature_without_heat_capacity_pushes_the_structure(tmp_path: Path) -> None:
    impulse = solved("heated_without_capacity", tmp_path)["contact_impulse"].squeeze()
    assert float(impulse.sel(scheme="moreau")) == pytest.approx(float(impulse.sel(scheme="event_driven")), rel=0.02)
