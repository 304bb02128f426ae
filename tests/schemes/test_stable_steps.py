"""The largest step up to which a condition holds."""

from __future__ import annotations

import re
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenes import cases, chain, step
from workflow.models import Rayleigh
from workflow.schemes import Sampling, Status
from workflow.schemes._fixed.step_limits import largest_step, limit_text


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
    for seed in range(8):
        rng = np.random.default_rng(seed)
        structure = chain(
            nodes=4, mass=10 ** rng.uniform(-4, -2), stiffness=10 ** rng.uniform(4, 7), damping=Rayleigh(20.0, 1e-6)
        )
        batch, h = cases(structure, gap=1.0, mean=1.0), 10.0
        message = step(structure, batch, h, Sampling(h, h, 2), method, **OPTIONS[scheme]).messages[0]
        match = re.search(r"stable up to (?:h = )?([\d.e+-]+) s", message)
        assert match is not None, message
        below = float(match[1])
        ran = step(structure, batch, below, Sampling(100 * below, 100 * below, 2), method, **OPTIONS[scheme])
        assert ran.status[0] == Status.OK, (seed, ran.messages)
