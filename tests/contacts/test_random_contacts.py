"""Schemes of the package against the plain one, on random structures of up to five contacts."""

from __future__ import annotations

import numpy as np
import plain_contacts
import pytest
from plain_contacts import Operator
from random_contacts import DURATION, drawn, on_basis

from scenes import watched
from workflow import schemes
from workflow.models import Array
from workflow.schemes import HISTORIES, Sampling, Status

OVER = Sampling(DURATION, DURATION / 200, 201)
H, FINER = 4e-5, 4

SEEDS = [*range(2), *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(2, 50))]


def apart(values: Array, truth: Array) -> float:
    """Return the relative L2 distance over contacts and samples; 0 of what stays 0."""
    distance = float(np.linalg.norm(values - truth))
    return distance / float(np.linalg.norm(truth)) if distance else 0.0


@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_smaller_steps_of_the_plain_scheme_come_closer_to_the_exact_motion(seed: int, massless: bool) -> None:
    """At first order: 2000 steps come within a tenth of it, in most cases within a hundredth."""
    case, scheme = drawn(seed, massless), schemes.load("event_driven")
    exact = scheme.compute(scheme.init(case.structure, H, scheme.Options()), case.cases, OVER)
    assert exact.status.tolist() == [Status.OK], exact.messages
    steps = [Operator(case.structure, h, 0.5) for h in (H, H / FINER)]
    coarse, fine = (plain_contacts.compute(one, case.cases, OVER).histories for one in steps)
    truth = exact.histories
    if massless or case.cases.e[0] == 0.0:  # bounces make a motion chaotic
        distances = [apart(states["displacement"], truth["displacement"]) for states in (coarse, fine)]
        assert distances[1] < 0.6 * distances[0]
    for name in ("displacement", "impulse", "temperature"):
        assert apart(fine[name], truth[name]) < 0.15, name


@pytest.mark.parametrize("theta", [0.5, 1.0])
@pytest.mark.parametrize("massless", [False, True])
@pytest.mark.parametrize("seed", SEEDS)
def test_moreau_steps_as_the_plain_scheme(seed: int, massless: bool, theta: float) -> None:
    case, scheme = on_basis(seed, massless), schemes.load("moreau")
    structure = watched(case.structure)
    results = scheme.compute(scheme.init(structure, H, scheme.Options(theta=theta)), case.cases, OVER)
    assert results.status.tolist() == [Status.OK], results.messages
    plain = plain_contacts.compute(Operator(structure, H, theta), case.cases, OVER)
    for name in (*HISTORIES, "sensor_value"):
        truth = plain.histories[name]
        np.testing.assert_allclose(
            results.histories[name], truth, rtol=0, atol=1e-9 * np.abs(truth).max(), err_msg=name
        )
    for name in ("impacts", "contact_time", "max_penetration", "max_temperature", "thermal_closing"):
        truth = plain.metrics[name]
        np.testing.assert_allclose(results.metrics[name], truth, rtol=1e-8, atol=1e-13, err_msg=name)
