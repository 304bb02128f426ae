"""Figures for papers as the reference shows them, over the speed, and interaction maps whose lines are known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from scripts import script
from workflow import open_archive, plots, run_study, spectrum, write_matrices
from workflow.analysis import labels_of
from workflow.plots._units import axis_of

DATA = Path(__file__).parents[2] / "data"


LONG = ("sobol_indices", "sweep", "clearance")
"""Examples that run larger studies."""


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n in LONG)) for n in script("reference").FIGURES]
)
def test_the_examples_of_the_reference_draw(name: str) -> None:
    reference = script("reference")
    assert (reference.FILE.with_name("figures") / f"{name}.png").exists()
    assert all(panel.has_data() for panel in reference.drawn(name).axes)


def test_histories_along_a_dimension() -> None:
    with open_archive(DATA / "abstract_figure.nc") as archive:
        figure = plots.histories(archive.sel(alpha=30).isel(scheme=0), along="model")
        drawn = [one for one in figure.axes[1].get_lines() if np.size(one.get_xdata()) == archive.sizes["t"]]
        for k, one in enumerate(drawn):
            expected = archive["temperature"].sel(alpha=30).isel(scheme=0, model=k).values
            assert np.asarray(one.get_ydata()) == pytest.approx(expected)
        assert len(drawn) == 2
        assert figure._repr_png_().startswith(b"\x89PNG")  # a notebook shows it, with no magic line
        with pytest.raises(ValueError, match=r"`h` is no dimension of the cases; they lie along scheme, model, alpha"):
            plots.histories(archive, along="h")
        with pytest.raises(ValueError, match="keeps no histories"):
            plots.histories(archive.drop_dims("t"))


def test_a_map_of_one_metric_and_lines_of_a_selection() -> None:
    with open_archive(DATA / "work_precision.nc") as archive:
        full = archive.isel(model=0).sel(scheme="event_driven", e=0)
        panel, _ = plots.scene_map(full, "alpha", "h", "max_temperature").axes
        shown = np.ma.filled(panel.collections[0].get_array(), np.nan)
        assert shown == pytest.approx(full["max_temperature"].transpose("h", "alpha").values)
        with pytest.raises(
            ValueError, match="`scheme` is no dimension with numbers; the cases lie along scheme, model"
        ):
            plots.scene_map(archive, "scheme", "h")
        with pytest.raises(ValueError, match="`t` is no metric"):
            plots.scene_map(full, "alpha", "h", "t")
        lines = plots.convergence(archive.sel(e=0.9, alpha=1).isel(model=0)).axes[0].get_lines()
        euler = archive["impulse_error"].sel(scheme="implicit_euler", e=0.9, alpha=1).isel(model=0).values
        drawn = np.asarray(lines[0].get_ydata())
        assert drawn == pytest.approx(euler[euler < 3])
        for draw in (plots.work_precision, plots.convergence):
            with pytest.raises(ValueError, match="several steps `h`"):
                draw(full.isel(h=0))


def test_energy_that_an_impact_leaves() -> None:
    """A mass of 2 kg hits at 3 m/s with e = 0.5: it keeps e² of its energy, whatever the step."""
    case = xr.Dataset(
        {"velocity": ("t", [3.0, 3.0, -1.5, -1.5]), "impulse": ("t", [0.0, 0.0, 9.0, 9.0]), "energy_residual": 0.01},
        coords={"t": [0.0, 1.0, 2.0, 3.0]},
    )
    assert script("scene_pictures").energy_kept(case, energy=9.0) == pytest.approx(0.25 + 0.01)


ROD: dict[str, Any] = {
    "study": "rod",
    "scene": {
        "chain": {"nodes": 1, "mass": 1e-3, "stiffness": 4e6, "spacing": 0.01, "heat_capacity": 1.0,
                  "spin": {"radius": 0.2}},
        "casing": {"gap": "3 um", "harmonics": [{"order": 3, "amplitude": "1 um"}]},
        "speed": 5000.0,
        "duration": "1 ms",
        "initial": "static",
    },
    "axes": {"scheme": "event_driven"},
    "output": {"interval": "0.1 ms"},
}  # fmt: skip


def marks(figure: Any, label: str) -> np.ndarray:
    return np.array(next(line.get_xydata() for line in figure.axes[0].lines if line.get_label() == label))


def test_orders_cross_the_free_frequency_where_it_is_their_multiple() -> None:
    """√(k/m - Ω²) = n Ω at Ω = √(k/m/(1 + n²))."""
    for orders in (None, [3, 7]):
        crossed = marks(plots.campbell(ROD, orders), "crossing")
        expected = [np.sqrt(4e9 / (1 + n * n)) / (2 * np.pi) for n in orders or [3]]
        np.testing.assert_allclose(crossed[:, 0], 60 * np.array(expected), rtol=1e-3)
        np.testing.assert_allclose(crossed[:, 1], np.array(orders or [3]) * expected, rtol=1e-3)


def test_clearance_is_that_of_the_archive(tmp_path: Path) -> None:
    speeds = [1.0, 20.0, 30.0]
    del_speed = {name: value for name, value in ROD["scene"].items() if name != "speed"}
    study = ROD | {"scene": del_speed, "axes": {"scheme": "event_driven", "scene.speed": speeds}}
    figure = plots.clearance(run_study(study, tmp_path / "rod.nc", threads=1).dataset)
    square = (2 * np.pi * np.array(speeds)) ** 2
    static = square * 1e-3 * 0.21 / (4e6 - square * 1e-3)
    np.testing.assert_allclose(marks(figure, "tip at the start"), np.transpose([60 * np.array(speeds), 1e6 * static]))
    assert (marks(figure, "tip at most")[:, 1] >= 1e6 * static - 1e-9).all()
    assert (marks(figure, "clearance at rest, 3 µm")[:, 1] == 3.0).all()
    figure.savefig(tmp_path / "drawn.png")
    (legend,) = figure.legends
    inside = legend.get_window_extent().transformed(figure.transFigure.inverted())
    assert 0 <= inside.x0 < inside.x1 <= 1


def test_what_has_no_speed_is_refused() -> None:
    still = ROD | {"scene": {name: value for name, value in ROD["scene"].items() if name not in ("speed", "casing")}}
    still["scene"]["casing"] = {"gap": 1.0}
    with pytest.raises(ValueError, match="has no speed"):
        plots.campbell(still)


def test_marks_lie_on_modes_that_cross_whatever_speeds_the_study_has(tmp_path: Path) -> None:
    """√(f² + k s²) = n s at s = f/√(n² - k); order 2 meets 60 Hz where that crosses 100 Hz."""
    frequencies, slopes, masses = (
        np.array([100.0, 60.0, 150.0]),
        np.array([0.0, 2.56, -1.0]),
        np.array([0.02, 0.03, 0.04]),
    )
    write_matrices(
        tmp_path / "spin.npz",
        mass=np.diag(masses),
        stiffness=np.diag(masses * (2 * np.pi * frequencies) ** 2),
        stiffness_speed2=np.diag(masses * slopes),
        contact=np.ones(3),
        load=np.ones(3),
    )
    scene = {"matrices": {"file": str(tmp_path / "spin.npz")}, "casing": {"gap": "1 mm"}, "duration": 0.01}
    study = {"study": "spin", "scene": scene, "axes": {"scheme": "event_driven", "scene.speed": [0, 30, 55]}}
    orders = np.array([2.0, 3.0, 6.0])
    expected = (frequencies / np.sqrt(orders[:, None] ** 2 - slopes)).ravel()
    marked = marks(plots.campbell(study, orders.tolist()), "crossing")
    within = np.flatnonzero(expected <= 55.0)
    order = np.lexsort((np.repeat(orders, 3)[within], expected[within]))
    shown = marked[np.lexsort((marked[:, 1] / marked[:, 0], np.round(marked[:, 0], 3)))]
    np.testing.assert_allclose(shown[:, 0], 60 * expected[within][order], rtol=1e-4)
    np.testing.assert_allclose(shown[:, 1], (np.repeat(orders, 3) * expected)[within][order], rtol=1e-4)


def test_as_many_free_frequencies_are_drawn_as_are_asked_for() -> None:
    modes = ROD | {"scene": ROD["scene"] | {"chain": ROD["scene"]["chain"] | {"nodes": 5}, "speed": 1000.0}}
    curves = [len(plots.campbell(modes, [3], count).axes[0].lines) for count in (2, 5)]
    assert curves[1] - curves[0] == 3
    for orders in ([0], [2, -1]):
        with pytest.raises(ValueError, match="engine orders are above 0"):
            plots.campbell(ROD, orders)


def test_speeds_of_sliders_and_tables_are_those_of_figures() -> None:
    about = {"units": "Hz", "study_path": "scene.speed"}
    dataset = xr.Dataset({"status": ("speed", [0, 0])}, {"speed": ("speed", [25.0, 100.0], about)})
    axis = axis_of(dataset, "speed")
    assert (axis["unit"], axis["texts"], axis["selectors"]) == ("rpm", ["1500", "6000"], ["speed=25", "speed=100"])
    assert labels_of(dataset, "speed", rounded=True) == ["speed 1500 rpm", "speed 6000 rpm"]


SPEED, TIMES, FREE = np.linspace(50.0, 150.0, 21), np.arange(4001) / 4000, 730.0


def at_speeds() -> xr.Dataset:
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
    found = spectrum(at_speeds()["sensor_value"].sel(sensor="edge"))
    step = float(found["frequency"][1])
    for k, n in enumerate(SPEED):
        line = found.isel(speed=k)
        assert abs(float(line.idxmax("frequency")) - 4 * n) <= step
        beside = line.where(abs(line["frequency"] - 4 * n) > 8 * step)
        if abs(4 * n - FREE) > 16 * step:
            assert abs(float(beside.idxmax("frequency")) - FREE) <= step
    assert float(found.sel(speed=100.0, frequency=400.0)) == pytest.approx(3e-6, rel=1e-3)
    with pytest.raises(ValueError, match="`status` has no dimension `t`"):
        spectrum(at_speeds()["status"])
    with pytest.raises(ValueError, match="a spectrum of 2 samples"):
        spectrum(at_speeds()["sensor_value"].isel(t=slice(4)))


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
    figure = plots.interaction_map(at_speeds(), "edge", study=study)
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
        plots.interaction_map(at_speeds(), "edge", along="gap")
    with pytest.raises(ValueError, match="`tip` is neither a sensor nor a history of the dataset; it has edge, root"):
        plots.interaction_map(at_speeds(), "tip")


def test_a_map_of_rounding_says_that_nothing_vibrates() -> None:
    still = at_speeds()
    still["sensor_value"][:] = 7e-6 + 1e-21 * np.random.default_rng(1).standard_normal(TIMES.size)
    figure = plots.interaction_map(still, "edge")
    assert figure.axes[1].get_ylabel() == "amplitude [dB], nothing vibrates"
    drawn = np.ma.filled(figure.axes[0].collections[0].get_array(), np.nan)
    assert np.nanmax(drawn) == -60


def test_the_axis_of_a_spectrum_has_a_name_of_its_own() -> None:
    """Where the study varies what it calls ``frequency`` itself."""
    tones = at_speeds().isel(speed=slice(4)).rename(speed="frequency")
    found = spectrum(tones["sensor_value"].sel(sensor="edge"))
    assert found.dims == ("frequency", "spectral_frequency")
    step = float(found["spectral_frequency"][1])
    assert np.abs(found.idxmax("spectral_frequency").values - 4 * SPEED[:4]).max() <= step
    panel, _ = plots.interaction_map(tones, "edge", along="frequency").axes
    assert panel.collections[0].get_array().shape == (found.sizes["spectral_frequency"], 4)


def test_a_spectrum_is_of_equal_steps_and_a_share_of_them() -> None:
    history = at_speeds()["sensor_value"].isel(speed=0, sensor=0)
    cut = history.isel(t=np.r_[0:3000, 3400:4001])
    with pytest.raises(ValueError, match="`sensor_value` are not equally spaced in time"):
        spectrum(cut)
    assert spectrum(cut, last=0.1).size == 181  # they begin behind what was cut out
    for share in (0.0, -0.5, 1.5, np.nan):
        with pytest.raises(ValueError, match="give a share of the samples above 0"):
            spectrum(history, last=share)


def test_a_map_of_one_speed_is_a_strip() -> None:
    mesh = plots.interaction_map(at_speeds().isel(speed=[3]), "edge").axes[0].collections[0]
    left, right = np.unique(mesh.get_coordinates()[..., 0])
    assert left < 60 * SPEED[3] < right
