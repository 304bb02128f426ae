"""Which cases are worth a look, the most notable first, and which case is the exact solution of the same scene."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.analysis._cases import case_dims, finest, modes_along, most_loaded
from workflow.analysis._recommend import Choice, NoReferenceError, is_numerical, numerical_dims, recommend
from workflow.judges.trials import EXACT
from workflow.schemes import Status
from workflow.variables import COMPARED

if TYPE_CHECKING:
    import xarray as xr

_EXTREMES = (
    ("error", "largest error of the ok cases"),
    ("predictability", "least predictable: its reference moves most when the gap changes by rounding"),
    ("energy_residual", "largest residual of the energy balance"),
    ("max_penetration", "deepest penetration of the casing"),
    ("max_temperature", "hottest tip"),
    ("impacts", "most impacts"),
    ("contact_impulse", "largest impulse of the casing"),
)
"""Metrics whose case of the largest magnitude is named, and how."""


def total_error(dataset: xr.Dataset, part: str = "") -> NDArray[np.float64] | None:
    """Return the largest error of any history of each case, shape of ``status``; NaN where a case is not ok.

    ``part`` is ``scheme_`` or ``model_`` for that part of the errors alone. ``None`` where the archive holds none.
    """
    names = [f"{name}_{part}error" for name in COMPARED]
    if not all(name in dataset for name in names):
        return None
    errors = [np.asarray(dataset[name].values, dtype=float) for name in names]
    ok = np.asarray(dataset["status"].values) == Status.OK
    return np.asarray(np.where(ok, np.max(errors, axis=0), np.nan))


def notable_cases(dataset: xr.Dataset, choice: Choice | None) -> dict[int, str]:
    """Return the cases that are worth a look, the most notable first, and what is worth it.

    Cases have numbers, counted in the order of the archive's dimensions, the last fastest. First comes the worst case
    of the ``choice`` that the archive recommends, or that comes nearest; without one the hottest or hardest pressed
    case. Then cases that are not ok, the first of each status, and those with the largest magnitude of each metric.
    """
    dataset = most_loaded(dataset)
    status = np.asarray(dataset["status"].values).ravel()
    reasons: dict[int, str] = {}
    worst = None if choice is None or choice.worst.status != "ok" else choice.number
    if worst is not None:
        reasons[worst] = "worst case of the choice that is recommended, or of the one that comes nearest"
    extremes = _extremes(dataset, status)
    if worst is None and extremes:
        named = {name: case for name, case, _ in extremes}
        first = next((named[name] for name in ("max_temperature", "contact_impulse") if name in named), extremes[0][1])
        reasons[first] = next(why for _, case, why in extremes if case == first)
    for code in Status:
        if code is not Status.OK and (status == code).any():
            reasons.setdefault(int(np.argmax(status == code)), f"the first case that is {code.name.lower()}")
    for _, case, why in extremes:
        reasons.setdefault(case, why)
    reasons.setdefault(int(np.argmax(status == Status.OK)), "the first case")
    return reasons


def shown_place(dataset: xr.Dataset) -> dict[str, int]:
    """Return where the case lies that a figure shows: the worst of the choice that is recommended.

    Without such a choice that ok case whose contact impulse is the median; raises :class:`ValueError` where none is ok.
    """
    dataset = most_loaded(dataset)
    status = np.asarray(dataset["status"].values)
    ok = np.flatnonzero(status == Status.OK)
    if not ok.size:
        raise ValueError("no case of the dataset is ok")
    try:
        choice = recommend(dataset).choice
    except NoReferenceError:
        choice = None
    impulses = np.asarray(dataset.get("contact_impulse", dataset["status"]).values).ravel()[ok]
    number = ok[np.argsort(impulses, kind="stable")[ok.size // 2]] if choice is None else choice.number
    return dict(zip(case_dims(dataset), map(int, np.unravel_index(number, status.shape)), strict=True))


def _extremes(dataset: xr.Dataset, status: NDArray[np.int8]) -> list[tuple[str, int, str]]:
    """Return metric, case and reason of the ok case with the largest magnitude of each metric."""
    extremes = []
    for name, why in _EXTREMES:
        values = total_error(dataset) if name == "error" else dataset[name].values if name in dataset else None
        if values is None:
            continue
        size = np.abs(np.asarray(values, dtype=float).ravel())
        size = np.where((status == Status.OK) & np.isfinite(size), size, 0.0)
        if size.size and size.max() > 0:
            extremes.append((name, int(np.argmax(size)), why))
    return extremes


def is_exact(dataset: xr.Dataset, methods: Mapping[str, str]) -> bool:
    """Tell whether all cases are of the scheme :data:`EXACT`; ``methods`` as in :func:`exact_partners`."""
    return bool(np.all(_exact_labels(dataset, methods)))


def _exact_labels(dataset: xr.Dataset, methods: Mapping[str, str]) -> NDArray[np.bool_]:
    """Return which labels along the dimension of the schemes are those of :data:`EXACT`."""
    labels = map(str, np.atleast_1d(dataset["scheme"].values))
    return np.asarray([methods.get(label, label) == EXACT for label in labels])


def exact_place(dataset: xr.Dataset, methods: Mapping[str, str]) -> dict[str, int] | None:
    """Return where the exact solutions with the most modes lie along the dimensions that change the computation alone.

    ``None`` where no scheme is exact. ``methods`` as in :func:`exact_partners`.
    """
    exact = _exact_labels(dataset, methods)
    if not exact.any():
        return None
    place, coords = finest(dataset), dataset.coords.items()
    changing_scene = {dim for name, values in coords if not is_numerical(dataset, str(name)) for dim in values.dims}
    at = {dim: place[dim] for dim in numerical_dims(dataset) if dim not in changing_scene}
    for dim in map(str, dataset["scheme"].dims):
        at[dim] = int(np.argmax(np.where(exact, modes_along(dataset, dim), -np.inf)))
    return at


def exact_partners(dataset: xr.Dataset, methods: Mapping[str, str]) -> NDArray[np.int64]:
    """Return, for each case, the number of the case that is the exact solution of its scene; -1 where there is none.

    That is a case of the scheme :data:`EXACT` with the most modes that the archive holds; along a dimension that
    changes the scene too, as a zip may, with those of the case. ``methods`` are those of the study's schemes by label,
    which is its own method where it is missing. Shape ``(case,)``, cases counted as in :func:`notable_cases`.
    """
    import xarray as xr

    status = np.asarray(dataset["status"].values)
    at = exact_place(dataset, methods)
    if at is None:
        return np.full(status.size, -1, dtype=np.int64)
    number = xr.DataArray(np.arange(status.size).reshape(status.shape), dims=case_dims(dataset))
    partners = number.isel(at).broadcast_like(number).transpose(*number.dims).values.ravel()
    return np.where(status.ravel()[partners] == Status.OK, partners, -1)
