"""What a case's histories and scene tell: contact phases, growing impulses, spectra, the casing's motion."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow import models
from workflow.analysis._cases import added_dim, most_loaded
from workflow.plan import HARMONIC

if TYPE_CHECKING:
    import xarray as xr

Array = NDArray[np.float64]

_PATHS = ("scene.speed", "scene.load.", "scene.casing.harmonics.", "scene.casing.angles")
"""Beginnings of the axes on which the motion of load and casing depends."""


def gap_of(case: xr.Dataset) -> xr.DataArray:
    """Return the clearance at rest, cold, with what a study adds to that of every contact, m."""
    gap = case["gap"]
    return gap + case["clearance"] if "clearance" in case.coords else gap


def casing_motion(case: xr.Dataset) -> tuple[Array, Array] | None:
    """Return place d(t) [m] and velocity ḋ(t) [m/s] of a casing that moves, at the samples of one case and contact.

    ``None`` where the casing stays at the gap or the archive does not say.
    """
    if "gap" not in case.coords or "t" not in case.coords:
        return None
    harmonics = _casing_harmonics(case)
    if not harmonics.width:
        return None
    t = np.asarray(case["t"].values, dtype=float)
    angle = harmonics.angular * t[:, None] + harmonics.phase
    place = float(gap_of(case)) + np.sin(angle) @ harmonics.amplitude[0]
    velocity = np.cos(angle) @ (harmonics.angular * harmonics.amplitude)[0]
    return place, velocity


def period_frequency(case: xr.Dataset, scene: Mapping[str, Any]) -> float:
    """Return the frequency of the load periods of an archive's case, Hz, see :func:`workflow.models.period_frequency`.

    ``scene`` is its study's as resolved, without the values of axes. Not a number where the scene makes no sense.
    """
    try:
        scene = _of_case(case, scene)
        speed, load = float(scene.get("speed", 0.0)), scene["load"]
        amplitude, frequency = (np.full((1, 1), float(load[name])) for name in ("amplitude", "frequency"))
        own = models.Harmonics(amplitude, frequency, np.zeros((1, 1)))
        listed, casing = (_harmonics(scene.get(group, {}).get("harmonics", []), speed) for group in ("load", "casing"))
        return float(models.period_frequency(own.joined(listed), casing)[0])
    except (ValueError, TypeError, KeyError, IndexError, AttributeError):
        return float("nan")


def _casing_harmonics(case: xr.Dataset) -> models.Harmonics:
    """Return the harmonics of a case's casing; none where what is said makes no sense."""
    about = case["gap"].attrs
    try:
        columns = [np.atleast_1d(about[f"casing_{name}"]).tolist() for name in HARMONIC]
        entries = [dict(zip(HARMONIC, entry, strict=True)) for entry in zip(*columns, strict=True)]
        scene = _of_case(case, {"speed": about["speed"], "casing": {"harmonics": entries}})
        angle = float(scene["casing"].get("angles", case.coords.get("contact_angle", 0.0)))
        return _harmonics(scene["casing"]["harmonics"], float(scene["speed"]), angle)
    except (ValueError, TypeError, KeyError, IndexError, AttributeError):
        return _harmonics([], 0.0)


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


def _harmonics(entries: Sequence[Mapping[str, Any]], speed: float, angle: float = 0.0) -> models.Harmonics:
    """Return the harmonics of one case; an entry has an order where its frequency is None or NaN.

    The ``angle`` [rad] of a contact turns those with an order.
    """
    rows = np.zeros((3, 1, len(entries)))
    for k, entry in enumerate(entries):
        frequency = entry.get("frequency")
        has_order = frequency is None or np.isnan(frequency)
        cycles, turn = (entry["order"] * speed, entry["order"] * angle) if has_order else (frequency, 0.0)
        rows[:, 0, k] = entry["amplitude"], cycles, entry["phase"] + turn
    return models.Harmonics(*rows)


_VARIABLES = {
    "begin": ("s", "begin of the contact phase, on the grid of samples"),
    "end": ("s", "end of the contact phase, on the grid of samples"),
    "impulse": ("N s", "impulse of the casing on the blade tip during the contact phase"),
    "peak_force": ("N", "largest contact force of the phase, mean over an output interval"),
}


def contact_phases(dataset: xr.Dataset) -> xr.Dataset:
    """Return when the tip touches its casing, with which impulse and which largest force.

    A phase is a run of output intervals in which the contact force is positive. ``contact_force`` is the mean over
    the interval before a sample, so begin and end are known to one output interval, and contacts that are less than
    one interval apart are one phase.

    Parameters
    ----------
    dataset
        An archive, or any selection of its cases, with the history ``contact_force``.

    Returns
    -------
    xarray.Dataset
        Variables ``begin`` and ``end`` [s], ``impulse`` [N s] and ``peak_force`` [N] over the dimensions of the cases
        and ``phase`` (``contact_phase`` where an axis is called ``phase``), which counts from 1; NaN beyond a case's
        last phase.

    Raises
    ------
    ValueError
        The dataset has no history ``contact_force``.
    """
    import xarray as xr

    if "contact_force" not in dataset or "t" not in dataset["contact_force"].dims:
        raise ValueError("the dataset has no history `contact_force`; name it in `output.histories` of the study")
    force = dataset["contact_force"].transpose(..., "t")
    dims = [str(dim) for dim in force.dims[:-1]]
    t = np.asarray(dataset["t"].values, dtype=float)
    cases = np.asarray(force.values, dtype=float).reshape(-1, t.size)
    phases_of_cases = [_phases(case, t) for case in cases]
    most = max((phases.shape[1] for phases in phases_of_cases), default=0)
    table = np.full((len(phases_of_cases), len(_VARIABLES), most), np.nan)
    for row, phases in zip(table, phases_of_cases, strict=True):
        row[:, : phases.shape[1]] = phases
    values = table.reshape(*force.shape[:-1], len(_VARIABLES), most)
    attributes = [{"units": unit, "long_name": meaning} for unit, meaning in _VARIABLES.values()]
    phase = added_dim(force, "phase", "contact_phase")
    variables = {name: ([*dims, phase], values[..., k, :], attributes[k]) for k, name in enumerate(_VARIABLES)}
    return xr.Dataset(variables, {**force.isel(t=0, drop=True).coords, phase: np.arange(1, most + 1)})


