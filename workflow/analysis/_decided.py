"""Counts of modes that tolerances decided: how many, and the error that was found with them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, labels_of

if TYPE_CHECKING:
    import xarray as xr

_VARIABLES = ("mechanical_modes_used", "thermal_modes_used", "basis_error")


@dataclass(frozen=True)
class Decided:
    """A reduced model whose counts of modes a tolerance decided.

    Attributes
    ----------
    where
        Values of the dimensions along which counts or errors differ.
    mechanical_modes, thermal_modes
        Vectors beside the tip's own.
    error
        Error in the worst corner of the scene, 1.
    """

    where: str
    mechanical_modes: int
    thermal_modes: int
    error: float


def decided(dataset: xr.Dataset) -> list[Decided]:
    """Return the reduced models that tolerances decided, in the archive's order; none where no tolerance did."""
    if not all(name in dataset for name in _VARIABLES):
        return []
    dims = [dim for dim in case_dims(dataset) if any(_varies(dataset[name].transpose(dim, ...)) for name in _VARIABLES)]
    shown = dataset[list(_VARIABLES)].isel(dict.fromkeys(set(case_dims(dataset)) - set(dims), 0)).transpose(*dims)
    labels = {dim: labels_of(dataset, dim) for dim in dims}
    models = []
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        mechanical, thermal, error = (float(shown[name].values[place]) for name in _VARIABLES)
        if np.isfinite(error):
            where = ", ".join(labels[dim][k] for dim, k in zip(dims, place, strict=True))
            models.append(Decided(where or "all cases", int(mechanical), int(thermal), error))
    return models


def _varies(variable: xr.DataArray) -> bool:
    """Tell whether a variable differs along its first dimension."""
    values: NDArray[np.float64] = np.asarray(variable.values)
    return not np.array_equal(values, np.broadcast_to(values[:1], values.shape), equal_nan=True)
