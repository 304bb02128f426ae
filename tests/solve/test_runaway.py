"""Runaway is physics: flagged, predicted, and the case stays ok."""

import pytest

from studies import solve_all


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
    values = solve_all(text)[0].values
    assert values["critical_alpha"][0] == pytest.approx(2e-3 / 0.3, rel=1e-12)
    assert 0 < values["growth_rate"][1] < 1e-5
    assert values["runaway"].tolist() == [0, 1]
