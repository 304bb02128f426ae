"""Branches of steady rubs along the axis that is followed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis import case_dims, followed_axis, labels, labels_of
from workflow.plots._style import COLOURS, new_figure, trim
from workflow.plots._units import in_units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

MARKS = {"fold": "o", "period_doubling": "s", "torus": "D", "grazing": "x"}
"""Of bifurcations."""


def branches(dataset: xr.Dataset, variable: str = "steady_max_temperature") -> Figure:
    """Draw a variable along all branches of an archive: stable rubs solid, unstable ones dashed, bifurcations marked.

    Raises
    ------
    ValueError
        The archive has no branches, or no such variable along them.
    """
    along = followed_axis(dataset)
    if along is None or variable not in dataset or dataset[variable].dims != dataset[along].dims:
        raise ValueError(f"there are no branches of `{variable}`; write an axis as `{{branch: [from, to, points]}}`")
    (x, x_label), (y, y_label) = (in_units(dataset[name]) for name in (along, variable))
    stable, flags = labels(dataset["steady_state"]).values != "unstable", labels(dataset["bifurcation"]).values
    dims = [dim for dim in case_dims(dataset) if dataset.sizes[dim] > 1]
    texts = {dim: labels_of(dataset, dim, rounded=True) for dim in dims}
    figure = new_figure(7.0, 4.2)
    panel = figure.subplots()
    for k, place in enumerate(np.ndindex(dataset["status"].shape)):
        where = dict(zip(case_dims(dataset), place, strict=True))
        colour, label = COLOURS[k % len(COLOURS)], ", ".join(texts[dim][where[dim]] for dim in dims)
        panel.plot(x[place], y[place], "--", color=colour, lw=1.2)
        panel.plot(x[place], np.where(stable[place], y[place], np.nan), color=colour, lw=1.8, label=label)
    for name, mark in MARKS.items():
        at = (flags == name) & np.isfinite(x)
        if at.any():
            panel.plot(x[at], y[at], mark, color="black", mfc="white", ms=6, label=name.replace("_", " "), zorder=3)
    panel.set(xlabel=x_label, ylabel=y_label)
    if panel.get_legend_handles_labels()[1]:
        panel.legend(fontsize=8, frameon=False)
    trim(panel)
    return figure
