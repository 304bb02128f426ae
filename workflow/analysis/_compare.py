"""How far the cases of two datasets differ."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workflow.archive import LEFT_OUT
from workflow.variables import BY_NAME

if TYPE_CHECKING:
    import xarray as xr

_SAME_INSTANT = 1e-9
"""Share of the last instant within which two samples are of one instant; a study's duration is a multiple of its
interval to the same share."""


def compare(dataset: xr.Dataset, other: xr.Dataset) -> xr.Dataset:
    """Return the relative differences of the results of two datasets, cases paired by their labels.

    A history counts by ``‖x − y‖ / ‖y‖`` with the L2 norm over the samples that both have, a number by
    ``|x − y| / |y|``, y being that of ``other``; 0 where both are equal, infinite where only y is zero.

    Parameters
    ----------
    dataset
        An archive, a selection of its cases or a single case.
    other
        What it is compared with. Along a dimension that both have, the labels that both have are compared; along one
        that only one of them has, each of its cases is compared with the same case of the other: a single case is
        compared with all. A dimension without labels, as a zip has it, must have the same length in both.

    Returns
    -------
    xarray.Dataset
        Dimensionless, for each history, metric and value per load period that both have, under its name.

    Raises
    ------
    ValueError
        They have no result, no label along a dimension or no two samples in common.
    """
    import xarray as xr

    for one in (dataset, other):
        if not isinstance(one, xr.Dataset):
            raise TypeError(f"compare takes datasets, and {one!r} is none: give open_archive({str(one)!r})")
    names = [name for name in BY_NAME if _is_result(name) and name in dataset and name in other]
    if not names:
        raise ValueError("the datasets have no result in common")
    one, two = _paired(dataset[names], other[names])
    differences = {}
    for name in names:
        x, y = one[name].astype(float), two[name].astype(float)
        with np.errstate(divide="ignore", invalid="ignore"):
            difference, size = abs((x - y).where(x != y, 0.0)), abs(y)  # infinite values may be equal, too
            if "t" in difference.dims:
                difference, size = _norm(difference), _norm(size)
            share = (difference / size).where(difference != 0, 0.0)
        share.attrs = {"units": "1", "long_name": f"relative difference of the {BY_NAME[name].meaning}"}
        differences[name] = share
    return xr.Dataset(differences)


def _norm(history: xr.DataArray) -> xr.DataArray:
    return (history**2).sum("t", skipna=False) ** 0.5


def _is_result(name: str) -> bool:
    variable = BY_NAME[name]
    return (
        variable.shape not in ("flag", "text") and name not in LEFT_OUT and not name.endswith(("_error", "_residual"))
    )


def _paired(dataset: xr.Dataset, other: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
    """Return two datasets with the same labels along the dimensions that both have, and no other coordinates."""
    import xarray as xr

    if "t" in dataset.dims and "t" in other.dims:
        dataset, other = _at_common_instants(dataset, other)
    shared = {*dataset.dims} & {*other.dims}
    one, two = (part.drop_vars([name for name in part.coords if name not in part.dims]) for part in (dataset, other))
    one, two = xr.align(one, two, join="inner", copy=False)
    for dim in shared:
        if not one.sizes[dim]:
            raise ValueError(f"the datasets have no `{dim}` in common")
    return one, two


def _at_common_instants(dataset: xr.Dataset, other: xr.Dataset) -> tuple[xr.Dataset, xr.Dataset]:
    """Return the samples of the instants that both datasets have."""
    t = dataset["t"].values
    nearest = other.get_index("t").get_indexer(t, method="nearest", tolerance=_SAME_INSTANT * t[-1])
    same = np.flatnonzero(nearest >= 0)
    if same.size < 2:
        raise ValueError("the datasets have no two samples `t` in common")
    return dataset.isel(t=same), other.isel(t=nearest[same]).assign_coords(t=dataset["t"][same])
