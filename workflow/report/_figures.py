"""Figures and widgets of an interactive page, made with Bokeh; the page's script fills them with numbers.

Every part that the script looks for has a name. Figures are as wide as the page lets them be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np
from bokeh import models
from bokeh.document import Document
from bokeh.layouts import column
from bokeh.palettes import Cividis256
from bokeh.plotting import figure

from workflow.analysis import case_dims, followed_axis, labels, labels_of
from workflow.plots import COLOURS
from workflow.plots._style import GREY
from workflow.plots._units import in_units, scaled
from workflow.study import AUTO, MODES

if TYPE_CHECKING:
    import xarray as xr

MARKS = ("circle", "square", "triangle", "diamond", "inverted_triangle", "plus", "x", "star")
"""Markers of schemes, one for each colour of :data:`COLOURS`."""

TOLERANCES = (0.1, 0.01, 0.001)

EXACT, CHOSEN = COLOURS[5], COLOURS[6]
SELECTED = COLOURS[1]

STATUS_COLOURS = ("#56B4E9", "#F0E442", "#CC79A7", "#000000", "#f2f2f2")
"""Of the statuses in the order of their numbers, none of them :data:`SELECTED`; the page names them too."""

STATE_COLOURS = ("#009E73", "#56B4E9", "#0072B2", "#E69F00", "#CC79A7", "#8a8a8a", "#f2f2f2")
"""Of what becomes of rubs, in the order of ``steady_state``."""

ORBIT = ("orbit_displacement", "orbit_velocity", "orbit_temperature")


def drawn(figures: Mapping[str, Any]) -> dict[str, Any]:
    """Return figures as the page's script gives them to Bokeh, each for the element ``figure-NAME``."""
    document = Document()
    for root in figures.values():
        document.add_root(root)
    return {
        "drawn": document.to_json(deferred=False),
        "roots": {root.id: f"figure-{name}" for name, root in figures.items()},
    }


def case_figures(about: Mapping[str, Any]) -> dict[str, Any]:
    """Return the figures for what :func:`workflow.report._explorer.described` says, by name of their place.

    Parts for which the archive has nothing are left out.
    """
    axes = [axis for axis in about["dims"] if len(axis["texts"]) > 1]
    metrics = [metric["name"] for metric in about["metrics"]]
    cases = about["cases"]
    figures: dict[str, Any] = {}
    if cases and cases["histories"]:
        time = models.Range1d(0, 1, name="time")
        figures["case"] = _histories(cases["histories"], cases["titles"], time)
        if cases["contacts"]:
            figures["contacts"] = _contacts(cases["contacts"], time)
    if axes:
        figures["controls"] = _controls(about, axes)
        states: Sequence[str] = next((m["words"] for m in about["metrics"] if m["words"]), [])
        figures["map"] = _map({"statuses": (about["statuses"], STATUS_COLOURS), "states": (states, STATE_COLOURS)})
    if "error" in metrics and axes:
        if "processor_time" in metrics and about["numerical"]:
            figures["cost"] = _errors("cost", "processor time / simulated time [s/s]")
        if about["h_dim"] is not None and len(about["h"]) > 1:
            figures["order"] = _errors("order", "step h [s]")
        if about["modes"]:
            figures["modes"] = _modes(about["modes"], about["chosen_modes"])
    if cases and any("periods" in entry for entry in cases["entries"].values()):
        figures["periods"] = _periods()
    if cases and cases["worn_unit"]:
        figures["worn"] = _worn(cases["worn_unit"])
    if cases and cases["orbit_unit"]:
        figures["orbit"] = orbit_panels(cases["orbit_unit"])
    return figures


def panel_of(name: str, height: int, tools: str = "pan,box_zoom,wheel_zoom,reset,save", **options: Any) -> Any:
    """Return an empty figure on which a finger scrolls the page until a tool is chosen."""
    panel: Any = figure(name=name, height=height, sizing_mode="stretch_width", tools=tools, **options)
    panel.toolbar.active_drag = panel.toolbar.active_scroll = panel.toolbar.logo = None
    panel.toolbar.autohide = True
    panel.grid.grid_line_alpha = 0.4
    panel.axis.axis_label_text_font_style = "normal"
    panel.min_border_right = 12
    for axis in panel.axis:
        if isinstance(axis.formatter, models.BasicTickFormatter):
            axis.formatter.power_limit_low = -5
    return panel


