"""A bifurcation diagram: the tip at the starts of load periods along an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis import case_dims, finest
from workflow.plots._style import COLOURS, new_figure, trim
from workflow.plots._units import in_units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def bifurcation(dataset: xr.Dataset, along: str, variable: str = "section_displacement") -> Figure:
    """Draw a value of each load period along an axis, in the later half of the periods: one point where a rub settles.

    Of all other dimensions the smallest step, the most modes and the largest α are shown: select what else is shown
    before.

    Parameters
    ----------
    dataset
        An archive with ``output: {sections: true}``, or a selection of its cases.
    along
        Dimension across the picture, with numbers.
    variable
        What is drawn of each load period.

    Raises
    ------
    ValueError
        There is no such dimension with numbers, or no such variable of load periods.
    """
    if along not in case_dims(dataset) or along not in dataset.coords or dataset[along].dtype.kind not in "if":
        raise ValueError(f"`{along}` is no dimension with numbers; they lie along {', '.join(case_dims(dataset))}")
    if variable not in dataset or "period" not in dataset[variable].dims:
        raise ValueError(f"`{variable}` is not given per load period; write `output: {{sections: true}}` in the study")
    place = {dim: k for dim, k in finest(dataset).items() if dim != along}
    cut = dataset.isel(place).where(dataset["status"].isel(place) == 0).transpose(along, "period", ...)
    values = np.asarray(cut[variable].values, dtype=float)
    complete = np.isfinite(values).sum(axis=1, keepdims=True)
    values = np.where(np.arange(values.shape[1]) >= complete // 2, values, np.nan)
    figure = new_figure(7.0, 4.2)
    panel = figure.subplots()
    (x, x_label), (y, y_label) = in_units(dataset[along]), in_units(cut[variable].copy(data=values))
    panel.plot(np.repeat(x, values.shape[1]), y.ravel(), ".", color=COLOURS[0], ms=2)
    panel.set(xlabel=x_label, ylabel=y_label)
    trim(panel)
    return figure
