"""A tip that its reduction leaves without mass: contact by place, no impacts, and schemes that cannot."""

from typing import Any

import numpy as np
import pytest
from plain_theta import march_by_place

from scenes import cases, everything_acts, heavy_chain, sampling, step
from workflow.reduction import Reduction, reduce_structure
from workflow.schemes import Status

LIGHTENED = ("macneal", "massless")
REFUSED = [
    *((method, {}, "without mass") for method in ("carpenter", "event_driven", "penalty")),
    ("moreau", {"theta": 0.0}, "theta = 0"),
    ("penalty", {"theta": 0.0, "integration": "implicit"}, "theta = 0"),
]


def reduced(basis: str, mechanical: int = 3, thermal: int = 5) -> Reduction:
    reduction = reduce_structure(heavy_chain(), mechanical, thermal, basis)
    assert reduction.structure.has_massless_tip
    return reduction


@pytest.mark.parametrize("theta", [1.0, 0.5])
@pytest.mark.parametrize("basis", LIGHTENED)
def test_a_step_is_that_of_plain_matrices(basis: str, theta: float) -> None:
    """Bent, moving and warm starts under constant and harmonic loads, with friction heat; a tip that is let go."""
    whole, reduction, h = heavy_chain(), reduced(basis), 1e-5
    batch = everything_acts(whole, 3, e=0.7, mean=0.0, alpha=[0.0, 0.5, 0.9], gap=[2e-5, 3e-5, 5e-5])
    small = reduction.project(batch)
    run = step(reduction.structure, small, h, sampling(0.02, 1e-4, balances=True), theta=theta)
    assert theta == 1.0 or np.abs(run.metrics["energy_residual"]).max() < 1e-12  # the mode of the tip is in it
    for case in range(3):
        plain = march_by_place(reduction.structure, small.take(slice(case, case + 1)), h, theta, 2000)
        for name, values in (("displacement", plain.displacement[:, -1]), ("temperature", plain.temperature[:, -1]),
                             ("impulse", np.append(0.0, np.cumsum(plain.impulse)))):  # fmt: skip
            assert np.abs(run.histories[name][case] - values[::10]).max() < 1e-9 * np.abs(values).max(), name
    assert run.metrics["impacts"].min() > 0
    assert run.metrics["max_penetration"].max() == 0


@pytest.mark.parametrize(("method", "options", "why"), REFUSED)
def test_schemes_that_cannot_step_it_say_so(method: str, options: dict[str, Any], why: str) -> None:
    """Those that need the mass, and explicit steps."""
    over = sampling(1e-3, 1e-4, balances=True)
    with pytest.raises(ValueError, match=why):
        step(reduced("massless").structure, cases(heavy_chain(nodes=4)), 1e-6, over, method, **options)


def test_theta_below_one_half_diverges_at_any_step() -> None:
    reduction = reduced("massless")
    batch = reduction.project(cases(heavy_chain(), 1, gap=1.0, displacement=1e-6))
    run = step(reduction.structure, batch, 1e-9, sampling(1e-7, 1e-8, balances=True), theta=0.4)
    assert run.status.tolist() == [Status.DIVERGED]
    assert "1.5-fold" in run.messages[0]
    assert "at no h" in run.messages[0]


@pytest.mark.parametrize("basis", LIGHTENED)
def test_a_stiff_implicit_penalty_is_near_the_law_by_place(basis: str) -> None:
    reduction = reduced(basis)
    batch = reduction.project(cases(heavy_chain(), 1, alpha=0.5, gap=5e-5, amplitude=100.0, frequency=20.0))
    over = sampling(0.05, 1e-3, balances=True)
    rigid = step(reduction.structure, batch, 1e-5, over)
    apart = []
    for stiffness in (1e8, 1e10):
        soft = step(reduction.structure, batch, 1e-5, over, "penalty", integration="implicit", stiffness=stiffness)
        assert soft.status.tolist() == [Status.OK]
        apart.append(np.abs(soft.histories["displacement"] - rigid.histories["displacement"]).max())
    assert apart[1] < 0.02 * apart[0] < 0.02 * 1e-6
