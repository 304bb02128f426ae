"""What is said of steady rubs does not depend on the duration of the cases."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from studies import parsed
from workflow import run_study

SCENE = """
scene:
  chain: {nodes: 2, mass: 2.0e-3, stiffness: 1.0e6, heat_capacity: 2.0e-3, conductance: 0.4,
          spacing: 3.0e-3, expansion: 1.0e-5, damping: {mass: 200}}
  casing: {gap: 1.0e-5}
  load: {amplitude: 15.0, frequency: FREQUENCY}
  duration: DURATION
"""


@pytest.mark.parametrize("frequency", [260, pytest.param(900, marks=pytest.mark.slow)])
def test_steady_rubs_do_not_depend_on_the_duration(frequency: int, tmp_path: Path) -> None:
    axes = {"scheme": "event_driven", "e": [0.0, 0.5], "alpha": [0.0, 2.0]}
    found = []
    for duration in (0.003, 0.02, 0.3):
        scene = SCENE.replace("FREQUENCY", str(frequency)).replace("DURATION", str(duration))
        output = {"interval": 0.001, "histories": [], "steady": {"samples": 4}}
        study = parsed(f"study: durations\n{scene}\naxes: {json.dumps(axes)}\noutput: {json.dumps(output)}\n")
        found.append(run_study(study, tmp_path / f"{duration}.nc").dataset.load())
    for name in ("steady_state", "steady_periods", "steady_impulse", "orbit_temperature", "floquet_multiplier"):
        for other in found[1:]:
            np.testing.assert_array_equal(found[0][name].values, other[name].values)
