"""What the tip reaches without contact and how hot it becomes, told beforehand, against the exact solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scenes import blade, cases, chain, heavy_chain, sampling, step
from sliding import slider
from workflow.models import Structure, free_motion, frequencies, quasi_static_temperature
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
    bound = float(free_motion(structure, batch, over.duration).reach[0])
    assert reached <= bound * (1 + 1e-9)
    if reached > 1e-6:
        assert bound < 2.5 * reached


def test_a_free_body_reaches_everywhere() -> None:
    structure = chain(nodes=3, mass=1.0, stiffness=(0.0, 1e6, 1e6))
    assert np.isinf(free_motion(structure, cases(structure, gap=1.0, mean=1.0), 1.0).reach[0])


@pytest.mark.parametrize("gap", [15e-6, 17.5e-6, 20e-6, 22e-6])
def test_temperatures_are_told_within_a_fifth(gap: float) -> None:
    """The rubbing blade below and above its critical coupling in permanent contact: 102 K to 3 918 K."""
    structure, over = blade(), sampling(2.0, 1e-3)
    batch = cases(structure, alpha=30.0, gap=gap, amplitude=24.0, frequency=5.0)
    results = event_driven.compute(event_driven.init(structure, 1.0, event_driven.Options()), batch, over)
    estimated = quasi_static_temperature(structure, batch, free_motion(structure, batch, over.duration), over.duration)
    assert estimated[0] == pytest.approx(results.metrics["max_temperature"][0], rel=0.2)


def test_a_tip_that_stays_clear_stays_cold() -> None:
    structure = blade()
    batch = cases(structure, alpha=30.0, gap=30e-6, amplitude=24.0, frequency=5.0)
    assert quasi_static_temperature(structure, batch, free_motion(structure, batch, 2.0), 2.0)[0] == 0.0


def test_friction_presses_harder_where_it_leans_on_the_casing() -> None:
    """The force on the casing is that at rest over 1 - µ s, s = ψᵀt; heat that moves nothing rises in proportion."""
    structure, friction = slider(cross=-30.0), np.array([0.0, 0.5, 1.2, 10.0 / 3.0, 4.0])
    batch = cases(structure, 5, friction=friction, mean=5.0, gap=0.01, alpha=0.1)
    temperatures = quasi_static_temperature(structure, batch, free_motion(structure, batch, 1.0), 1.0)
    forces = np.array([static_force(structure, mu) for mu in friction[:3]])
    np.testing.assert_allclose(temperatures[:3] / temperatures[0], forces / forces[0], rtol=1e-12)
    assert np.all(np.isinf(temperatures[3:]))


def static_force(structure: Structure, friction: float) -> float:
    """λ of a tip at rest on its casing under 5 N, from K1 x = F e_n - λ (e_n - µ t), x_n = 0.01."""
    push = np.array([-friction * structure.tangent[0], 1.0])
    answer = np.linalg.solve(structure.stiffness_matrix, np.column_stack([[0.0, 5.0], push]))[-1]
    return float((answer[0] - 0.01) / answer[1])


@pytest.mark.parametrize("load", [None, np.array([1.0, 0.5, 0.0, 0.2])])
def test_the_reach_holds_where_damping_couples_modes(load: np.ndarray | None) -> None:
    """At a resonance of a mode that a dashpot drives through another: the steady answer is the harmonic one."""
    structure = heavy_chain(nodes=4).matrices()
    damper = np.zeros((4, 4))
    damper[np.ix_([0, 2], [0, 2])] = 60.0 * np.array([[1.0, -1.0], [-1.0, 1.0]])
    structure = replace(structure, damper=damper, load=load)
    frequency = float(frequencies(structure)[1] / (2 * np.pi))
    batch = cases(structure, amplitude=100.0, frequency=frequency, gap=1.0, velocity=[[0.3, -0.2, 0.1, 0.4]])
    displacement = step(structure, batch, 2e-6, sampling(0.05, 5e-5), theta=0.5).histories["displacement"][0]
    free = free_motion(structure, batch, 0.05)
    assert displacement.max() < free.reach[0] < 20 * displacement.max()
    late = displacement[len(displacement) * 4 // 5 :]
    assert late.max() == pytest.approx(free.harmonic[0], rel=0.05)
