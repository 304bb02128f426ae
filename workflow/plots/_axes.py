"""A metric along every axis of a study."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import effect, finest, unit_of
from workflow.plots._style import COLOURS, GREY, legend_below, new_figure, trim
from workflow.plots._units import axis_of
from workflow.study import POINT

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

MOST_PANELS = 6
"""Axes that a picture of a metric shows, those with the largest effect."""

_LETTER = 0.075
"""Width of a letter of a tick label, inches: 0.62 of its 8 points, and some room."""

_FREE = 0.8
"""Share of a panel's width that ticks span."""


def metric_by_axis(archive: xr.Dataset, metric: str) -> Figure:
    """Draw a metric along every dimension through the finest case, the range of all cases behind it."""
    place = finest(archive)
    varied = [dim for dim in place if archive.sizes[dim] > 1]
    strongest = sorted(varied, key=lambda dim: -np.nan_to_num(effect(archive, metric, dim)))[:MOST_PANELS]
    axes = {dim: axis_of(archive, dim) for dim in varied if dim in strongest}
    width = min(3.0, 11.4 / max(len(axes), 1))
    upright = {dim: len(axis["texts"]) * _room(axis["texts"]) > _FREE * width for dim, axis in axes.items()}
    height = 2.9 + max((_room(axis["texts"]) for dim, axis in axes.items() if upright[dim]), default=0.0)
    figure = new_figure(max(width * len(axes), 3.0) + 0.6, height)
    panels: Any = np.atleast_1d(figure.subplots(1, max(len(axes), 1), sharey=True))
    values = archive[metric].where(archive["status"] == 0)
    for panel, (dim, axis) in zip(panels, axes.items(), strict=True):
        others = [name for name in place if name != dim]
        at = np.arange(archive.sizes[dim])
        low, high = values.min(others).values, values.max(others).values
        panel.fill_between(at, low, high, color=GREY, alpha=0.2, lw=0, label="all ok cases")
        line = values.isel({name: place[name] for name in others}).values
        form = "o" if POINT in archive.coords and archive[POINT].dims == (dim,) else "o-"  # what is drawn has no order
        panel.plot(at, line, form, color=COLOURS[0], ms=4, lw=1.2, label="one axis varied, the others fixed")
        every = int(np.ceil(len(at) * _room([""] if upright[dim] else axis["texts"]) / (_FREE * width)))
        panel.set_xticks(at[::every], axis["texts"][::every], fontsize=8, rotation=90 if upright[dim] else 0)
        title = axis["title"] + (f" [{axis['unit']}]" if axis["unit"] else "")
        panel.set_xlabel(fill(title, int(width / _LETTER)), fontsize=9)
        trim(panel)
    panels[0].set_ylabel(f"{metric.replace('_', ' ')} [{unit_of(archive[metric]) or 1}]")
    legend_below(figure, panels[0].get_legend_handles_labels(), 2)
    return figure


def _room(texts: Sequence[str]) -> float:
    """Return what the longest of some tick labels takes beside the others, inches."""
    return _LETTER * (2 + max(map(len, texts)))
