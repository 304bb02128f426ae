"""Quantities and pictures of single scenes: impact speeds, energy kept and growth against closed forms."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from scripts import script
from studies import FALLING_BALL, parsed
from workflow.analysis import casing_motion
from workflow.archive import open_archive
from workflow.plots import save
from workflow.run import run_study

SCRIPT = script("scene_pictures")
energy_kept, impact_speeds = SCRIPT.energy_kept, SCRIPT.impact_speeds
growth_against_prediction, impact_speed_map = SCRIPT.growth_against_prediction, SCRIPT.impact_speed_map

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


def test_impact_speeds_are_relative_to_the_casing() -> None:
    """A tip that moves on at 3 mm/s meets a casing that comes with up to 2π · 0.2 mm/s."""
    t = np.linspace(0, 1, 2001)
    moves = {
        "casing_amplitude": 2e-4,
        "casing_frequency": 1.0,
        "casing_order": np.nan,
        "casing_phase": np.pi,
        "speed": 0.0,
    }
    dataset = xr.Dataset(coords={"t": t, "gap": ((), 1e-5, moves)})
    x = 3e-3 * (t - 0.5) + 1e-5 + 2e-4 * np.sin(np.pi)
    place = casing_motion(dataset)
    assert place is not None
    touched = (x >= place[0]) & (t > 0.3)
    dataset = dataset.assign(
        displacement=("t", np.minimum(x, place[0])),
        velocity=("t", np.full(t.size, 3e-3)),
        contact_force=("t", touched * 1.0),
    )
    ahead = 2 * np.pi * 2e-4  # d = -a sin(2π t) rises at t = 1/2
    assert impact_speeds(dataset)[0] == pytest.approx(3e-3 - ahead, rel=1e-2)


def pressed(share: np.ndarray) -> xr.Dataset:
    t, rate = np.linspace(0, 5, 51), 0.4 * (share - 1)
    limit = 10 / (1 - share)
    force = limit[:, None] + (10 - limit)[:, None] * np.exp(rate[:, None] * t)
    force[:, 0] = 0
    return xr.Dataset(
        {
            "contact_force": (("alpha", "t"), force),
            "critical_alpha": ("alpha", np.full(share.size, 2.0)),
            "growth_rate": ("alpha", rate),
        },
        coords={"alpha": 2 * share, "t": t},
    )


def test_growth_lies_on_its_prediction(tmp_path: Path) -> None:
    figure = growth_against_prediction(pressed(np.array([0.0, 0.9, 1.1, 4.0])))
    drawn = [np.asarray(one.get_ydata()) for one in figure.axes[0].get_lines() if np.size(one.get_ydata())]
    assert len(drawn) == 4 + 3
    for case, predicted in ((drawn[1], drawn[2]), (drawn[3], drawn[4]), (drawn[5], drawn[6])):
        assert predicted == pytest.approx(case, rel=1e-9)
    low, high = figure.axes[0].get_ylim()
    assert low < 10 < high < 1e7
    save(figure, tmp_path / "a.png")


def test_impact_speeds_by_frequency_gap_and_e(tmp_path: Path) -> None:
    """A saw-tooth that hits the gap at ±v: the speed drawn is v, and nothing where nothing touches."""
    t = np.linspace(0, 1, 2001)
    frequency, gap, e = np.array([10.0, 20.0]), np.array([0.0, 5.0]), np.array([0.0, 0.5])
    dims = ("frequency", "gap", "e", "t")
    phase = (t * frequency[:, None]) % 1
    x = np.broadcast_to((phase - 1)[:, None, None], (2, 2, 2, t.size))
    v = np.broadcast_to(frequency[:, None, None, None], x.shape)
    force = np.zeros(x.shape)
    force[:, 0] = np.where(phase < 1 / 40, 1.0, 0.0)[:, None]
    archive = xr.Dataset(
        {"displacement": (dims, x), "velocity": (dims, v), "contact_force": (dims, force)},
        coords={"frequency": frequency, "gap": gap, "e": e, "t": t},
    )
    figure = impact_speed_map(archive)
    near, far = figure.axes
    assert near.get_title() == "gap 0 µm"
    assert [one.get_label() for one in near.get_lines()] == ["e = 0", "e = 0.5"]
    assert np.asarray(near.get_lines()[0].get_ydata()) == pytest.approx(frequency)
    assert np.isnan(np.asarray(far.get_lines()[0].get_ydata())).all()
    save(figure, tmp_path / "a.png")


def test_many_gaps_and_restitutions_are_drawn() -> None:
    """Nine values of e ended with an index out of range, nine gaps were a strip 33 inches wide."""
    e, gap, frequency = np.linspace(0, 0.8, 9), 1e-5 * np.arange(1, 8), np.array([10.0, 20.0])
    dims, shape = ("frequency", "gap", "e", "t"), (2, 7, 9, 11)
    archive = xr.Dataset(
        {name: (dims, np.zeros(shape)) for name in ("displacement", "velocity", "contact_force")},
        coords={"frequency": frequency, "gap": gap, "e": e, "t": np.linspace(0, 1, 11)},
    )
    figure = impact_speed_map(archive)
    assert len(figure.axes) == 7
    assert figure.get_size_inches()[0] < 13
    assert [bool(panel.get_xlabel()) for panel in figure.axes] == [False] * 4 + [True] * 3
    looks = {(one.get_color(), one.get_marker()) for one in figure.axes[0].get_lines()}
    assert len(looks) == 8
