"""The largest step up to which a condition holds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workflow.schemes._fixed.stable_steps import largest_step


@given(st.floats(1e-9, 1.0), st.floats(2e-12, 1.0))
def test_a_limit_is_found_to_rounding(h: float, share: float) -> None:
    limit = h * share
    assert largest_step(lambda step: step <= limit, h) == pytest.approx(limit, rel=1e-13)


def test_the_first_limit_counts_and_there_may_be_none() -> None:
    assert largest_step(lambda step: step <= 0.1 or step > 0.5, 1.0) == pytest.approx(0.1, rel=1e-13)
    assert largest_step(lambda step: False, 1.0) == 0.0
    assert largest_step(lambda step: True, 3e-5) == pytest.approx(3e-5, rel=1e-15)


def test_what_is_tried_is_no_further_apart_than_said() -> None:
    tried: list[float] = []
    largest_step(lambda step: tried.append(step) is None, 0.7)
    assert len(tried) == 641
    assert tried[0] == 0.7 / 2**40
    assert np.diff(np.log2(tried)).max() == pytest.approx(1 / 16)
