"""Contact phases of cases whose contact is known."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from studies import FALLING_BALL, parsed
from workflow import contact_phases
from workflow.archive import open_archive
from workflow.run import run_study

T = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


def forces(*rows: list[float]) -> xr.Dataset:
    coords = {"alpha": np.arange(len(rows), dtype=float), "t": T, "gap": 3.0}
    return xr.Dataset({"contact_force": (("alpha", "t"), np.array(rows))}, coords)


def test_phases_of_known_forces() -> None:
    phases = contact_phases(forces([0, 2, 4, 0, 0, 1], [0, 0, 0, 0, 0, 0], [0, 0, 0, 5, 0, 0], [0, 1, 1, 1, 1, 1]))
    assert dict(phases.sizes) == {"alpha": 4, "phase": 2}
    assert phases["begin"].values == pytest.approx(
        np.array([[0, 0.4], [np.nan, np.nan], [0.2, np.nan], [0, np.nan]]), nan_ok=True
    )
    assert phases["end"].values == pytest.approx(
        np.array([[0.2, 0.5], [np.nan, np.nan], [0.3, np.nan], [0.5, np.nan]]), nan_ok=True
    )
    assert phases["impulse"].sel(alpha=0).values == pytest.approx([0.6, 0.1])
    assert phases["peak_force"].sel(alpha=[0, 2], phase=1).values == pytest.approx([4, 5])
    assert list(phases["phase"].values) == [1, 2]
    assert float(phases["gap"]) == 3.0
    assert phases["impulse"].attrs["units"] == "N s"


def test_a_single_case_and_one_without_contact() -> None:
    one = contact_phases(forces([0, 2, 4, 0, 0, 1]).isel(alpha=0))
    assert one["begin"].dims == ("phase",)
    none = contact_phases(forces([0.0] * 6, [np.nan] * 6))
    assert dict(none.sizes) == {"alpha": 2, "phase": 0}


def test_without_forces_there_are_no_phases() -> None:
    with pytest.raises(ValueError, match=r"no history `contact_force`; name it in `output\.histories`"):
        contact_phases(forces([0.0] * 6).drop_vars("contact_force"))


def test_phases_of_a_ball_hold_its_impacts(tmp_path) -> None:  # type: ignore[no-untyped-def]
    """A ball from 1 m: the first phase holds the first impact, and all of them bear the whole impulse."""
    rest = "axes: {scheme: event_driven, e: [0, 0.7]}\noutput: {interval: 1 ms, histories: [contact_force]}\n"
    run_study(parsed(f"study: ball{FALLING_BALL}{rest}"), tmp_path / "ball.nc")
    with open_archive(tmp_path / "ball.nc") as archive:
        phases = contact_phases(archive)
        assert np.all(phases["begin"].sel(phase=1) <= np.sqrt(2 / 9.81))
        assert np.all(phases["end"].sel(phase=1) >= np.sqrt(2 / 9.81))
        assert phases["impulse"].sum("phase").values == pytest.approx(archive["contact_impulse"].values, rel=1e-9)
        assert int(phases["begin"].sel(e=0).count()) == 1  # it lies where it fell
        bounces = phases["impulse"].sel(e=0.7, phase=[1, 2, 3]).values
        assert bounces == pytest.approx(1.7 * 2 * np.sqrt(2 * 9.81) * 0.7 ** np.arange(3), rel=1e-9)
