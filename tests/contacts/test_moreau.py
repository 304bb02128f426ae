"""What ``moreau`` leaves behind with one contact and with several: a pressed tip on its casing, a batch's bits."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from random_contacts import varied
from scenes_of_contacts import pressed, two_masses

from scenes import alone, cases, chain, heavy_chain, same_bits, sampling, static_equilibrium, step, taken
from workflow.models import Array, at_rest
from workflow.reduction import reduce_structure
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
