"""What changes with the speed: free frequencies under engine orders, clearance, the spectrum of a sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow import analysis
from workflow.archive import grid_of, provenance
from workflow.cases import arrange, full_structure
from workflow.kernels import Array
from workflow.models import at_speed, structure_of
from workflow.plots._style import COLOURS, GREY, cell_edges, head, legend_below, new_figure, trim
from workflow.plots._units import in_units, scaled
from workflow.study import Study, StudySource, read_study

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_POINTS = 25
"""Speeds from 0 to the fastest at which free frequencies are computed for a diagram, beside those of the study."""

_FAINTEST = -60.0
"""Decibels below which all is drawn alike: a thousandth of the largest amplitude."""

_ROUNDING = 1e-9
"""Largest amplitude, over the largest value, up to which a history does not vibrate: its deviations are rounding."""

_SPEEDS, _MODES = 13, 12
"""Speeds at which free frequencies are computed, with straight lines between, and the most of them."""


def campbell(study: StudySource, orders: Sequence[float] | None = None, modes: int | None = None) -> Figure:
    """Draw the free frequencies over the speed with engine orders, lines through 0, and mark where they cross.

    The structure is that of the first case, with the tip free and nothing reduced.

    Parameters
    ----------
    study
        What ``read_study`` takes, or an archive's path, with a ``scene.speed``: the fastest one ends the diagram.
    orders
        Engine orders, above 0; those of the harmonics of casing and load where left out.
    modes
        Number of free frequencies; where left out six, less those that no order reaches.

    Raises
    ------
    ValueError
        The study has no speed, or an order is not above 0.
    """
    study = _read(study)
    speeds = _speeds(study)
    lines = engine_orders(study) if orders is None else sorted(map(float, orders))
    free = free_frequencies(study, speeds, modes or 6)
    if modes is None:
        highest = max([order * speeds[-1] for order in lines], default=0.0)
        free = free[:, : max(1, int((free.min(axis=0) <= highest).sum()))]
    figure = new_figure(5.0, 3.8)
    panel: Any = figure.subplots()
    panel.plot(analysis.RPM * speeds, free, color=COLOURS[0], lw=1.6)[0].set_label("free frequency")
    _draw_orders(panel, speeds, analysis.RPM * speeds, lines, top := 1.12 * free.max(), GREY)
    crossings = [crossing for order in lines for crossing in _crossings(study, speeds, free, order)]
    if crossings:
        at, frequency = np.transpose(crossings)
        panel.plot(analysis.RPM * at, frequency, "o", color="black", mfc="white", ms=6, label="crossing", zorder=3)
    panel.set(xlabel="speed [rpm]", ylabel="frequency [Hz]", ylim=(0.0, top))
    panel.margins(x=0.04)
    trim(panel)
    legend_below(figure, panel.get_legend_handles_labels(), 3)
    return figure


def _read(source: StudySource) -> Study:
    """Return a study, or that of the archive at a path."""
    if isinstance(source, str | Path) and str(source).endswith(".nc"):
        return grid_of(provenance(source)).study
    return read_study(source)


def _speeds(study: Study) -> Array:
    """Return speeds from 0 to the fastest of a study, its own among them, ascending, rev/s."""
    own = np.array(study.each("scene.speed"), dtype=np.float64)
    if own.max() == 0:
        raise ValueError("the study has no speed; write `speed` in its scene, or the axis `scene.speed`")
    return np.union1d(np.linspace(0.0, own.max(), _POINTS), own)


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


def _crossings(study: Study, speeds: Array, free: Array, order: float) -> Iterator[tuple[float, float]]:
    """Yield speeds and frequencies at which an engine order meets a free frequency; ``free`` are those at speeds."""
    from scipy.optimize import brentq

    apart = free - order * speeds[:, None]
    for k, mode in np.argwhere((apart[:-1] > 0) != (apart[1:] > 0)).tolist():
        known = dict(zip(speeds[k : k + 2].tolist(), apart[k : k + 2, mode].tolist(), strict=True))

        def distance(speed: float, mode: int = mode, known: Mapping[float, float] = known) -> float:
            if speed in known:  # rounding may turn the sign of one that is next to 0
                return known[speed]
            return float(free_frequencies(study, np.array([speed]), free.shape[1])[0, mode]) - order * speed

        at = brentq(distance, *known, xtol=1e-5 * float(speeds[-1]))  # far below the width of a line
        yield at, order * at


def clearance(dataset: xr.Dataset, along: str = "speed") -> Figure:
    """Draw how far the tip closes its clearance: at the start, at most, and by heat at the end; the clearance dotted.

    The clearance is the gap at rest, cold, with what the study adds as ``clearance``; the legend gives the least of it.
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
    analysis.require_numbers(dataset, along)
    dataset = analysis.most_loaded(dataset)
    place = {dim: k for dim, k in analysis.finest(dataset).items() if dim != along}
    cut = dataset.isel(place).where(dataset["status"].isel(place) == 0)
    heat = np.asarray(cut["thermal_closing"].values, dtype=float)
    curves = {"growth by heat at the end": heat} if heat.any() else {}
    if "displacement" in cut:
        x = np.asarray(cut["displacement"].transpose(along, "t").values, dtype=float)
        begins = {} if analysis.swept_axis(dataset) else {"tip at the start": x[:, 0]}
        curves = {**begins, "tip at most": x.max(axis=1), **curves}
    gap = np.broadcast_to(np.asarray(analysis.gap_of(cut).values, dtype=float), dataset[along].shape)
    unit, factor = scaled("m", gap)
    across, label = in_units(dataset[along])
    figure = new_figure(5.0, 3.5)
    panel: Any = figure.subplots()
    name = f"clearance at rest, {'' if np.ptp(gap) == 0 else 'from '}{factor * gap.min():.4g} {unit}"
    panel.plot(across, factor * gap, ":", color="black", lw=1.4, label=name, zorder=3)
    reach = float(np.abs(np.nan_to_num(dataset["gap"].attrs.get("casing_amplitude", 0.0))).sum())
    if reach > 0:
        low, high = factor * (gap - reach), factor * (gap + reach)
        panel.fill_between(across, low, high, color=GREY, alpha=0.2, lw=0, label="reached by the casing")
    for k, (name, values) in enumerate(curves.items()):
        panel.plot(across, factor * values, ("-", "-", "--")[k], color=COLOURS[k], lw=1.6, label=name)
    panel.set(xlabel=label, ylabel=f"displacement [{unit}]")
    trim(panel)
    legend_below(figure, panel.get_legend_handles_labels(), 2)
    head(figure, fill(analysis.place_text(dataset, place), 60))
    return figure


