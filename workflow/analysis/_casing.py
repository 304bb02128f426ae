"""The casing's motion and the load periods of a case, from what an archive says of its scene and the axes."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.grid import HARMONIC

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_PATHS = ("scene.speed", "scene.load.", "scene.casing.")
"""Beginnings of the axes on which the motion of load and casing depends."""


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


def period_frequency(case: xr.Dataset, scene: Mapping[str, Any]) -> float:
    """Return the frequency whose periods an archive counts, Hz.

    That of the load, else of its first harmonic, else of the casing's.

    Parameters
    ----------
    case
        One case of an archive.
    scene
        Its study's scene as resolved, without the values of axes.

    Returns
    -------
    float
        Not a number where the scene makes no sense.
    """
    try:
        scene = _of_case(case, scene)
        load, casing = scene.get("load", {}), scene.get("casing", {})
        harmonics = [*load.get("harmonics", []), *casing.get("harmonics", [])]
        if harmonics and float(load.get("amplitude", 0.0)) == 0.0:
            return _frequency(harmonics[0], float(scene.get("speed", 0.0)))
        return float(load["frequency"])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError):
        return float("nan")


def _entries(case: xr.Dataset) -> list[tuple[float, float, float]]:
    """Return amplitude [m], frequency [Hz] and phase of each harmonic; none where what is said makes no sense."""
    about = case["gap"].attrs
    try:
        columns = [np.atleast_1d(about[f"casing_{name}"]).tolist() for name in HARMONIC]
        harmonics = [dict(zip(HARMONIC, entry, strict=True)) for entry in zip(*columns, strict=True)]
        scene = _of_case(case, {"speed": about["speed"], "casing": {"harmonics": harmonics}})
        speed, entries = float(scene["speed"]), scene["casing"]["harmonics"]
        return [
            (float(entry["amplitude"]), _frequency(entry, speed), float(entry.get("phase", 0.0))) for entry in entries
        ]
    except (ValueError, TypeError, KeyError, IndexError, AttributeError):
        return []


def _of_case(case: xr.Dataset, scene: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scene with the values that a case has along the axes, as far as the scene names them."""
    varied = copy.deepcopy(dict(scene))
    for coordinate in case.coords.values():
        path = str(coordinate.attrs.get("study_path", ""))
        if not path.startswith(_PATHS):
            continue
        _, *groups, name = path.split(".")
        group: Any = varied
        for key in groups:
            group = group[int(key)] if isinstance(group, list) else group.get(key, {})
        group[name] = float(coordinate)
    return varied


def _frequency(entry: Mapping[str, Any], speed: float) -> float:
    """Return the frequency of a harmonic, Hz; it has an order where its frequency is None or NaN."""
    frequency = entry.get("frequency")
    return float(entry["order"]) * speed if frequency is None or np.isnan(frequency) else float(frequency)
