"""How the impulse of load periods grows."""

from __future__ import annotations

import numpy as np
import pytest
import xarray as xr

from workflow.analysis import impulse_growth


def test_growth_of_the_impulse_is_of_the_last_complete_period_over_the_first() -> None:
    nan = np.nan
    impulse = [[2.0, 3.0, 5.0], [2.0, 3.0, nan], [2.0, nan, nan], [0.0, 1.0, 2.0], [nan, nan, nan]]
    growth = impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), impulse)}))
    assert growth == pytest.approx([2.5, 1.5, nan, nan, nan], nan_ok=True)
    assert impulse_growth(xr.Dataset({"period_impulse": (("case", "period"), [[1.0]])})) is None
    assert impulse_growth(xr.Dataset()) is None