def interaction_map(
    dataset: xr.Dataset,
    sensor: str,
    along: str = "speed",
    orders: Sequence[float] | None = None,
    study: StudySource | None = None,
    highest: float | None = None,
) -> Figure:
    """Draw the amplitude spectrum of a sensor over the speed: frequency up, decibels of the largest amplitude.

    The spectrum is that of the last half of each case, see :func:`workflow.spectrum`; the caption gives its window and
    resolution. Along the speed engine orders are drawn, f = order · speed, and the free frequencies of a study. Of all
    other dimensions the smallest step, the most modes and the largest α are shown: select what else is shown before.
    Cases that are not ok are left white.

    Parameters
    ----------
    dataset
        An archive that keeps histories, or a selection of its cases.
    sensor
        Name of a sensor, or of a history of the contact such as ``displacement``.
    along
        Dimension across the picture, with numbers.
    orders
        Engine orders whose lines are drawn; those of casing and load of the study, else of the casing, where left out.
    study
        The study of the archive, or its path, whose free frequencies are drawn, as by :func:`campbell`.
    highest
        Highest frequency drawn, Hz; all where left out.

    Raises
    ------
    ValueError
        There is no such dimension with numbers, or no such sensor or history.
    """
    analysis.require_numbers(dataset, along)
    dataset = analysis.most_loaded(dataset)
    place = {dim: k for dim, k in analysis.finest(dataset).items() if dim != along}
    cut = dataset.isel(place).sortby(along)
    history = _history(cut, sensor).where(cut["status"] == 0)
    found = analysis.spectrum(history).transpose(..., along)
    frequency = found[found.dims[0]].values
    largest, label = in_units(found.max())
    moves = float(found.max()) > _ROUNDING * float(abs(history).max())
    decibels = _decibels(found.values if moves else 0 * found.values)
    figure = new_figure(5.6, 4.2)
    panel: Any = figure.subplots()
    (x, x_label), top = in_units(cut[along]), highest or float(frequency[-1])
    drawn = panel.pcolormesh(
        cell_edges(x), cell_edges(frequency), decibels, cmap="magma_r", vmin=_FAINTEST, vmax=0.0, rasterized=True,
    )  # fmt: skip
    if along == "speed":
        read = None if study is None else _read(study)
        shown = orders if orders is not None else _orders(dataset) if read is None else engine_orders(read)
        _draw_orders(panel, cut[along].values, x, shown, top, COLOURS[2])
        if read is not None:
            _draw_free(panel, read, cut[along].values, top)
    panel.set(xlabel=x_label, ylabel="frequency [Hz]", ylim=(0.0, top))
    panel.spines[["top", "right"]].set_visible(False)
    scale = f"0 is {float(largest):.3g} {label.partition('[')[2][:-1]}" if moves else "nothing vibrates"
    figure.colorbar(drawn, ax=panel, label=f"amplitude [dB], {scale}")
    legend_below(figure, panel.get_legend_handles_labels(), 2)
    window = f"{sensor.replace('_', ' ')}: last {found.attrs['seconds']:.3g} s, Hann window"
    resolution = f"resolution {2 * float(frequency[1]):.3g} Hz"
    head(figure, fill("; ".join(filter(None, [f"{window}, {resolution}", analysis.place_text(dataset, place)])), 60))
    return figure