def source_of(name: str, *columns: str) -> Any:
    return models.ColumnDataSource(name=name, data={column: [] for column in columns})


def _histories(names: Sequence[str], titles: Sequence[str], time: Any) -> Any:
    """Return a figure for each history, below each other, with the exact solution behind the case."""
    chosen, exact, gap = source_of("chosen", "t", *names), source_of("exact", "t", *names), source_of("gap", "t", "gap")
    panels = []
    for name, title in zip(names, titles, strict=True):
        last = name == names[-1]
        height = 215 if last else 185
        panel = panel_of(f"panel_{name}", height, x_range=time, x_axis_label="time [s]", y_axis_label=title)
        panel.line("t", name, source=exact, line_color=EXACT, line_width=4)
        panel.line("t", name, source=chosen, line_color=CHOSEN, line_width=1.0)
        if name == "displacement":
            panel.line("t", "gap", source=gap, line_color=SELECTED, line_dash="dashed", line_width=1.5)
        panel.yaxis.axis_label_text_font_size = "11px"
        panel.xaxis.visible = last
        panels.append(panel)
    return column(*panels, sizing_mode="stretch_width", name="histories")


def _contacts(count: int, time: Any) -> Any:
    """Return the contact force over time, a row for each of several contacts."""
    panel = panel_of(
        "contacts", min(470, 190 + 26 * count), x_range=time, y_range=(count, 0), x_axis_label="time [s]",
        y_axis_label="contact",
    )  # fmt: skip
    palette = Cividis256[::-1]
    colours = models.LinearColorMapper(palette=palette, low=0, high=1, nan_color="white", name="contact_colours")
    _draw_image(panel, "contact_cells", colours)
    panel.add_layout(models.ColorBar(color_mapper=colours, height=10, padding=4, title="contact force [N]"), "above")
    panel.grid.visible = False
    panel.yaxis.name, panel.yaxis.ticker = "contact_names", models.FixedTicker(ticks=[])
    return panel


def _worn(unit: str) -> Any:
    """Return the worn depth over the angle of the casing."""
    label = f"worn depth [{unit}]"
    panel = panel_of("worn", 215, x_range=(0, 360), x_axis_label="angle of the casing [°]", y_axis_label=label)
    panel.line("angle", "depth", source=source_of("worn_depths", "angle", "depth"), line_color=CHOSEN, line_width=1.5)
    panel.xaxis.ticker = panel.xgrid.ticker = models.FixedTicker(ticks=list(range(0, 361, 45)))
    return panel


def _draw_image(panel: Any, source: str, mapper: Any, **options: Any) -> None:
    """Draw an image of one cell without a value, in which the script puts others."""
    blank = {"image": [np.zeros((1, 1), np.float32)], "x": [0], "y": [0], "dw": [1], "dh": [1]}
    cells = models.ColumnDataSource(name=source, data=blank)
    panel.image("image", x="x", y="y", dw="dw", dh="dh", source=cells, color_mapper=mapper, **options)


def _controls(about: Mapping[str, Any], axes: Sequence[dict[str, Any]]) -> Any:
    """Return menus for the metric and the axes of the map, and a slider for each axis."""
    wrapped = models.InlineStyleSheet(css=".bk-slider-title { white-space: normal; overflow-wrap: anywhere; }")
    names = [pair for axis in axes for pair in _sides(axis)]
    first, second = map_axes(about)
    metrics = [("status", "status")] + [(metric["name"], metric["title"]) for metric in about["metrics"]]
    varied = [metric["name"] for metric in about["metrics"] if metric["varies"]]
    start = next(
        (name for name in ("error", "steady_state", "max_temperature", "contact_impulse", *varied) if name in varied),
        "status",
    )
    widgets: list[Any] = [
        models.Select(name="metric", title="colour", options=metrics, value=start),
        models.Select(name="across", title="across", options=names, value=first),
        models.Select(name="up", title="up", options=[("", "nothing"), *names], value=second),
    ]
    for axis in axes:
        unit = f" [{axis['unit']}]" if axis["unit"] else ""
        widgets.append(
            models.CategoricalSlider(
                name=f"slider_{axis['name']}",
                title=axis["title"] + unit,
                categories=axis["texts"],
                value=axis["texts"][0],
                tooltips=False,  # they would take a text as markup; the title has it
                stylesheets=[wrapped],
            )
        )
    for widget in widgets:
        widget.sizing_mode = "stretch_width"
    return column(*widgets, sizing_mode="stretch_width", name="widgets")


