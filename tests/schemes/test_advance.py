"""The exact motion from state to state beyond what orbits show: many events, and a state that is not reached."""

from __future__ import annotations

import numpy as np

from scenes import blade, blade_rub, cases, chain
from workflow.models import Cases, Structure
from workflow.reduction import reduce_structure
from workflow.schemes._exact.batch import make_operator
from workflow.schemes._exact.layout import Budget
from workflow.schemes._exact.trajectory import Trajectory, one_case, trajectory


def advanced(structure: Structure, batch: Cases, span: float, kept: int, events: int = 10**5) -> Trajectory:
    one = one_case(make_operator(structure, Budget(events, 10**6)), batch, 1.0)
    return trajectory(one, one.own.modal, False, 0.0, span, kept=kept)


def test_more_events_than_are_guessed_are_kept() -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    few, many = (advanced(structure, blade_rub(structure, e=0.5), 0.6, kept) for kept in (1, 1000))
    assert few.times.size > 6
    assert np.array_equal(few.times, many.times)
    assert np.array_equal(few.X, many.X)


def test_a_state_that_is_not_reached_is_told() -> None:
    ball = chain(nodes=1, mass=1.0, stiffness=0.0)
    course = advanced(ball, cases(ball, e=1.0, mean=1.0, gap=1.0), 100.0, 1, events=10)
    assert np.isnan(course.X).all()
    assert "after 10 contact events" in course.failure
