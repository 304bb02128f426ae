"""Error against processor time and against the step, one line per scheme."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import ERRORS, SENSELESS, Line, has_lines, lines
from workflow.plots._style import COLOURS, GREY, MARKERS, trim

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_FLOOR, _CEILING = 1e-12, SENSELESS
"""Errors outside are not drawn: rounding below, nothing right above."""


def error_by_cost(lines: Sequence[Line], beside: Sequence[Line] = ()) -> Figure:
    """Draw relative errors against processor seconds per simulated second, log-log.

    Markers are at steps h; a cross on the upper edge is a step beyond the scheme's limit (not ok, or an
    error above 3), at what it cost; the exact scheme is the cost line.

    Parameters
    ----------
    lines
        From :func:`workflow.analysis.lines`.
    beside
        The same schemes in another model (a reduced one), drawn thin and dashed.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12.0, 5.2), layout="constrained")
    panels: Any = figure.subplots(1, len(ERRORS), sharex=True, sharey=True)
    stepping = [line for line in lines if not line.exact]
    for panel, (name, about) in zip(panels, ERRORS.items(), strict=True):
        for k, line in enumerate(stepping):
            colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
            panel.plot(
                *_drawn(line.seconds, line.errors[name]), marker=marker, color=colour, ms=5, lw=1.4, label=line.scheme
            )
            _cross_out(panel, line.seconds[line.lost], k)
            for other in beside:
                if other.scheme == line.scheme:
                    panel.plot(
                        *_drawn(other.seconds, other.errors[name]), "--", color=colour, lw=0.9, marker=marker, ms=2.5
                    )
        for line in lines:
            if line.exact:
                cost = float(np.median(line.seconds))
                panel.axvline(cost, color="black", lw=1.2, ls=":", label=f"{line.scheme}: exact, at this cost")
        panel.set(xscale="log", yscale="log", title=about, xlabel="processor seconds per simulated second")
        trim(panel)
    panels[0].set_ylabel("relative L2 error")
    low, high = panels[0].get_ylim()
    panels[0].set_ylim(max(low, _FLOOR), max(high, 1.0))
    panels[0].set_xlim(panels[0].get_xlim()[0] / 5)  # room for the names of the steps
    _leave_room(panels[0], stepping)
    for panel in panels:
        _tick_decades(panel.xaxis)
        _tick_decades(panel.yaxis)
    _name_steps(panels[0], stepping)
    handles, labels = panels[0].get_legend_handles_labels()
    if beside:
        handles += panels[0].plot([], [], "--", color=GREY, lw=0.9)
        labels += ["reduced model (dashed)"]
    if any(line.lost.any() for line in stepping):
        handles += panels[0].plot([], [], "x", color=GREY)
        labels += ["beyond its stable step"]
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _tick_decades(axis: Any) -> None:
    """Write powers of ten along a logarithmic axis, of fewer than two decades what lies between too."""
    from matplotlib.ticker import LogLocator, NullLocator, StrMethodFormatter

    axis.set_minor_locator(NullLocator())
    low, high = axis.get_view_interval()
    if high < 100 * low:
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_major_formatter(StrMethodFormatter("{x:g}"))


