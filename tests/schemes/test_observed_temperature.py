"""Schemes record another temperature than the tip's, a mean over a depth: against all node temperatures."""

from typing import Any

import numpy as np
import pytest

from plain_steps import stepped_as
from scenes import cases, heavy_chain, observing, sampling, step
from workflow.models import Cases, Structure
from workflow.reduction import reduce_structure

DEPTH, DURATION, H = 7.3e-3, 6e-3, 1e-5


def rub(structure: Structure, count: int = 1) -> Cases:
    heat = {"heating": np.linspace(0.0, 3.0, structure.thermal_size), "temperature": 2.0}
    alpha = np.linspace(20.0, 40.0, count)
    return cases(structure, count, alpha=alpha, gap=2e-5, amplitude=60.0, frequency=200.0, mean=5.0, **heat)


FULL: Any = heavy_chain(nodes=6, stiffness=4e5)
MEAN, REDUCTION = FULL.mean_over(DEPTH), reduce_structure(FULL, 2, 3)
STRUCTURES = {
    "full": observing(FULL, MEAN),
    "reduced": observing(REDUCTION.structure, REDUCTION.temperature_basis.T @ MEAN),
}
LAWS: dict[str, tuple[str, dict[str, Any]]] = {
    "moreau": ("moreau", {"theta": 0.7}),
    "carpenter": ("carpenter", {}),
    "spring": ("penalty", {"stiffness": 1e7, "integration": "explicit"}),
    "implicit": ("penalty", {"stiffness": 1e7, "integration": "implicit", "theta": 1.0}),
}
SLOW = pytest.mark.slow
"""Each contact law compiles a kernel of its own for a depth."""


@pytest.mark.parametrize("name", ["moreau", *(pytest.param(name, marks=SLOW) for name in LAWS if name != "moreau")])
@pytest.mark.parametrize("kind", STRUCTURES)
def test_steps_record_the_mean_of_the_nodes_they_have(kind: str, name: str) -> None:
    """Samples and the largest of all step ends, and the motion to the bit as without."""
    structure, (method, options) = STRUCTURES[kind], LAWS[name]
    case, over = rub(structure), sampling(DURATION, 10 * H)  # by kernels that others have compiled
    results = step(structure, case, H, over, method, **options)
    nodes = stepped_as(structure, H, method, options)(case, round(DURATION / H)).temperature
    means = nodes @ structure.contacts.observed[0]
    assert results.metrics["impacts"][0] >= 1
    np.testing.assert_allclose(results.histories["temperature"][0], means[::10], rtol=1e-8, atol=1e-9)
    assert results.metrics["max_temperature"][0] == pytest.approx(means.max(), rel=1e-8)
    assert np.ptp(nodes[-1]) > 0.1 * abs(means[-1])  # another temperature than the tip's
    tip = step(observing(structure, None), case, H, over, method, **options)
    for history in ("displacement", "velocity", "impulse"):
        assert np.array_equal(results.histories[history], tip.histories[history])


@pytest.mark.parametrize("kind", STRUCTURES)
def test_the_exact_scheme_records_what_steps_converge_to(kind: str) -> None:
    structure = STRUCTURES[kind]
    case, over = rub(structure), sampling(DURATION, 10 * H)
    exact = step(structure, case, 0.0, over, "event_driven")
    errors = []
    for h in (4e-6, 1e-6):
        results = step(structure, case, h, over, "moreau", theta=0.5)
        errors.append(np.abs(results.histories["temperature"] - exact.histories["temperature"]).max())
        largest = results.metrics["max_temperature"][0]
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 2e-3 * exact.metrics["max_temperature"][0]
    assert largest == pytest.approx(exact.metrics["max_temperature"][0], rel=2e-3)
    tip = step(observing(structure, None), case, 0.0, over, "event_driven")
    assert np.array_equal(exact.histories["displacement"], tip.histories["displacement"])