def _history(cut: xr.Dataset, sensor: str) -> xr.DataArray:
    """Return the history of a sensor or of the contact."""
    sensors = [str(name) for name in np.atleast_1d(cut["sensor"].values)] if "sensor_value" in cut else []
    if sensor in sensors:
        one = cut.sel(sensor=sensor) if "sensor" in cut.dims else cut
        return one["sensor_value"].assign_attrs(units=str(one["sensor_unit"].values)).rename(sensor)
    kept = [str(name) for name, one in cut.data_vars.items() if "t" in one.dims and name != "sensor_value"]
    if sensor not in kept:
        names = ", ".join([*sensors, *kept]) or "none: name sensors and histories under `output` of the study"
        raise ValueError(f"`{sensor}` is neither a sensor nor a history of the dataset; it has {names}")
    return cut[sensor]


def _decibels(amplitude: Array) -> Array:
    """Return 20 log10 of amplitudes over the largest, not below what is drawn."""
    share = amplitude / np.nanmax(amplitude, initial=np.finfo(float).tiny)
    return np.asarray(20 * np.log10(np.maximum(share, 10 ** (_FAINTEST / 20))))


def _orders(dataset: xr.Dataset) -> list[float]:
    """Return the engine orders of the casing's harmonics."""
    orders = np.atleast_1d(dataset["gap"].attrs.get("casing_order", [])) if "gap" in dataset.coords else np.zeros(0)
    return sorted({float(order) for order in orders if np.isfinite(order)})


def _draw_free(panel: Any, study: Study, speed: Array, top: float) -> None:
    """Draw the free frequencies up to some frequency."""
    at = np.linspace(speed[0], speed[-1], _SPEEDS)
    free = free_frequencies(study, at, _MODES)
    lines = panel.plot(analysis.RPM * at, np.where(free <= top, free, np.nan), color=COLOURS[0], lw=0.9)
    lines[0].set_label("free frequency")


def _draw_orders(panel: Any, speed: Any, x: Any, orders: Sequence[float], top: float, colour: str) -> None:
    """Draw the lines f = order · speed, each with its order at its end."""
    if not all(order > 0 for order in orders):
        raise ValueError(f"engine orders are above 0, and one of {', '.join(map(str, orders))} is not")
    for order in orders:
        label = "engine order" if order == orders[0] else None
        panel.plot(x, order * speed, color=colour, lw=1.0, ls="--", label=label)
        reached = order * speed[-1]
        at, up = (x[-1], reached) if reached <= top else (x[-1] * top / reached, top)
        panel.annotate(f"{order:g}×", (at, up), xytext=(0, 3), textcoords="offset points", fontsize=8, ha="right")
