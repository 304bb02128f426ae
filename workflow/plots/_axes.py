"""A metric along every axis of a study."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import effect, finest, labels_of
from workflow.plots._style import COLOURS, GREY, trim

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

MOST_PANELS = 6
"""Axes that a picture of a metric shows, those with the largest effect."""


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
        names = labels_of(archive, dim, named=False, rounded=True)
        panel.set_xticks(at[:: max(1, len(at) // 6)])
        short = [", ".join(part.split()[-1] for part in name.split(", ")) for name in names]
        if dim in archive.coords and archive[dim].dtype.kind == "f":
            short = [f"{value:.4g}" for value in archive[dim].values]
        panel.set_xticklabels(
            short[:: max(1, len(at) // 6)], fontsize=8, rotation=20 if len(max(short, key=len)) > 6 else 0
        )
        panel.set_xlabel(_axis_label(archive, dim))
        trim(panel)
    panels[0].set_ylabel(f"{metric.replace('_', ' ')} [{archive[metric].attrs.get('units', '1')}]")
    if dims:
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    return figure


def _axis_label(archive: xr.Dataset, dim: str) -> str:
    """Return a dimension's name with its unit."""
    unit = archive[dim].attrs.get("units", "1") if dim in archive.coords else "1"
    return dim.replace("_", " ") + ("" if unit == "1" else f" [{unit}]")
