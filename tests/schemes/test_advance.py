"""The exact motion from state to state: it goes on as if it had not been stopped, and keeps energy and heat."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from scenes import blade, blade_rub, cases, chain, heavy_chain, sampling, step
from workflow.models import Cases, Structure
from workflow.reduction import reduce_structure
from workflow.schemes._exact.advance import KINDS, States, advance, start_of
from workflow.schemes._exact.batch import make_operator
from workflow.schemes._exact.outcome import Budget


def parts(structure: Structure, batch: Cases, times: list[float]) -> tuple[States, list[str]]:
    """Advance over all times, one after the other."""
    operator, states, kinds = make_operator(structure, Budget(10**5, 10**6)), start_of(batch), []
    for t0, t1 in pairwise(times):
        states, events = advance(operator, batch, states, t0, t1)
        kinds += [KINDS[kind] for kind in events.kind]
    return states, kinds


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_it_goes_on_in_flight_and_in_contact(e: float) -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    batch = blade_rub(structure, e=e)
    whole = step(structure, batch, 1.0, sampling(0.6, 0.6), "event_driven")
    once, kinds = parts(structure, batch, [0.0, 0.6])
    times = np.linspace(0.0, 0.6, 61)
    often, again = parts(structure, batch, list(times))
    assert once.temperature[0, -1] == pytest.approx(whole.histories["temperature"][0, -1], rel=1e-12)
    assert often.displacement[0] == pytest.approx(once.displacement[0], rel=1e-9, abs=1e-15)
    assert often.temperature[0] == pytest.approx(once.temperature[0], rel=1e-9)
    assert kinds == again
    assert kinds.count("release") == whole.metrics["releases"][0] == 3


def test_it_stops_in_contact() -> None:
    structure = reduce_structure(blade(), 3, 12).structure
    states, kinds = parts(structure, blade_rub(structure), [0.0, 0.05])
    assert states.contact[0]
    assert kinds[-1] == "touch"
    assert states.displacement[0, -1] == pytest.approx(20e-6, rel=1e-12)


def test_energy_and_heat_of_free_bounces_are_kept() -> None:
    """Undamped, unloaded: energy falls by (1 - e²)/2 W p²/(1 + e)² at impacts alone; heat is α times the impulse."""
    e, alpha = 0.6, 2.0
    structure = chain(nodes=3, mass=0.1, stiffness=1e3, heat_capacity=2.0, conductance=0.0)
    batch = cases(structure, e=e, alpha=alpha, gap=1e-3, velocity=[[0.3, 0.1, 0.5]])
    operator = make_operator(structure, Budget(10**5, 10**6))
    states, events = advance(operator, batch, start_of(batch), 0.0, 0.225)
    M, K, C2 = structure.mass, structure.stiffness_matrix, structure.heat_capacity

    def energy(s: States) -> float:
        return float(s.velocity[0] @ M @ s.velocity[0] + s.displacement[0] @ K @ s.displacement[0]) / 2

    lost = sum(0.5 * (1 - e**2) * (p * 10.0 / (1 + e)) ** 2 * 0.1 for p in events.impulse)
    assert [KINDS[kind] for kind in events.kind] == 4 * ["impact"]
    assert energy(start_of(batch)) - energy(states) == pytest.approx(lost, rel=1e-11)
    assert C2[-1, -1] * states.temperature[0, -1] == pytest.approx(alpha * events.impulse.sum(), rel=1e-12)


def test_cases_are_their_own() -> None:
    structure = heavy_chain()
    batch = cases(structure, 3, alpha=[0.0, 1.0, 0.5], gap=5e-5, amplitude=100.0, frequency=20.0, e=0.5)
    operator = make_operator(structure, Budget(10**5, 10**6))
    together, events = advance(operator, batch, start_of(batch), 0.0, 0.1)
    for i in range(3):
        one = batch.take(slice(i, i + 1))
        alone, own = advance(operator, one, start_of(one), 0.0, 0.1)
        assert alone.velocity[0] == pytest.approx(together.velocity[i], rel=1e-12)
        assert own.time.tobytes() == events.time[events.case == i].tobytes()
