"""Friction heat that brings poles of the held tip together: they move as one, whatever lies beside."""

from __future__ import annotations

import numpy as np
import pytest
from test_event_driven_random import against_reference

from scenes import cases, chain, heavy_chain, held_matrix, sampling, with_dashpot
from workflow.models import Rayleigh, Structure
from workflow.schemes._exact.batch import make_operator
from workflow.schemes._exact.layout import Budget, unpacked
from workflow.schemes._exact.tables import block, first

HEAT = {"spacing": 1e-2, "expansion": 1e-4, "heat_capacity": 1e-3, "conductance": 1.0}


def real_poles(structure: Structure, alpha: float) -> int:
    return int(np.isreal(np.linalg.eigvals(held_matrix(structure, alpha))).sum())


@pytest.mark.parametrize("dashpot", [0.0, 3.0])
@pytest.mark.parametrize("beside", [0.0, 1e-14, -1e-14, 1e-10, -1e-10, 1e-6, -1e-6, 1e-4, -1e-4, 1e-2, -1e-2])
def test_real_poles_that_meet(beside: float, dashpot: float) -> None:
    """A mode a little beyond critical damping under a pressed tip, against matrix exponentials in 80 bits."""
    structure = chain(nodes=3, mass=0.01, stiffness=1e5, damping=Rayleigh(2.1 * np.sqrt(1e7)), **HEAT)
    if dashpot:
        structure = with_dashpot(structure, 0, None, dashpot)
    low, high = 1e-4, 10.0
    apart = real_poles(structure, low)
    assert apart > real_poles(structure, high)
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if real_poles(structure, middle) < apart else (middle, high)
    pressed = {"mean": 50.0, "amplitude": 10.0, "frequency": 100.0, "temperature": 0.1}
    case = cases(
        structure, alpha=high * (1 + beside), displacement=[1e-5, -2e-5, 0.0], velocity=[0.3, 0.1, 0.0], **pressed
    )
    assert against_reference(structure, case, sampling(3e-3, 1e-4)) <= 1e-10


@pytest.mark.parametrize("alpha", [1e-3, 10.0, 100.0])
def test_blocks_are_the_poles_of_the_held_tip_in_the_order_of_their_size(alpha: float) -> None:
    """Searches for events take the slowest blocks first."""
    structure = heavy_chain(nodes=9)
    held = make_operator(structure, Budget(1, 1)).held.at(np.array([alpha]), np.zeros(1), np.ones(1, dtype=bool))
    assert held.separable.all()
    regime = unpacked(held.rows[0])
    c, w2 = regime.block[[block.DAMPING, block.STIFFNESS], : regime.blocks]
    rates = regime.first[first.RATE, : regime.firsts]
    assert np.all(np.diff(w2) > 0.0)
    assert np.all(np.diff(np.abs(rates)) > 0.0)
    exact = np.linalg.eigvals(held_matrix(structure, alpha))
    np.testing.assert_allclose(np.sqrt(w2), np.sort(np.abs(exact[exact.imag > 0])), rtol=1e-9)
    np.testing.assert_allclose(c.sum() + rates.sum(), -exact.sum().real, rtol=1e-7)
