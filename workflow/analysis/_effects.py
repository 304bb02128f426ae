"""What axes and drawn numbers do: effects, whether they exceed the error of the schemes, and Sobol' indices."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import added_dim, finest, labels_of
from workflow.analysis._recommend import numerical_dims
from workflow.schemes import Status
from workflow.study import MATRIX, POINT

if TYPE_CHECKING:
    import xarray as xr

MEASURED = {"contact_impulse": "impulse_error", "max_temperature": "temperature_error"}
"""Metrics whose change along an axis is weighed, and the error it is weighed against."""


def effect(dataset: xr.Dataset, variable: str, dim: str) -> float:
    """Return how far a metric of ok cases changes along a dimension, all others fixed.

    The largest of (max - min) over the other dimensions, as a share of the metric's largest
    magnitude; NaN where no two ok cases can be compared.
    """
    values = dataset[variable].where((dataset["status"] == Status.OK) & np.isfinite(dataset[variable]))
    change = (values.max(dim) - values.min(dim)).where(values.count(dim) > 1).max()
    largest = float(abs(values).max())
    return float(change) / (largest or 1.0)


@dataclass(frozen=True)
class Hidden:
    """An axis of the scene whose effect on a metric is below the error of some schemes."""

    dim: str
    metric: str
    """``dim``, ``metric``: the axis and what it changes."""
    effect: float
    """Its effect in the most accurate computation, as :func:`effect` counts it."""
    within: dict[str, str]
    """For each scheme, ``every h`` or the step from which on its median error is at least as large."""


def hidden(dataset: xr.Dataset) -> list[Hidden]:
    """Return the axes of the scene whose effect lies below the error of some scheme and step.

    Of several models the one with the most modes counts, the median of the error is over all other
    axes, and the effect is that of the scheme and step with the least error.
    """
    if "impulse_error" not in dataset:
        return []
    place = finest(dataset)
    numerical = numerical_dims(dataset)
    stepped: list[str] = [d for d in ("scheme", "h") if d in numerical]
    chosen = dataset.isel({d: place[d] for d in numerical if d not in stepped})
    axes = []
    for metric, error in MEASURED.items():
        of_ok = chosen[error].where((chosen["status"] == Status.OK) & np.isfinite(chosen[error]))
        medians = of_ok.median([dim for dim in of_ok.dims if dim not in stepped]).transpose(*stepped)
        if not bool((medians > 0).any()):
            continue
        best = chosen.isel(medians.fillna(np.inf).argmin(...)) if stepped else chosen
        for dim in (d for d in place if d not in numerical and dataset.sizes[d] > 1):
            size = effect(best, metric, dim)
            within = _within(chosen, medians.where(medians > 0), size)
            if within:
                axes.append(Hidden(dim, metric, size, within))
    return axes


def _within(dataset: xr.Dataset, medians: xr.DataArray, size: float) -> dict[str, str]:
    """Return from which step on each scheme has a median error of at least some size; NaN where it has none."""
    steps_of = {}
    schemes = labels_of(dataset, "scheme", named=False) if "scheme" in medians.dims else ["the scheme"]
    for k, name in enumerate(schemes):
        of_scheme = medians.isel(scheme=k) if "scheme" in medians.dims else medians
        known = of_scheme.dropna("h").sortby("h", ascending=False) if "h" in of_scheme.dims else of_scheme
        blurred = np.atleast_1d((known >= size).values)
        if blurred.size and blurred.all():
            steps_of[name] = "every h"
        elif blurred.any() and blurred[0]:
            steps_of[name] = f"h = {float(known['h'][np.argmin(blurred) - 1]):.4g} s and more"
    return steps_of


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
        95 % of 999 resamples of the points (``drawn_number`` where an axis is called ``number``). NaN where a case is
        not ok or the metric is the same in all cases.

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
    number = added_dim(others, "number", "drawn_number")
    dims = (*others.dims, number)
    return xr.Dataset(
        {
            "first": (dims, first, {"units": "1", "long_name": f"first-order index of {metric}"}),
            "total": (dims, total, {"units": "1", "long_name": f"total index of {metric}"}),
            "first_interval": ((*dims, "bound"), intervals[0]),
            "total_interval": ((*dims, "bound"), intervals[1]),
        },
        {**others.coords, number: [names.get(path, path) for path in paths], "bound": ["low", "high"]},
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
