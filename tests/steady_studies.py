"""A blade of 3 + 12 modes whose rub settles at α = 5, runs away at α = 30, and never touches across a wide gap."""

from __future__ import annotations

import json
from typing import Any

from studies import parsed
from workflow.study import Study

BLADE = """
scene:
  blade: {nodes: 20, length: 40 mm, width: 30 mm, thickness: 1 mm, density: 4430, specific_heat: 560,
          conductivity: 7.0, convection: 400, expansion: 9.0e-6, tip_stiffness: 1.0e6,
          damping: {mass: 10.0, stiffness: 2.0e-7}}
  casing: {gap: 20 um}
  load: {amplitude: 24, frequency: 5 Hz}
  duration: 2 s
"""


def steady_study(axes: dict[str, Any], steady: Any = True) -> Study:
    """A study of the blade with some axes beside its modes, which asks for steady rubs."""
    axes = {"scheme": "event_driven", "mechanical_modes": 3, "thermal_modes": 12, **axes}
    output = {"interval": 0.1, "histories": ["displacement"], "steady": steady}
    return parsed(f"study: steady\n{BLADE}\naxes: {json.dumps(axes)}\noutput: {json.dumps(output)}\n")
