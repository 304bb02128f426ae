"""Interaction maps and spectra of archives whose lines are known."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from workflow import plots, spectrum

SPEED, TIMES, FREE = np.linspace(50.0, 150.0, 21), np.arange(4001) / 4000, 730.0


def archive() -> xr.Dataset:
    """An answer of 3 µm at order 4 and of 0.5 µm at a free frequency, about a mean; the last case has diverged."""
    phase = 2 * np.pi * TIMES
    rows = [7e-6 + 3e-6 * np.sin(4 * n * phase) + 0.5e-6 * np.cos(FREE * phase + 1) for n in SPEED]
    gauge = np.stack([rows, np.zeros_like(rows)], axis=1)
    status = np.zeros(SPEED.size, np.int8)
    status[-1] = 1
    return xr.Dataset(
        {"sensor_value": (("speed", "sensor", "t"), gauge), "status": ("speed", status)},
        coords={
            "speed": ("speed", SPEED, {"units": "Hz", "study_path": "scene.speed"}),
            "t": ("t", TIMES, {"units": "s"}),
            "sensor": ["edge", "root"],
            "sensor_unit": ("sensor", ["m", "K"]),
            "gap": ((), 1e-5, {"casing_order": [4.0, np.nan]}),
        },
    )


def test_a_spectrum_finds_frequencies_and_amplitudes() -> None:
    found = spectrum(archive()["sensor_value"].sel(sensor="edge"))
    step = float(found["frequency"][1])
    for k, n in enumerate(SPEED):
        line = found.isel(speed=k)
        assert abs(float(line.idxmax("frequency")) - 4 * n) <= step
        beside = line.where(abs(line["frequency"] - 4 * n) > 8 * step)
        if abs(4 * n - FREE) > 16 * step:
            assert abs(float(beside.idxmax("frequency")) - FREE) <= step
    assert float(found.sel(speed=100.0, frequency=400.0)) == pytest.approx(3e-6, rel=1e-3)
    with pytest.raises(ValueError, match="`status` has no dimension `t`"):
        spectrum(archive()["status"])
    with pytest.raises(ValueError, match="a spectrum of 2 samples"):
        spectrum(archive()["sensor_value"].isel(t=slice(4)))


def scene_of(frequency: float) -> dict[str, object]:
    """A study of one mode on a casing of four lobes."""
    scene = {
        "modes": {"table": [[frequency, 0.0, 1.0]]},
        "casing": {"gap": 1.0, "harmonics": [{"order": 4, "amplitude": 1e-6}]},
        "speed": 100.0,
        "duration": 1.0,
    }
    return {"study": "one_mode", "scene": scene}


def test_a_map_draws_what_lies_on_orders_and_free_frequencies(tmp_path: Path) -> None:
    study = scene_of(FREE)
    figure = plots.interaction_map(archive(), "edge", study=study)
    panel, bar = figure.axes
    decibels = np.ma.filled(panel.collections[0].get_array(), np.nan)
    up = panel.collections[0].get_coordinates()[:, 0, 1]
    middles = (up[1:] + up[:-1]) / 2
    assert np.isnan(decibels[:, -1]).all()
    assert np.nanmax(decibels) == 0
    peaks = middles[decibels[:, :-1].argmax(axis=0)]
    assert np.abs(peaks - 4 * SPEED[:-1]).max() <= middles[1] - middles[0]
    order, level = panel.get_lines()
    assert np.asarray(order.get_ydata()) == pytest.approx(4 * SPEED)
    assert np.asarray(order.get_xdata()) == pytest.approx(60 * SPEED)
    assert np.asarray(level.get_ydata()) == pytest.approx(FREE)
    assert bar.get_ylabel() == "amplitude [dB], 0 is 3 µm"
    assert figure.get_suptitle() == "edge: last 0.5 s, Hann window, resolution 4 Hz"
    plots.save(figure, tmp_path / "map.png")


def test_what_no_map_can_show() -> None:
    with pytest.raises(ValueError, match="`gap` is no dimension with numbers; the cases lie along speed"):
        plots.interaction_map(archive(), "edge", along="gap")
    with pytest.raises(ValueError, match="`tip` is neither a sensor nor a history of the dataset; it has edge, root"):
        plots.interaction_map(archive(), "tip")


def test_a_map_of_rounding_says_that_nothing_vibrates() -> None:
    still = archive()
    still["sensor_value"][:] = 7e-6 + 1e-21 * np.random.default_rng(1).standard_normal(TIMES.size)
    figure = plots.interaction_map(still, "edge")
    assert figure.axes[1].get_ylabel() == "amplitude [dB], nothing vibrates"
    drawn = np.ma.filled(figure.axes[0].collections[0].get_array(), np.nan)
    assert np.nanmax(drawn) == -60


def test_the_axis_of_a_spectrum_has_a_name_of_its_own() -> None:
    """Where the study varies what it calls ``frequency`` itself."""
    tones = archive().isel(speed=slice(4)).rename(speed="frequency")
    found = spectrum(tones["sensor_value"].sel(sensor="edge"))
    assert found.dims == ("frequency", "spectral_frequency")
    step = float(found["spectral_frequency"][1])
    assert np.abs(found.idxmax("spectral_frequency").values - 4 * SPEED[:4]).max() <= step
    panel, _ = plots.interaction_map(tones, "edge", along="frequency").axes
    assert panel.collections[0].get_array().shape == (found.sizes["spectral_frequency"], 4)


def test_a_spectrum_is_of_equal_steps_and_a_share_of_them() -> None:
    history = archive()["sensor_value"].isel(speed=0, sensor=0)
    cut = history.isel(t=np.r_[0:3000, 3400:4001])
    with pytest.raises(ValueError, match="`sensor_value` are not equally spaced in time"):
        spectrum(cut)
    assert spectrum(cut, last=0.1).size == 181  # they begin behind what was cut out
    for share in (0.0, -0.5, 1.5, np.nan):
        with pytest.raises(ValueError, match="give a share of the samples above 0"):
            spectrum(history, last=share)


def test_a_map_of_one_speed_is_a_strip() -> None:
    mesh = plots.interaction_map(archive().isel(speed=[3]), "edge").axes[0].collections[0]
    left, right = np.unique(mesh.get_coordinates()[..., 0])
    assert left < 60 * SPEED[3] < right
