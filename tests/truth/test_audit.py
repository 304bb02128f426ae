"""Scenes of an independent audit: event solver in 80-bit arithmetic, or closed forms."""

import shutil
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from workflow import read_study, run_study
from workflow.schemes import Status
from workflow.study import StudyError

SCENES = Path(__file__).parent / "audit"


def solved(name: str, tmp_path: Path, **settings: object) -> xr.Dataset:
    """Run a scene of the audit."""
    study = read_study(SCENES / f"{name}.yaml").with_(settings)
    return run_study(study, tmp_path / "x.nc", threads=1).dataset.load()


def test_the_hottest_moment_of_a_held_tip_whose_poles_are_all_complex(tmp_path: Path) -> None:
    archive = solved("hottest_moment", tmp_path).sel(scheme="event_driven")
    assert float(archive["max_temperature"].squeeze()) == pytest.approx(6.521667013224, rel=1e-9)
    assert float(archive["temperature"].isel(t=-1).squeeze()) == pytest.approx(5.697016726177, rel=1e-9)


@pytest.mark.parametrize("alpha", [6e4, 7e4, 7.4e4, 8e4, 8.2e4])
def test_a_state_that_leaves_the_numbers_ends_its_case(alpha: float, tmp_path: Path) -> None:
    """Growth rate times duration is 943 at 8e4: the exponential overflows, at last or before the bounds of a step."""
    archive = solved("never_ends", tmp_path, **{"axes.alpha": alpha})
    assert int(archive["status"]) == int(Status.DIVERGED)
    assert int(archive["runaway"]) == 1
    assert "left the finite numbers" in str(archive["message"].values)


def test_heat_on_a_temperature_without_heat_capacity_pushes_the_structure(tmp_path: Path) -> None:
    archive = solved("heated_without_capacity", tmp_path)
    exact = archive.sel(scheme="event_driven").squeeze()
    assert float(exact["contact_impulse"]) == pytest.approx(0.06404588799630, rel=1e-9)
    assert float(exact["temperature"].isel(t=-1)) == pytest.approx(1.606764362717, rel=1e-9)
    assert float(archive["contact_impulse"].sel(scheme="moreau").squeeze()) == pytest.approx(0.06404588799630, rel=0.02)


def test_a_free_root_that_hits_its_casing_once_is_ok(tmp_path: Path) -> None:
    exact = solved("free_root_hits_casing", tmp_path).sel(scheme="event_driven").squeeze()
    assert int(exact["status"]) == int(Status.OK)
    assert int(exact["impacts"]) == 1
    assert float(exact["displacement"].isel(t=-1)) == pytest.approx(-7.362006399559e-3, rel=1e-9)
    assert float(exact["contact_impulse"]) == pytest.approx(0.0999838127, rel=1e-9)


def test_the_heat_that_enters_a_reduced_structure_stays_or_leaves(tmp_path: Path) -> None:
    archive = solved("heat_residual_reduced", tmp_path, **{"axes.scheme": ["moreau", "midpoint"]})
    assert float(np.abs(archive["heat_residual"]).max()) < 1e-10
    assert np.all(archive["status"] == Status.OK)


def test_a_dashpot_on_a_displacement_without_mass(tmp_path: Path) -> None:
    """It does not follow statically; with a mass of 1e-6 kg there the study meets its truth."""
    with pytest.raises(StudyError, match="`damping` acts on displacement 1, which has no mass"):
        solved("massless_dashpot", tmp_path)
    matrices = dict(np.load(SCENES / "massless_dashpot.npz"))
    matrices["mass"][1, 1] = 1e-6
    np.savez(tmp_path / "massless_dashpot.npz", **matrices)
    shutil.copy(SCENES / "massless_dashpot.yaml", tmp_path)
    archive = run_study(read_study(tmp_path / "massless_dashpot.yaml"), tmp_path / "x.nc", threads=1).dataset.load()
    assert float(archive["contact_impulse"]) == pytest.approx(0.0908490061571892, rel=1e-9)
    assert float(archive["displacement"].isel(t=-1)) == pytest.approx(-5.221466711969172e-4, rel=1e-9)


def test_the_hottest_moment_under_heat_loads(tmp_path: Path) -> None:
    with np.load(SCENES / "hottest_moment.npz") as entries:
        np.savez(tmp_path / "hottest_moment.npz", **entries, heating=[0.5, 0.5])
    shutil.copy(SCENES / "hottest_moment.yaml", tmp_path)
    study = read_study(tmp_path / "hottest_moment.yaml")
    archive = run_study(study, tmp_path / "x.nc", threads=1).dataset.load().sel(scheme="event_driven")
    assert float(archive["contact_impulse"].squeeze()) == pytest.approx(13.78499023078, rel=1e-9)
    assert float(archive["max_temperature"].squeeze()) == pytest.approx(6.509184946667, rel=1e-9)


def test_a_free_root_has_no_critical_coupling_in_any_basis(tmp_path: Path) -> None:
    archive = solved("macneal_free_root", tmp_path)
    assert np.isinf(archive["critical_alpha"].values).all()
