"""Quantities and pictures of single scenes: impact speeds, energy kept and growth against closed forms."""

import numpy as np
import pytest
import xarray as xr

from scripts import script
from studies import FALLING_BALL, parsed
from workflow.archive import open_archive
from workflow.run import run_study

SCRIPT = script("scene_pictures")
energy_kept, impact_speeds = SCRIPT.energy_kept, SCRIPT.impact_speeds


BALL = f"""
study: ball{FALLING_BALL}
axes: {{scheme: event_driven, e: 0.7}}
output: {{interval: 1 ms, histories: [displacement, velocity, impulse, contact_force]}}
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
