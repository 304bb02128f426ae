"""What the tip reaches without contact, told beforehand, against the exact solution."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import cases, chain, heavy_chain, sampling, step, with_dashpot
from workflow.models import free_reach


@pytest.mark.parametrize(
    "conditions",
    [
        {"amplitude": 24.0, "frequency": 5.0},
        {"amplitude": 10.0, "frequency": 1090.0},
        {"amplitude": 10.0, "frequency": 3000.0, "phase": 1.2},
        {"mean": 20.0},
        {"mean": -20.0, "velocity": 0.3},
        {"displacement": 1e-5, "amplitude": 5.0, "frequency": 0.0, "phase": np.pi / 2},
    ],
)
def test_the_free_tip_stays_within_its_reach(conditions: dict[str, float]) -> None:
    """An upper bound, and no more than 2.5 times what is reached where anything moves towards the casing."""
    structure = heavy_chain()
    batch = cases(structure, gap=10.0, **conditions)
    over = sampling(0.2, 1e-5)
    results = step(structure, batch, 0.0, over, "event_driven")
    reached = float(results.histories["displacement"].max())
    bound = float(free_reach(structure, batch, over.duration)[0])
    assert reached <= bound * (1 + 1e-9)
    if reached > 1e-6:
        assert bound < 2.5 * reached


def test_a_free_body_reaches_everywhere() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=(0.0, 1e6, 1e6))
    assert np.isinf(free_reach(structure, cases(structure, gap=1.0, mean=1.0), 1.0)[0])


def test_no_bound_is_known_where_damping_couples_modes() -> None:
    structure = with_dashpot(heavy_chain(nodes=4), 0, 2, 60.0)
    assert np.isinf(free_reach(structure, cases(structure, gap=1.0, mean=1.0), 1.0)[0])
