"""What changes with the speed: free frequencies under engine orders, and how far the clearance is closed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import case_dims, contact_text, finest, gap_of, most_loaded, swept_axis
from workflow.cases import arrange, full_structure
from workflow.kernels import Array
from workflow.models import at_speed, structure_of
from workflow.plots._style import COLOURS, GREY, head, legend_below, new_figure, trim
from workflow.plots._units import RPM, in_units, scaled
from workflow.study import Study, StudySource, read_study

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_POINTS = 60
"""Speeds from 0 to that of a study without an axis of it."""


def campbell(study: StudySource, orders: Sequence[float] | None = None, modes: int = 6) -> Figure:
    """Draw the free frequencies over the speed with engine orders, lines through 0, and mark where they cross.

    The structure is that of the first case, with the tip free and nothing reduced.

    Parameters
    ----------
    study
        All that ``read_study`` takes, with a ``scene.speed``: along its axis, or from 0 to it.
    orders
        Engine orders; those of the harmonics of casing and load where left out.
    modes
        Largest number of free frequencies.

    Raises
    ------
    ValueError
        The study has no speed.
    """
    study = read_study(study)
    speeds = _speeds(study)
    lines = engine_orders(study) if orders is None else sorted(map(float, orders))
    free = free_frequencies(study, speeds, modes)
    highest = max([order * speeds[-1] for order in lines], default=0.0)
    free = free[:, : max(1, int((free.min(axis=0) <= highest).sum()))]
    figure = new_figure(5.0, 3.8)
    panel: Any = figure.subplots()
    top = 1.12 * max(free.max(), min(highest, free.max()))
    for k, frequency in enumerate(free.T):
        label = "free frequency" if k == 0 else None
        panel.plot(RPM * speeds, frequency, color=COLOURS[0], lw=1.6, label=label)
    for k, order in enumerate(lines):
        panel.plot(RPM * speeds, order * speeds, "--", color=GREY, lw=1.0, label=None if k else "engine order")
        x = min(float(speeds[-1]), top / order)
        panel.annotate(f"{order:g}×", (RPM * x, order * x), (2, 2), textcoords="offset points", fontsize=9)
    crossings = [crossing for order in lines for one in free.T for crossing in _crossings(speeds, one, order)]
    if crossings:
        at, frequency = np.transpose(crossings)
        panel.plot(RPM * at, frequency, "o", color="black", mfc="white", ms=6, label="crossing", zorder=3)
    panel.set(xlabel="speed [rpm]", ylabel="frequency [Hz]", ylim=(0.0, top))
    panel.margins(x=0.04)
    trim(panel)
    legend_below(figure, panel.get_legend_handles_labels(), 3)
    return figure


def _speeds(study: Study) -> Array:
    """Return the speeds of a study's axis, or from 0 to its speed, ascending, rev/s."""
    along = [axis.values for axis in study.axes() if axis.path == "scene.speed"]
    values = np.unique(np.array([*(along[0] if along else ()), study.scene.speed], dtype=np.float64))
    values = values if values.size > 2 else np.linspace(0.0, values.max(), _POINTS)
    if values[-1] == 0:
        raise ValueError("the study has no speed; write `speed` in its scene, or the axis `scene.speed`")
    return values


def engine_orders(study: Study) -> list[float]:
    """Return the engine orders of the harmonics of casing and load, ascending."""
    casing = [entry.order for entry in study.scene.casing.harmonics]
    load = [entry.order for entry in study.scene.load.harmonics]
    return sorted({float(order) for order in (*casing, *load) if order})


def free_frequencies(study: Study, speeds: Array, modes: int) -> Array:
    """Return the lowest free frequencies of the first case's structure at each speed, Hz, ``(speed, mode)``."""
    first = full_structure(arrange(study).settings(0))
    count, scene = min(modes, first.mechanical_size), study.scene
    values = [
        structure_of(scene.model, at_speed(scene.model, scene.parameters, float(speed))).mechanical.modes(count).values
        for speed in speeds
    ]
    return np.sqrt(np.maximum(values, 0.0)) / (2 * np.pi)


def _crossings(speeds: Array, frequency: Array, order: float) -> list[tuple[float, float]]:
    """Return speeds and frequencies at which an engine order meets a free frequency, linear between the speeds."""
    apart = frequency - order * speeds
    places = np.flatnonzero((apart[:-1] > 0) != (apart[1:] > 0))
    share = apart[places] / (apart[places] - apart[places + 1])
    at = speeds[places] + share * (speeds[places + 1] - speeds[places])
    return list(zip(at.tolist(), (order * at).tolist(), strict=True))


def clearance(dataset: xr.Dataset, along: str = "speed") -> Figure:
    """Draw how far the tip closes its clearance: at the start, at most, and by heat at the end; the gap dotted.

    The start is the static growth where the study says ``initial: static``; that of the points of a sweep is left out.
    The most is that of the samples. Of all other dimensions the smallest step, the most modes and the largest α are
    shown: select what else is shown before. Of several contacts the most loaded one is shown.

    Parameters
    ----------
    dataset
        An archive, or a selection of its cases.
    along
        Dimension across the picture, with numbers.

    Raises
    ------
    ValueError
        There is no such dimension with numbers.
    """
    if along not in case_dims(dataset) or along not in dataset.coords or dataset[along].dtype.kind not in "if":
        raise ValueError(f"`{along}` is no dimension with numbers; they lie along {', '.join(case_dims(dataset))}")
    dataset = most_loaded(dataset)
    place = {dim: k for dim, k in finest(dataset).items() if dim != along}
    cut = dataset.isel(place).where(dataset["status"].isel(place) == 0)
    curves = {"quasi-static growth by heat at the end": np.asarray(cut["thermal_closing"].values, dtype=float)}
    if "displacement" in cut:
        x = np.asarray(cut["displacement"].transpose(along, "t").values, dtype=float)
        begins = {} if swept_axis(dataset) else {"tip at the start": x[:, 0]}
        curves = {**begins, "tip at most": x.max(axis=1), **curves}
    gap = np.broadcast_to(np.asarray(gap_of(cut).values, dtype=float), dataset[along].shape)
    unit, factor = scaled("m", gap)
    across, label = in_units(dataset[along])
    figure = new_figure(5.0, 3.5)
    panel: Any = figure.subplots()
    panel.plot(across, factor * gap, ":", color="black", lw=1.4, label="gap", zorder=3)
    for k, (name, values) in enumerate(curves.items()):
        panel.plot(across, factor * values, ("-", "-", "--")[k], color=COLOURS[k], lw=1.6, label=name)
    panel.set(xlabel=label, ylabel=f"displacement [{unit}]")
    trim(panel)
    legend_below(figure, panel.get_legend_handles_labels(), 2)
    head(figure, contact_text(dataset))
    return figure