def _drawn(x: Any, y: Any) -> tuple[Any, Any]:
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
    if not stepping:
        return
    line = stepping[0]
    for h, x, y in zip(line.h, line.seconds, line.errors["impulse_error"], strict=True):
        if abs(np.log10(h) - round(np.log10(h))) < 1e-6 and np.isfinite(y) and _FLOOR < y < _CEILING:
            note = panel.annotate(f"h = {h:.0e} s", (x, y), xytext=(-5, -9), textcoords="offset points", fontsize=7.5)
            note.set(color=COLOURS[0], ha="right", in_layout=False)
            note.set_bbox({"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.8})


def error_by_step(lines: Sequence[Line]) -> Figure:
    """Draw errors, penetration and energy residual against the step, with slopes 1 and 2.

    Observed orders and their scatter (:func:`workflow.analysis.observed_order`) stand in the legend; crosses as in
    :func:`error_by_cost`.
    """
    from matplotlib.figure import Figure

    stepping = [line for line in lines if not line.exact]
    balanced = any(np.isfinite(line.residual).any() for line in stepping)
    names = [*ERRORS, "penetration", *(["residual"] if balanced else [])]
    columns = 3 if len(names) > 4 else 2
    figure = Figure(figsize=(4.1 * columns, 7.6), layout="constrained")
    panels = np.ravel(figure.subplots(2, columns, sharex=True))
    for panel, name in zip(panels, names, strict=False):
        for k, line in enumerate(stepping):
            colour, marker = COLOURS[k % len(COLOURS)], MARKERS[k % len(MARKERS)]
            if name in ERRORS:
                values, (order, scatter) = line.errors[name], line.order(name)
                label = None if np.isnan(order) else f"order {order:z.2f}, scatter {scatter:.2f}"
            else:
                values, label = np.abs(line.penetration if name == "penetration" else line.residual), None
            with np.errstate(invalid="ignore"):
                sane = np.where(line.errors["impulse_error"] < _CEILING, values, np.nan)
            x, y = _drawn(line.h, sane) if name in ERRORS else (line.h[sane > 0], sane[sane > 0])
            panel.plot(x, y, marker=marker, color=colour, ms=4.5, lw=1.3, label=label)
            _cross_out(panel, line.h[line.lost], k)
        panel.set(xscale="log", yscale="log")
        if name in ERRORS:
            _slopes(panel, stepping, name)
            panel.set_title(f"{ERRORS[name]}: relative L2 error", fontsize=10)
            if panel.get_legend_handles_labels()[0]:
                panel.legend(frameon=False, fontsize=7.5, loc="lower right")
        else:
            panel.set_title(
                "largest penetration [m]" if name == "penetration" else "|energy residual| / largest energy",
                fontsize=10,
            )
        _leave_room(panel, stepping)
        _tick_decades(panel.xaxis)
        _tick_decades(panel.yaxis)
        trim(panel)
    for panel in panels[len(names) :]:
        panel.remove()
    for place, panel in enumerate(panels[: len(names)]):
        if place + columns >= len(names):  # nothing is drawn below it
            panel.set_xlabel("step h [s]")
            panel.tick_params(labelbottom=True)
    handles = [
        panels[0].plot([], [], marker=MARKERS[k % len(MARKERS)], color=COLOURS[k % len(COLOURS)])[0]
        for k in range(len(stepping))
    ]
    labels = [line.scheme for line in stepping]
    if any(line.lost.any() for line in stepping):
        handles += panels[0].plot([], [], "x", color=GREY)
        labels += ["beyond its stable step"]
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    return figure


def _slopes(panel: Any, stepping: Sequence[Line], name: str) -> None:
    """Draw slopes 1 and 2 through the middle of what is drawn."""
    points = [_drawn(line.h, line.errors[name]) for line in stepping]
    if not any(x.size for x, _ in points):
        return
    h = np.concatenate([x for x, _ in points])
    error = np.concatenate([y for _, y in points])
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


def work_precision(dataset: xr.Dataset, beside: xr.Dataset | None = None) -> Figure:
    """Draw relative errors against processor seconds per simulated second, a line per scheme with a marker per step.

    Of all other dimensions the most modes, the largest α and the first of the rest are shown. Crosses on the upper edge
    are steps at which a scheme is not ok or errs by more than three times the solution.

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
    return error_by_cost(_lines(dataset), [] if beside is None else _lines(beside))


def convergence(dataset: xr.Dataset) -> Figure:
    """Draw errors, largest penetration and energy residual against the step h, a line per scheme, and slopes 1 and 2.

    Of the other dimensions and of crosses as :func:`work_precision`; the observed orders stand in the legend.

    Parameters
    ----------
    dataset
        An archive whose study has a ``reference`` and several steps ``h``, or a selection of its cases.

    Raises
    ------
    ValueError
        The dataset has no errors or one step only.
    """
    return error_by_step(_lines(dataset))


def _lines(dataset: xr.Dataset) -> list[Line]:
    if not has_lines(dataset):
        raise ValueError("errors over steps need a `reference` in the study and several steps `h` in the dataset")
    return lines(dataset)
