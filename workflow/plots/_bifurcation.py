"""A bifurcation diagram: the tip at the starts of load periods along an axis."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis import case_dims, finest
from workflow.plots._style import COLOURS, trim
from workflow.plots._units import scaled

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
    from matplotlib.figure import Figure

    if along not in case_dims(dataset) or along not in dataset.coords or dataset[along].dtype.kind not in "if":
        raise ValueError(f"`{along}` is no dimension with numbers; they lie along {', '.join(case_dims(dataset))}")
    if variable not in dataset or "period" not in dataset[variable].dims:
        raise ValueError(f"`{variable}` is not given per load period; write `output: {{sections: true}}` in the study")
    place = {dim: k for dim, k in finest(dataset).items() if dim != along}
    cut = dataset.isel(place).where(dataset["status"].isel(place) == 0).transpose(along, "period", ...)
    values = np.asarray(cut[variable].values, dtype=float)
    complete = np.isfinite(values).sum(axis=1, keepdims=True)
    values = np.where(np.arange(values.shape[1]) >= complete // 2, values, np.nan)
    figure = Figure(figsize=(7.0, 4.2), layout="constrained")
    panel = figure.subplots()
    (x_unit, x_factor), (unit, factor) = (
        scaled(str(dataset[name].attrs.get("units", "1")), numbers)
        for name, numbers in ((along, dataset[along].values), (variable, values))
    )
    x = np.broadcast_to(dataset[along].values[:, None] * x_factor, values.shape)
    panel.plot(x.ravel(), values.ravel() * factor, ".", color=COLOURS[0], ms=2)
    for name, there, label in ((along, x_unit, panel.set_xlabel), (variable, unit, panel.set_ylabel)):
        label(name.replace("_", " ") + (f" [{there}]" if there else ""))
    trim(panel)
    return figure
