"""The casing's motion of a case, from what an archive says of it: the attributes of ``gap`` and the axes."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

HARMONICS, SPEED = "casing_harmonics", "speed"
"""Attributes of the coordinate ``gap``: the study's ``casing.harmonics`` as JSON, and ``scene.speed`` in Hz."""

_PATH = "scene.casing.harmonics."


def casing_motion(case: xr.Dataset) -> tuple[Array, Array] | None:
    """Return place d(t) [m] and velocity ḋ(t) [m/s] of a casing that moves, at the archive's samples.

    Parameters
    ----------
    case
        One case of an archive with histories.

    Returns
    -------
    tuple or None
        Two arrays ``(t,)``; ``None`` where the casing stays at the gap or the archive does not say.
    """
    if "gap" not in case.coords or "t" not in case.coords:
        return None
    entries = _entries(case)
    if not entries:
        return None
    t = np.asarray(case["t"].values, dtype=float)
    place, velocity = np.full(t.shape, float(case["gap"])), np.zeros(t.shape)
    for amplitude, frequency, phase in entries:
        angle = 2 * np.pi * frequency * t + phase
        place += amplitude * np.sin(angle)
        velocity += 2 * np.pi * frequency * amplitude * np.cos(angle)
    return place, velocity


def _entries(case: xr.Dataset) -> list[tuple[float, float, float]]:
    """Return amplitude [m], frequency [Hz] and phase of each harmonic; none where what is said makes no sense."""
    about = case["gap"].attrs
    try:
        entries: list[dict[str, Any]] = [dict(entry) for entry in json.loads(str(about.get(HARMONICS, "[]")))]
        speed = float(about.get(SPEED, 0.0))
        for coordinate in case.coords.values():
            path = str(coordinate.attrs.get("study_path", ""))
            if path == "scene.speed":
                speed = float(coordinate)
            elif path.startswith(_PATH):
                place, name = path.removeprefix(_PATH).split(".")
                entries[int(place)][name] = float(coordinate)
        return [
            (float(entry["amplitude"]), _frequency(entry, speed), float(entry.get("phase", 0.0))) for entry in entries
        ]
    except (ValueError, TypeError, KeyError, IndexError):
        return []


def _frequency(entry: dict[str, Any], speed: float) -> float:
    """Return the frequency of a harmonic, Hz."""
    order = entry.get("order")
    return float(entry["frequency"]) if order is None else float(order) * speed
