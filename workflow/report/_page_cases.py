"""Histories and load periods of the cases that a page holds, while there is room."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis import case_dims, casing_motion, period_frequency
from workflow.plots import HISTORIES
from workflow.plots._units import scaled
from workflow.report._thinned import BUCKETS, Pack, levels, thinned, thinned_times

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
    part: xr.Dataset, pack: Pack, order: Iterator[int], scene: Mapping[str, Any], room: int
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
    status, written = np.asarray(part["status"].values).ravel(), 0
    part = _read(part, [*names, *(ORBIT if orbits else ())])
    for case in order:
        if len(described["entries"]) >= MOST or pack.size + written > room:
            break
        entry = _entry(part, pack, case, names, buckets, scene, bool(status[case] == 0))
        described["entries"][str(case)] = entry
        written += len(str(entry))
    described["thinned"] = part.sizes["t"] > 2 * buckets if names else False
    return described


def _read(part: xr.Dataset, curves: list[str]) -> xr.Dataset:
    """Return what an entry needs of an archive; numbers are read at once where they are few, else case by case."""
    numbers = part[["status", *curves, *(name for name in ("period_impulse", "growth_rate") if name in part)]]
    if sum(array.nbytes for array in numbers.values()) <= MOST_READ:
        numbers = numbers.load()
    return numbers.assign(message=part["message"]) if "message" in part else numbers


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


def _curve(pack: Pack, values: NDArray[np.float64]) -> dict[str, Any]:
    """Take in a curve as levels between its ends."""
    steps, low, high = levels(values)
    return {**pack.add(steps), "low": low, "high": high}


def _entry(
    part: xr.Dataset, pack: Pack, case: int, names: list[str], buckets: int, scene: Mapping[str, Any], ok: bool
) -> dict[str, Any]:
    """Take in one case."""
    shape = part["status"].shape
    place = dict(zip(case_dims(part), map(int, np.unravel_index(case, shape) if shape else ()), strict=True))
    coordinates = part.coords.to_dataset().isel(place)

    def values(name: str) -> NDArray[np.float64]:
        return np.asarray(part.variables[name].isel(place).values, dtype=np.float64)

    entry: dict[str, Any] = {"curves": [_curve(pack, thinned(values(name), buckets)) for name in names]}
    if "period_impulse" in part:
        entry["periods"] = pack.add(values("period_impulse"))
        entry["growth"] = float(values("growth_rate")) if "growth_rate" in part else None
    if ORBIT[0] in part and np.isfinite(values(ORBIT[0])).all():
        entry["orbit"] = [_curve(pack, values(name)) for name in ORBIT]
    entry["frequency"] = period_frequency(coordinates, scene)
    if "gap" in coordinates:
        entry["gap"] = float(coordinates["gap"])
        motion = casing_motion(coordinates) if names else None
        if motion is not None:
            entry["casing"] = _curve(pack, thinned(motion[0], buckets))
    if not ok and "message" in part:
        entry["message"] = str(part.variables["message"].isel(place).values)[:_LONGEST_MESSAGE]
    return entry
