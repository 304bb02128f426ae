"""Error against processor time and against the step, one line per scheme."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import ERRORS, SENSELESS, Line, contact_text, lines, most_loaded
from workflow.plots._style import COLOURS, GREY, head, label_lowest, legend_below, look, new_figure, trim

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_FLOOR, _CEILING = 1e-12, SENSELESS
"""Errors outside are not drawn: rounding below, nothing right above."""


def work_precision(dataset: xr.Dataset, beside: xr.Dataset | None = None) -> Figure:
    """Draw relative errors against processor seconds per simulated second, a line per scheme with a marker per step.

    Of all other dimensions the most modes, the largest α and the first of the rest are shown. Crosses on the upper edge
    are steps at which a scheme is not ok or errs by more than three times the solution, at what they cost; the exact
    scheme is the line of its cost.

    Parameters
    ----------
    dataset
        An archive whose study has a ``reference`` and several steps ``h``, or a selection of its cases.
    beside
        The same schemes in a reduced model, drawn thin and dashed.

    Raises
    ------
    ValueError
        A dataset has no errors or one step only.
    """
    drawn = lines(dataset)
    stepping = [line for line in drawn if not line.exact]
    reduced = {} if beside is None else {line.scheme: line for line in lines(beside)}
    figure = new_figure(12.0, 5.2)
    panels: Any = figure.subplots(1, len(ERRORS), sharex=True, sharey=True)
    for panel, (name, about) in zip(panels, ERRORS.items(), strict=True):
        for k, line in enumerate(stepping):
            panel.plot(*_shown(line.seconds, line.errors[name]), **look(k), ms=5, lw=1.4, label=line.scheme)
            _cross_out(panel, line.seconds[line.lost], k)
            if line.scheme in reduced:
                other = reduced[line.scheme]
                panel.plot(*_shown(other.seconds, other.errors[name]), "--", **look(k), ms=2.5, lw=0.9)
        for line in drawn:
            if line.exact:
                cost = float(np.median(line.seconds))
                panel.axvline(cost, color="black", lw=1.2, ls=":", label=f"{line.scheme}: exact, at this cost")
        panel.set(xscale="log", yscale="log", title=about, xlabel="processor seconds per simulated second")
        trim(panel)
    first = panels[0]
    first.set_ylabel("relative L2 error")
    low, high = first.get_ylim()
    first.set_ylim(max(low, _FLOOR), max(high, 1.0))
    first.set_xlim(first.get_xlim()[0] / 5)  # room for the names of the steps
    _leave_room(first, stepping)
    for panel in panels:
        _tick_decades(panel)
    _name_steps(first, stepping)
    _name_below(figure, first, first.get_legend_handles_labels(), stepping, bool(reduced))
    return figure


def convergence(dataset: xr.Dataset) -> Figure:
    """Draw errors, largest penetration and energy residual against the step h, a line per scheme, and slopes 1 and 2.

    Of the other dimensions and of crosses as :func:`work_precision`; observed orders and their scatter
    (:func:`workflow.analysis.observed_order`) stand in the legend.

    Parameters
    ----------
    dataset
        An archive whose study has a ``reference`` and several steps ``h``, or a selection of its cases.

    Raises
    ------
    ValueError
        The dataset has no errors or one step only.
    """
    stepping = [line for line in lines(dataset) if not line.exact]
    others = {"largest penetration [m]": [line.penetration for line in stepping]}
    if any(np.isfinite(line.residual).any() for line in stepping):
        others["|energy residual| / largest energy"] = [np.abs(line.residual) for line in stepping]
    used = len(ERRORS) + len(others)
    columns = 3 if used > 4 else 2
    figure = new_figure(4.1 * columns, 7.6)
    panels = np.ravel(figure.subplots(2, columns, sharex=True))
    for panel, (name, about) in zip(panels, ERRORS.items(), strict=False):
        for k, line in enumerate(stepping):
            order, scatter = line.orders[name]
            label = None if np.isnan(order) else f"order {order:z.2f}, scatter {scatter:.2f}"
            _draw_over_steps(panel, line, _shown(line.h, line.sane(line.errors[name])), k, label)
        panel.set(xscale="log", yscale="log")
        _slopes(panel, stepping, name)
        panel.set_title(f"{about}: relative L2 error", fontsize=10)
        if panel.get_legend_handles_labels()[0]:
            panel.legend(frameon=False, fontsize=7.5, loc="lower right")
    for panel, (about, values) in zip(panels[len(ERRORS) :], others.items(), strict=False):
        for k, line in enumerate(stepping):
            sane = line.sane(values[k])
            _draw_over_steps(panel, line, (line.h[sane > 0], sane[sane > 0]), k)
        panel.set(xscale="log", yscale="log")
        panel.set_title(about, fontsize=10)
    for panel in panels[:used]:
        _leave_room(panel, stepping)
        _tick_decades(panel)
        trim(panel)
    label_lowest(panels, used, columns, "step h [s]")
    head(figure, contact_text(most_loaded(dataset)))
    handles = [panels[0].plot([], [], **look(k))[0] for k in range(len(stepping))]
    _name_below(figure, panels[0], (handles, [line.scheme for line in stepping]), stepping)
    return figure


def _draw_over_steps(panel: Any, line: Line, points: tuple[Any, Any], k: int, label: str | None = None) -> None:
    """Draw some points of a line, and crosses at the steps that are lost."""
    panel.plot(*points, **look(k), ms=4.5, lw=1.3, label=label)
    _cross_out(panel, line.h[line.lost], k)


def _name_below(
    figure: Figure, panel: Any, named: tuple[list[Any], list[str]], stepping: Sequence[Line], reduced: bool = False
) -> None:
    """Name the lines below the panels, and what dashes and crosses are."""
    handles, labels = named
    if reduced:
        handles += panel.plot([], [], "--", color=GREY, lw=0.9)
        labels += ["reduced model (dashed)"]
    if any(line.lost.any() for line in stepping):
        handles += panel.plot([], [], "x", color=GREY)
        labels += ["beyond its stable step"]
    legend_below(figure, named, 4)


def _tick_decades(panel: Any) -> None:
    """Write powers of ten along logarithmic axes, along one of fewer than two decades what lies between too."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    for axis in (panel.xaxis, panel.yaxis):
        axis.set_minor_locator(NullLocator())
        low, high = axis.get_view_interval()
        if high < 100 * low:
            axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _shown(x: Any, y: Any) -> tuple[Any, Any]:
    """Return the points that a log axis can show."""
    with np.errstate(invalid="ignore"):
        good = np.isfinite(y) & (y > _FLOOR) & (y < _CEILING)
    return x[good], y[good]


