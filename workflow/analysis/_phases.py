"""Contact phases of the blade tip, found in the sampled contact force."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_VARIABLES = {
    "begin": ("s", "begin of the contact phase, on the grid of samples"),
    "end": ("s", "end of the contact phase, on the grid of samples"),
    "impulse": ("N s", "impulse of the casing on the blade tip during the contact phase"),
    "peak_force": ("N", "largest contact force of the phase, mean over an output interval"),
}


def contact_phases(dataset: xr.Dataset) -> xr.Dataset:
    """Return when the tip touches its casing, with which impulse and which largest force.

    A phase is a run of output intervals in which the contact force is positive. ``contact_force`` is the mean over
    the interval before a sample, so begin and end are known to one output interval, and contacts that are less than
    one interval apart are one phase.

    Parameters
    ----------
    dataset
        An archive, or any selection of its cases, with the history ``contact_force``.

    Returns
    -------
    xarray.Dataset
        Variables ``begin`` and ``end`` [s], ``impulse`` [N s] and ``peak_force`` [N] over the dimensions of the cases
        and ``phase``, which counts from 1; NaN beyond a case's last phase.

    Raises
    ------
    ValueError
        The dataset has no history ``contact_force``.
    """
    import xarray as xr

    if "contact_force" not in dataset or "t" not in dataset["contact_force"].dims:
        raise ValueError("the dataset has no history `contact_force`; name it in `output.histories` of the study")
    force = dataset["contact_force"].transpose(..., "t")
    dims = [str(dim) for dim in force.dims[:-1]]
    t = np.asarray(dataset["t"].values, dtype=float)
    cases = np.asarray(force.values, dtype=float).reshape(-1, t.size)
    phases_of_cases = [_phases(case, t) for case in cases]
    most = max((phases.shape[1] for phases in phases_of_cases), default=0)
    table = np.full((len(phases_of_cases), len(_VARIABLES), most), np.nan)
    for row, phases in zip(table, phases_of_cases, strict=True):
        row[:, : phases.shape[1]] = phases
    values = table.reshape(*force.shape[:-1], len(_VARIABLES), most)
    attributes = [{"units": unit, "long_name": meaning} for unit, meaning in _VARIABLES.values()]
    variables = {name: ([*dims, "phase"], values[..., k, :], attributes[k]) for k, name in enumerate(_VARIABLES)}
    return xr.Dataset(variables, {**force.isel(t=0, drop=True).coords, "phase": np.arange(1, most + 1)})


def _phases(force: Array, t: Array) -> Array:
    """Return begin, end, impulse and largest force of one case's phases, ``(4, phase)``."""
    touching = np.concatenate([[False], force[1:] > 0, [False]])
    edges = np.flatnonzero(np.diff(touching.astype(np.int8)))
    first, last = edges[::2], edges[1::2]  # a phase lasts from sample `first` to sample `last`
    impulse = np.concatenate([[0.0], np.cumsum(np.where(touching[1:-1], force[1:], 0.0) * np.diff(t))])
    peak = [force[a + 1 : b + 1].max() for a, b in zip(first, last, strict=True)]
    return np.array([t[first], t[last], impulse[last] - impulse[first], peak])
