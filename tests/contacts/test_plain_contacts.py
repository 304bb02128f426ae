"""The plain scheme of several contacts: complementarity, one contact as ever, and convergence to exact impulses."""

from __future__ import annotations

from typing import Any

import numpy as np
import plain_theta
import pytest
from plain_contacts import Operator, complementary, march
from several import of_entries

from scenes import heavy_chain, rubs
from workflow.models import Cases, Contacts, Rayleigh


@pytest.mark.parametrize("size", [1, 2, 3, 5])
def test_a_complementary_impulse_is_found(size: int) -> None:
    rng = np.random.default_rng(size)
    for _ in range(20):
        root = rng.normal(size=(size, size))
        matrix = root @ root.T + 0.1 * np.eye(size) + 0.1 * np.triu(rng.normal(size=(size, size)), 1)
        b = rng.normal(size=size)
        p, rest = complementary(matrix, b), matrix @ complementary(matrix, b) - b
        assert p.min() >= 0
        assert rest.min() >= -1e-10
        assert np.abs(p * rest).max() < 1e-10


@pytest.mark.parametrize("theta", [0.5, 1.0])
def test_one_contact_is_stepped_as_by_the_scheme_of_one(theta: float) -> None:
    structure, h, steps = heavy_chain(nodes=4, stiffness=4e6), 2e-5, 1500
    batch = rubs(structure, 1, e=0.4, frequency=50.0)
    tip = np.eye(4)[-1:]
    one = Contacts(("1",), tip, 0 * tip, tip, np.zeros(1))
    several = Cases(**{**vars(batch), "gaps": batch.gap[:, None], "turns": np.zeros((1, 1, 0))})
    motion = march(Operator(structure, h, theta), one, several, 0, steps)
    plain = plain_theta.march(structure, batch, h, theta, steps)
    assert plain.impulse.max() > 0
    np.testing.assert_allclose(motion.impulses[1:, 0], plain.impulse, atol=1e-11 * plain.impulse.sum())
    for name, states in (("displacement", plain.displacement), ("temperature", plain.temperature)):
        np.testing.assert_allclose(motion.histories[name][:, 0], states[:, -1], rtol=1e-9, atol=1e-15)


def two_stops(e: float, **more: Any) -> Cases:
    """One mass between two stops without a spring of its own: it flies from one to the other."""
    zero = np.zeros(1)
    given: dict[str, Any] = dict.fromkeys(("alpha", "gap", "mean"), zero)
    states = {"steady": zero[None], "heating": zero[None], "displacement": zero[None], "temperature": zero[None]}
    gaps, turns = np.array([[0.4, 0.25]]), np.zeros((1, 2, 0))
    return Cases(**given, **states, e=np.array([e]), velocity=np.ones((1, 1)), gaps=gaps, turns=turns, **more)


def test_a_mass_between_two_stops_loses_speed_by_e_at_each() -> None:
    """v = e^n: impulses m (1 + e) e^n at the stops in turn, in times 0.65 / e^n apart."""
    e, h = 0.6, 4e-3
    entries = {"mass": np.array([[2.0]]), "stiffness": np.array([[0.0]]), "contact": np.array([[1.0], [-1.0]])}
    structure = of_entries(entries, Rayleigh())
    assert structure.contacts is not None
    motion = march(Operator(structure, h, 0.5), structure.contacts, two_stops(e), 0, 1600)
    step, stop = np.nonzero(motion.impulses)
    assert stop.tolist() == [0, 1, 0, 1]
    np.testing.assert_allclose(motion.impulses[step, stop], 2.0 * (1 + e) * e ** np.arange(4), rtol=1e-12)
    times = 0.4 + np.cumsum([0.0, *0.65 / e ** np.arange(1, 4)])
    np.testing.assert_allclose(h * step, times, atol=8 * h)
