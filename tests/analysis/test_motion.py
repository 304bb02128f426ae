"""What histories tell: impact speeds, energy kept and growth against closed forms."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from studies import parsed
from workflow.analysis import energy_kept, impact_speeds, impulse_growth
from workflow.archive import open_archive
from workflow.run import run_study

BALL = """
study: ball
scene:
  chain: {nodes: 1, mass: 2, stiffness: 0, heat_capacity: 1}
  casing: {gap: 1}
  load: {mean: 19.62}
  duration: 3
axes: {scheme: event_driven, e: 0.7}
output: {interval: 1 ms, histories: [displacement, velocity, impulse, contact_force]}
"""


@pytest.fixture(scope="module")
def ball(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    archive = tmp_path_factory.mktemp("ball") / "ball.nc"
    run_study(parsed(BALL), archive)
    with open_archive(archive) as dataset:
        return dataset.load()


def test_impact_speeds_of_a_ball(ball: xr.Dataset) -> None:
    """A falling ball: constant acceleration, so that the carried-on speed is exact to rounding."""
    first = np.sqrt(2 * 9.81)
    assert impact_speeds(ball)[:5] == pytest.approx(first * 0.7 ** np.arange(5), rel=1e-9)


def test_energy_that_an_impact_leaves() -> None:
    """A mass of 2 kg hits at 3 m/s with e = 0.5: it keeps e² of its energy, whatever the step."""
    case = xr.Dataset(
        {"velocity": ("t", [3.0, 3.0, -1.5, -1.5]), "impulse": ("t", [0.0, 0.0, 9.0, 9.0]), "energy_residual": 0.01},
        coords={"t": [0.0, 1.0, 2.0, 3.0]},
    )
    assert energy_kept(case, energy=9.0) == pytest.approx(0.25 + 0.01)


def test_growth_of_the_impulse_is_of_the_last_complete_period_over_the_first() -> None:
    nan = np.nan
    impulse = [[2.0, 3.0, 5.0], [2.0, 3.0, nan], [2.0, nan, nan], [0.0, 1.0, 2.0], [nan, nan, nan]]
    growth = impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), impulse)}))
    assert growth == pytest.approx([2.5, 1.5, nan, nan, nan], nan_ok=True)
    assert impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), [[1.0]])})) is None
    assert impulse_growth(xr.Dataset()) is None
