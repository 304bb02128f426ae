"""Transfer functions of the tip: against NumPy's complex solver, and the counts that they ask for."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import chain
from workflow.models import Rayleigh, Structure, critical_alpha
from workflow.reduction import Reduction, names, reduce_structure
from workflow.reduction._transfer import (
    Excitation,
    displacement_answer,
    least_counts,
    temperature_answer,
)

N = 6


def structure() -> Structure:
    return chain(
        nodes=N,
        mass=2.5e-3,
        stiffness=6.0e6,
        damping=Rayleigh(10.0, 2.0e-7),
        spacing=8e-3,
        expansion=8.6e-6,
        heat_capacity=4.4,
        conductance=0.18,
        convection=0.07,
    )


def excitation(frequency: float = 20.0) -> Excitation:
    tip = np.eye(N)[:, -1:]
    warm = np.full((N, 1), 3.0)
    return Excitation(0.3, 1e-4, frequency, tip, np.hstack([tip, warm]))


def test_answers_are_those_of_a_complex_solver() -> None:
    """The last point is the load's own frequency; heat begins at 1/duration, with the real part a fifth of ω."""
    full, excited = structure(), excitation()
    s = 2j * np.pi * 20.0
    dynamic = full.stiffness_matrix + s * full.damping_matrix + s**2 * full.mass
    exact = np.linalg.solve(dynamic, np.eye(N)[-1])[-1]
    answer = displacement_answer(full, excited, excited.forces)[-1, 0]
    np.testing.assert_allclose([answer.real, answer.imag], [exact.real, exact.imag], rtol=1e-10)
    s = (0.2 + 1j) / 0.3
    exact = np.linalg.solve(full.conductance_matrix + s * full.heat_capacity, excited.heats)[-1]
    answer = temperature_answer(full, excited, excited.heats)[0]
    np.testing.assert_allclose([answer.real, answer.imag], [exact.real, exact.imag], rtol=1e-10)


@pytest.mark.parametrize("basis", names())
def test_counts_grow_as_the_tolerance_falls_and_end_with_all(basis: str) -> None:
    full = structure()
    if "massless" in basis or basis == "macneal":
        pytest.skip("its tip has no mass")

    def reduce(mechanical: int, thermal: int) -> Reduction:
        return reduce_structure(full, mechanical, thermal, basis, 0.3)

    counts = [least_counts(full, reduce, excitation(), 10.0**-k, (N - 1, N - 1)) for k in (1, 3, 5, 14)]
    assert counts == sorted(counts)
    assert counts[0] < counts[-1] == (N - 1, N - 1)


def test_a_wrong_critical_coupling_asks_for_more() -> None:
    """Of a reduction whose temperatures are all there but whose springs are those of another chain until all are."""
    full = structure()
    wrong = chain(
        nodes=N,
        mass=2.5e-3,
        stiffness=6.0e6,
        spacing=8e-3,
        heat_capacity=4.4,
        expansion=1e-6,
        conductance=0.18,
        convection=0.07,
    )
    assert critical_alpha(wrong) > 2 * critical_alpha(full)

    def reduce(mechanical: int, thermal: int) -> Reduction:
        right = mechanical == N - 1 or thermal == 0 or mechanical == 0
        return reduce_structure(full if right else wrong, mechanical, thermal)

    assert least_counts(full, reduce, excitation(), 1e-3, (N - 1, N - 1))[0] == N - 1
