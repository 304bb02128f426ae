"""How the impulse of the load periods grows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


def impulse_growth(dataset: xr.Dataset) -> Array | None:
    """Return the impulse of each case's last complete load period over that of its first, 1, shape of ``status``.

    NaN where a case has fewer than two periods, or no contact in the first; ``None`` of archives without periods.
    """
    if "period_impulse" not in dataset:
        return None
    impulse = np.asarray(dataset["period_impulse"].transpose(..., "period").values, dtype=np.float64)
    if impulse.shape[-1] < 2:
        return None
    count = np.isfinite(impulse).sum(axis=-1)
    last = np.take_along_axis(impulse, np.maximum(count - 1, 0)[..., None], axis=-1)[..., 0]
    first = np.where((count > 1) & (impulse[..., 0] > 0), impulse[..., 0], np.nan)
    return np.asarray(last / first)
