"""Branches of one mass against the closed form of its rub with one impact, and rubs at the edges of their kind."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from one_impact import OneImpact
from test_branch import states

from scenes import cases, chain
from workflow.models import Cases, Rayleigh, Structure
from workflow.orbits import STATES, Options, branch, steady_rubs


def followed(one: OneImpact, start: float, stop: float, points: int) -> dict[str, Any]:
    """The branch over the amplitude of the load."""
    structure = one.structure
    scene = one.scene(structure, start)

    def problem(force: float) -> tuple[Structure, Cases]:
        return structure, replace(scene, load_harmonics=scene.load_harmonics.scaled(force / start))

    return branch(problem, start, stop, points, Options(periods=2, samples=4))[0]


def test_a_section_that_is_moved_does_not_turn_a_branch_round() -> None:
    values = followed(OneImpact(1.352e-5, 0.0, 274.72, 2845.2, 1.0, 2.1319e-3, 128.78), 3.0, 30.0, 12)
    assert values["value"][[0, -1]].tolist() == [3.0, 30.0]
    assert np.all(np.diff(values["value"]) > 0)
    assert set(states(values)) == {"settles"}


def judged(structure: Structure, batch: Cases) -> str:
    return STATES[steady_rubs(structure, batch, Options())[0]["steady_state"][0]]


@pytest.mark.slow
def test_a_motion_that_touches_for_ever_is_not_free() -> None:
    """It touches to period 597 of 600 with an exponent above 0, though a free motion exists and is stable."""
    structure = chain(nodes=3, mass=1.0, stiffness=4e5, damping=Rayleigh(4.89, 0.0))
    batch = cases(structure, gap=0.03365, amplitude=1000.0, frequency=126.6)
    assert judged(structure, batch) == "not_found"


@pytest.mark.parametrize(
    ("alpha", "state"),
    [(0.02, "not_found"), pytest.param(0.2, "not_found", marks=pytest.mark.slow), (0.55, "runs_away")],
)
def test_a_flutter_that_lifts_the_tip_does_not_run_away(alpha: float, state: str) -> None:
    """At 0.2 it hammers with at most 150.66 K over 1 s; α_c is 0.5."""
    lumps = {"mass": 1e-3, "stiffness": 1e6, "spacing": 0.01, "expansion": 1e-5, "heat_capacity": 1e-5}
    structure = chain(nodes=4, conductance=0.1, damping=Rayleigh(10.0, 0.0), **lumps)
    loads = {"mean": 7.5, "amplitude": 0.05, "frequency": 2e5, "gap": -1e-5}
    start = np.linalg.solve(structure.stiffness_matrix, [0, 0, 0, 1.0])
    start = start * loads["gap"] / start[-1]
    assert judged(structure, cases(structure, alpha=alpha, e=0.5, displacement=start, **loads)) == state
