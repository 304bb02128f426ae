"""Steps that messages name: the largest that is stable or admissible, at which the same case runs."""

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes import cases, chain, metal_chain, sampling, step, tip_flexibility
from workflow.models import Cases, Rayleigh, Structure, critical_alpha, frequencies, growth_rate
from workflow.schemes import Status
from workflow.schemes._fixed.step_limits import largest_step, limit_text

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
    for seed in range(24):
        growth = float(np.random.default_rng(1000 + seed).uniform(3, 250))
        structure, batch, duration, theta = scene(seed, growth)
        over = sampling(duration, duration)
        results = step(structure, batch, min(1e-4, duration), over, method, **theta, **options)
        if results.status[0] != Status.ILL_POSED:
            continue
        h = recommended(results.messages[0])
        if h is None:
            assert "no largest admissible h" in results.messages[0]
            assert growth > 200
        elif duration / h < MOST_STEPS:
            runs += 1
            again = step(structure, batch, h, over, method, **theta, **options)
            assert again.status[0] == Status.OK, (seed, growth, results.messages[0], again.messages)
    assert runs >= 4


def test_where_no_step_helps_it_says_so() -> None:
    for seed in range(60):
        structure, batch, duration, theta = scene(seed, 5000.0)
        results = step(structure, batch, min(1e-4, duration), sampling(duration, duration), "moreau", **theta)
        if results.status[0] == Status.ILL_POSED:
            assert "no largest admissible h" in results.messages[0]
            return
    raise AssertionError("no scene was ill-posed")


@given(st.floats(1e-9, 1.0), st.floats(2e-12, 1.0))
def test_a_limit_is_found_to_rounding(h: float, share: float) -> None:
    limit = h * share
    assert largest_step(lambda step: step <= limit, h) == pytest.approx(limit, rel=1e-13)


def test_the_first_limit_counts_and_there_may_be_none() -> None:
    assert largest_step(lambda step: step <= 0.1 or step > 0.5, 1.0) == pytest.approx(0.1, rel=1e-13)
    assert largest_step(lambda step: False, 1.0) == 0.0
    assert largest_step(lambda step: True, 3e-5) == pytest.approx(3e-5, rel=1e-15)


@given(st.floats(1e-300, 1e300), st.integers(2, 9))
def test_a_limit_is_said_in_so_many_digits_and_never_above_it(limit: float, digits: int) -> None:
    said = float(limit_text(limit, digits))
    assert said <= limit
    assert said == pytest.approx(limit, rel=10.0 ** (1 - digits))
    assert len(limit_text(limit, digits).split("e")[0].replace(".", "").strip("0")) <= digits
    assert limit_text(np.inf) == "inf"


OPTIONS: dict[str, dict[str, Any]] = {
    "carpenter": {},
    "carpenter, lagged": {"damping": "lagged"},
    "penalty": {"stiffness": 1e5},
    "moreau": {"theta": 0.3},
}


@pytest.mark.parametrize("scheme", OPTIONS)
def test_the_step_that_a_message_says_runs(scheme: str) -> None:
    """Rounded to the nearest, one limit in two is said too large, and the case diverges again at the step it names."""
    method = scheme.split(",")[0]
    for seed in range(4):
        rng = np.random.default_rng(seed)
        structure = chain(
            nodes=4, mass=10 ** rng.uniform(-4, -2), stiffness=10 ** rng.uniform(4, 7), damping=Rayleigh(20.0, 1e-6)
        )
        batch, h = cases(structure, gap=1.0, mean=1.0), 10.0
        message = step(structure, batch, h, sampling(h, h), method, **OPTIONS[scheme]).messages[0]
        match = re.search(r"stable up to (?:h = )?([\d.e+-]+) s", message)
        assert match is not None, message
        below = float(match[1])
        ran = step(structure, batch, below, sampling(100 * below, 100 * below), method, **OPTIONS[scheme])
        assert ran.status[0] == Status.OK, (seed, ran.messages)
