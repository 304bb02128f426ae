"""Which axes matter, and whether their effect exceeds the error of the schemes."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
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
    values = np.asarray(dataset[variable].where(dataset["status"] == Status.OK).values, dtype=float)
    axis = dataset[variable].dims.index(dim)
    values = np.moveaxis(np.where(np.isfinite(values), values, np.nan), axis, 0)
    comparable = np.isfinite(values).sum(axis=0) > 1
    if not comparable.any():
        return float("nan")
    compared = values[:, comparable]
    scale = float(np.nanmax(np.abs(values)))
    spread = float(np.max(np.nanmax(compared, axis=0) - np.nanmin(compared, axis=0)))
    return spread / scale if scale > 0 else 0.0


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
        medians = _medians(chosen, error, stepped)
        if not any(value > 0 for value in medians.values()):
            continue
        least = min(medians, key=medians.__getitem__)
        best = chosen.isel(dict(zip(stepped, least, strict=True)))
        for dim in (d for d in place if d not in numerical and dataset.sizes[d] > 1):
            size = effect(best, metric, dim)
            blurred = {at: value >= size for at, value in medians.items() if value > 0}
            within = _within(chosen, stepped, blurred)
            if within:
                axes.append(Hidden(dim, metric, size, within))
    return axes


def _medians(dataset: xr.Dataset, error: str, dims: list[str]) -> dict[tuple[int, ...], float]:
    """Return the median error of ok cases at every place along some dimensions that has one."""
    of_ok = dataset[error].where(dataset["status"] == Status.OK)
    medians = {}
    for at in np.ndindex(*(dataset.sizes[dim] for dim in dims)):
        values = np.asarray(of_ok.isel(dict(zip(dims, at, strict=True))).values, dtype=float)
        if np.isfinite(values).any():
            medians[at] = float(np.median(values[np.isfinite(values)]))
    return medians


def _within(dataset: xr.Dataset, dims: list[str], blurred: dict[tuple[int, ...], bool]) -> dict[str, str]:
    """Return from which step on each scheme is blurred."""
    labels = {dim: labels_of(dataset, dim, named=False) for dim in dims}
    by_scheme: dict[str, dict[int, bool]] = {}
    for at, blur in blurred.items():
        here = dict(zip(dims, at, strict=True))
        name = labels["scheme"][here["scheme"]] if "scheme" in here else "the scheme"
        by_scheme.setdefault(name, {})[here.get("h", 0)] = blur
    steps_of = {}
    for name, steps in by_scheme.items():
        if all(steps.values()):
            steps_of[name] = "every h"
        elif any(steps.values()):
            h = np.asarray(dataset["h"].values)
            largest = list(takewhile(steps.__getitem__, sorted(steps, key=h.__getitem__, reverse=True)))
            if largest:
                steps_of[name] = f"h = {h[largest[-1]]:.4g} s and more"
    return steps_of
