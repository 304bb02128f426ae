"""Error against cost: on archives whose answer is known, and in agreement with what is recommended."""

import numpy as np
import pytest
import xarray as xr

from workflow import work_precision
from workflow.analysis import NoReferenceError


def archive() -> xr.Dataset:
    """Two schemes and three steps in two scenes; the second scene's error is twice as large."""
    h, gap = np.array([1e-5, 1e-4, 1e-3]), np.array([1e-5, 2e-5])
    dims, shape = ("scheme", "h", "gap"), (2, 3, 2)
    error = np.array([1.0, 10.0])[:, None, None] * h[:, None] * np.array([1.0, 2.0])
    status = np.zeros(shape, dtype=np.int8)
    status[1, 2, 0] = 1
    values = {"impulse_error": error, "temperature_error": 3 * error, "displacement_error": 0 * error}
    return xr.Dataset(
        {
            **{name: (dims, value) for name, value in values.items()},
            "status": (dims, status),
            "processor_time": (dims, np.broadcast_to(np.array([3e-8, 1e-8])[:, None, None] / h[:, None], shape)),
        },
        coords={"scheme": ["fine", "rough"], "h": h, "gap": gap, "alpha": 30.0},
        attrs={"duration": 2.0},
    )


def test_cost_and_error_of_known_choices() -> None:
    work = work_precision(archive())
    assert work["error"].dims == ("scheme", "h")
    assert work["error"].sel(scheme="fine").values == pytest.approx([6e-5, 6e-4, 6e-3])
    assert work["error"].sel(scheme="rough").values == pytest.approx([6e-4, 6e-3, np.nan], nan_ok=True)
    assert work["cost"].sel(scheme="fine").values == pytest.approx([3e-3, 3e-4, 3e-5])
    assert (work["cost_per_second"] * 2).values == pytest.approx(work["cost"].values)
    assert work["efficient"].values.tolist() == [[True, True, True], [False, False, False]]
    assert "gap" not in work.coords
    assert float(work["alpha"]) == 30.0
    impulse = work_precision(archive(), "impulse_error")
    assert impulse["error"].sel(scheme="fine").values == pytest.approx([2e-5, 2e-4, 2e-3])


def test_what_is_missing_is_said() -> None:
    with pytest.raises(NoReferenceError, match="no `reference`"):
        work_precision(archive().drop_vars("impulse_error"))
    with pytest.raises(ValueError, match=r"no `force_error`; give one of displacement_error"):
        work_precision(archive(), "force_error")