def _sides(axis: dict[str, Any]) -> list[tuple[str, str]]:
    """Return names and titles of what an axis puts along a side of the map: itself, or each number drawn along it."""
    numbers = [(f"{axis['name']}:{k}", number["title"]) for k, number in enumerate(axis["numbers"])]
    return numbers or [(axis["name"], axis["title"])]


def map_axes(about: Mapping[str, Any]) -> tuple[str, str]:
    """Return the names of the sides of the map at first: scheme and h where they have three values, else the longest.

    Of two axes h or α lies across; drawn numbers come before all axes.
    """
    drawn = [name for axis in about["dims"] if axis["numbers"] for name, _ in _sides(axis)]
    if drawn:
        return (drawn[0], drawn[1]) if len(drawn) > 1 else (drawn[0], "")
    sizes = {axis["name"]: len(axis["texts"]) for axis in about["dims"] if len(axis["texts"]) > 1}
    ranked = sorted(sizes, key=lambda name: (name not in ("h", "scheme") or sizes[name] < 3, -sizes[name]))
    first, second = [*ranked, ""][:2]
    return (second, first) if second == "alpha" or (first, second) == ("scheme", "h") else (first, second)


def _map(words: Mapping[str, tuple[Sequence[str], Sequence[str]]]) -> Any:
    """Return the map: an image, what is not ok, values where they fit, and the cell that is selected.

    ``words`` has the meanings of whole numbers and their colours for each scale of words.
    """
    panel = panel_of("map", 420, tools="reset,save", x_range=(0, 1), y_range=(0, 1))
    mappers: dict[str, Any] = {
        "linear": models.LinearColorMapper(palette=Cividis256, nan_color="#dddddd", name="linear"),
        "log": models.LogColorMapper(palette=Cividis256, nan_color="#dddddd", low=1e-3, high=1, name="log"),
    }
    for name, (meanings, colours) in words.items():
        high = max(len(meanings) - 0.5, 0.5)
        mappers[name] = models.LinearColorMapper(palette=colours, low=-0.5, high=high, nan_color="#dddddd", name=name)
    for name, mapper in mappers.items():  # an image for each scale: one cannot change its own
        _draw_image(panel, f"cells_{name}", mapper, name=f"image_{name}")
    points = source_of("points", "x", "y", "value")
    for name, mapper in mappers.items():
        colour = {"field": "value", "transform": mapper}
        panel.scatter("x", "y", source=points, size=8, fill_color=colour, line_color=None, name=f"points_{name}")
    bad = source_of("bad", "x", "y")
    panel.scatter("x", "y", source=bad, marker="x", size=9, line_color="black", line_width=1.5)
    panel.text(
        "x", "y", "text", source=source_of("values", "x", "y", "text", "colour"), text_color="colour",
        text_align="center", text_baseline="middle", text_font_size="11px",
    )  # fmt: skip
    cell = source_of("cell", "x", "y", "w", "h")
    panel.rect("x", "y", "w", "h", source=cell, fill_color=None, line_color=SELECTED, line_width=3.5)
    for name, mapper in mappers.items():
        ticks: dict[str, Any] = {}
        if name in words:
            ticks["ticker"] = models.FixedTicker(ticks=list(range(len(words[name][0]))))
            ticks["major_label_overrides"] = {k: word.replace("_", "\n") for k, word in enumerate(words[name][0])}
        bar = models.ColorBar(color_mapper=mapper, name=f"bar_{name}", height=10, padding=4, **ticks)
        panel.add_layout(bar, "above")
    panel.grid.visible = False
    for axis, name in ((panel.xaxis, "map_x"), (panel.yaxis, "map_y")):
        axis.name, axis.ticker, axis.major_tick_line_color = name, models.FixedTicker(ticks=[]), None
        axis.major_label_policy = models.NoOverlap(min_distance=8)
    return panel


