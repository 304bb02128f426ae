"""The data of an interactive page: axes, metrics of all cases, and histories of as many as fit."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis import (
    case_dims,
    exact_partners,
    finest,
    impulse_growth,
    numerical_dims,
    total_error,
)
from workflow.plots._units import axis_of, coordinate_texts, scaled
from workflow.report._page_cases import MOST_READ, append_cases
from workflow.report._thinned import PackedArrays, rounded
from workflow.study import MODES

if TYPE_CHECKING:
    import xarray as xr

MOST_VALUES = 2000
"""Values of an axis that a page holds; of a longer one evenly spread ones."""

MOST_CASES = 250_000

_FIRST = (
    "error",
    "processor_time",
    "scheme_error",
    "model_error",
    "max_temperature",
    "contact_impulse",
    "impulse_growth",
    "runaway",
    "steady_state",
    "impacts",
    "max_penetration",
    "displacement_error",
    "temperature_error",
    "impulse_error",
    "energy_residual",
    "predictability",
    "contact_time",
    "thermal_closing",
    "growth_rate",
)
"""Metrics that come first where not all fit."""

_DERIVED: dict[str, Callable[[xr.Dataset], NDArray[Any] | None]] = {
    "error": total_error,
    "scheme_error": partial(total_error, part="scheme_"),
    "model_error": partial(total_error, part="model_"),
    "impulse_growth": impulse_growth,
}
"""What a page derives from the variables of an archive; ``None`` where it lacks them."""

_EXPLAINED = {
    "error": "largest relative L2 distance of displacement, temperature and impulse from the reference",
    "scheme_error": "largest part of the scheme in the errors: against the exact solution of the same reduced model",
    "model_error": "largest part of the reduced model in the errors: its exact solution against the reference",
    "impulse_growth": "impulse of the last complete load period over that of the first",
    "runaway": "1: in permanent contact the tip grows without bound; it need not touch",
    "energy_residual": "energy that the scheme itself creates (+) or takes (−), as a share of the largest energy",
    "effective_restitution": "speed after over speed before an impact, which a scheme without e gives by itself",
}
"""Short meanings for a reader of the page, in place of the archive's definitions."""


@dataclass(frozen=True)
class Shown:
    """The part of an archive that a page holds.

    Attributes
    ----------
    dataset
        That part.
    cases
        Number of each notable case in it.
    left_out
        A sentence for every axis of which values are left out.
    """

    dataset: xr.Dataset
    cases: tuple[int, ...]
    left_out: tuple[str, ...]


def shown_part(dataset: xr.Dataset, notable: Iterable[int]) -> Shown:
    """Return the cases that a page holds: all, or evenly spread values of the longest axes and the notable cases."""
    dims, shape = case_dims(dataset), dataset["status"].shape
    places = [np.unravel_index(case, shape) if shape else () for case in notable]
    most = dict.fromkeys(dims, MOST_VALUES)
    while np.prod([min(n, most[dim]) for dim, n in zip(dims, shape, strict=True)]) > MOST_CASES:
        longest = max(dims, key=lambda dim: min(dataset.sizes[dim], most[dim]))
        most[longest] = 7 * min(dataset.sizes[longest], most[longest]) // 8
    selected, remarks, first = {}, [], finest(dataset)
    for k, (dim, size) in enumerate(zip(dims, shape, strict=True)):
        if size > most[dim]:
            even = np.linspace(0, size - 1, most[dim]).round().astype(int)
            selected[dim] = np.unique([*even, first[dim], *(int(place[k]) for place in places)])
            remarks.append(f"{dim.replace('_', ' ')}: {len(selected[dim])} of its {size} values")
    part = _part(dataset, selected)
    moved = [
        [
            int(np.searchsorted(selected[dim], place[k])) if dim in selected else int(place[k])
            for k, dim in enumerate(dims)
        ]
        for place in places
    ]
    cases = tuple(int(np.ravel_multi_index(place, part["status"].shape)) if place else 0 for place in moved)
    return Shown(part, cases, tuple(remarks))


def _part(dataset: xr.Dataset, selected: Mapping[str, NDArray[np.int64]]) -> xr.Dataset:
    """Return the kept places of an archive; variables that are small are read whole: scattered reads take longer."""
    if not selected:
        return dataset
    small = [name for name, array in dataset.data_vars.items() if array.dtype.kind != "O" and array.nbytes <= MOST_READ]
    return dataset.isel(selected).assign({name: dataset[name].compute().isel(selected) for name in small})


