"""The interactive part of a report: a map of the cases, the case that is selected, its errors and load periods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from workflow.analysis import Choice, notable_cases
from workflow.plots import COLOURS
from workflow.report._bokeh_figures import MARKS, explorer
from workflow.report._html import Html, block, note, tag
from workflow.report._page_data import page_data, shown_part
from workflow.schemes import Status
from workflow.study import MODES

if TYPE_CHECKING:
    import xarray as xr

PAGE_BYTES = 6_000_000
"""Size of a page that still goes through the mail."""

_TITLES = {
    "map": "Map of the cases",
    "case": "The selected case",
    "cost": "Error against cost",
    "order": "Error against step",
    "modes": "Error of the reduced models",
    "periods": "Impulse of each load period",
    "orbit": "The steady rub of the selected case",
}

_NO_SCRIPT = (
    "The figures below are drawn by a script, which this viewer does not run; save the page and open it in a browser."
)


def interactive(
    dataset: xr.Dataset,
    archive: str,
    choice: Choice | None,
    methods: Mapping[str, str],
    scene: Mapping[str, Any],
    room: int,
) -> tuple[list[str], list[str]]:
    """Return the interactive part of a report and the scripts it needs.

    Parameters
    ----------
    dataset, archive
        The archive and the name of its file.
    choice
        What it recommends or comes nearest to it.
    methods
        Method of each scheme of its study by label.
    scene
        Of its study as resolved.
    room
        Bytes that the part and its scripts may take.
    """
    scripts = library()
    script = files("workflow.report").joinpath("explorer.js").read_text(encoding="utf-8")
    room -= sum(len(one.encode()) for one in [*scripts, script])
    notable = notable_cases(dataset, choice)
    shown = shown_part(dataset, notable)
    described, packed = page_data(shown.dataset, shown.cases, methods, scene, room)
    described |= {
        "archive": repr(archive),
        "statuses": [status.name.lower().replace("_", "-") for status in Status],
        "colours": list(COLOURS),
        "markers": list(MARKS),
        "scheme": _scheme(dataset),
        "chosen_modes": _chosen_modes(dataset, choice),
    }
    figures = explorer(described, described["statuses"])
    body = [
        *_layout(figures, described, shown.left_out),
        *_hard(notable.values(), shown.cases, described["dims"]),
        block("description", described),
        block("figures", figures),
        tag("script", Html(packed), id="block", type="text/plain"),
    ]
    return body, [*scripts, script]


def library() -> list[str]:
    """Return Bokeh's scripts as they stand in the page."""
    from bokeh.resources import Resources

    return list(Resources(mode="inline", components=["bokeh", "bokeh-widgets"], log_level="error").js_raw)


def _scheme(dataset: xr.Dataset) -> str:
    return str(dataset["scheme"].values) if "scheme" in dataset.coords and dataset["scheme"].ndim == 0 else "the scheme"


def _chosen_modes(dataset: xr.Dataset, choice: Choice | None) -> list[str] | None:
    """Return the mode counts of the study's own choice, as the page writes them: ``auto``, else what is recommended."""
    values = [dataset[name].values.ravel() for name in MODES if name in dataset.coords]
    if len(values) == 2 and any((one == -1).any() for one in values):
        return ["auto" if (one == -1).any() else str(one[-1]) for one in values]
    if choice is None or not all(name in choice.settings for name in MODES):
        return None
    return [str(choice.settings[name]) for name in MODES]


def _layout(figures: Mapping[str, Any], described: Mapping[str, Any], left_out: Sequence[str]) -> list[str]:
    """Return the places of the figures, with what stands beside each."""
    omitted = list(left_out)
    if described["left_out"]:
        omitted.append("metrics that do not fit: " + ", ".join(described["left_out"]))
    remark = "Not all of the archive is in this page: " + "; ".join(omitted) + "."
    panels = [tag("div", *_map_panel(), kind="panel") if "map" in figures else Html(""), _case_panel(figures)]
    for name in ("cost", "order", "modes", "periods", "orbit"):
        if name in figures:
            about = _about(name, described)
            key = [tag("p", "", id=f"{name}-key", kind="key")] if name in ("cost", "order") else []
            text = note(about, id=f"{name}-about")
            panels.append(tag("div", tag("h3", _TITLES[name]), text, figure_place(name), *key, kind="panel"))
    return [
        tag("h2", "Explore", id="explore"),
        tag("noscript", _NO_SCRIPT),
        *([note(remark)] if omitted else []),
        tag("div", *panels, kind="panels"),
    ]  # fmt: skip


