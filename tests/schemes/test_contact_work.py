"""What contact gave the tip over the largest energy: the same in modes, along nodes and by matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import cases, chain, sampling, step
from workflow.models import Cases, Chain
from workflow.schemes import Results, Sampling, moreau, penalty
from workflow.schemes._fixed import dense
from workflow.schemes._sweep.sweeps import Swept

H, STEPS = 2e-4, 100
OVER = replace(sampling(STEPS * H, H), balances=True)
"""Samples at every step's end; balances look at the energy of each of so few steps."""


def light_tip() -> tuple[Chain, Cases]:
    """Three nodes of which the tip is light and on its casing, and a step of ten periods of the tip."""
    structure = chain(nodes=3, mass=(0.01, 0.01, 1e-5), stiffness=(1e4, 1e6, 1e6))
    return structure, cases(structure, 4, e=[0.0, 0.3, 0.8, 1.0], velocity=0.05)


def run(structure: Chain, batch: Cases, how: str, theta: float, over: Sampling = OVER) -> Results:
    if how == "modes":
        return step(structure, batch, H, over, theta=theta)
    operator = moreau.Operator(structure, H, theta, Swept(structure), moreau.CONTACT)
    return moreau.compute(operator if how == "nodes" else dense.init(structure, H, theta, moreau.CONTACT), batch, over)


@pytest.mark.parametrize("how", ["modes", "nodes", "matrices"])
def test_contact_work_is_the_most_work_of_contact_over_the_largest_energy(how: str) -> None:
    """Nothing else does work at θ = 1/2: the largest energy is that of the start and the most that contact gave."""
    structure, batch = light_tip()
    results = run(structure, batch, how, 0.5)
    v, p = results.histories["velocity"], np.diff(results.histories["impulse"], axis=1)
    work = -p * (v[:, 1:] + v[:, :-1]) / 2
    most = np.fmax(np.stack([np.cumsum(work, axis=1).max(axis=1), work.max(axis=1)], axis=1), 0.0)
    largest = 0.5 * 0.05**2 * structure.masses.sum() + most[:, 0]
    shares = results.contact_work
    assert shares is not None
    assert np.abs(shares - most / largest[:, None]).max() < 1e-9
    assert shares[:2].min() > 0.2
    assert shares[:2, 0].min() > 0.5
    assert shares[3].max() < 1e-12  # e = 1 gives nothing


@pytest.mark.parametrize("how", ["modes", "nodes", "matrices"])
@pytest.mark.parametrize("theta", [0.5, 0.8])
def test_the_work_of_a_moving_casing_does_not_count(how: str, theta: float) -> None:
    """A casing that comes at up to 0.3 m/s throws a ball off: all its energy is that of the casing."""
    ball = chain(nodes=1, mass=(0.01,), stiffness=(0.0,))
    batch = cases(ball, 2, e=[0.0, 0.5], gap=5e-4, casing_harmonics=[[1e-3, 50.0, np.pi / 2]])
    results = run(ball, batch, how, theta)
    assert results.metrics["impacts"].min() > 0
    assert np.abs(results.histories["velocity"]).max() > 0.2
    assert results.contact_work is not None
    assert np.abs(results.contact_work).max() < 1e-12


def test_contact_work_is_known_with_balances_and_of_laws_that_count_it() -> None:
    structure, batch = light_tip()
    assert run(structure, batch, "modes", 0.5, sampling(STEPS * H, H)).contact_work is None
    spring = penalty.Options(stiffness=1e5, integration="implicit", theta=1.0)
    by_spring = penalty.compute(penalty.init(structure, H, spring), batch, OVER)
    assert by_spring.contact_work is not None
    assert not by_spring.contact_work.any()


def test_cases_with_heat_and_without_keep_their_order() -> None:
    structure, _ = light_tip()
    structure = replace(structure, free_expansion=np.full(3, 1e-7))
    batch = cases(structure, 4, e=[0.0, 0.3, 0.0, 0.3], alpha=[1e-3, 0.0, 0.0, 1e-3], velocity=0.05)
    both = step(structure, batch, H, OVER, theta=0.5).contact_work
    assert both is not None
    for case in range(4):
        alone = step(structure, batch.take(slice(case, case + 1)), H, OVER, theta=0.5).contact_work
        assert alone is not None
        assert np.array_equal(alone[0], both[case])
    assert both[0, 0] != both[1, 0]
