"""Branches of steady rubs on an interactive page: a click on a point shows its orbit."""

from __future__ import annotations

from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import case_dims, followed_axis, labels, labels_of
from workflow.plots._style import COLOURS
from workflow.plots._units import in_units, scaled
from workflow.report._bokeh_figures import SELECTED, orbit_panels, panel_of, source_of
from workflow.report._page_cases import ORBIT

if TYPE_CHECKING:
    import xarray as xr

_MOST_SAMPLES = 300_000
"""Samples of all orbits of a page: in 4 MB."""


def branch_explorer(dataset: xr.Dataset, variable: str) -> dict[str, Any]:
    """Return what Bokeh's script draws of the branches of an archive, by name of its place."""
    from bokeh.embed import json_item
    from bokeh.models import HoverTool, TapTool

    along = followed_axis(dataset)
    assert along is not None
    (x, x_label), (y, y_label) = (in_units(dataset[name]) for name in (along, variable))
    states, flags = labels(dataset["steady_state"]).values, labels(dataset["bifurcation"]).values
    unit, factor = scaled("m", dataset[ORBIT[0]].values)
    thinning = -(-dataset[ORBIT[0]].size // _MOST_SAMPLES)
    orbits = [dataset[name].values[..., ::thinning].astype(np.float32) for name in ORBIT]
    varied = [dim for dim in case_dims(dataset) if dataset.sizes[dim] > 1]
    texts = product(*(labels_of(dataset, dim, rounded=True) for dim in varied))
    branch_texts = [f"{', '.join(each)}: " if each else "" for each in texts]
    found, branch = np.isfinite(x), np.arange(dataset["status"].size).reshape(*dataset["status"].shape, 1)
    colours = np.broadcast_to(np.array(COLOURS)[branch % len(COLOURS)], x.shape)
    words = states + np.where(flags == "none", "", ", " + flags)
    panel, points = panel_of("branches", 420), source_of("branch_points")
    for one in np.ndindex(dataset["status"].shape):
        panel.line(x[one][found[one]], y[one][found[one]], line_color=colours[one][0], line_width=1.2)
    columns = {"x": x, "y": y, "colour": colours, "fill": np.where(states == "unstable", "white", colours)}
    columns |= {"text": np.array(branch_texts, dtype=object)[branch] + words}
    points.data = {name: list(each[found]) for name, each in (columns | dict(zip(ORBIT, orbits, strict=True))).items()}
    dots = panel.scatter(
        "x", "y", size=7, line_color="colour", fill_color="fill", source=points,
        nonselection_fill_alpha=1, nonselection_line_alpha=1,
    )  # fmt: skip
    here = source_of("branch_here", "x", "y")
    panel.scatter("x", "y", size=15, fill_color=None, line_color=SELECTED, line_width=2.5, source=here)
    panel.add_tools(HoverTool(renderers=[dots], tooltips=[("", "@text")]), TapTool(renderers=[dots]))
    panel.xaxis.axis_label, panel.yaxis.axis_label = x_label, y_label
    return {"branches": json_item(panel), "orbit": json_item(orbit_panels(unit)), "factor": factor}
