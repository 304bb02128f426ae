"""moreau with several contacts: plain matrices, one contact, convergence to exact scenes, rest, and what is refused."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_contacts import varied
from two_masses import pressed, two_masses

from scenes import alone, same_bits, sampling, step, taken
from workflow.models import Array, at_rest
from workflow.schemes import Status

H, OVER = 4e-5, sampling(0.004, 5e-5)


@pytest.mark.parametrize(("method", "options"), [("moreau", {"theta": 0.5}), ("event_driven", {})])
@pytest.mark.parametrize("massless", [False, True])
def test_a_case_alone_has_the_bits_it_has_in_a_batch(massless: bool, method: str, options: dict[str, Any]) -> None:
    """Of cases that differ in all that a batch may vary; one is cold."""
    structure, case = varied(0, massless)
    batch, grows = case.take(np.zeros(5, dtype=int)), np.linspace(0, 1, 5)
    gaps = batch.gaps + 1e-5 * grows[:, None]
    batch = replace(batch, e=0.9 * grows, alpha=30 * grows, friction=0.2 * grows, gaps=gaps)
    together = step(structure, batch, H, OVER, method, **options)
    for k in range(batch.count):
        one = step(structure, alone(batch, k), H, OVER, method, **options)
        assert same_bits(one, taken(together, slice(k, k + 1)))


@pytest.mark.parametrize("massless", [False, True])
def test_what_starts_pressed_in_equilibrium_stays_on_its_casing(massless: bool) -> None:
    """In motion too: x = d, and with a casing at rest λ = f - k d."""
    residual = {"residual_flexibility": 1e-6 * np.eye(2)} if massless else {}
    structure = two_masses(**residual)
    for amplitude in (0.0, 1e-5):
        wave = {"casing_harmonics": [[amplitude, 3.0, 0.2]], "turns": [[0.0], [0.7]]}
        case = at_rest(structure, pressed(structure, **wave))
        over = sampling(0.1, 1e-3)
        ours = step(structure, case, 1e-3, over, theta=0.5)
        place = np.stack([case.casing_of_contacts(t)[0] for t in over.times], axis=-1)
        np.testing.assert_allclose(ours.histories["displacement"], place, rtol=4e-15)
        assert ours.metrics["contact_time"][0] == pytest.approx([0.1, 0.1])
        if amplitude == 0:
            force = (np.array([30.0, 50.0]) - 1e4 * 1e-3) / (1 + 1e4 * 1e-6 * massless)
            np.testing.assert_allclose(ours.histories["impulse"][0], force[:, None] * over.times, rtol=1e-9, atol=1e-15)


@pytest.mark.parametrize(("method", "options"), [("moreau", {}), ("moreau", {"theta": 0.5}), ("carpenter", {})])
def test_two_contacts_at_one_place_share_the_impulse_of_one(method: str, options: dict[str, Any]) -> None:
    """Newton's equations are singular there, so that the impulses are those of Lemke's method."""
    rows: Array = np.array([[1.0, 0.0], [1.0, 0.0]])
    ours, truth = (
        step(each, pressed(each, e=0.5, gaps=gaps, velocity=[3.0, -1.0]), 1e-3, sampling(0.2, 1e-3), method, **options)
        for each, gaps in ((two_masses(contact=rows), [[1e-3, 1e-3]]), (two_masses(), [[1e-3, 1e3]]))
    )
    assert ours.status.tolist() == [Status.OK], ours.messages
    total, alone_there = ours.histories["impulse"].sum(axis=1), truth.histories["impulse"][:, 0]
    assert alone_there[0, -1] > 1.0
    np.testing.assert_allclose(total, alone_there, rtol=1e-12, atol=1e-12)
