"""What a report says of steady rubs: in which ranges they keep within limits, and the branches that were followed."""

from __future__ import annotations

from importlib.resources import files
from typing import TYPE_CHECKING

import numpy as np

from workflow.analysis import NothingSteadyError, count_sentence, followed_axis, limit_sentence, limits
from workflow.plots import branches
from workflow.report._bokeh_branches import branch_explorer
from workflow.report._explorer import figure_place, library
from workflow.report._html import block, image, note, paragraph, prose, tag
from workflow.report._sections import Section, any_ok

if TYPE_CHECKING:
    import xarray as xr

_ALONG = ("steady_max_temperature", "steady_impulse", "floquet_multiplier")


def along_branches(dataset: xr.Dataset) -> Section:
    """Draw the branches of an archive, where it has any."""
    if followed_axis(dataset) is None or not any_ok(dataset):
        return Section([], None)
    about = "Solid: stable rubs; dashed: unstable ones. Beyond the fold where both meet a rub runs away or jumps."
    names = _varied(dataset)
    pictures = [image(branches(dataset, name), f"{name.replace('_', ' ')} along the branches") for name in names]
    body = [tag("h2", "Branches"), note(about), tag("div", *pictures, kind="panels")]
    return Section(body, branches(dataset, names[0]))


def where_it_settles(dataset: xr.Dataset) -> list[str]:
    """Say in which range of each axis every rub settles, as ``workflow limits`` without bounds."""
    try:
        found = limits(dataset)
    except NothingSteadyError:
        return []
    sentences = [tag("p", prose(limit_sentence(limit, dataset, {})), kind="quoted") for limit in found.limits]
    count = paragraph(prose(count_sentence(found)))
    return [tag("section", tag("h2", "Where it settles"), *sentences, count, kind="answer")]


def interactive_branches(dataset: xr.Dataset) -> tuple[list[str], list[str]]:
    """Return branches whose points show their orbits when they are clicked, and the scripts for it."""
    if followed_axis(dataset) is None or not any_ok(dataset):
        return [], []
    titles = {"branches": "A point of a branch", "orbit": "Its steady rub"}
    about = {"branches": "Filled: stable rubs; open: unstable ones. A click selects.", "orbit": ""}
    panels = [
        tag("div", tag("h3", titles[name]), note(about[name], id=f"{name}-about"), figure_place(name))
        for name in titles
    ]
    figures = block("branch-figures", branch_explorer(dataset, _varied(dataset)[0]))
    script = files("workflow.report").joinpath("branches.js").read_text(encoding="utf-8")
    return [tag("div", *panels, kind="panels"), figures], [*library(), script]


def _varied(dataset: xr.Dataset) -> list[str]:
    """Return the variables to draw: heat is left out where none acts."""
    return [name for name in _ALONG if np.nanmax(dataset[name].values) > 0]