def _errors(name: str, label: str) -> Any:
    """Return a panel of errors on logarithmic axes: a line and markers for each scheme; a click selects."""
    panel = panel_of(
        name, 330, x_axis_type="log", y_axis_type="log", x_range=(0.1, 1), y_range=(1e-4, 1), x_axis_label=label,
        y_axis_label="relative error [1]",
    )  # fmt: skip
    for tolerance in TOLERANCES:
        panel.add_layout(models.Span(location=tolerance, dimension="width", line_color=GREY, line_dash="dotted"))
    lines = source_of(f"{name}_lines", "x", "y", "colour")
    panel.multi_line("x", "y", line_color="colour", line_width=1.5, source=lines)
    exact = source_of(f"{name}_exact", "x", "y")
    panel.multi_line("x", "y", line_color="black", line_dash="dotted", line_width=1.5, source=exact)
    points = source_of(f"{name}_points", "x", "y", "colour", "marker", "case", "scheme", "h")
    tips = [("scheme", "@scheme"), ("h", "@h"), (label.split(" [")[0], "@x{0.00e}"), ("error", "@y{0.00e}")]
    _scatter_cases(panel, points, f"{name}_here", 8, tips, marker="marker", fill_color="colour")
    for side, axis, grid in (("x", panel.xaxis, panel.xgrid), ("y", panel.yaxis, panel.ygrid)):
        axis.name = f"{name}_{side}"
        axis.ticker = grid.ticker = models.FixedTicker(ticks=[])
    return panel


def _scatter_cases(panel: Any, points: Any, here: str, size: int, tips: Sequence[Any], **look: Any) -> None:
    """Draw points, each of which says what it is and is selected by a click, and a ring about the selected one."""
    dots = panel.scatter(
        "x", "y", source=points, size=size, line_color="colour", nonselection_fill_alpha=1, nonselection_line_alpha=1,
        **look,
    )  # fmt: skip
    ring = source_of(here, "x", "y")
    panel.scatter("x", "y", source=ring, size=2 * size + 1, fill_color=None, line_color=SELECTED, line_width=2.5)
    panel.add_tools(models.HoverTool(renderers=[dots], tooltips=tips), models.TapTool(renderers=[dots]))


def _modes(modes: Mapping[str, Any], chosen: Sequence[str] | None) -> Any:
    """Return the error over mechanical and thermal modes, with the choice of the study marked."""
    counts = [
        sorted(set(modes[name]["texts"]), key=lambda text: np.inf if text == AUTO else float(text)) for name in MODES
    ]
    x_range, y_range = (models.FactorRange(*texts, range_padding=0.1) for texts in counts)
    panel = panel_of(
        "modes", 330, tools="reset,save", x_range=x_range, y_range=y_range, x_axis_label="mechanical modes",
        y_axis_label="thermal modes",
    )  # fmt: skip
    points = source_of("modes_points", "x", "y", "error", "text", "colour", "name")
    mapper = models.LogColorMapper(palette=Cividis256, name="modes_colours", low=1e-3, high=1)
    dots = panel.rect(
        "x", "y", 0.9, 0.9, source=points, fill_color={"field": "error", "transform": mapper}, line_color=None
    )
    panel.text(
        "x", "y", "text", source=points, text_color="colour", text_align="center", text_baseline="middle",
        text_font_size="11px",
    )  # fmt: skip
    panel.rect(
        "x", "y", 0.9, 0.9, source=source_of("modes_here", "x", "y"), fill_color=None, line_color=SELECTED, line_width=3
    )
    if chosen and all(count in texts for count, texts in zip(chosen, counts, strict=True)):
        corner = [[(count, shift)] for count, shift in zip(chosen, (-0.33, 0.3), strict=True)]
        star = models.ColumnDataSource(dict(zip("xy", corner, strict=True)))
        panel.scatter("x", "y", marker="star", size=18, source=star, fill_color="white", line_color="black")
    panel.add_tools(models.HoverTool(renderers=[dots], tooltips=[("modes", "@name"), ("error", "@text")]))
    return panel


