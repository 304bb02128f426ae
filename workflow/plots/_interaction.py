"""Interaction maps: at which frequencies a sensor answers over the speed, and which of them are engine orders."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.analysis import case_dims, finest, most_loaded, place_text, spectrum
from workflow.plots._speed import engine_orders, free_frequencies
from workflow.plots._style import COLOURS, head, new_figure
from workflow.plots._units import RPM, in_units
from workflow.study import Study, StudySource, read_study

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_FAINTEST = -60.0
"""Decibels below which all is drawn alike: a thousandth of the largest amplitude."""

_SPEEDS, _MODES = 13, 12
"""Speeds at which free frequencies are computed, with straight lines between, and the most of them."""


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
        The study of the archive, whose free frequencies are drawn, see :func:`workflow.plots.campbell`.
    highest
        Highest frequency drawn, Hz; all where left out.

    Raises
    ------
    ValueError
        There is no such dimension with numbers, or no such sensor or history.
    """
    if along not in case_dims(dataset) or along not in dataset.coords or dataset[along].dtype.kind not in "if":
        raise ValueError(f"`{along}` is no dimension with numbers; the cases lie along {', '.join(case_dims(dataset))}")
    dataset = most_loaded(dataset)
    place = {dim: k for dim, k in finest(dataset).items() if dim != along}
    cut = dataset.isel(place).sortby(along)
    found = spectrum(_history(cut, sensor).where(cut["status"] == 0)).transpose("frequency", along)
    figure = new_figure(5.6, 4.2)
    panel: Any = figure.subplots()
    (x, x_label), top = in_units(cut[along]), highest or float(found["frequency"][-1])
    drawn = panel.pcolormesh(
        x, found["frequency"].values, _decibels(found.values), cmap="magma_r", vmin=_FAINTEST, vmax=0.0,
        shading="nearest", rasterized=True,
    )  # fmt: skip
    if along == "speed":
        read = None if study is None else read_study(study)
        shown = orders if orders is not None else _orders(dataset) if read is None else engine_orders(read)
        _draw_orders(panel, cut[along].values, x, shown, top)
        if read is not None:
            _draw_free(panel, read, cut[along].values, top)
    panel.set(xlabel=x_label, ylabel="frequency [Hz]", ylim=(0.0, top))
    panel.spines[["top", "right"]].set_visible(False)
    largest, label = in_units(found.max())
    figure.colorbar(drawn, ax=panel, label=f"amplitude [dB], 0 is {float(largest):.3g} {label.partition('[')[2][:-1]}")
    window = f"{sensor.replace('_', ' ')}: last {found.attrs['seconds']:.3g} s, Hann's window"
    resolution = f"resolution {2 * float(found['frequency'][1]):.3g} Hz"
    head(figure, "; ".join(filter(None, [f"{window}, {resolution}", place_text(dataset, place)])))
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


def _decibels(amplitude: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return 20 log10 of amplitudes over the largest, not below what is drawn."""
    share = amplitude / np.nanmax(amplitude, initial=np.finfo(float).tiny)
    return np.asarray(20 * np.log10(np.maximum(share, 10 ** (_FAINTEST / 20))))


def _orders(dataset: xr.Dataset) -> list[float]:
    """Return the engine orders of the casing's harmonics."""
    orders = np.atleast_1d(dataset["gap"].attrs.get("casing_order", [])) if "gap" in dataset.coords else np.zeros(0)
    return sorted({float(order) for order in orders if np.isfinite(order)})


def _draw_free(panel: Any, study: Study, speed: NDArray[np.float64], top: float) -> None:
    """Draw the free frequencies up to some frequency."""
    at = np.linspace(speed[0], speed[-1], _SPEEDS)
    free = free_frequencies(study, at, _MODES)
    panel.plot(RPM * at, np.where(free <= top, free, np.nan), color=COLOURS[0], lw=0.9)


def _draw_orders(panel: Any, speed: Any, x: Any, orders: Sequence[float], top: float) -> None:
    """Draw the lines f = order · speed, each with its order at its end."""
    for order in orders:
        panel.plot(x, order * speed, color="black", lw=0.8, ls="--")
        reached = order * speed[-1]
        at, up = (x[-1], reached) if reached <= top else (x[-1] * top / reached, top)
        panel.annotate(f"{order:g}", (at, up), xytext=(0, 3), textcoords="offset points", fontsize=8, ha="right")
