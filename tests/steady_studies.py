"""A blade of 3 + 12 modes whose rub settles at α = 5, runs away at α = 30, and never touches across a wide gap."""

from __future__ import annotations

import json
from typing import Any

from studies import BLADE_SCENE, parsed
from workflow.study import Study


def steady_study(axes: dict[str, Any], steady: Any = True) -> Study:
    """A study of the blade with some axes beside its modes, which asks for steady rubs."""
    axes = {"scheme": "event_driven", "mechanical_modes": 3, "thermal_modes": 12, **axes}
    output = {"interval": 0.1, "histories": ["displacement"], "steady": steady}
    return parsed(f"study: steady\n{BLADE_SCENE}\naxes: {json.dumps(axes)}\noutput: {json.dumps(output)}\n")
