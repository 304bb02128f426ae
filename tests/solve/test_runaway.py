"""Runaway is physics: flagged, predicted, and the case stays ok."""

from __future__ import annotations

import numpy as np
import pytest

from studies import HEAVY_SCENE, parsed
from workflow.cases import arrange
from workflow.schemes import Status
from workflow.solve import solve

LIGHT = HEAVY_SCENE.replace("1.315", "1.315e-3").replace("amplitude: 100, frequency: 20", "mean: 100")


def solved_at(alphas: list[float]) -> dict[str, np.ndarray]:
    scene = LIGHT.replace("duration: 0.3", "duration: 8")
    axes = f"axes: {{scheme: event_driven, alpha: {alphas}}}\noutput: {{interval: 0.1}}\n"
    return solve(arrange(parsed(f"study: runaway{scene}{axes}")), 0, np.arange(len(alphas))).values


def test_below_at_and_above_the_critical_coupling() -> None:
    critical = float(solved_at([0.0, 1.0])["critical_alpha"][0])
    assert critical == pytest.approx(1.071, abs=5e-4)
    solved = solved_at([share * critical for share in (0.9, 1.0, 1.1)])
    assert np.all(solved["status"] == Status.OK)
    assert solved["runaway"].tolist() == [0, 0, 1]  # at the critical coupling nothing grows exponentially
    force, t = solved["contact_force"], np.arange(81) * 0.1
    assert force[0, -1] == pytest.approx(500, rel=1e-3)
    late = t > 3
    slope = np.polyfit(t[late], force[1, late], 1)
    assert np.abs(np.polyval(slope, t[late]) - force[1, late]).max() < 1e-3 * force[1, -1]  # linear
    assert solved["growth_rate"][2] == pytest.approx(1.608, abs=5e-4)
    growth = np.log(force[2, -1] / force[2, -2]) / 0.1
    assert growth == pytest.approx(solved["growth_rate"][2], rel=1e-3)


def test_slow_growth_beside_fast_decay_is_a_runaway() -> None:
    """1e-6 1/s beside damping rates of 4e8 1/s: above the critical coupling a positive eigenvalue is certain."""
    text = """
study: slow
scene:
  chain: {nodes: 3, mass: 1.0e-3, stiffness: 1.0e6, damping: {stiffness: 0.1}, spacing: 1.0e-2, expansion: 1.0e-5,
          heat_capacity: 1.0e+3, conductance: 1.0e-3}
  casing: {gap: 0}
  duration: 1.0e-3
axes: {alpha: [0.003, 0.02], scheme: event_driven}
output: {interval: 1.0e-3}
"""
    grid = arrange(parsed(text))
    (outer,) = grid.computed.tolist()
    values = solve(grid, outer, np.arange(grid.inner_count)).values
    assert values["critical_alpha"][0] == pytest.approx(2e-3 / 0.3, rel=1e-12)
    assert 0 < values["growth_rate"][1] < 1e-5
    assert values["runaway"].tolist() == [0, 1]
