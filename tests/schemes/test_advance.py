"""The exact motion from state to state: it goes on as if it had not been stopped, and keeps energy and heat."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from scenes import blade, blade_rub, cases, chain, sampling, step
from workflow.models import Cases, Structure
from workflow.reduction import reduce_structure
from workflow.schemes._exact.advance import Trajectory, advance
from workflow.schemes._exact.batch import BatchRun, MarchInput, make_operator
from workflow.schemes._exact.modal_system import ModalBasis
from workflow.schemes._exact.outcome import Budget
from workflow.schemes._exact.record import IMPACT, RELEASE, TOUCH


def march_input(structure: Structure, batch: Cases) -> tuple[MarchInput, ModalBasis]:
    """Return what advances the first case."""
    operator = make_operator(structure, Budget(10**5, 10**6))
    return BatchRun(operator, batch, sampling(1.0, 1.0)).march_input(0), operator.basis


def parts(one: MarchInput, times: list[float]) -> list[Trajectory]:
    """Advance over all times, one after the other, from the start of a case."""
    X, contact, motions = one.case.modal, False, []
    for t0, t1 in pairwise(times):
        motions.append(advance(one, X, contact, t0, t1 - t0, kept=1))
        X, contact = motions[-1].X, motions[-1].contact
    return motions


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_it_goes_on_in_flight_and_in_contact(e: float) -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    batch = blade_rub(structure, e=e)
    whole = step(structure, batch, 1.0, sampling(0.6, 0.6), "event_driven")
    one, basis = march_input(structure, batch)
    (once,), often = parts(one, [0.0, 0.6]), parts(one, list(np.linspace(0.0, 0.6, 61)))
    warm = basis.free.heat_tip @ once.X[2 * basis.tip.size :]
    assert warm == pytest.approx(whole.histories["temperature"][0, -1], rel=1e-12)
    assert once.histories[2, -1] == pytest.approx(warm, rel=1e-12)
    np.testing.assert_allclose(often[-1].X, once.X, rtol=1e-9, atol=1e-9 * np.abs(once.X).max())
    assert np.concatenate([motion.kinds for motion in often]).tolist() == once.kinds.tolist()
    later = np.concatenate([motion.begin + motion.times for motion in often])
    np.testing.assert_allclose(later, once.times, rtol=1e-9)
    assert (once.kinds == RELEASE).sum() == whole.metrics["releases"][0] == 3


def test_it_stops_in_contact() -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    one, basis = march_input(structure, blade_rub(structure))
    (motion,) = parts(one, [0.0, 0.05])
    assert motion.contact
    assert motion.kinds[-1] == TOUCH
    assert basis.tip @ motion.X[: basis.tip.size] == pytest.approx(20e-6, rel=1e-12)


def test_energy_and_heat_of_free_bounces_are_kept() -> None:
    """Undamped, unloaded: energy falls by (1 - e²)/2 W p²/(1 + e)² at impacts alone; heat is α times the impulse."""
    e, alpha = 0.6, 2.0
    structure = chain(nodes=3, mass=0.1, stiffness=1e3, heat_capacity=2.0, conductance=0.0)
    one, basis = march_input(structure, cases(structure, e=e, alpha=alpha, gap=1e-3, velocity=[[0.3, 0.1, 0.5]]))
    (motion,), frequency = parts(one, [0.0, 0.225]), basis.free.frequency

    def energy(X: np.ndarray) -> float:
        return float(np.sum((frequency * X[:3]) ** 2 + X[3:6] ** 2)) / 2

    lost = sum(0.5 * (1 - e**2) * (p * 10.0 / (1 + e)) ** 2 * 0.1 for p in motion.impulses)
    assert motion.kinds.tolist() == 4 * [IMPACT]
    assert energy(motion.start) - energy(motion.X) == pytest.approx(lost, rel=1e-11)
    assert 2.0 * basis.free.heat_tip @ motion.X[6:] == pytest.approx(alpha * motion.impulses.sum(), rel=1e-12)


def test_a_state_that_is_not_reached_is_told() -> None:
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, e=1.0, mean=1.0, gap=1.0)
    one = BatchRun(make_operator(structure, Budget(10, 10**6)), batch, sampling(1.0, 1.0)).march_input(0)
    (motion,) = parts(one, [0.0, 100.0])
    assert np.isnan(motion.X).all()
    assert "after 10 contact events" in motion.failure
