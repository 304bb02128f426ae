"""Errors of the stepping schemes against the exact solution: their size and their order, bounded."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from scenes import cases, heavy_chain, relative, sampling, step
from workflow.schemes import penalty

NAMES = ("displacement", "temperature", "impulse")


def errors(steps: tuple[float, ...], e: float, method: str, options: Callable[[float], dict[str, Any]]) -> np.ndarray:
    """Return errors on the heavy chain, ``(step, history)``."""
    structure, over = heavy_chain(), sampling(0.3, 1e-3)
    batch = cases(structure, e=e, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)
    exact = step(structure, batch, 1.0, over, "event_driven").histories
    runs = [step(structure, batch, h, over, method, **options(h)).histories for h in steps]
    return np.array([[relative(run[name], exact[name]) for name in NAMES] for run in runs])


def orders(steps: tuple[float, ...], values: np.ndarray) -> np.ndarray:
    return np.polyfit(np.log(steps), np.log(values), 1)[0]


LARGEST = {
    # θ, e: the largest of the three errors at each step
    (0.5, 0.5): (4.3e-2, 2.6e-3, 4.2e-5, 2.1e-6),
    (0.5, 0.0): (1.7e-2, 3.0e-3, 2.2e-4, 2.3e-5),
    (0.5, 0.9): (7.4e-2, 2.6e-3, 6.5e-5, 4.0e-6),
    (1.0, 0.0): (1.9e-2, 7.2e-3, 4.2e-3, 1.15e-3),
}


@pytest.mark.parametrize(("theta", "e"), LARGEST)
def test_moreau(theta: float, e: float) -> None:
    steps = (1e-4, 1e-5, 1e-6, 1e-7)
    largest = errors(steps, e, "moreau", lambda h: {"theta": theta}).max(axis=1)
    assert largest == pytest.approx(LARGEST[theta, e], rel=0.05)
    # below 1e-6 s implicit Euler still damps f1 more than it is damped
    assert orders(steps, largest) > (0.85 if theta == 0.5 else 0.3)


def test_paoli_schatzman_at_an_impact() -> None:
    """Newton's law between positions: at e = 0.5 the error is a fraction of that of carpenter, which has no e."""
    steps = (1e-5, 1e-6, 1e-7)
    found = errors(steps, 0.5, "paoli_schatzman", lambda h: {})
    assert np.all(orders(steps, found) > 0.8)
    assert found[-1].max() < 1e-5


@pytest.mark.parametrize(
    ("method", "options", "least", "most"),
    [
        ("carpenter", lambda h: {}, (1.8, 1.2, 1.2), 1e-6),
        ("penalty", lambda h: asdict(penalty.rigid(heavy_chain(), h)), (0.9, 0.9, 0.9), 1e-3),
    ],
)
def test_rivals(method: str, options: Callable[[float], dict[str, Any]], least: tuple[float, ...], most: float) -> None:
    """At e = 0: carpenter of second order, a spring of κ = 1/(4h²W), c = 1/(hW) of first."""
    steps = (1e-5, 1e-6, 1e-7)
    found = errors(steps, 0.0, method, options)
    assert np.all(orders(steps, found) > least)
    assert found[-1].max() < most
