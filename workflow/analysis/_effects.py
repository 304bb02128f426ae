"""Which axes matter, and whether their effect exceeds the error of the schemes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis._cases import finest, labels_of
from workflow.analysis._recommend import numerical_dims
from workflow.schemes import Status

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
    """An axis of the scene whose effect on a metric is below the error of some schemes.

    Attributes
    ----------
    dim, metric
        The axis and what it changes.
    effect
        Its effect in the most accurate computation, as :func:`effect` counts it.
    within
        For each scheme, ``every h`` or the step from which on its median error is at least as large.
    """

    dim: str
    metric: str
    effect: float
    within: dict[str, str]


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