def _cross_out(panel: Any, x: Any, row: int) -> None:
    """Put crosses along the upper edge, a row for each scheme."""
    if x.size:
        y = np.full(x.size, 0.985 - 0.025 * row)
        panel.plot(x, y, "x", color=COLOURS[row % len(COLOURS)], ms=6, transform=panel.get_xaxis_transform())


def _leave_room(panel: Any, stepping: Sequence[Line]) -> None:
    """Raise the upper edge so that crosses lie above what is drawn."""
    low, high = panel.get_ylim()
    if low <= 0:  # nothing is drawn
        panel.set_ylim(_FLOOR, 1.0)
    elif any(line.lost.any() for line in stepping):
        panel.set_ylim(low, high * (high / low) ** (0.03 * len(stepping)))


def _name_steps(panel: Any, stepping: Sequence[Line]) -> None:
    """Write h beside the markers at whole decades of the first line."""
    for line in stepping[:1]:
        for h, x, y in zip(line.h, line.seconds, line.errors["impulse_error"], strict=True):
            if abs(np.log10(h) - round(np.log10(h))) < 1e-6 and np.isfinite(y) and _FLOOR < y < _CEILING:
                note = panel.annotate(f"h = {h:.0e} s", (x, y), (-5, -9), textcoords="offset points", fontsize=7.5)
                note.set(color=COLOURS[0], ha="right", in_layout=False)
                note.set_bbox({"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.8})


def _slopes(panel: Any, stepping: Sequence[Line], name: str) -> None:
    """Draw slopes 1 and 2 through the middle of what is drawn."""
    points = [_shown(line.h, line.errors[name]) for line in stepping]
    if not any(x.size for x, _ in points):
        return
    h, error = (np.concatenate(each) for each in zip(*points, strict=True))
    low, high = panel.get_ylim()
    middle, ends = np.sqrt(h.min() * h.max()), np.array([h.min(), h.max()])
    for slope, style in ((1, "--"), (2, ":")):
        y = float(np.exp(np.median(np.log(error)))) * (ends / middle) ** slope
        panel.plot(ends, y, style, color=GREY, lw=1.0, zorder=0)
        # a line that leaves the panel is named below where it does, slope 1 below slope 2
        top = min(float(y[1]), float(high) / (high / low) ** (0.08 * (3 - slope)))
        place = (ends[1] * (top / y[1]) ** (1 / slope), top)
        note = panel.annotate(f"slope {slope}", place, fontsize=7.5, color=GREY, ha="right", va="bottom")
        note.set_in_layout(False)
    panel.set_ylim(low, high)