def _about(name: str, described: Mapping[str, Any]) -> str:
    """Return what stands above a panel."""
    metrics = [metric["name"] for metric in described["metrics"]]
    if name == "cost":
        return (
            "Largest relative error of displacement, temperature and impulse, for the scene of the selected case; "
            "lines lead through the steps of a scheme. Dotted across: 10 %, 1 %, 0.1 %. A click selects."
        )
    if name == "order":
        split = "scheme_error" in metrics
        part = "The scheme's part of the error" if split else "The whole error, reduced model's included"
        return (
            f"{part}. For the scene of the selected case; order is the slope of log error over log h, where three "
            "errors or more are below a tenth."
        )
    if name == "modes":
        part = "The reduced model's part of the error" if "model_error" in metrics else "The whole error"
        star = "choice (auto)" if "auto" in (described["chosen_modes"] or ()) else "choice, as recommended above"
        return f"{part}. For the scene of the selected case, which is framed. The star is the study's own {star}."
    return ""


def figure_place(name: str) -> Html:
    return tag("div", "", id=f"figure-{name}", kind="figure")


def _map_panel() -> list[str]:
    return [
        tag("h3", _TITLES["map"]),
        note("", id="map-about"),
        figure_place("map"),
        note("A click selects a case, a slider moves through the others.", id="map-here"),
        figure_place("controls"),
    ]


def _case_panel(figures: Mapping[str, Any]) -> Html:
    """Return the place of the selected case: what it is, its curves, how to read it in Python, its metrics."""
    curves: list[str] = [note("The archive keeps no histories.")]
    if "case" in figures:
        key = [
            tag("span", tag("i", "—", kind="chosen"), " selected case"),
            tag("span", tag("i", "━", kind="exact"), " exact solution"),
            tag("span", tag("i", "╌", kind="gap"), " gap"),
        ]
        window = note("", id="case-window")
        curves = [tag("p", *key, kind="key"), window, figure_place("case"), note("", id="case-exact")]
    table = tag("table", "", id="case-metrics")
    return tag(
        "div",
        tag("h3", _TITLES["case"]),
        tag("p", "", id="case-labels"),
        tag("p", "", id="case-status", kind="bad"),
        *curves,
        tag("p", "In Python, after ", tag("code", "from workflow import open_archive"), ":"),
        tag("pre", "", id="case-command", kind="command"),
        tag("details", tag("summary", "Its metrics"), table, open="" if "case" in figures else "open"),
        kind="panel",
    )  # fmt: skip


def _hard(reasons: Iterable[str], cases: Sequence[int], dims: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the cases that are worth a look, with a button that selects each."""
    shape = [len(dim["texts"]) for dim in dims]
    rows = []
    for why, case in zip(reasons, cases, strict=True):
        place = np.unravel_index(case, shape) if shape else ()
        named = [f"{d['title']} {d['texts'][k]} {d['unit']}".strip() for d, k in zip(dims, place, strict=True)]
        varied = [text for text, size in zip(named, shape, strict=True) if size > 1]
        button = tag("button", "show", type="button", **{"data-case": str(case), "aria-label": f"show {why}"})
        rows.append(tag("tr", tag("td", why), tag("td", ", ".join(varied) or "the only case"), tag("td", button)))
    head = tag("tr", tag("th", "why"), tag("th", "case"), tag("th", "select"))
    return [tag("h3", "Cases worth a look"), tag("div", tag("table", head, *rows), kind="wide")]
