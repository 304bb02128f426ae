"""Newton's law on central differences: what it gives a single mass, and what it shares with carpenter."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import cases, chain, everything_acts, heavy_chain, sampling, step


@pytest.mark.parametrize("h", [1e-2, 7e-3])
def test_a_single_mass_leaves_with_e_times_its_speed(h: float) -> None:
    """It meets the casing at 2 m/s, passes it by less than e times the way of one step, and takes (1 + e) m v."""
    e = np.array([0.0, 0.3, 1.0])
    batch = cases(chain(nodes=1, mass=3.0, stiffness=0.0), 3, e=e, gap=0.5, velocity=2.0)
    results = step(chain(nodes=1, mass=3.0, stiffness=0.0), batch, h, sampling(1.0, 0.1), "paoli_schatzman")
    assert results.histories["velocity"][:, -1] == pytest.approx(-2.0 * e, abs=1e-12)
    assert results.histories["impulse"][:, -1] == pytest.approx(6.0 * (1 + e), rel=1e-12)
    assert results.metrics["impacts"].tolist() == [1, 1, 1]
    assert np.all(results.metrics["max_penetration"] <= e * 2.0 * h + 1e-12)


def test_without_restitution_it_is_carpenter() -> None:
    batch = everything_acts(heavy_chain(), 16, e=np.zeros(16))
    ours, theirs = (
        step(heavy_chain(), batch, 1e-6, sampling(0.02, 1e-3), scheme) for scheme in ("paoli_schatzman", "carpenter")
    )
    assert theirs.metrics["impacts"].min() > 0
    for name, values in theirs.histories.items():
        assert ours.histories[name] == pytest.approx(values, rel=1e-9, abs=1e-9 * np.abs(values).max()), name
