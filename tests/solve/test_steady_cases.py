"""Steady rubs of an archive: part of a case's identity, extended and verified; runaway, which leaves a case ok."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from quick import hashes_of, quick
from studies import archived, solve_all, steady_study
from workflow import plan_study, run_study
from workflow.run import verify

AXES = {"scheme": ["event_driven", "moreau"], "h": 1e-3, "alpha": [0, 5, 30], "scene.casing.gap": [20e-6, 25e-6]}


path = archived(steady_study(AXES, {"samples": 40}))


@pytest.fixture
def archive(path: Path) -> xr.Dataset:
    return xr.open_dataset(path)


def states(dataset: xr.Dataset) -> np.ndarray:
    return np.array(dataset["steady_state"].attrs["flag_meanings"].split())[dataset["steady_state"].values]


def test_a_rub_settles_runs_away_or_is_not_asked_for(archive: xr.Dataset) -> None:
    exact, stepped = archive.sel(scheme="event_driven"), archive.sel(scheme="moreau")
    assert states(exact.sel(gap=20e-6)).tolist() == ["settles", "settles", "runs_away"]
    assert states(exact.sel(gap=25e-6)).tolist() == ["no_contact"] * 3
    assert set(states(stepped).ravel()) == {"not_asked"}
    assert np.isnan(stepped["floquet_multiplier"]).all()
    assert (archive["status"] == 0).all()
    rub = exact.sel(gap=20e-6, alpha=5)
    assert float(rub["floquet_multiplier"]) == pytest.approx(0.96052457, abs=1e-8)
    assert float(rub["orbit_temperature"][0]) == pytest.approx(48.59578199, abs=1e-8)
    message = str(exact["message"].sel(gap=20e-6, alpha=30).values)
    assert message.startswith("steady: ")
    assert str(rub["message"].values) == ""


def test_orbits_lie_along_their_phase(archive: xr.Dataset) -> None:
    rub = archive.sel(scheme="event_driven", gap=20e-6, alpha=5)
    assert archive["phase"].values == pytest.approx(np.arange(40) / 40)
    assert archive["orbit_displacement"].dims[-1] == "phase"
    largest = float(rub["orbit_displacement"].max())
    assert largest <= float(rub["steady_max_displacement"]) == pytest.approx(20e-6)
    assert float(rub["orbit_temperature"].mean()) == pytest.approx(float(rub["steady_mean_temperature"]), rel=1e-2)


def test_the_archive_is_verified_and_extended(path: Path, tmp_path: Path) -> None:
    assert all(check.holds for check in verify(path))
    copy = tmp_path / "a.nc"
    copy.write_bytes(path.read_bytes())
    more = run_study(steady_study({**AXES, "alpha": [0, 2, 5, 30]}, {"samples": 40}), copy)
    assert more.resumed == 12
    with xr.open_dataset(path) as old, xr.open_dataset(copy) as new:
        for name in ("steady_state", "floquet_multiplier", "orbit_velocity"):
            np.testing.assert_array_equal(new[name].sel(alpha=old["alpha"]), old[name])
        assert states(new.sel(scheme="event_driven", alpha=2, gap=20e-6)) == "settles"


def test_what_is_asked_enters_the_identity_of_exact_cases_alone() -> None:
    axes = {"scheme": ["event_driven", "moreau"], "alpha": [0, 5]}
    plain, asked, finer = (
        hashes_of(quick(axes, output=output)) for output in ({}, {"steady": True}, {"steady": {"samples": 7}})
    )
    assert plain == hashes_of(quick(axes, output={"steady": False}))
    for k in range(6):
        assert len({plain[k], asked[k], finer[k]}) == 3
        assert plain[6 + k] == asked[6 + k] == finer[6 + k]


def test_the_plan_counts_them() -> None:
    plain, asked = (plan_study(quick({"scheme": "event_driven"}, output=output)) for output in ({}, {"steady": True}))
    assert asked.bytes - plain.bytes > 9 * 3 * 8 * 100
    assert {"output.steady.periods", "output.steady.samples"} <= {value.path for value in asked.scene}


@pytest.mark.parametrize("frequency", [260, pytest.param(900, marks=pytest.mark.slow)])
def test_steady_rubs_do_not_depend_on_the_duration(frequency: int, tmp_path: Path) -> None:
    chain = {"nodes": 2, "mass": 2e-3, "stiffness": 1e6, "heat_capacity": 2e-3, "conductance": 0.4, "spacing": 3e-3}
    chain |= {"expansion": 1e-5, "damping": {"mass": 200}}
    scene = {"chain": chain, "casing.gap": 1e-5, "load": {"amplitude": 15.0, "frequency": frequency}}
    axes = {"scheme": "event_driven", "h": None, "e": [0.0, 0.5], "alpha": [0.0, 2.0]}
    output = {"interval": 0.001, "histories": [], "steady": {"samples": 4}}
    found = [
        run_study(quick(axes, scene=scene | {"duration": duration}, output=output), tmp_path / f"{duration}.nc").dataset
        for duration in (0.003, 0.02, 0.3)
    ]
    for name in ("steady_state", "steady_periods", "steady_impulse", "orbit_temperature", "floquet_multiplier"):
        for other in found[1:]:
            np.testing.assert_array_equal(found[0][name].values, other[name].values)


def test_a_branch_whose_first_case_raises_leaves_the_others() -> None:
    """A free body under a constant load has no equilibrium to start from."""
    chain = {"nodes": 2, "mass": 1, "stiffness": [0, 1], "heat_capacity": 1, "convection": 1, "damping": {"mass": 0.1}}
    load = {"amplitude": 1, "frequency": 0.3}
    scene = {"chain": chain, "casing.gap": 0.1, "load": load, "initial": "static", "duration": 10}
    axes = {"scheme": "event_driven", "h": None, "e": None, "alpha": None, "scene.load.mean": [-1, 0]}
    branch = {"scene.casing.gap": {"branch": [0.05, 0.2, 4]}}
    output = {"interval": 1, "histories": [], "steady": True}
    (results,) = solve_all(quick(axes | branch, scene=scene, output=output).text)
    assert "no equilibrium" in results.messages[0]
    assert "no equilibrium" not in results.messages[1]
    assert results.values["steady_state"].shape == (2, 4)


def test_slow_growth_beside_fast_decay_is_a_runaway() -> None:
    """1e-6 1/s beside damping rates of 4e8 1/s: above the critical coupling a positive eigenvalue is certain."""
    chain = {"nodes": 3, "mass": 1e-3, "stiffness": 1e6, "damping": {"stiffness": 0.1}, "spacing": 1e-2}
    chain |= {"expansion": 1e-5, "heat_capacity": 1e3, "conductance": 1e-3}
    scene = {"chain": chain, "casing.gap": 0, "load.amplitude": 0, "duration": 1e-3}
    axes = {"h": None, "e": None, "alpha": [0.003, 0.02], "scheme": "event_driven"}
    values = solve_all(quick(axes, scene=scene, output={"interval": 1e-3}).text)[0].values
    assert values["critical_alpha"][0] == pytest.approx(2e-3 / 0.3, rel=1e-12)
    assert 0 < values["growth_rate"][1] < 1e-5
    assert values["runaway"].tolist() == [0, 1]
