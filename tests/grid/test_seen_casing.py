"""Cases whose step makes the casing's harmonic far faster than it is are ``diverged``.

``python tests/grid/test_seen_casing.py`` measures scenes by how many times as fast the step sees the casing.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
from scipy.optimize import brentq

sys.path.insert(0, str(Path(__file__).parents[1]))

from studies import solve_all
from workflow.grid import Solved
from workflow.schemes import Status

SEEN = """
study: a
scene:
  chain: {{nodes: 1, mass: 0.1, stiffness: 0, heat_capacity: 1}}
  casing: {{gap: 0, harmonics: [{{amplitude: {amplitude}, frequency: 500 Hz}}]}}
  load: {{steady: 0.981}}
  initial: {{displacement: {start}}}
  duration: 0.24 s
schemes: {{half: {{method: moreau, theta: {theta}}}}}
axes: {{scheme: half, h: {h}}}
output: {{interval: 1 ms}}
"""


def seen(**values: Any) -> Solved:
    usual = {"amplitude": 1e-5, "start": -1e-4, "theta": 0.5, "h": 1.0002e-3}
    (solved,) = solve_all(SEEN.format(**{**usual, **values}))
    return solved


def test_a_step_of_half_the_casing_s_period_is_not_ok() -> None:
    """θ = 1/2 at two steps to the period: the casing of 31 mm/s is seen to move at 64 m/s; balances leave nothing."""
    thrown = seen()
    assert np.abs(thrown.values["displacement"]).max() > 1e-2
    assert abs(thrown.values["energy_residual"][0]) < 1e-9
    assert thrown.values["status"][0] == Status.DIVERGED
    assert "500 Hz" in thrown.messages[0]
    sound = seen(h=float(thrown.messages[0].split("h = ")[2].split()[0]))
    assert sound.values["status"][0] == Status.OK
    assert np.abs(sound.values["displacement"]).max() < 1e-3


def test_a_casing_that_the_step_makes_faster_harms_no_tip_that_it_does_not_reach() -> None:
    far = seen(start=-2.0)
    assert far.values["impacts"][0] == 0
    slight = seen(amplitude=1e-12)
    assert slight.values["impacts"][0] > 0
    assert not far.values["status"][0]
    assert not slight.values["status"][0]
    assert not seen(theta=1.0).values["status"][0]


def _farther(nodes: int, times: float) -> np.ndarray:
    """Return how far bars go by θ = 1/2 over how far they go, where a step sees the casing so many times as fast.

    They fall by their weight on a casing that vibrates; three start heights and three restitutions, ``(case,)``.
    """
    frequency = 500.0
    h = brentq(lambda y: np.tan(y) / y - times, 0.1, 1.5707) / (np.pi * frequency)
    study = {
        "study": "seen",
        "scene": {
            "chain": {
                "nodes": nodes,
                "mass": 0.1,
                "stiffness": [0.0, *[1e4] * (nodes - 1)],
                "heat_capacity": 1,
            },
            "casing": {"gap": 0, "harmonics": [{"amplitude": 1e-5, "frequency": frequency}]},
            "load": {"steady": [0.981] * nodes},
            "duration": 0.24,
        },
        "schemes": {"half": {"method": "moreau", "theta": 0.5}},
        "axes": {
            "scheme": ["half", "event_driven"],
            "h": h,
            "e": [0.0, 0.5, 0.8],
            "scene.initial.displacement": [-1e-6, -1e-5, -1e-4],
        },
        "output": {"interval": 1e-3},
    }
    half, exact = (np.abs(each.values["displacement"]).max(axis=1) for each in solve_all(json.dumps(study)))
    return np.asarray(half / exact)


if __name__ == "__main__":
    for times in (1.5, 2.0, 3.0, 4.5, 6.0, 10.0, 30.0):
        farther = np.concatenate([_farther(nodes, times) for nodes in (1, 2, 3, 5)])
        print(f"{times:g} times as fast: half of {farther.size} cases go above {np.median(farther):.2g} times as far")
