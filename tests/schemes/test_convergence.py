"""Errors of the stepping schemes against the exact solution: their size and their order, bounded."""

from __future__ import annotations

import numpy as np
import pytest

from scenes import cases, heavy_chain, relative, sampling, step

STEPS = (1e-4, 1e-5, 1e-6, 1e-7)

LARGEST = {
    # θ, e: the largest of the three errors at each step; the first row is the trial's of the issue
    (0.5, 0.5): (4.3e-2, 2.6e-3, 4.2e-5, 2.1e-6),
    (0.5, 0.0): (1.7e-2, 3.0e-3, 2.2e-4, 2.3e-5),
    (0.5, 0.9): (7.4e-2, 2.6e-3, 6.5e-5, 4.0e-6),
    (1.0, 0.0): (1.9e-2, 7.2e-3, 4.2e-3, 1.15e-3),
}


@pytest.mark.parametrize(("theta", "e"), LARGEST)
def test_moreau_converges_on_the_heavy_chain(theta: float, e: float) -> None:
    structure, over = heavy_chain(), sampling(0.3, 1e-3)
    batch = cases(structure, e=e, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)
    exact = step(structure, batch, 1.0, over, "event_driven").histories
    errors = []
    for h in STEPS:
        histories = step(structure, batch, h, over, theta=theta).histories
        errors.append(
            max(relative(histories[name], exact[name]) for name in ("displacement", "temperature", "impulse"))
        )
    print(f"theta {theta:g}, e {e:g}: " + ", ".join(f"{error:.2e}" for error in errors))
    order = np.polyfit(np.log(STEPS), np.log(errors), 1)[0]
    assert errors == pytest.approx(LARGEST[theta, e], rel=0.05)
    assert order > (0.85 if theta == 0.5 else 0.3)  # below 1e-6 s implicit Euler still damps f1 more than it is damped
