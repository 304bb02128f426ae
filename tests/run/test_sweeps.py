"""Sweeps: each point of an axis starts from the state in which the one before ended, and a line is one unit."""

from typing import Any

import numpy as np
import pytest

from workflow.cases import arrange
from workflow.schemes import Status
from workflow.solve import _solve, solve
from workflow.study import Study, checks, read_study

FREQUENCY = "scene.load.frequency"
CHAIN: dict[str, Any] = {
    "nodes": 4, "mass": 2.5e-3, "stiffness": 4e6, "damping": {"mass": 10, "stiffness": 2e-7}, "spacing": 2.5e-3,
    "expansion": 8.6e-6, "heat_capacity": 1.3, "conductance": 0.6, "convection": 0.02,
}  # fmt: skip


def sweep(axes: dict[str, Any] | None = None, scene: dict[str, Any] | None = None, **more: Any) -> Study:
    """Return a study of a chain that rubs while the frequency of its load goes up."""
    load = {"mean": 20.0, "amplitude": 100.0, "frequency": 50.0, "phase": 0.3}
    moving = {"chain": CHAIN, "casing": {"gap": 5e-5}, "load": load, "duration": 0.03, **(scene or {})}
    own = {"h": 1e-5, "alpha": 20.0, FREQUENCY: {"sweep": [50.0, 90.0, 5]}, **(axes or {})}
    output = {"interval": 1e-3, "histories": ["displacement", "velocity", "temperature"]}
    return read_study({"study": "swept", "scene": moving, "axes": own, "output": output, **more})


def given_that_state(study: Study, start: Any, value: float) -> Study:
    """Return the study of one point of a sweep: a case that starts so, with the phases that have gone on."""
    scene = study.scene
    axis = study.swept
    assert axis is not None
    initial = {name: getattr(start, name)[0].tolist() for name in ("displacement", "velocity", "temperature")}
    turned: dict[str, Any] = {"scene.load.phase": scene.load.phase + 2 * np.pi * start.load_turns[0, 0]}
    for group, turns in (("load", start.load_turns[0, 1:]), ("casing", start.casing_turns[0])):
        for k, entry in enumerate(getattr(scene, group).harmonics):
            turned[f"scene.{group}.harmonics.{k}.phase"] = entry.phase + 2 * np.pi * turns[k]
    return study.with_({"scene.initial": initial, f"axes.{axis.path}": value, **turned})


HARMONICS = [{"order": 2, "amplitude": 30.0}]
MOVING = {
    "speed": 50.0,
    "load": {"mean": 60.0, "amplitude": 60.0, "frequency": 70.0, "harmonics": HARMONICS},
    "casing": {"gap": 5e-5, "harmonics": [{"order": 1, "amplitude": 5e-6, "phase": 0.4}]},
}
SCHEMES = ("event_driven", "moreau", "carpenter", "paoli_schatzman", "penalty")


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize(
    ("scene", "axes"),
    [
        ({}, {}),
        ({"initial": "static"}, {"e": 0.5, "mechanical_modes": 2, "thermal_modes": 1}),
        ({}, {"alpha": {"sweep": [30.0, 0.0, 3]}, FREQUENCY: 60.0}),
        (MOVING, {FREQUENCY: 70.0, "scene.speed": {"sweep": [50.0, 40.0, 4]}}),
    ],
    ids=["frequency", "reduced", "alpha", "speed"],
)
def test_a_point_equals_a_case_given_the_state_before(
    scheme: str, scene: Any, axes: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """To the bit, also where a tip is inside its casing, as schemes may leave it, or by rounding."""
    monkeypatch.setattr(checks, "_start", lambda *words: [])
    study = sweep({"scheme": scheme, **axes}, scene)
    grid = arrange(study)
    assert study.swept is not None
    every = solve(grid, 0, np.arange(grid.inner_count))
    assert (every.values["status"] == Status.OK).all()
    start = None
    for point, value in enumerate(study.swept.values):
        one = _solve._solve_or_tell(grid, 0, np.array([point]), None, start)
        alone = one if start is None else solve(arrange(given_that_state(study, start, value)), 0, np.array([0]))
        for name, array in every.values.items():
            if name != "processor_time" and not name.startswith("period"):
                assert alone.values[name][0].tobytes() == array[point].tobytes(), (point, name)
        start = one.following
