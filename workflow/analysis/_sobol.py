"""Sobol' indices: which share of a metric's variance each drawn number makes."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.schemes import Status
from workflow.study import MATRIX, POINT

if TYPE_CHECKING:
    import xarray as xr

RESAMPLES = 999
BOUNDS = (2.5, 97.5)
"""Percentiles of the resamples between which the interval of an index lies."""


def drawn_dim(dataset: xr.Dataset) -> str | None:
    """Return the dimension of the matrices of Sobol' indices, ``None`` where the archive has none."""
    has_some = MATRIX in dataset.coords and dataset[MATRIX].ndim == 1 and "B" in dataset[MATRIX].values
    return str(dataset[MATRIX].dims[0]) if has_some else None


def sobol(dataset: xr.Dataset, metric: str) -> xr.Dataset:
    """Return the Sobol' indices of a metric, for every number that the study draws.

    With f less its mean over the matrices A and B, and V its variance over both:

        first = mean(f_B (f_AB - f_A)) / V        share of V that the number makes alone
        total = mean((f_A - f_AB)²) / (2 V)       share of V that it makes alone and with the others

    Parameters
    ----------
    dataset
        An archive of a study that draws ``sample: sobol_indices``, or a selection of its other dimensions.
    metric
        A variable along the drawn dimension; its other dimensions stay.

    Returns
    -------
    xarray.Dataset
        ``first`` and ``total`` ``(…, number)``, and ``first_interval`` and ``total_interval`` ``(…, number, bound)``,
        95 % of 999 resamples of the points. NaN where a case is not ok or the metric is the same in all cases.

    Raises
    ------
    ValueError
        Nothing is drawn for Sobol' indices, or there is no such metric.
    """
    import xarray as xr

    dim = drawn_dim(dataset)
    if dim is None:
        raise ValueError("the dataset has no matrices of Sobol' indices; draw a zip with `sample: sobol_indices`")
    if metric not in dataset.data_vars or dim not in dataset[metric].dims or dataset[metric].dtype.kind != "f":
        raise ValueError(f"`{metric}` is no metric along `{dim}`")
    paths = [path for path in dict.fromkeys(dataset[MATRIX].values.tolist()) if path not in ("A", "B")]
    names = {values.attrs.get("study_path"): str(name) for name, values in dataset.coords.items()}
    f = dataset[metric].where(dataset["status"] == Status.OK)
    f = f.drop_vars([name for name in f.coords if name not in f.dims])
    f = f.assign_coords({name: (dim, dataset[name].values) for name in (POINT, MATRIX)})
    index: dict[str, Any] = {dim: (POINT, MATRIX)}
    f = f.set_index(index).unstack(dim).transpose(..., MATRIX, POINT)
    others = f.isel({MATRIX: 0, POINT: 0}, drop=True)
    a, b, mixed = (np.asarray(f.sel({MATRIX: one}).values, dtype=np.float64) for one in (["A"], ["B"], paths))
    first, total, *intervals = _estimates(a, b, mixed)
    dims = (*others.dims, "number")
    return xr.Dataset(
        {
            "first": (dims, first, {"units": "1", "long_name": f"first-order index of {metric}"}),
            "total": (dims, total, {"units": "1", "long_name": f"total index of {metric}"}),
            "first_interval": ((*dims, "bound"), intervals[0]),
            "total_interval": ((*dims, "bound"), intervals[1]),
        },
        {**others.coords, "number": [names.get(path, path) for path in paths], "bound": ["low", "high"]},
    )


def _estimates(a: NDArray[np.float64], b: NDArray[np.float64], mixed: NDArray[np.float64]) -> tuple[Any, ...]:
    """Return first-order and total indices and their intervals of ``(…, number, point)``."""
    both = np.concatenate([a, b], axis=-1)
    varies = np.ptp(both, axis=-1) > 0
    centre = both.mean(axis=-1, keepdims=True)
    a, b, change = a - centre, b - centre, mixed - a
    means, squares, products, changes = (a + b) / 2, (a**2 + b**2) / 2, b * change, change**2 / 2

    def indices(weights: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return both indices of weighted points; their own mean is taken off again."""
        mean = means @ weights
        variance = squares @ weights - mean**2
        variance = np.where(varies & (variance > 0), variance, np.nan)
        return (products @ weights - mean * (change @ weights)) / variance, changes @ weights / variance

    size = a.shape[-1]
    generator = np.random.default_rng(0)
    drawn = (generator.integers(size, size=size) for _ in range(RESAMPLES))
    resampled = np.array([indices(np.bincount(points, minlength=size) / size) for points in drawn])
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "All-NaN slice", RuntimeWarning)
        low_high = np.moveaxis(np.nanpercentile(resampled, BOUNDS, axis=0), 0, -1)
    return (*indices(np.full(size, 1 / size)), *low_high)
