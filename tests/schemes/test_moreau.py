"""What ``moreau`` leaves behind: samples and load periods in their places, a pressed tip on its casing."""

import numpy as np
import pytest

from scenes import cases, chain, heavy_chain, sampling, static_equilibrium, step
from workflow.reduction import reduce_structure


def test_last_step_beyond_the_duration_counts_up_to_it() -> None:
    """duration/h = 12.5: the metrics end where the last sample lies."""
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, gap=0.0, mean=1.0)
    results = step(structure, batch, 0.08, sampling(1.0, 0.5))
    assert results.metrics["steps"][0] == 13
    assert results.metrics["contact_time"][0] == pytest.approx(1.0, rel=1e-12)
    assert results.histories["impulse"][0, -1] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("e", [0.0, 0.7])
def test_a_pressed_tip_stays_on_its_casing(theta: float, e: float) -> None:
    """Static starts at x = d exactly: no rounding may lose the contact, whatever gap, model and heat."""
    full = heavy_chain()
    gaps = np.linspace(1e-5, 7e-5, 31)
    rest = [static_equilibrium(full, np.eye(20)[-1] * 120.0, np.zeros(20), float(gap)) for gap in gaps]
    batch = cases(
        full, 31, e=e, alpha=np.arange(31) % 2 * 1e-9, gap=gaps, mean=120.0, displacement=np.array([x for x, _ in rest])
    )
    reduction = reduce_structure(full, 3, 12)
    for structure, loaded in ((full, batch), (reduction.structure, reduction.project(batch))):
        results = step(structure, loaded, 1e-4, sampling(0.5, 1e-3), theta=theta)
        force = np.diff(results.histories["impulse"], axis=1) / 1e-3
        assert np.array_equal(results.histories["displacement"], np.repeat(gaps[:, None], 501, axis=1))
        assert np.allclose(force, (120.0 - gaps * 1e6)[:, None], rtol=1e-6)
