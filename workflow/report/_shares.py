"""Section of a report on drawn numbers: their Sobol' indices."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflow.analysis import drawn_dim, effect, finest, place_text
from workflow.plots import sobol_indices
from workflow.report._html import image, note, tag
from workflow.report._sections import METRICS, Section

if TYPE_CHECKING:
    import xarray as xr

_SHARES = (
    "Sobol' indices: the share of a metric's variance that a number makes alone (first order), and alone and together "
    "with the others (total); lines are 95 % intervals of 999 resamples of the points. No index where the metric is "
    "the same in all cases, or a case that it needs is not ok."
)


def shares(dataset: xr.Dataset) -> Section:
    """Draw the Sobol' indices of metrics that the drawn numbers change; nothing where an archive has no matrices."""
    design = drawn_dim(dataset)
    if design is None:
        return Section([], None)
    changing = [name for name in METRICS if name in dataset and effect(dataset, name, design) > 0]
    where = place_text(dataset, {dim: k for dim, k in finest(dataset).items() if dim != design})
    figure = sobol_indices(dataset, *changing) if changing else None
    picture = [] if figure is None else [image(figure, "Sobol' indices of the drawn numbers")]
    about = note(f"{_SHARES} {where}".strip())
    return Section([tag("h2", "What the drawn numbers do"), about, *picture], figure)
