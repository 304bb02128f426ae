"""What the tip reaches without contact, told beforehand, against the exact solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import cases, chain, heavy_chain, sampling, step, with_dashpot
from workflow.models import free_reach, frequencies
from workflow.schemes import event_driven


@pytest.mark.parametrize(
    "conditions",
    [
        {"amplitude": 24.0, "frequency": 5.0},
        {"amplitude": 10.0, "frequency": 1090.0},
        {"amplitude": 10.0, "frequency": 3000.0, "phase": 1.2},
        {"mean": 20.0},
        {"mean": -20.0, "velocity": 0.3},
        {"displacement": 1e-5, "amplitude": 5.0, "frequency": 0.0, "phase": np.pi / 2},
    ],
)
def test_the_free_tip_stays_within_its_reach(conditions: dict[str, float]) -> None:
    """An upper bound, and no more than 2.5 times what is reached where anything moves towards the casing."""
    structure = heavy_chain()
    batch = cases(structure, gap=10.0, **conditions)
    over = sampling(0.2, 1e-5)
    results = event_driven.compute(event_driven.init(structure, 1.0, event_driven.Options()), batch, over)
    reached = float(results.histories["displacement"].max())
    bound = float(free_reach(structure, batch, over.duration)[0])
    assert reached <= bound * (1 + 1e-9)
    if reached > 1e-6:
        assert bound < 2.5 * reached


def test_a_free_body_reaches_everywhere() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=(0.0, 1e6, 1e6))
    assert np.isinf(free_reach(structure, cases(structure, gap=1.0, mean=1.0), 1.0)[0])


@pytest.mark.parametrize("load", [None, np.array([1.0, 0.5, 0.0, 0.2])])
def test_the_reach_holds_where_damping_couples_modes(load: np.ndarray | None) -> None:
    """At a resonance of a mode that a dashpot drives through another: from the steady motion on, the bound is met."""
    structure = replace(with_dashpot(heavy_chain(nodes=4), 0, 2, 60.0), load=load)
    frequency = float(frequencies(structure)[1] / (2 * np.pi))
    drive = {"amplitude": 100.0, "frequency": frequency, "gap": 1.0}
    started = cases(structure, velocity=[[0.3, -0.2, 0.1, 0.4]], **drive)
    displacement = step(structure, started, 2e-6, sampling(0.05, 5e-5), theta=0.5).histories["displacement"][0]
    assert displacement.max() < free_reach(structure, started, 0.05)[0] < 20 * displacement.max()
    omega, force = 2 * np.pi * frequency, np.eye(4)[3] if load is None else load
    dynamic = structure.stiffness_matrix - omega**2 * structure.mass + 1j * omega * structure.damping_matrix
    answer = 100.0 * np.linalg.solve(dynamic, force)
    steady = cases(structure, displacement=[answer.imag], velocity=[omega * answer.real], **drive)
    assert free_reach(structure, steady, 0.05)[0] == pytest.approx(abs(answer[3]), rel=1e-6)
