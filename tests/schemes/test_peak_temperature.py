"""The largest tip temperatures of the event-driven scheme do not depend on the output interval."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

from scenes import cases, chain, sampling, step
from workflow.models import Cases, Structure
from workflow.schemes import Results


def run(structure: Structure, case: Cases, duration: float, interval: float) -> Results:
    return step(structure, case, 0.0, sampling(duration, interval), "event_driven", events=1000)


@pytest.mark.parametrize("interval", [1000.0, 10.0, 1.0, 0.1])
@pytest.mark.parametrize("frequency", [0.0, 0.004])
def test_heat_that_passes_through_the_tip_between_two_samples(interval: float, frequency: float) -> None:
    """A hot node beside a cold tip far from its casing: the tip warms up, then cools."""
    structure = chain(nodes=2, mass=1.0e-3, stiffness=1.0e6, conductance=1.0, spacing=1.0, expansion=0.0)
    rate = -np.linalg.solve(structure.heat_capacity, structure.conductance_matrix)
    start = np.array([100.0, 0.0])
    top = brentq(lambda t: (rate @ expm(rate * t) @ start)[1], 0.1, 10.0, xtol=1e-12)
    exact = (expm(rate * top) @ start)[1]
    results = run(structure, cases(structure, gap=1.0, temperature=[start], frequency=frequency), 1000.0, interval)
    assert results.metrics["max_temperature"][0] == pytest.approx(exact, rel=1e-12)
    if frequency:  # load periods of 250 s: the tip is warmest in the first, then at the beginning of each
        boundaries = [(expm(rate * t) @ start)[1] for t in (250.0, 500.0, 750.0)]
        np.testing.assert_allclose(results.period_temperature[0], [exact, *boundaries], rtol=1e-9, atol=1e-12)


def test_a_top_between_load_periods_belongs_to_both() -> None:
    structure = chain(nodes=1, mass=1.0, stiffness=1.0, conductance=1.0, spacing=1.0, expansion=0.0)
    case = cases(structure, gap=1.0, heating=1.0, frequency=1.0)
    results = run(structure, case, 3.0, 3.0)
    np.testing.assert_allclose(results.period_temperature[0], -np.expm1([-1.0, -2.0, -3.0]), rtol=1e-13)
    cooling = run(structure, cases(structure, gap=1.0, temperature=1.0, frequency=1.0), 3.0, 3.0)
    np.testing.assert_allclose(cooling.period_temperature[0], np.exp([0.0, -1.0, -2.0]), rtol=1e-13)
