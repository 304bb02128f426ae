"""Histories and load periods of the cases that a page holds, while there is room."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis import case_dims, casing_motion, period_frequency
from workflow.plots import HISTORIES
from workflow.plots._units import scaled
from workflow.report._thinned import BUCKETS, PackedArrays, levels, thinned, thinned_times

if TYPE_CHECKING:
    import xarray as xr

MOST = 1500
"""Cases whose histories a page holds at most: beyond, reading them takes longer than anybody looks."""

ORBIT = ("orbit_displacement", "orbit_velocity", "orbit_temperature")

MOST_BUCKETS = 8 * BUCKETS

MOST_READ = 64 * 2**20
"""Bytes of an archive that are read at once."""

_CHARACTERS = 2.2
"""Characters of a page that a point of a history takes, measured on oscillating ones."""

_LONGEST_MESSAGE = 300
"""Characters of a message that a page repeats."""


def append_cases(
    part: xr.Dataset, pack: PackedArrays, order: Iterator[int], scene: Mapping[str, Any], room: int
) -> dict[str, Any] | None:
    """Take in histories and impulses of load periods of cases in order, while there is room.

    Returns
    -------
    dict or None
        Where each case lies; ``None`` where the archive keeps neither.
    """
    names = [name for name in HISTORIES if name in part] if "t" in part.coords and part.sizes["t"] > 1 else []
    orbits = ORBIT[0] in part and "point" not in part.dims
    if not names and "period_impulse" not in part and not orbits:
        return None
    buckets = _buckets(part, len(names), room - pack.size) if names else 0
    described: dict[str, Any] = {
        "histories": [_history(part, name) for name in names],
        "t": pack.add(thinned_times(np.asarray(part["t"].values, dtype=float), buckets)) if names else None,
        "period_unit": "N s",
        "entries": {},
        "kept": bool(names),
        "orbit": dict(zip(("unit", "factor"), scaled("m", part[ORBIT[0]].values), strict=True)) if orbits else None,
    }
    status, written = np.asarray(part["status"].values), 0
    numbers, coordinates = _numbers(part, [*names, *(ORBIT if orbits else ())]), _of_scene(part)
    for case in order:
        if len(described["entries"]) >= MOST or pack.size + written > room:
            break
        place = tuple(map(int, np.unravel_index(case, status.shape))) if status.shape else ()
        here = coordinates.isel(dict(zip(case_dims(part), place, strict=True)), missing_dims="ignore")
        entry = _entry({name: array[place] for name, array in numbers.items()}, here, pack, names, buckets, scene)
        if status[place] != 0 and "message" in part:
            entry["message"] = str(part.variables["message"][place].values)[:_LONGEST_MESSAGE]
        described["entries"][str(case)] = entry
        written += len(str(entry))
    described["thinned"] = part.sizes["t"] > 2 * buckets if names else False
    return described


def _numbers(part: xr.Dataset, curves: list[str]) -> dict[str, Any]:
    """Return the variables that an entry needs: as arrays where they are small, else to be read case by case."""
    names = [*curves, *(name for name in ("period_impulse", "growth_rate") if name in part)]
    is_small = sum(part[name].nbytes for name in names) <= MOST_READ
    return {name: part[name].values if is_small else part.variables[name] for name in names}


def _of_scene(part: xr.Dataset) -> xr.Dataset:
    """Return the coordinates on which the motion of load and casing depends."""
    paths = {name: str(coordinate.attrs.get("study_path", "")) for name, coordinate in part.coords.items()}
    return part.coords.to_dataset()[[n for n, path in paths.items() if n in ("gap", "t") or path.startswith("scene.")]]


def _buckets(part: xr.Dataset, names: int, room: int) -> int:
    """Return in how many pieces histories are thinned: more where the cases are few and there is room for them."""
    cases = min(int(part["status"].size), MOST)
    buckets = MOST_BUCKETS
    while buckets > BUCKETS and cases * names * 2 * buckets * _CHARACTERS > room:
        buckets //= 2
    return buckets


def _history(part: xr.Dataset, name: str) -> dict[str, Any]:
    """Describe a history; its unit fits the gap or, without one, the usual case."""
    unit = str(part[name].attrs.get("units", "1"))
    size = (
        np.asarray(part["gap"].values, dtype=float) if name == "displacement" and "gap" in part.coords else np.ones(1)
    )
    if name == "displacement" and not np.any(size):
        size = np.abs(np.asarray(part[name].isel(dict.fromkeys(case_dims(part), 0)).values, dtype=float))
    shown, factor = scaled(unit, size)
    return {"name": name, "title": HISTORIES[name], "unit": shown, "factor": factor}


def _curve(pack: PackedArrays, values: NDArray[np.float64]) -> dict[str, Any]:
    """Take in a curve as levels between its ends."""
    steps, low, high = levels(values)
    return {**pack.add(steps), "low": low, "high": high}


def _entry(
    case: Mapping[str, Any],
    coordinates: xr.Dataset,
    pack: PackedArrays,
    names: list[str],
    buckets: int,
    scene: Mapping[str, Any],
) -> dict[str, Any]:
    """Take in one case, given its variables by name and its coordinates."""
    values = {name: np.asarray(array, dtype=np.float64) for name, array in case.items()}
    entry: dict[str, Any] = {"curves": [_curve(pack, thinned(values[name], buckets)) for name in names]}
    if "period_impulse" in values:
        entry["periods"] = pack.add(values["period_impulse"])
        entry["growth"] = float(values["growth_rate"]) if "growth_rate" in values else None
    if ORBIT[0] in values and np.isfinite(values[ORBIT[0]]).all():
        entry["orbit"] = [_curve(pack, values[name]) for name in ORBIT]
    entry["frequency"] = period_frequency(coordinates, scene)
    if "gap" in coordinates:
        entry["gap"] = float(coordinates["gap"])
        motion = casing_motion(coordinates) if names else None
        if motion is not None:
            entry["casing"] = _curve(pack, thinned(motion[0], buckets))
    return entry
