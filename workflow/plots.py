"""Pictures of an archive with Matplotlib; imported when something is drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import contact_phases, effect, finest, labels_of, shown_dim

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

# Okabe and Ito's palette: told apart by colour-blind readers and in print.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")
GREY = "#8a8a8a"
SHADE = "#0072B2"

MOST_PANELS = 6
"""Axes that a picture of a metric shows, those with the largest effect."""

_LENGTHS = ((1.0, "m", 1.0), (1e-3, "mm", 1e3), (0.0, "µm", 1e6))
"""From which largest displacement on which unit serves, and its factor."""

_PANELS = {
    "displacement": ("tip displacement", "m", 1.0),
    "velocity": ("tip velocity", "m/s", 1.0),
    "temperature": ("tip temperature rise", "K", 1.0),
    "contact_force": ("contact force", "N", 1.0),
    "impulse": ("impulse", "N s", 1.0),
}


@dataclass(frozen=True)
class Curve:
    """One case of an archive and how it is drawn."""

    case: xr.Dataset
    label: str
    colour: str = COLOURS[0]
    style: str = "-"
    width: float = 1.2


def tip_response(curves: list[Curve], title: str = "", phases_of: int | None = None) -> Figure:
    """Draw the histories of some cases below each other: displacement with the gap, heat, force.

    Parameters
    ----------
    curves
        The cases, drawn in order; all from archives with the same histories.
    title
        Above the picture.
    phases_of
        Position of the case whose contact phases are shaded, ``None`` for none.
    """
    from matplotlib.figure import Figure

    first = curves[0].case
    names = [name for name in _PANELS if name in first]
    figure = Figure(figsize=(9.0, 2.3 * len(names) + 0.9), layout="constrained")
    axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    for panel, name in zip(axes, names, strict=True):
        about, unit, scale = _PANELS[name]
        if name == "displacement":
            largest = max(float(np.nanmax(np.abs(curve.case[name].values), initial=0.0)) for curve in curves)
            unit, scale = next((u, factor) for least, u, factor in _LENGTHS if largest >= least)
        if phases_of is not None and "contact_force" in first:
            for begin, end in contact_phases(curves[phases_of].case):
                panel.axvspan(begin, end, color=SHADE, alpha=0.09, lw=0)
        for curve in curves:
            t = np.asarray(curve.case["t"].values)
            values = np.asarray(curve.case[name].values) * scale
            panel.plot(t, values, curve.style, color=curve.colour, lw=curve.width, label=curve.label)
        if name == "displacement":
            for gap in sorted({float(curve.case["gap"]) for curve in curves if "gap" in curve.case.coords}):
                panel.axhline(gap * scale, color="black", lw=0.8, ls=":")
                panel.annotate(
                    f"gap {gap * scale:.4g} {unit}", (1.0, gap * scale), xycoords=("axes fraction", "data"),
                    ha="right", va="bottom", fontsize=8, xytext=(-3, 2), textcoords="offset points",
                )  # fmt: skip
        panel.set_ylabel(f"{about} [{unit}]")
        panel.margins(x=0)
        panel.grid(alpha=0.25, lw=0.5)
        panel.spines[["top", "right"]].set_visible(False)
    low, high = axes[0].get_ylim()
    axes[0].set_ylim(low, high + 0.08 * (high - low))
    axes[-1].set_xlabel("time [s]")
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=min(4, len(labels)), frameon=False, fontsize=9)
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def abstract_figure(archive: xr.Dataset) -> Figure:
    """Draw the extended abstract's figure: full solid, reduced dashed, without contact heat grey.

    Parameters
    ----------
    archive
        Of ``studies/abstract_figure.yaml``: dimensions ``alpha`` (0 first) and ``model`` (full first).
    """
    cold, hot = archive.isel(alpha=0), archive.isel(alpha=-1)
    modes = f"{int(hot['mechanical_modes'][-1])} + {int(hot['thermal_modes'][-1])} modes"
    return tip_response(
        [
            Curve(cold.isel(model=0), "α = 0, full", GREY, "-", 1.0),
            Curve(hot.isel(model=0), f"α = {float(hot['alpha']):g} m/s, full", COLOURS[5], "-", 2.6),
            Curve(hot.isel(model=-1), f"α = {float(hot['alpha']):g} m/s, {modes}", COLOURS[1], "--", 1.1),
        ],
        phases_of=1,
    )


def overview(archive: xr.Dataset) -> Figure:
    """Draw the finest case of any archive, beside the others along one dimension."""
    place = finest(archive)
    dim = shown_dim(archive)
    if dim is None:
        curves = [Curve(archive.isel(place), "the case shown")]
    else:
        labels = labels_of(archive, dim)
        curves = [
            Curve(archive.isel({**place, dim: k}), labels[k], COLOURS[k % len(COLOURS)])
            for k in range(archive.sizes[dim])
        ]
    rest = [labels_of(archive, name)[k] for name, k in place.items() if name != dim]
    return tip_response(curves, title="; ".join(rest), phases_of=len(curves) - 1)


def metric_by_axis(archive: xr.Dataset, metric: str) -> Figure:
    """Draw a metric along every dimension through the finest case, the range of all cases behind it."""
    from matplotlib.figure import Figure

    place = finest(archive)
    varied = [dim for dim in place if archive.sizes[dim] > 1]
    strongest = sorted(varied, key=lambda dim: -np.nan_to_num(effect(archive, metric, dim)))[:MOST_PANELS]
    dims = [dim for dim in varied if dim in strongest]
    figure = Figure(figsize=(min(3.0 * len(dims) + 0.6, 12.0), 3.1), layout="constrained")
    panels: Any = np.atleast_1d(figure.subplots(1, max(len(dims), 1), sharey=True))
    values = archive[metric].where(archive["status"] == 0)
    for panel, dim in zip(panels, dims, strict=True):
        others = [name for name in place if name != dim]
        at = np.arange(archive.sizes[dim])
        low, high = values.min(others).values, values.max(others).values
        panel.fill_between(at, low, high, color=GREY, alpha=0.2, lw=0, label="all cases")
        line = values.isel({name: place[name] for name in others}).values
        panel.plot(at, line, "o-", color=COLOURS[0], ms=4, lw=1.2, label="through the case shown")
        names = labels_of(archive, dim, named=False)
        panel.set_xticks(at[:: max(1, len(at) // 6)])
        short = [", ".join(part.split()[-1] for part in name.split(", ")) for name in names]
        if dim in archive.coords and archive[dim].dtype.kind == "f":
            short = [f"{value:.4g}" for value in archive[dim].values]
        panel.set_xticklabels(
            short[:: max(1, len(at) // 6)], fontsize=8, rotation=20 if len(max(short, key=len)) > 6 else 0
        )
        panel.set_xlabel(_axis_label(archive, dim))
        panel.spines[["top", "right"]].set_visible(False)
        panel.grid(alpha=0.25, lw=0.5)
    panels[0].set_ylabel(f"{metric.replace('_', ' ')} [{archive[metric].attrs.get('units', '1')}]")
    if dims:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return figure


def _axis_label(archive: xr.Dataset, dim: str) -> str:
    """Return a dimension's name with its unit."""
    unit = archive[dim].attrs.get("units", "1") if dim in archive.coords else "1"
    return dim.replace("_", " ") + ("" if unit == "1" else f" [{unit}]")


def save(figure: Figure, path: Path) -> Path:
    """Write a figure as PNG and return its path."""
    figure.savefig(path, dpi=150)
    return path