def _phases(force: Array, t: Array) -> Array:
    """Return begin, end, impulse and largest force of one case's phases, ``(4, phase)``."""
    touching = np.concatenate([[False], force[1:] > 0, [False]])
    edges = np.flatnonzero(np.diff(touching.astype(np.int8)))
    first, last = edges[::2], edges[1::2]  # a phase lasts from sample `first` to sample `last`
    impulse = np.concatenate([[0.0], np.cumsum(np.where(touching[1:-1], force[1:], 0.0) * np.diff(t))])
    peak = [force[a + 1 : b + 1].max() for a, b in zip(first, last, strict=True)]
    return np.array([t[first], t[last], impulse[last] - impulse[first], peak])


def impulse_growth(dataset: xr.Dataset) -> Array | None:
    """Return the impulse of each case's last complete load period over that of its first, 1, shape of ``status``.

    NaN where a case has fewer than two periods, or no contact in the first; ``None`` of archives without periods. Of
    several contacts the most loaded one counts.
    """
    dataset = most_loaded(dataset)
    if "period_impulse" not in dataset:
        return None
    impulse = np.asarray(dataset["period_impulse"].transpose(..., "period").values, dtype=np.float64)
    if impulse.shape[-1] < 2:
        return None
    count = np.isfinite(impulse).sum(axis=-1)
    last = np.take_along_axis(impulse, np.maximum(count - 1, 0)[..., None], axis=-1)[..., 0]
    first = np.where((count > 1) & (impulse[..., 0] > 0), impulse[..., 0], np.nan)
    return np.asarray(last / first)


def spectrum(values: xr.DataArray, last: float = 0.5) -> xr.DataArray:
    """Return the amplitude spectrum of the last part of a history, its mean taken off.

    The samples x_k of the last part are weighed by Hann's window w_k: A(f) = 2 |Σ w_k (x_k - mean) exp(-2πi f t_k)| /
    Σ w_k, which is the amplitude of a sinusoid at its own frequency. Two of them are told apart where their frequencies
    differ by twice the distance of the frequencies given, the width of the window's main lobe at half its height.

    Parameters
    ----------
    values
        A history of an archive or of some of its cases, with the dimension ``t``.
    last
        Share of the samples, 0 < last <= 1.

    Returns
    -------
    xarray.DataArray
        In the unit of the history, with the dimension ``frequency`` [Hz] in the place of ``t``, the last one
        (``spectral_frequency`` where an axis is called ``frequency``); NaN where a case is.

    Raises
    ------
    ValueError
        The array has no dimension ``t``, ``last`` is no share, or fewer than four samples are left, or uneven ones.
    """
    import xarray as xr

    if "t" not in values.dims:
        raise ValueError(f"`{values.name}` has no dimension `t`; a spectrum is that of a history")
    if not 0 < last <= 1:
        raise ValueError(f"`last` is {last}; give a share of the samples above 0, 1 for all of them")
    part = values.isel(t=slice(values.sizes["t"] - round(last * values.sizes["t"]), None))
    count = part.sizes["t"]
    if count < 4:
        raise ValueError(f"a spectrum of {count} samples says nothing; record more, or take a larger part of them")
    times = np.asarray(part["t"].values, dtype=float)
    interval = float(times[-1] - times[0]) / (count - 1)
    if not (interval > 0 and np.allclose(np.diff(times), interval, rtol=1e-3, atol=0)):  # a part is cut out, say
        raise ValueError(f"the samples of `{values.name}` are not equally spaced in time; give all of an archive")
    window = np.hanning(count + 1)[:-1]
    frequency = np.fft.rfftfreq(count, interval)
    deviation = (part - part.mean("t", skipna=False)).transpose(..., "t")
    amplitude = 2 * np.abs(np.fft.rfft(deviation.values * window)) / window.sum()
    name = added_dim(values, "frequency", "spectral_frequency")
    coords = {name: one for name, one in part.coords.items() if "t" not in one.dims}
    coords[name] = xr.DataArray(frequency, dims=name, attrs={"units": "Hz", "long_name": "frequency"})
    about = {"units": str(values.attrs.get("units", "1")), "seconds": count * interval}
    return xr.DataArray(amplitude, coords, (*deviation.dims[:-1], name), name=values.name, attrs=about)
