"""Where a coating is worn: its depth over the angle of the casing, revolution by revolution."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import contact_text, most_loaded
from workflow.plots._contacts import shown_case
from workflow.plots._style import COLOURS, head, new_figure, trim
from workflow.plots._units import scaled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure


def wear_map(dataset: xr.Dataset) -> Figure:
    """Draw the worn depth of a coating: the angle of the casing across, its revolutions up; white is not worn.

    Without ``output.wear`` it is the depth at the end over the angle. Of several contacts the most loaded one is shown.

    Parameters
    ----------
    dataset
        One case of an archive with a coating; of an archive that case is shown which
        :func:`~workflow.plots.histories` shows.

    Raises
    ------
    ValueError
        The casing has no coating, or no case is ok.
    """
    if "worn_depth" not in dataset:
        raise ValueError("the casing has no coating; write `scene.casing.coating` in the study")
    (case, rest), figure = shown_case(most_loaded(dataset)), new_figure(7.0, 3.6)
    edges = np.linspace(0.0, 360.0, int(np.isfinite(case["sector_angle"].values).sum()) + 1)
    panel: Any = figure.subplots()
    unit, factor = scaled("m", case["worn_depth"].values)
    label = f"worn depth [{unit}]"
    if "wear_map" in case:
        rows = factor * case["wear_map"].transpose("revolution", "sector").values[:, : edges.size - 1]
        ended = np.isfinite(rows).all(axis=1)
        revolutions = np.append(0, case["revolution"].values[ended])
        worn = np.where(rows[ended] > 0, rows[ended], np.nan)
        most = np.nanmax(rows[ended], initial=0.0) or 1.0
        drawn = panel.pcolormesh(edges, revolutions, worn, cmap="cividis_r", vmin=0.0, vmax=most, rasterized=True)
        figure.colorbar(drawn, ax=panel, label=label, pad=0.02)
        panel.set(ylabel="revolution", ylim=(0, revolutions[-1]))
        panel.spines[["top", "right"]].set_visible(False)
    else:
        panel.stairs(factor * case["worn_depth"].values[: edges.size - 1], edges, color=COLOURS[0])
        panel.set(ylabel=label, ylim=(0, None))
        trim(panel)
    panel.set(xlabel="angle of the casing [°]", xlim=(0, 360), xticks=range(0, 361, 45))
    head(figure, "; ".join(filter(None, (contact_text(dataset), rest))))
    return figure
