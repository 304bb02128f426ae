"""First-order and total Sobol' indices of metrics."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import drawn_dim, finest, sobol
from workflow.plots._style import COLOURS, legend_below, new_figure, trim

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def sobol_indices(dataset: xr.Dataset, *metrics: str) -> Figure:
    """Draw the Sobol' indices of metrics with their intervals: what each number does alone, and with the others.

    Of all other dimensions the smallest step, the most modes and the first value are shown: select what else is shown
    before.

    Parameters
    ----------
    dataset
        An archive of a study that draws ``sample: sobol_indices``, or a selection of its cases.
    metrics
        One number for each case; ``contact_impulse`` and ``max_temperature`` where none is named.

    Raises
    ------
    ValueError
        Nothing is drawn for Sobol' indices, or there is no such metric.
    """
    metrics = metrics or ("contact_impulse", "max_temperature")
    place = {dim: k for dim, k in finest(dataset).items() if dim != drawn_dim(dataset)}
    indices = {metric: sobol(dataset.isel(place), metric) for metric in metrics}
    figure = new_figure(3.4 * len(metrics) + 0.6, 3.6)
    panels: Any = np.atleast_1d(figure.subplots(1, len(metrics), sharey=True))
    for panel, (metric, index) in zip(panels, indices.items(), strict=True):
        at = np.arange(index.sizes["number"])
        for k, name in enumerate(("first", "total")):
            low, high = index[f"{name}_interval"].values.T
            values, x = index[name].values, at + 0.24 * (k - 0.5)
            panel.vlines(x, low, high, color=COLOURS[k], lw=1.4)
            label = ("first-order index: the number alone", "total index: with the others")[k]
            panel.plot(x, values, ("o", "s")[k], color=COLOURS[k], ms=5, label=label)
        panel.axhline(0, color="black", lw=0.8)
        names = [str(name).replace("_", " ") for name in index["number"].values]
        turned = sum(map(len, names)) > 30
        panel.set_xticks(at, names, fontsize=9, rotation=30 if turned else 0, ha="right" if turned else "center")
        panel.set_xlim(-0.5, len(at) - 0.5)
        panel.set_title(metric.replace("_", " "), fontsize=10)
        trim(panel, "y")
    panels[0].set_ylabel("share of the variance")
    legend_below(figure, panels[0].get_legend_handles_labels(), 2)
    return figure
