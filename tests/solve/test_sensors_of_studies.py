"""Sensors and events in studies and archives."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from quick import hashes_of, quick
from studies import refusal
from workflow import run_study
from workflow.archive import open_archive
from workflow.plan import plan_study
from workflow.study import Study, StudyError

SCENE = {
    "chain.nodes": 4,
    "chain.stiffness": 2e7,
    "chain.damping": {"mass": 100.0},
    "load.frequency": 500.0,
    "load.amplitude": 300.0,
}
SENSORS: dict[str, Any] = {"tip": 4, "middle": 2, "root": {"temperature": 1}}


def watched(axes: dict[str, Any] | None = None, **output: Any) -> Study:
    axes = {"scheme": ["event_driven", "moreau"], "alpha": 5.0, "e": [0.0, 0.5], "h": 1e-5, **(axes or {})}
    return quick(axes, scene=SCENE, output={"interval": 5e-5, "sensors": SENSORS, **output})


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    place = tmp_path_factory.mktemp("sensors") / "sensors.nc"
    histories = ["displacement", "temperature", "contact_force"]
    run_study(watched(histories=histories, events=50, steady={"samples": 20}), place)
    return open_archive(place)


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
