"""Counts of modes that tolerances decided: how many, and the error that was found with them."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, labels_of
from workflow.analysis._recommend import numerical_dims

if TYPE_CHECKING:
    import xarray as xr

_VARIABLES = ("mechanical_modes_used", "thermal_modes_used", "basis_error")


@dataclass(frozen=True)
class AutoModel:
    """A reduced model whose counts of modes a tolerance decided.

    Attributes
    ----------
    where
        Values of the dimensions along which counts differ, or along which numerics and errors do.
    mechanical_modes, thermal_modes
        Vectors beside the tip's own.
    error
        Largest known error: in the worst corner of the scene, or in a condition that misses the tolerance, 1.
    met, conditions
        Number of its conditions that are not known to miss the tolerance, and of all.
    """

    where: str
    mechanical_modes: int
    thermal_modes: int
    error: float
    met: int
    conditions: int

    @property
    def text(self) -> str:
        """Counts and error in words."""
        modes = f"{self.mechanical_modes} + {self.thermal_modes} modes for {self.where}"
        met = "" if self.met == self.conditions else f", met in {self.met} of {self.conditions} conditions"
        return f"{modes}, basis error {self.error:.2g}{met}"


def decided(dataset: xr.Dataset) -> list[AutoModel]:
    """Return the reduced models that tolerances decided, in the archive's order; none where no tolerance did."""
    if not all(name in dataset for name in _VARIABLES):
        return []
    *counts, basis_error = (dataset[name] for name in _VARIABLES)
    numerical = numerical_dims(dataset)
    dims = [
        dim
        for dim in case_dims(dataset)
        if any(_varies(count.transpose(dim, ...)) for count in counts)
        or (dim in numerical and _varies(basis_error.transpose(dim, ...)))
    ]
    idle = dict.fromkeys(set(numerical) - set(dims), 0)
    inside = [dim for dim in case_dims(dataset) if dim not in (*dims, *idle)]
    misses = (basis_error > dataset["tolerance"]).isel(idle).sum(inside).transpose(*dims)
    used = [count.isel(idle | dict.fromkeys(inside, 0)).transpose(*dims) for count in counts]
    worst = basis_error.isel(idle).max(inside).transpose(*dims)
    conditions = math.prod(dataset.sizes[dim] for dim in inside)
    labels = {dim: labels_of(dataset, dim) for dim in dims}
    models = []
    for place in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        error = float(worst.values[place])
        if np.isfinite(error):
            where = ", ".join(labels[dim][k] for dim, k in zip(dims, place, strict=True))
            mechanical, thermal = (int(count.values[place]) for count in used)
            met = conditions - int(misses.values[place])
            models.append(AutoModel(where or "all cases", mechanical, thermal, error, met, conditions))
    return models


def _varies(variable: xr.DataArray) -> bool:
    """Tell whether a variable differs along its first dimension."""
    values: NDArray[np.float64] = np.asarray(variable.values)
    return not np.array_equal(values, np.broadcast_to(values[:1], values.shape), equal_nan=True)
