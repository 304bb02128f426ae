"""Central differences that keep the tip outside, ``carpenter`` and ``paoli_schatzman``: theory, exact solutions."""

import numpy as np
import pytest

from scenes import cases, chain, heavy_chain, sampling, step
from workflow import models
from workflow.schemes import Status, carpenter, limit_text


def test_the_heat_step_has_a_limit_of_its_own() -> None:
    """Explicit: 2/μ_max; implicit: none. Unheated cases carry no thermal state."""
    structure = heavy_chain(convection=2e3, conductance=7e4)
    limit = 2 / models.thermal_modes(structure).values.max()
    assert limit < 1.1e-5  # below that of the mechanics, 1.12e-5 s
    batch = cases(structure, 2, alpha=[0.0, 1.0], gap=5e-5, amplitude=100.0, frequency=200.0)
    over = sampling(0.02, 1e-3)
    assert np.all(step(structure, batch, 0.999 * limit, over, "carpenter", heat="explicit").status == Status.OK)
    beyond = step(structure, batch, 1.001 * limit, over, "carpenter", heat="explicit")
    assert beyond.status.tolist() == [Status.OK, Status.DIVERGED]
    assert beyond.messages[1].startswith("the explicit heat step grows")
    assert f"stable up to {limit_text(limit, 7)} s" in beyond.messages[1]
    assert np.all(step(structure, batch, 1.001 * limit, over, "carpenter", heat="implicit").status == Status.OK)


def test_impact_at_the_start_and_a_load_that_presses() -> None:
    """An impulse at t = 0 counts whole; then the force is the load."""
    structure = chain(nodes=1, mass=2.0, stiffness=0.0)
    batch = cases(structure, 2, gap=0.0, mean=5.0, velocity=[[3.0], [0.0]])
    results = step(structure, batch, 1e-3, sampling(1.0, 0.1), "carpenter")
    assert np.abs(results.histories["displacement"]).max() < 1e-15
    assert results.histories["impulse"][:, -1] == pytest.approx([2 * 3.0 + 5.0, 5.0], rel=1e-3)
    assert np.diff(results.histories["impulse"][1])[1:] == pytest.approx(0.5, rel=1e-12)
    assert results.metrics["max_penetration"].max() < 1e-15


@pytest.mark.parametrize("scheme", [carpenter.Options(), carpenter.Options(damping="lagged")])
def test_a_damped_rigid_mode_does_not_grow(scheme: carpenter.Options) -> None:
    """Its roots are 1 and the factor of damping; rounding made 1 + 1e-11 of 1, and sound cases were diverged."""
    steps, rates = np.geomspace(1e-9, 1e-3, 40), np.array([1e-3, 1.0, 10.0, 1e3])
    for h in steps:
        roots = carpenter.amplification(np.zeros(rates.size), rates, float(h), scheme)
        assert np.abs(roots).max() <= 1 + np.finfo(float).eps
