"""What `output` asks for: sensors, events, means over a depth, and sections and extremes of load periods."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from matrix_files import as_npz, matrices_of
from quick import hashes_of, quick
from scenes import heavy_chain
from studies import BLADE_SCENE, SCENE, parsed, refusal, solve_all, written
from workflow import plan_study, plots, run_study
from workflow.archive import ArchiveError
from workflow.cases import arrange, case_hashes
from workflow.solve import _solve, solve
from workflow.study import Study, StudyError, read_study

FOUR_NODES = {
    "chain.nodes": 4,
    "chain.stiffness": 2e7,
    "chain.damping": {"mass": 100.0},
    "load.frequency": 500.0,
    "load.amplitude": 300.0,
}
SENSORS: dict[str, Any] = {"tip": 4, "middle": 2, "root": {"temperature": 1}}


def watched(axes: dict[str, Any] | None = None, **output: Any) -> Study:
    axes = {"scheme": ["event_driven", "moreau"], "alpha": 5.0, "e": [0.0, 0.5], "h": 1e-5, **(axes or {})}
    return quick(axes, scene=FOUR_NODES, output={"interval": 5e-5, "sensors": SENSORS, **output})


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    histories = ["displacement", "temperature", "contact_force"]
    study = watched(histories=histories, events=50, steady={"samples": 20})
    return run_study(study, tmp_path_factory.mktemp("sensors") / "sensors.nc").dataset


def test_sensors_are_selected_by_name(archive: xr.Dataset) -> None:
    assert archive.sensor.values.tolist() == ["tip", "middle", "root"]
    assert archive.sensor_unit.values.tolist() == ["m", "m", "K"]
    assert archive.sensor_value.dims == ("scheme", "e", "sensor", "t")
    tip = archive.sensor_value.sel(sensor="tip")
    assert float(abs(tip - archive.displacement).max()) < 1e-12 * float(abs(archive.displacement).max())
    middle = archive.sensor_value.sel(sensor="middle")
    assert 0 < float(abs(middle).max()) < float(abs(tip).max())
    assert float(archive.sensor_value.sel(sensor="root").max()) > 0


def test_extremes_are_those_of_the_samples(archive: xr.Dataset) -> None:
    last = archive.sensor_value.isel(t=archive.t >= 2e-3 - 1e-12)
    assert np.array_equal(archive.sensor_max, last.max("t"))
    assert np.array_equal(archive.sensor_min, last.min("t"))
    np.testing.assert_allclose(archive.sensor_rms, np.sqrt((last**2).mean("t")), rtol=1e-12)
    second = archive.sensor_value.sel(t=slice(2e-3 + 1e-6, 4e-3))  # the sample at its start ends an interval before
    assert archive.period_sensor_max.dims == ("scheme", "e", "sensor", "period")
    assert np.array_equal(archive.period_sensor_max.sel(period=2), second.max("t"))


def test_events_are_those_of_event_driven(archive: xr.Dataset) -> None:
    exact, stepped = archive.sel(scheme="event_driven"), archive.sel(scheme="moreau")
    assert archive.event_kind.attrs["flag_meanings"] == "impact touches leaves yields stops_yielding"
    assert archive.event_kind.dtype == archive.event_contact.dtype == np.int8
    assert np.array_equal((exact.event_impulse > 0).sum("event"), exact.impacts)
    count = exact.event_time.notnull().sum("event")
    assert np.array_equal(count, exact.event_count)
    assert np.array_equal((exact.event_kind >= 0).sum("event"), count)
    assert np.array_equal((exact.event_contact == 0).sum("event"), count)
    assert not stepped.event_count.any()
    assert stepped.event_time.isnull().all()
    assert (stepped.event_kind == -1).all()


def test_a_steady_rub_has_the_orbit_of_sensors(tmp_path: Path) -> None:
    output = {"histories": [], "steady": {"samples": 20}}
    study = watched({"scheme": "event_driven", "alpha": 0.0, "e": 0.0}, **output)
    data = run_study(study, tmp_path / "steady.nc").dataset.squeeze()
    assert "t" not in data.dims
    assert "sensor_value" not in data
    assert np.isfinite(data.sensor_max).all()
    assert data.orbit_sensor.dims == ("sensor", "phase")
    assert np.isfinite(data.orbit_sensor).all()
    tip = data.sel(sensor="tip")
    within = 1e-12 * float(data.steady_max_displacement)
    assert np.abs(tip.orbit_sensor - data.orbit_displacement).max() < within
    for name, extreme in (("max", data.steady_max_displacement), ("min", data.steady_min_displacement)):
        assert float(tip[f"steady_sensor_{name}"]) == pytest.approx(float(extreme), rel=1e-3)


def test_a_branch_has_the_extremes_of_sensors_at_each_point(tmp_path: Path) -> None:
    axes = {"scheme": "event_driven", "alpha": 0.0, "e": 0.0, "h": None}
    axes["scene.load.amplitude"] = {"branch": [295.0, 305.0, 3]}
    data = run_study(watched(axes), tmp_path / "branch.nc").dataset
    assert data.steady_sensor_max.dims == ("sensor", "point")
    tip = data.sel(sensor="tip")
    assert np.isfinite(tip.steady_sensor_max).all()
    np.testing.assert_allclose(tip.steady_sensor_max, data.steady_max_displacement, rtol=1e-3)
    assert data.orbit_sensor.dims == ("sensor", "point", "phase")


def test_without_sensors_and_events_nothing_of_them_is_there(tmp_path: Path) -> None:
    plain, rich = quick(), quick(output={"sensors": {"tip": 1}})
    assert not {"sensors", "events"} & set(plain.resolved()["output"])
    data = run_study(plain, tmp_path / "plain.nc").dataset
    assert not [name for name in data.variables if "sensor" in str(name) or "event" in str(name)]
    assert not set(hashes_of(plain)) & set(hashes_of(rich))
    listed = quick(output={"events": 9})
    assert hashes_of(listed) == hashes_of(plain)  # moreau has none
    for study in (quick({"scheme": "event_driven"}), quick({"scheme": "event_driven"}, output={"events": 9})):
        assert len(set(hashes_of(study))) == 9


def test_plan_names_them() -> None:
    values = {one.path: one.values for one in plan_study(watched(events=50)).scene}
    assert values["output.sensors"] == ("tip: 4", "middle: 2", "root: temperature 1")
    assert values["output.events"] == (50,)
    assert "output.sensors" not in {one.path for one in plan_study(quick()).scene}


@pytest.mark.parametrize(
    ("sensors", "place", "problem", "remedy"),
    [
        ({"edge": 5}, "output.sensors.edge", "`5` is no node", "a number from 1 to 4"),
        ({"edge": "17.y"}, "output.sensors.edge", "`17.y` is no node", "a number from 1 to 4"),
        ({"edge": {"temperature": 0}}, "output.sensors.edge", "`0` is no node", "from 1 to 4"),
        ({"impulse": 4}, "output.sensors.impulse", "is the name of a variable", "another name"),
        ({"2": 4}, "output.sensors.2", "is no name", "letters"),
        ({"edge": {"temp": 1}}, "output.sensors.edge", "`temp` is not known", "`temperature`"),
        ({"edge": [1, 2]}, "output.sensors.edge", "is not a line of text", "characters"),
        ([4], "output.sensors", "is not a mapping", "key: value"),
    ],
)
def test_a_mistake_is_told(sensors: Any, place: str, problem: str, remedy: str) -> None:
    with pytest.raises(StudyError) as refused:
        watched(sensors=sensors)
    text = str(refused.value)
    assert [part for part in (place, problem, remedy) if part not in text] == []


def test_nodes_that_vary_leave_the_sensors_of_all() -> None:
    assert "`4` is no node" in refusal(watched, {"scene.chain.nodes": [3, 6]})


AXES = """
axes: {scheme: [moreau, event_driven], h: 2e-5, alpha: [0, 30]}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
"""
DEEP = f"study: deep\n{SCENE}{AXES}output: {{interval: 2 ms, temperature_depth: 6 mm}}\n"

TWO_MESHES = DEEP.split("zip")[0].replace("alpha: [0, 30]", "scene.chain.nodes: [4, 2]") + DEEP.splitlines()[-1]


def test_an_archive_holds_the_mean_over_the_depth_in_every_basis(tmp_path: Path) -> None:
    """The mean lies below the tip of a blade that is heated there, and schemes agree on it as on the tip."""
    archive = run_study(parsed(DEEP), tmp_path / "deep.nc").dataset
    assert (archive["status"] == 0).all()
    assert archive["depth_temperature"].dims == archive["temperature"].dims
    assert archive["max_depth_temperature"].dims == archive["max_temperature"].dims
    assert archive["depth_temperature"].attrs["depth"] == archive["max_depth_temperature"].attrs["depth"] == 6e-3
    hot = archive.sel(alpha=30)
    assert (hot["depth_temperature"].max("t") <= hot["max_depth_temperature"] * (1 + 1e-12)).all()
    assert (hot["max_depth_temperature"] < 0.9 * hot["max_temperature"]).all()
    exact = hot.sel(scheme="event_driven")
    for name in ("max_depth_temperature", "max_temperature"):
        assert (np.abs(hot[name] / exact[name] - 1) < 0.1).all()
    assert not archive.sel(alpha=0)["depth_temperature"].any()


@pytest.mark.parametrize(("nodes", "mean"), [(20, 254.182), pytest.param(320, 261.019, marks=pytest.mark.slow)])
def test_the_mean_over_two_millimetres_of_the_example_converges(nodes: int, mean: float) -> None:
    scene = BLADE_SCENE.replace("nodes: 20", f"nodes: {nodes}")
    axes, output = "axes: {scheme: event_driven, alpha: 30}", "output: {temperature_depth: 2 mm, histories: []}"
    (solved,) = solve_all(f"study: a{scene}{axes}\n{output}\n")
    assert solved.values["max_depth_temperature"][0] == pytest.approx(mean, abs=2e-3)


def test_histories_alone_have_samples_of_it(tmp_path: Path) -> None:
    text = DEEP.replace("temperature_depth", "histories: [], temperature_depth")
    archive = run_study(parsed(text), tmp_path / "deep.nc").dataset
    assert "depth_temperature" not in archive
    assert archive["max_depth_temperature"].notnull().all()


def test_results_depend_on_the_depth() -> None:
    texts = [DEEP.replace("6 mm", depth) for depth in ("6 mm", "0.6 cm", "5 mm")]
    same, again, *others = map(hashes_of, map(parsed, [*texts, DEEP.replace(", temperature_depth: 6 mm", "")]))
    assert same == again
    assert not any(set(same) & set(other) for other in others)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        (DEEP.replace("6 mm", "11 mm"), "of 0.011 m is deeper than the 0.01 m of `chain`"),
        (DEEP.replace("spacing: 2.5e-3,", ""), "of 0.006 m is deeper than the 0 m of `chain`"),
        (TWO_MESHES, "deeper than the 0.005 m of `chain`"),
        (DEEP.replace("6 mm", "-1 mm"), "it must be above 0 m"),
    ],
)
def test_a_depth_that_a_structure_does_not_have_is_refused(text: str, problem: str) -> None:
    mistake = refusal(parsed, text)
    assert "output.temperature_depth" in mistake
    assert problem in mistake


def test_matrices_have_no_depth(tmp_path: Path) -> None:
    as_npz(matrices_of(heavy_chain(nodes=4)), tmp_path)
    text = f"study: a{BLADE_SCENE}output: {{temperature_depth: 1 mm}}\n"
    before, after = text.split("  blade: {")[0], text.split("stiffness: 2.0e-7}}\n")[1]
    path = written(f"{before}  matrices: {{file: blade.npz, contact: 3}}\n{after}", tmp_path)
    assert "deeper than the 0 m of `matrices`" in refusal(read_study, path)


FREQUENCIES = (50.0, 125.0, 333.3)
METHODS = ("event_driven", "moreau", "carpenter", "penalty")


def rub(interval: str = "0.1 ms") -> Study:
    axes = f"scheme: [{', '.join(METHODS)}], e: 0.5, alpha: 5, h: 3e-7, scene.load.frequency: {list(FREQUENCIES)}"
    output = f"interval: {interval}, sections: true, histories: [displacement, velocity, temperature]"
    scene = SCENE.replace("frequency: 50 Hz", "frequency: 50")
    return parsed(f"study: rub\n{scene}\naxes: {{{axes}}}\noutput: {{{output}}}\n")


def test_plan_says_that_extremes_of_load_periods_are_taken_of_few_samples() -> None:
    for interval, told in (("1 ms", True), ("0.1 ms", False)):
        warnings = plan_study(rub(interval)).warnings
        assert any("samples per load period" in warning for warning in warnings) == told, warnings


@pytest.fixture(scope="module")
def rubs(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return run_study(rub(), tmp_path_factory.mktemp("sections") / "rub.nc", threads=1).dataset


@pytest.mark.parametrize("frequency", [50.0, 125.0])
def test_sections_are_the_histories_at_the_starts_of_periods(rubs: xr.Dataset, frequency: float) -> None:
    of, count = rubs.sel(frequency=frequency), int(0.06 * frequency + 1e-9)
    at = np.round(np.arange(count) / frequency / 1e-4).astype(int)
    for name in ("displacement", "velocity", "temperature"):
        sections, largest = of[f"section_{name}"], float(abs(of[name]).max())
        assert sections.dims == ("scheme", "period")
        assert sections[:, :count].values == pytest.approx(of[name][:, at].values, abs=1e-12 * largest)
        assert np.isnan(sections[:, count:]).all()
    for k in range(count):
        x = of["displacement"][:, at[k] : round((k + 1) / frequency / 1e-4) + 1]
        assert of["period_displacement"][:, k].values == pytest.approx(x.max("t").values, rel=1e-12)
        assert of["period_displacement_min"][:, k].values == pytest.approx(x.min("t").values, rel=1e-12)


def test_sections_lie_between_samples(rubs: xr.Dataset, tmp_path: Path) -> None:
    """At 333.3 Hz no start of a period but the first is a sample; samples a hundred times as far apart change none."""
    coarse = run_study(rub("10 ms"), tmp_path / "coarse.nc", threads=1).dataset.sel(frequency=333.3)
    fine = rubs.sel(frequency=333.3)
    for name in ("section_displacement", "section_velocity", "section_temperature"):
        assert coarse[name].values == pytest.approx(fine[name].values, rel=1e-6, abs=1e-9)
    between = fine["displacement"].interp(t=np.arange(19) / 333.3)
    assert float(abs(between.values - fine["section_displacement"].values).max()) < 1e-6
    assert float(abs(fine["section_displacement"]).max()) > 1e-5


def test_impacts_of_periods_add_up(rubs: xr.Dataset) -> None:
    """Three periods of 50 Hz are the duration; of the others some impacts come after the last complete period."""
    sums = rubs["period_impacts"].sum("period")
    assert sums.sel(frequency=50).values == pytest.approx(rubs["impacts"].sel(frequency=50).values)
    assert np.all(sums <= rubs["impacts"])
    assert np.all(sums > 0)


def test_they_are_kept_where_they_are_asked_for(tmp_path: Path) -> None:
    study, path = quick(), tmp_path / "a.nc"
    assert "sections" not in study.resolved()["output"]
    assert not any("section" in name for name in run_study(study, path, threads=1).dataset)
    asked = study.with_({"output.sections": True})
    assert np.array_equal(case_hashes(arrange(asked)), case_hashes(arrange(study)))
    with pytest.raises(ArchiveError, match="without section_displacement"):
        run_study(asked, path, threads=1)
    run_study(asked, path, threads=1, recompute=True)
    with pytest.raises(ArchiveError, match="section_displacement"):
        run_study(study, path, threads=1)


def test_a_scheme_that_gives_none_leaves_them_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    own = _solve.run_batch
    monkeypatch.setattr(_solve, "run_batch", lambda *batch, **given: replace(own(*batch, **given), sections={}))
    study = quick().with_({"output.sections": True})
    values = solve(arrange(study), 0, np.arange(3)).values
    assert np.isnan(values["section_velocity"]).all()
    assert np.isnan(values["period_impacts"]).all()
    assert np.isfinite(values["period_displacement"]).all()


def test_a_bifurcation_diagram_shows_the_later_half(rubs: xr.Dataset) -> None:
    figure = plots.bifurcation(rubs.sel(scheme="event_driven"), "frequency")
    (line,) = figure.axes[0].get_lines()
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    shown = rubs["section_displacement"].sel(scheme="event_driven", frequency=125).values[3:7]
    assert y[(x == 125) & np.isfinite(y)] == pytest.approx(shown * 1e6)
    with pytest.raises(ValueError, match=r"`impacts` is not given per load period"):
        plots.bifurcation(rubs, "frequency", "impacts")
