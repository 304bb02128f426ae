"""Perturbed cases: one sign of the share leaves less contact, the other more, and no tip starts beyond its casing."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import cases, chain
from workflow.judges.distances import perturbed


@pytest.mark.parametrize("share", [1e-6, -1e-6])
def test_a_share_widens_gaps_and_takes_as_much_of_loads(share: float) -> None:
    lump, sway = chain(nodes=2, mass=1.0, stiffness=1.0), [[0.5, 3.0, 1.0]]
    gap, mean = np.array([2.0, -2.0, 0.0]), np.array([5.0, -5.0, 0.0])
    one = cases(lump, 3, gap=gap, mean=mean, amplitude=8.0, frequency=1.0, displacement=-4.0, casing_harmonics=sway)
    other = perturbed(one, share, 3.0)
    np.testing.assert_allclose(other.gap - gap, 3.0 * share, rtol=1e-6)
    np.testing.assert_allclose(other.mean - mean, -8.0 * share, rtol=1e-6)
    np.testing.assert_allclose(other.load_harmonics.amplitude - 8.0, -8.0 * share, rtol=1e-6)
    on = cases(lump, 3, displacement=one.casing_at(0.0)[:, None], gap=gap, casing_harmonics=sway)
    start = perturbed(on, share, 0.0)
    assert np.all(start.displacement[:, -1] <= start.casing_at(0.0))
