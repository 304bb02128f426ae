"""Sensors and events of studies with several contacts, with mass and without."""

from pathlib import Path

import numpy as np
from scenes_of_contacts import chain, study

from workflow import run_study


def test_sensors_at_contacts_show_their_displacements_and_events_name_them(tmp_path: Path) -> None:
    entries = chain() | {"labels": np.array([f"{k}.y" for k in range(5)]), "gauge": np.array([0, -1.0, 1, 0, 0])}
    axes = {"scheme": ["event_driven", "moreau"], "e": 0.5, "alpha": 3, "h": 2e-5}
    axes |= {"reduction": ["craig_bampton", "macneal"], "mechanical_modes": 2, "thermal_modes": 2}
    sensors = {"mid": "mid", "end": "4.y", "before": "1.y", "gauge": "gauge", "hot": {"temperature": 4}}
    output = {"interval": 5e-4, "sensors": sensors, "events": 40}
    data = run_study(study(tmp_path, entries, axes=axes, output=output), tmp_path / "two.nc").dataset
    assert not data.status.any()
    largest = float(np.abs(data.displacement).max())
    for k, name in enumerate(("mid", "end")):
        assert np.abs(data.sensor_value.sel(sensor=name) - data.displacement.isel(contact=k)).max() < 1e-12 * largest
    strained = data.sensor_value.sel(sensor="mid") - data.sensor_value.sel(sensor="before")
    assert np.abs(data.sensor_value.sel(sensor="gauge") - strained).max() < 1e-12 * largest
    hot = data.sensor_value.sel(sensor="hot") - data.temperature.isel(contact=1)
    assert np.abs(hot).max() < 1e-12 * float(data.temperature.max())
    exact = data.sel(scheme="event_driven")
    for reduction, impacts in (("craig_bampton", True), ("macneal", False)):
        one = exact.sel(reduction=reduction)
        struck = [int(((one.event_contact == k) & (one.event_impulse > 0)).sum()) for k in range(2)]
        assert struck == one.impacts.values.tolist()
        assert (sum(struck) > 3) == impacts
        assert int((one.event_kind >= 0).sum()) == int(one.event_count) <= 40
