"""The exact motion from state to state: it goes on as if it had not been stopped, and keeps energy and heat."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from scenes import blade, blade_rub, cases, chain, sampling, step
from workflow.models import Cases, Structure
from workflow.reduction import reduce_structure
from workflow.schemes._exact.advance import Course, advance
from workflow.schemes._exact.batch import Batch, Prepared, make_operator
from workflow.schemes._exact.modal_system import Basis
from workflow.schemes._exact.outcome import Budget
from workflow.schemes._exact.record import IMPACT, RELEASE, TOUCH


def prepared(structure: Structure, batch: Cases) -> tuple[Prepared, Basis]:
    """Return what advances the first case."""
    operator = make_operator(structure, Budget(10**5, 10**6))
    return Batch(operator, batch, sampling(1.0, 1.0)).prepared(0), operator.basis


def parts(one: Prepared, times: list[float]) -> list[Course]:
    """Advance over all times, one after the other, from the start of a case."""
    X, contact, courses = one.case.modal, False, []
    for t0, t1 in pairwise(times):
        courses.append(advance(one, X, contact, t0, t1 - t0, kept=1))
        X, contact = courses[-1].X, courses[-1].contact
    return courses


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_it_goes_on_in_flight_and_in_contact(e: float) -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    batch = blade_rub(structure, e=e)
    whole = step(structure, batch, 1.0, sampling(0.6, 0.6), "event_driven")
    one, basis = prepared(structure, batch)
    (once,), often = parts(one, [0.0, 0.6]), parts(one, list(np.linspace(0.0, 0.6, 61)))
    warm = basis.free.heat_tip @ once.X[2 * basis.tip.size :]
    assert warm == pytest.approx(whole.histories["temperature"][0, -1], rel=1e-12)
    assert once.histories[2, -1] == pytest.approx(warm, rel=1e-12)
    np.testing.assert_allclose(often[-1].X, once.X, rtol=1e-9, atol=1e-9 * np.abs(once.X).max())
    assert np.concatenate([course.kinds for course in often]).tolist() == once.kinds.tolist()
    later = np.concatenate([course.begin + course.times for course in often])
    np.testing.assert_allclose(later, once.times, rtol=1e-9)
    assert (once.kinds == RELEASE).sum() == whole.metrics["releases"][0] == 3


def test_it_stops_in_contact() -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    one, basis = prepared(structure, blade_rub(structure))
    (course,) = parts(one, [0.0, 0.05])
    assert course.contact
    assert course.kinds[-1] == TOUCH
    assert basis.tip @ course.X[: basis.tip.size] == pytest.approx(20e-6, rel=1e-12)


def test_energy_and_heat_of_free_bounces_are_kept() -> None:
    """Undamped, unloaded: energy falls by (1 - e²)/2 W p²/(1 + e)² at impacts alone; heat is α times the impulse."""
    e, alpha = 0.6, 2.0
    structure = chain(nodes=3, mass=0.1, stiffness=1e3, heat_capacity=2.0, conductance=0.0)
    one, basis = prepared(structure, cases(structure, e=e, alpha=alpha, gap=1e-3, velocity=[[0.3, 0.1, 0.5]]))
    (course,), frequency = parts(one, [0.0, 0.225]), basis.free.frequency

    def energy(X: np.ndarray) -> float:
        return float(np.sum((frequency * X[:3]) ** 2 + X[3:6] ** 2)) / 2

    lost = sum(0.5 * (1 - e**2) * (p * 10.0 / (1 + e)) ** 2 * 0.1 for p in course.impulses)
    assert course.kinds.tolist() == 4 * [IMPACT]
    assert energy(course.start) - energy(course.X) == pytest.approx(lost, rel=1e-11)
    assert 2.0 * basis.free.heat_tip @ course.X[6:] == pytest.approx(alpha * course.impulses.sum(), rel=1e-12)


def test_a_state_that_is_not_reached_is_told() -> None:
    structure = chain(nodes=1, mass=1.0, stiffness=0.0)
    batch = cases(structure, e=1.0, mean=1.0, gap=1.0)
    one = Batch(make_operator(structure, Budget(10, 10**6)), batch, sampling(1.0, 1.0)).prepared(0)
    (course,) = parts(one, [0.0, 100.0])
    assert np.isnan(course.X).all()
    assert "after 10 contact events" in course.failure
