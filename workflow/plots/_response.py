"""Histories of some cases below each other."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from workflow import analysis
from workflow.plots._style import COLOURS, legend_below, new_figure, trim
from workflow.plots._units import scaled

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHADE = "#0072B2"

MOST_SHADED = 40
"""Contact phases that are shaded; more would be a grey wall."""

_LINE = 0.09
"""Share of a panel's height that a line of text takes."""

_LETTERS = 105
"""Letters of a line of the legend; a sample takes eight."""

_LAST, _BESIDE, _WIDEST = 1.2, 1.8, 5.0
"""Points of the last curve, by how many more each one before it is wider, and all: those that coincide are seen."""

HISTORIES = {
    "displacement": "tip displacement",
    "velocity": "tip velocity",
    "temperature": "tip temperature rise",
    "contact_force": "contact force",
    "impulse": "impulse",
}
"""Histories in the order in which they stand below each other, and their titles."""


@dataclass(frozen=True)
class Curve:
    """One case of an archive and how it is drawn."""

    case: xr.Dataset
    label: str
    colour: str = COLOURS[0]
    style: str = "-"
    width: float = 1.2


def tip_response(curves: list[Curve], title: str = "", phases_of: int | None = None) -> Figure:
    """Draw the histories of some cases below each other: displacement with the gap, heat, force.

    Parameters
    ----------
    curves
        The cases, drawn in order; all from archives with the same histories.
    title
        Above the picture.
    phases_of
        Position of the case whose contact phases are shaded, ``None`` for none.
    """
    first = curves[0].case
    names = [name for name in HISTORIES if name in first]
    moving = [name for name in names if any(np.any(curve.case[name].values) for curve in curves)]
    names = moving or names[:1]  # what stays 0, as the temperature of a cold blade, needs no panel
    figure = new_figure(9.0, 2.3 * len(names) + 0.9)
    axes = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    for panel, name in zip(axes, names, strict=True):
        unit, scale = analysis.unit_of(first[name]), 1.0
        if name == "displacement":
            largest = max(float(np.nanmax(np.abs(curve.case[name].values), initial=0.0)) for curve in curves)
            unit, scale = scaled("m", np.array([largest]))
        if phases_of is not None and "contact_force" in first:
            phases = analysis.contact_phases(curves[phases_of].case)
            few = phases["begin"].size <= MOST_SHADED
            for begin, end in zip(phases["begin"].values, phases["end"].values, strict=True) if few else ():
                panel.axvspan(begin, end, color=SHADE, alpha=0.09, lw=0)
        for curve in curves:
            t = np.asarray(curve.case["t"].values)
            values = np.asarray(curve.case[name].values) * scale
            panel.plot(t, values, curve.style, color=curve.colour, lw=curve.width, label=curve.label)
        if name == "displacement":
            _draw_casing(panel, curves, scale, unit)
        panel.set_ylabel(f"{HISTORIES[name]} [{unit}]")
        panel.margins(x=0)
        trim(panel)
    low, high = axes[0].get_ylim()
    axes[0].set_ylim(low, high + 0.08 * (high - low))
    axes[-1].set_xlabel("time [s]")
    columns = _LETTERS // (8 + max(len(curve.label) for curve in curves))
    legend_below(figure, axes[0].get_legend_handles_labels(), max(1, min(4, len(curves), columns)))
    if title:
        figure.suptitle(title, fontsize=11)
    return figure


def _draw_casing(panel: Axes, curves: list[Curve], scale: float, unit: str) -> None:
    """Draw where the casing of each case is: a line at the gap, its motion dotted in the colour of the case."""
    casings: dict[float, tuple[float, bool]] = {}  # at each gap: how far up one moves, and whether one stays
    for curve in curves:
        if "gap" not in curve.case.coords:
            continue
        gap, motion = float(analysis.gap_of(curve.case)), analysis.casing_motion(curve.case)
        top, stays = casings.get(gap, (gap, False))
        if motion is None:
            panel.axhline(gap * scale, color="black", lw=0.8, ls=":")
            casings[gap] = top, True
        else:
            panel.plot(curve.case["t"].values, motion[0] * scale, color=curve.colour, lw=0.9, ls=":")
            casings[gap] = max(top, float(np.max(motion[0]))), stays
    low, high = panel.get_ylim()
    above = -np.inf
    for gap, (top, stays) in sorted(casings.items()):
        if top * scale < above + _LINE * (high - low):  # the legend names gaps that are compared
            continue
        above = top * scale
        panel.annotate(
            f"gap {gap * scale:.4g} {unit}" + ("" if stays else ", casing dotted"), (1.0, above),
            xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=8, xytext=(-3, 2),
            textcoords="offset points",
        )  # fmt: skip


def histories(dataset: xr.Dataset, along: str | None = None) -> Figure:
    """Draw the histories of the cases along one dimension below each other: select what else is shown before.

    Of all other dimensions the place of that case is shown which :func:`~workflow.recommend` names, the worst of its
    choice; without a choice that of the ok case whose contact impulse is the median. Cases that are not ok are left
    out; contact phases of the last case are shaded. Of several contacts the most loaded one is shown.

    Parameters
    ----------
    dataset
        An archive that keeps histories, or a selection of its cases.
    along
        Dimension whose cases are compared; where left out α, the scheme or the longest with at most eight cases.

    Raises
    ------
    ValueError
        There are no histories, no case is ok, or there is no such dimension.
    """
    if not any(name in dataset for name in HISTORIES):
        raise ValueError("the dataset keeps no histories; name them under `output.histories` of the study")
    if along is not None and along not in analysis.case_dims(dataset):
        raise ValueError(
            f"`{along}` is no dimension of the cases; they lie along {', '.join(analysis.case_dims(dataset))}"
        )
    dataset = analysis.most_loaded(dataset)
    place = analysis.shown_place(dataset)
    dim = along or analysis.shown_dim(dataset)
    compared = [{**place, dim: k} for k in range(dataset.sizes[dim])] if dim else [place]
    shown = [at for at in compared if int(dataset["status"].isel(at)) == 0]
    if dim is None:
        curves = [Curve(dataset.isel(shown[0]), "the case shown")]
    else:
        labels = analysis.labels_of(dataset, dim, rounded=True)
        widths = np.linspace(_LAST + min(_BESIDE * (len(shown) - 1), _WIDEST), _LAST, len(shown))
        curves = [
            Curve(dataset.isel(at), labels[at[dim]], COLOURS[at[dim] % len(COLOURS)], width=float(width))
            for at, width in zip(shown, widths, strict=True)
        ]
    rest = analysis.place_text(dataset, {name: k for name, k in place.items() if name != dim})
    return tip_response(curves, title=rest, phases_of=len(curves) - 1)
