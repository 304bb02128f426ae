"""Error against processor time: what every choice of scheme, step and model costs and how far it errs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._recommend import Table, simulated_seconds

if TYPE_CHECKING:
    import xarray as xr


def work_precision(dataset: xr.Dataset, error: str | None = None) -> xr.Dataset:
    """Return cost and error of every choice of scheme, step, modes and options of schemes.

    Error and cost are those that :func:`recommend` weighs: its answer is, of ``work_precision(dataset)`` with
    ``error`` up to a tolerance and ``cost`` at most 25 % above the least, where ``error`` is least.

    Parameters
    ----------
    dataset
        An archive whose study has a reference.
    error
        The error that counts, such as ``impulse_error``; the largest of displacement, temperature and impulse error
        where left out.

    Returns
    -------
    xarray.Dataset
        Over the dimensions that change the computation (scheme, h, modes, options), not the scene: ``error``, the
        largest over all cases of the scene, NaN where one is not ok or has none; ``cost``, the mean processor time of a
        case in s; ``cost_per_second``, the same per simulated second; ``efficient``, whether no other choice has at
        most this error at less cost.

    Raises
    ------
    NoReferenceError
        The archive holds no errors.
    ValueError
        It has no such error.
    """
    import xarray as xr

    table = Table(dataset) if error is None else Table(dataset, error)
    worst = np.max(table.error, axis=1)
    variables = {
        "error": (worst, "1", f"largest {'error of any history' if error is None else error.replace('_', ' ')}"),
        "cost": (table.cost, "s", "mean processor time of a case"),
        "cost_per_second": (table.cost / simulated_seconds(dataset), "1", "mean processor time per simulated time"),
        "efficient": (_efficient(worst, table.cost), "1", "whether no other choice is as accurate at less cost"),
    }
    sizes = [dataset.sizes[dim] for dim in table.rows]
    coords = {name: dataset[name] for name in dataset.coords if {*dataset[name].dims} <= {*table.rows}}
    return xr.Dataset(
        {
            name: (table.rows, values.reshape(sizes), {"units": unit, "long_name": about})
            for name, (values, unit, about) in variables.items()
        },
        coords,
    )


def _efficient(error: NDArray[np.float64], cost: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which choices have an error that no cheaper one reaches, ``(choice,)``."""
    efficient = np.zeros(error.size, dtype=bool)
    least = np.inf
    for k in np.lexsort((error, cost)):
        if error[k] < least:
            efficient[k], least = True, error[k]
    return efficient
