"""Quantities derived from the tip's motion: what energy is kept, impact speeds, growth of the impulse."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._casing import casing_motion

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]


def energy_kept(case: xr.Dataset, energy: float) -> float:
    """Return the share of its initial energy that an unloaded, undamped case has in the end.

    The energy residual (what the scheme gives or takes) and what the contact has taken, Σ p (v_n before + v_n after)/2,
    together; while the energy never passes its initial value, which the residual is then relative to.

    Parameters
    ----------
    case
        One case with balances and the histories ``velocity`` and ``impulse``, sampled at every step: the output
        interval is h.
    energy
        Energy at t = 0, J.
    """
    velocity = np.asarray(case["velocity"].values, dtype=float)
    impulses = np.diff(np.asarray(case["impulse"].values, dtype=float))
    taken = float(np.sum(impulses * (velocity[1:] + velocity[:-1]) / 2))
    return 1.0 + float(case["energy_residual"]) - taken / energy


def impact_speeds(case: xr.Dataset) -> Array:
    """Return the speeds at which the tip meets its casing, relative to it, m/s, one for each contact phase.

    From the last sample before a contact: its velocity, carried on to the casing with the
    acceleration of the interval before. The error is of second order in the output interval.

    Parameters
    ----------
    case
        One case with the histories ``displacement``, ``velocity`` and ``contact_force``.
    """
    x, v = (np.asarray(case[name].values, dtype=float) for name in ("displacement", "velocity"))
    motion = casing_motion(case)
    place = np.full(x.shape, float(case["gap"])) if motion is None else motion[0]
    v = v if motion is None else v - motion[1]
    interval = float(case["t"][1] - case["t"][0])
    touched = np.asarray(case["contact_force"].values) > 0
    first = np.flatnonzero(touched[2:] & ~touched[1:-1] & ~touched[:-2]) + 2
    before = first - 1
    acceleration = (v[before] - v[before - 1]) / interval
    room = np.maximum(place[before] - x[before], 0.0)
    squared = v[before] ** 2 + 2 * acceleration * room
    speeds = np.sqrt(np.maximum(squared, 0.0))
    return np.asarray(speeds[speeds > 0])


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