def page_data(
    part: xr.Dataset, first: Sequence[int], methods: Mapping[str, str], scene: Mapping[str, Any], room: int
) -> tuple[dict[str, Any], str]:
    """Return what a page's script reads: a plain description, and the block of arrays in base64.

    Parameters
    ----------
    part
        Of :func:`shown_part`.
    first
        Numbers of the cases whose histories come first; the first of all is the one shown.
    methods
        Method of each scheme by its label.
    scene
        Of its study as resolved.
    room
        Characters that the block may take.
    """
    pack = PackedArrays()
    status = np.asarray(part["status"].values).ravel().astype(np.int8)
    described: dict[str, Any] = {
        "dims": [axis_of(part, dim) for dim in case_dims(part)],
        "scheme_dim": _place_of(part, "scheme"),
        "h_dim": _place_of(part, "h"),
        "numerical": [case_dims(part).index(dim) for dim in numerical_dims(part)],
        "h": _values(part, "h"),
        "duration": float(part.attrs.get("duration", np.nan)),
        "start": first[0],
        "status": pack.add(status),
    }
    described["metrics"], described["left_out"] = _metrics(part, pack, status == 0, room // 2)
    described["modes"] = _modes(part)
    partners = exact_partners(part, methods).astype(np.int32)
    described["exact"] = pack.add(partners)
    order = _order(part, first, partners)
    described["cases"] = append_cases(part, pack, order, scene, room)
    return described, pack.text()


def _place_of(part: xr.Dataset, name: str) -> int | None:
    """Return the position among the dimensions of the one along which a coordinate lies."""
    dims, along = case_dims(part), part[name].dims if name in part.coords else ()
    return dims.index(str(along[0])) if len(along) == 1 and along[0] in dims else None


def _values(part: xr.Dataset, name: str) -> list[float]:
    return [float(value) for value in np.atleast_1d(part[name].values)] if name in part.coords else []


def _metrics(
    part: xr.Dataset, pack: PackedArrays, ok: NDArray[np.bool_], room: int
) -> tuple[list[dict[str, Any]], list[str]]:
    """Take in the metrics of all cases, the most useful first, while there is room; return those left out too."""
    dims = part["status"].dims
    there = [str(name) for name in part.data_vars if part[name].dims == dims and part[name].dtype.kind == "f"]
    flags = [name for name in ("runaway", "steady_state") if name in part and part[name].dims == dims]
    there += flags
    ranked = [name for name in _FIRST if name in there or name in _DERIVED]
    entries, left = [], []
    for name in [*ranked, *(name for name in there if name not in ranked)]:
        derived = name in _DERIVED
        values = _DERIVED[name](part) if derived else np.asarray(part[name].values, dtype=float)
        if values is None or not np.isfinite(values).any():
            continue
        if pack.size > room:
            left.append(name.replace("_", " "))
            continue
        small = rounded(np.where(ok, values.ravel(), np.nan))
        unit = "1" if derived else str(part[name].attrs.get("units", "1"))
        shown_unit, factor = scaled(unit, small)
        about = _EXPLAINED.get(name) or str(part[name].attrs.get("long_name", ""))
        entry = {"name": name, "title": name.replace("_", " "), "unit": shown_unit, "factor": factor, "about": about}
        entry["varies"] = bool(np.nanmax(small) > np.nanmin(small)) if np.isfinite(small).any() else False
        words = str(part[name].attrs["flag_meanings"]).split() if name == "steady_state" else None
        entries.append({**entry, "words": words, **pack.add(small)})
    return entries, left


def _modes(part: xr.Dataset) -> dict[str, Any] | None:
    """Describe the reduced models of an archive: the mode counts of every place along the dimensions they lie on."""
    if not all(name in part.coords for name in MODES) or not any(
        part[name].ndim and part[name].size > 1 for name in MODES
    ):
        return None
    return {name: {"dim": _place_of(part, name), "texts": coordinate_texts(part[name])[1]} for name in MODES}


def _order(part: xr.Dataset, first: Sequence[int], partners: NDArray[np.int32]) -> Iterator[int]:
    """Yield every case once: notable ones, neighbours of the first along every axis, then the largest errors.

    Before each comes its exact partner. Without errors the cases of the rest are spread evenly, by a fixed shuffle.
    """
    yielded: set[int] = set()
    for case in _ranked(part, first):
        for one in (int(partners[case]), case):
            if one >= 0 and one not in yielded:
                yielded.add(one)
                yield one


def _ranked(part: xr.Dataset, first: Sequence[int]) -> Iterator[int]:
    shape = part["status"].shape
    yield from first
    place = np.unravel_index(first[0], shape) if shape else ()
    for axis, size in enumerate(shape):
        for k in range(size):
            yield int(np.ravel_multi_index([*place[:axis], k, *place[axis + 1 :]], shape))
    mixed = np.random.default_rng(0).permutation(part["status"].size)
    error = total_error(part)
    if error is not None:
        rank = np.where(np.isfinite(error), error, -1.0).ravel()[mixed]
        mixed = mixed[np.argsort(-rank, kind="stable")]
    yield from map(int, mixed)
