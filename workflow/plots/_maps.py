"""Maps of a scene over two of its axes: how the impulse grows, who stays pressed, how often and how hot."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.analysis import case_dims, impulse_growth, most_loaded, place_text, require_numbers, unit_of
from workflow.plots._style import COLOURS, cell_edges, new_figure
from workflow.plots._units import in_units

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

LEAST_VALUES = 4
"""Values of an axis from which on a map along it says more than a table."""

MARGIN = 30.0
"""Largest over least positive value from which on colours are logarithmic."""

_EDGE = 1e-3
"""Share of the range of a map next to its ends in which no contour is drawn."""


class Panel(NamedTuple):
    """A map: its title, with the unit, the values ``(up, across)``, NaN where the tip never touches, and contours."""

    title: str
    values: NDArray[np.float64]
    has_contours: bool = True


def map_dims(archive: xr.Dataset) -> tuple[str, str] | None:
    """Return the dimensions across and up of the maps of an archive, ``None`` where they would say little.

    They are the two longest numerical axes of the scene; α lies across.
    """
    numbers = [dim for dim in case_dims(archive) if dim in archive.coords and archive[dim].dtype.kind == "f"]
    long = [dim for dim in numbers if dim != "h" and archive.sizes[dim] >= LEAST_VALUES]
    first = sorted(long, key=lambda dim: (-archive.sizes[dim], dim))[:2]
    if len(first) < 2 or "period_impulse" not in archive:
        return None
    across, up = sorted(first, key=lambda dim: dim != "alpha")
    return across, up


def middle(archive: xr.Dataset, dims: tuple[str, str]) -> dict[str, int]:
    """Return the middle place along all other dimensions of the cases."""
    return {dim: archive.sizes[dim] // 2 for dim in case_dims(archive) if dim not in dims}


def scene_map(dataset: xr.Dataset, across: str, up: str, variable: str | None = None) -> Figure:
    """Draw maps of a scene over two of its axes, in the middle of all others: select what else is shown before.

    Four maps where ``variable`` is left out: impulse of the last load period over that of the first, share of the last
    period in contact, impacts, largest temperature rise. Grey is no contact, or a case that is not ok; dashed the
    critical coupling, above which a tip in permanent contact runs away. Of several contacts the most loaded one
    is shown.

    Parameters
    ----------
    dataset
        An archive, or a selection of its cases.
    across, up
        Two of its dimensions, numbers both.
    variable
        The one metric that is drawn, such as ``contact_impulse``; grey is then a case that is not ok.

    Raises
    ------
    ValueError
        A dimension has no numbers, or there is no such metric.
    """
    dims, dataset = (across, up), most_loaded(dataset)
    for dim in dims:
        require_numbers(dataset, dim)
    if variable is None and "period_impulse" not in dataset:
        raise ValueError("the dataset has no load periods; name the `variable` to draw, such as contact_impulse")
    if variable is not None and (variable not in dataset or dataset[variable].dims != dataset["status"].dims):
        raise ValueError(f"`{variable}` is no metric of the dataset, one number for each case")
    place = middle(dataset, dims)
    cut = _cut(dataset, dims, place)
    figure = _drawn(cut, dims, _panels(cut), 2) if variable is None else _drawn(cut, dims, [_metric(cut, variable)])
    figure.suptitle(place_text(dataset, place), fontsize=10)
    return figure


def _drawn(cut: xr.Dataset, dims: tuple[str, str], panels: Sequence[Panel], side: int = 1) -> Figure:
    """Return a figure of maps, so many below and beside each other."""
    figure = new_figure(5.25 * side, 4.0 * side)
    grid = np.ravel(figure.subplots(side, side, sharex=True, sharey=True))
    for axes in grid[len(panels) :]:
        axes.remove()
    for axes, panel in zip(grid, panels, strict=False):
        _draw(axes, cut, dims, panel)
        if len(panels) == grid.size:
            axes.label_outer()
    return figure


def _metric(cut: xr.Dataset, variable: str) -> Panel:
    """Return the map of a metric, NaN where a case is not ok."""
    unit = unit_of(cut[variable])
    title = str(cut[variable].attrs.get("long_name", variable.replace("_", " "))) + (f" [{unit}]" if unit else "")
    return Panel(title, np.where(cut["status"].values == 0, cut[variable].values, np.nan))


def single_maps(archive: xr.Dataset, dims: tuple[str, str], place: Mapping[str, int]) -> list[Figure]:
    """Draw the maps of :func:`scene_map` as a figure each, to stand below each other where a page is narrow."""
    cut = _cut(most_loaded(archive), dims, place)
    return [_drawn(cut, dims, [panel]) for panel in _panels(cut)]


def _cut(archive: xr.Dataset, dims: tuple[str, str], place: Mapping[str, int]) -> xr.Dataset:
    """Return the cases of a map, ``(up, across)``."""
    across, up = dims
    return archive.isel(dict(place)).transpose(up, across, ...)


def _draw(axes: Any, cut: xr.Dataset, dims: tuple[str, str], panel: Panel) -> None:
    """Draw one map with its colours, its critical coupling and the names of its axes."""
    from matplotlib import colormaps

    (x, x_label), (y, y_label) = (in_units(cut[dim]) for dim in dims)
    norm, levels = _norm(panel.values)
    values = np.clip(panel.values, norm.vmin, None)
    mesh = axes.pcolormesh(cell_edges(x), cell_edges(y), values, cmap=colormaps["cividis"], norm=norm)
    if panel.has_contours and len(levels) and min(values.shape) > 1:
        lines = axes.contour(x, y, values, levels=levels, colors="white", linewidths=0.8)
        axes.clabel(lines, fmt="%g", fontsize=8)
    for critical in _critical(cut) if dims[0] == "alpha" else ():
        axes.axvline(critical, color=COLOURS[1], ls="--", lw=1.4)
    axes.figure.colorbar(mesh, ax=axes)
    axes.set(xlabel=x_label, ylabel=y_label, facecolor="#dddddd")
    axes.set_title(panel.title, fontsize=10)


def _panels(cut: xr.Dataset) -> list[Panel]:
    """Return the maps of a cut ``(up, across)`` that are not 0, four at most, NaN where a tip never touches."""
    ok = np.asarray(cut["status"].values) == 0
    touches = ok & (np.asarray(cut["contact_impulse"].values) > 0)

    def shown(values: Any) -> NDArray[np.float64]:
        return np.where(touches, np.asarray(values, dtype=np.float64), np.nan)

    periods = np.isfinite(cut["period_impulse"].values).sum(axis=-1)
    last = np.take_along_axis(cut["period_contact"].values, np.maximum(periods - 1, 0)[..., None], axis=-1)[..., 0]
    growth = impulse_growth(cut)
    panels = [
        Panel("growth of the impulse: last load period over the first", shown(np.nan if growth is None else growth)),
        Panel("share of the last load period in contact; 1: has run away", shown(last)),
        Panel("impacts", shown(cut["impacts"].values), has_contours=False),
        Panel("largest temperature rise of the tip [K]", shown(cut["max_temperature"].values)),
    ]
    return [panel for panel in panels if (panel.values > 0).any()]


def _critical(cut: xr.Dataset) -> NDArray[np.float64]:
    """Return the critical couplings of a cut that lie within its α."""
    couplings, alpha = np.unique(np.round(cut["critical_alpha"].values, 12)), cut["alpha"].values
    return np.asarray(couplings[(couplings >= alpha.min()) & (couplings <= alpha.max())])


def _norm(values: NDArray[np.float64]) -> tuple[Any, NDArray[np.float64]]:
    """Return how values become colours, logarithmic over three decades where they span much, and levels between."""
    from matplotlib.colors import LogNorm, Normalize
    from matplotlib.ticker import LogLocator, MaxNLocator

    some = values[np.isfinite(values)]
    positive = some[some > 0]
    if not positive.size or positive.max() <= MARGIN * positive.min():
        norm: Any = Normalize(*((some.min(), some.max()) if some.size else (0.0, 1.0)))
        levels = MaxNLocator(6).tick_values(norm.vmin, norm.vmax)
    else:
        norm = LogNorm(max(float(positive.min()), 1e-3 * float(positive.max())), float(positive.max()))
        levels = LogLocator(subs=(1.0, 2.0, 5.0)).tick_values(norm.vmin, norm.vmax)
    edge = _EDGE * (norm.vmax - norm.vmin)
    return norm, levels[(levels > norm.vmin + edge) & (levels < norm.vmax - edge)]
