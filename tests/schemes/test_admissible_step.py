"""The step that ``ill_posed`` recommends is one at which the same case runs; where none does it says so."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from random_chains import metal_chain

from scenes import cases, heavy_chain, sampling, step
from workflow.models import Cases, Structure, critical_alpha, frequencies, growth_rate, tip_flexibility
from workflow.schemes import Sampling, Status
from workflow.schemes._fixed import theta_method
from workflow.schemes._fixed.step_limits import largest_step

MOST_STEPS = 2_000_000


def scene(seed: int, growth: float) -> tuple[Structure, Cases, float, dict[str, Any]]:
    """Return a tip far above α_c, pressed or hammering, and the time in which its heat grows exp(``growth``)-fold."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 21))
    structure = metal_chain(rng, n)
    stiffness, omega = 1 / tip_flexibility(structure), float(frequencies(structure)[0])
    alpha = critical_alpha(structure) * 10 ** rng.uniform(1, 6)
    pressed = bool(rng.random() < 0.5)
    batch = cases(
        structure,
        e=float(rng.choice([0, 0.5, 0.9])),
        gap=-1e-6 if pressed else 1e-5,
        mean=stiffness * 2e-5,
        amplitude=stiffness * 1e-5,
        frequency=omega / (10 * np.pi),
        alpha=alpha,
        displacement=-1e-6 * np.arange(1, n + 1) / n if pressed else 0.0,
    )
    return structure, batch, growth / growth_rate(structure, alpha), {"theta": float(rng.choice([0.5, 0.75, 1.0]))}


def recommended(message: str) -> float | None:
    match = re.search(r"the largest admissible h is (\S+) s", message)
    return None if match is None else float(match[1])


@pytest.mark.parametrize("options", [{}, {"integration": "implicit", "stiffness": 1e10}])
def test_the_case_runs_at_the_step_that_is_recommended(options: dict[str, Any]) -> None:
    """Steps of 0.1 ms, growth of up to e^250 in the model itself."""
    method, runs = ("penalty" if options else "moreau"), 0
    for seed in range(120):
        growth = float(np.random.default_rng(1000 + seed).uniform(3, 250))
        structure, batch, duration, theta = scene(seed, growth)
        over = Sampling(duration, duration, 2, balances=True)  # as most tests do: one kernel serves them all
        results = step(structure, batch, min(1e-4, duration), over, method, **theta, **options)
        if results.status[0] != Status.ILL_POSED:
            continue
        h = recommended(results.messages[0])
        if h is None:
            assert "no step helps" in results.messages[0]
            assert growth > 200
        elif duration / h < MOST_STEPS:
            runs += 1
            again = step(structure, batch, h, over, method, **theta, **options)
            assert again.status[0] == Status.OK, (seed, growth, results.messages[0], again.messages)
    assert runs > 20


def test_where_no_step_helps_it_says_so() -> None:
    for seed in range(60):
        structure, batch, duration, theta = scene(seed, 5000.0)
        results = step(structure, batch, min(1e-4, duration), Sampling(duration, duration, 2), "moreau", **theta)
        if results.status[0] == Status.ILL_POSED:
            assert "no step helps" in results.messages[0]
            return
    raise AssertionError("no scene was ill-posed")


def test_the_limit_of_many_cases_of_one_law_is_looked_for_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """At hundreds of trials each, ten thousand cases took minutes."""
    looked: list[float] = []

    def counted(holds: Any, h: float) -> float:
        looked.append(h)
        return largest_step(holds, h)

    monkeypatch.setattr(theta_method, "largest_step", counted)
    structure = heavy_chain()
    batch = cases(structure, 60, gap=5e-5, mean=500.0, alpha=np.where(np.arange(60) % 2, 1e6, 2e6))
    results = step(structure, batch, 1e-3, sampling(0.05, 0.05))
    assert np.all(results.status == Status.ILL_POSED)
    assert len(looked) == 2
    assert len(set(results.messages.values())) == 2