def orbit_panels(unit: str) -> Any:
    """Return the phase plane of a steady rub, and its displacement and temperature over one period."""
    source, panels = source_of("orbit", "x", "v", "phase", "temperature"), []
    for x, y, x_label, y_label in (
        ("x", "v", f"displacement [{unit}]", "velocity [m/s]"),
        ("phase", "x", "share of the period", f"displacement [{unit}]"),
        ("phase", "temperature", "share of the period", "temperature rise [K]"),
    ):
        panels.append(panel_of(f"orbit_{x}_{y}", 215, x_axis_label=x_label, y_axis_label=y_label))
        panels[-1].line(x, y, source=source, line_color=COLOURS[0], line_width=1.5)
    return column(*panels, sizing_mode="stretch_width", name="orbits")


def _periods() -> Any:
    """Return the impulse of each load period and what the growth rate of permanent contact predicts."""
    panel = panel_of("periods", 300, y_range=(0, 1), x_axis_label="load period", y_axis_label="impulse [N s]")
    measured, predicted = (source_of(name, "period", "impulse") for name in ("period_impulses", "predicted"))
    panel.line("period", "impulse", source=measured, line_color=COLOURS[0], line_width=1.2)
    panel.scatter("period", "impulse", source=measured, color=COLOURS[0], size=7)
    panel.line("period", "impulse", source=predicted, line_color=COLOURS[1], line_dash="dashed", line_width=2)
    panel.xaxis.ticker = models.BasicTicker(min_interval=1, num_minor_ticks=0)
    panel.yaxis.name = "periods_y"
    return panel


def branch_figures(dataset: xr.Dataset, variable: str) -> tuple[dict[str, Any], Any]:
    """Return the branches of an archive, with a panel for the orbit of the point that is clicked, and all orbits.

    Orbits have the shape ``(point, 3, phase)``, in the order of ``branch_points``: displacement, velocity, temperature.
    """
    (x, x_label), (y, y_label) = (in_units(dataset[name]) for name in (followed_axis(dataset), variable))
    states, flags = labels(dataset["steady_state"]).values, labels(dataset["bifurcation"]).values
    varied = [dim for dim in case_dims(dataset) if dataset.sizes[dim] > 1]
    texts = product(*(labels_of(dataset, dim, rounded=True) for dim in varied))
    branch_texts = [f"{', '.join(each)}: " if each else "" for each in texts]
    found, branch = np.isfinite(x), np.arange(dataset["status"].size).reshape(*dataset["status"].shape, 1)
    colours = np.broadcast_to(np.array(COLOURS)[branch % len(COLOURS)], x.shape)
    words = states + np.where(flags == "none", "", ", " + flags)
    panel = panel_of("branches", 420, x_axis_label=x_label, y_axis_label=y_label)
    for one in np.ndindex(dataset["status"].shape):
        panel.line(x[one][found[one]], y[one][found[one]], line_color=colours[one][0], line_width=1.2)
    columns = {"x": x, "y": y, "colour": colours, "fill": np.where(states == "unstable", "white", colours)}
    columns |= {"text": np.array(branch_texts, dtype=object)[branch] + words}
    held = {name: list(each[found]) for name, each in columns.items()}
    points = models.ColumnDataSource(name="branch_points", data=held)
    _scatter_cases(panel, points, "branch_here", 7, [("", "@text")], fill_color="fill")
    unit, factor = scaled("m", dataset[ORBIT[0]].values)
    orbits = np.stack([dataset[name].values[found] for name in ORBIT], axis=1) * np.array([factor, 1, 1])[:, None]
    return {"branches": panel, "orbit": orbit_panels(unit)}, orbits
