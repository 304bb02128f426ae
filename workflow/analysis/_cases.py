"""Cases of an archive: their labels, contact phases, how they ended, and which of them to show."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workflow.run import status_name
from workflow.schemes import Status

if TYPE_CHECKING:
    import xarray as xr


def case_dims(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return the dimensions along which the cases of an archive differ."""
    return tuple(str(name) for name in dataset["status"].dims)


def labels_of(dataset: xr.Dataset, dim: str, named: bool = True) -> list[str]:
    """Return a label for each value of a dimension, zipped coordinates side by side.

    ``named`` puts the coordinate's name before its value, ``alpha 30 m/s``.
    """
    names = [str(name) for name in dataset.coords if dataset[name].dims == (dim,)]
    if not names:
        return [str(k) for k in range(dataset.sizes[dim])]
    columns = [_labels(dataset[name], named or len(names) > 1) for name in names]
    return [", ".join(parts) for parts in zip(*columns, strict=True)]


def _labels(coordinate: xr.DataArray, named: bool) -> list[str]:
    unit = str(coordinate.attrs.get("units", "1"))
    before = f"{coordinate.name} ".replace("_", " ") if named else ""
    after = "" if unit == "1" else f" {unit}"
    return [
        before + (f"{value:.4g}" if isinstance(value, float | np.floating) else str(value)) + after
        for value in coordinate.values
    ]


def contact_phases(case: xr.Dataset) -> list[tuple[float, float]]:
    """Return begin and end of each contact phase of a case, s, on the grid of its samples.

    Parameters
    ----------
    case
        One case of an archive with the history ``contact_force``.
    """
    touching = np.concatenate([[False], np.asarray(case["contact_force"].values) > 0, [False]])
    edges = np.flatnonzero(np.diff(touching.astype(np.int8)))
    t = np.asarray(case["t"].values, dtype=float)
    interval = t[1] - t[0]
    return [(float(t[a] - interval), float(t[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@dataclass(frozen=True)
class Failures:
    """Cases that are not ok and say the same: how many, and the labels of the first."""

    status: str
    message: str
    cases: int
    first: str


def failures(dataset: xr.Dataset) -> list[Failures]:
    """Return what cases that ran and are not ok have to say, the most frequent message first."""
    dims = case_dims(dataset)
    status = np.asarray(dataset["status"].values)
    places = np.argwhere((status != Status.OK) & (status != Status.NOT_RUN))
    messages = np.asarray(dataset["message"].values) if len(places) else np.empty(0)
    groups: dict[tuple[int, str], list[tuple[int, ...]]] = {}
    for place in places:
        index = tuple(map(int, place))
        groups.setdefault((int(status[index]), str(messages[index])), []).append(index)
    labels = {dim: labels_of(dataset, dim) for dim in dims} if groups else {}
    found = [
        Failures(
            status_name(state),
            message,
            len(alike),
            ", ".join(labels[dim][k] for dim, k in zip(dims, alike[0], strict=True)) or "the only case",
        )
        for (state, message), alike in groups.items()
    ]
    return sorted(found, key=lambda group: -group.cases)


def finest(dataset: xr.Dataset) -> dict[str, int]:
    """Return the position of the case to show first: smallest step, most modes, first of the rest."""
    place = dict.fromkeys(case_dims(dataset), 0)
    for name, largest in (("h", False), ("thermal_modes", True), ("mechanical_modes", True), ("alpha", True)):
        if name in dataset.coords and dataset[name].ndim == 1:
            values = np.asarray(dataset[name].values)
            place[str(dataset[name].dims[0])] = int(np.argmax(values) if largest else np.argmin(values))
    return place


def shown_dim(dataset: xr.Dataset, most: int = 9) -> str | None:
    """Return the dimension whose values one picture compares: α if it varies, then the scheme, else the largest."""
    dims = case_dims(dataset)
    fitting = [dim for dim in dims if 1 < dataset.sizes[dim] <= most]
    for first in ("alpha", "scheme"):
        if first in fitting:
            return first
    return max(fitting, key=lambda dim: dataset.sizes[dim]) if fitting else None
