"""What a report says of steady rubs: in which ranges they keep within limits, and the branches that were followed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from workflow.analysis import NothingSteadyError, followed_axis, limit_sentence, limits
from workflow.plots import branches
from workflow.report._html import image, prose, tag
from workflow.report._sections import Drawn, any_ok

if TYPE_CHECKING:
    import xarray as xr

_ALONG = ("steady_max_temperature", "steady_impulse", "floquet_multiplier")


def along_branches(dataset: xr.Dataset) -> Drawn:
    """Draw the branches of an archive, where it has any."""
    if followed_axis(dataset) is None or not any_ok(dataset):
        return Drawn([], None)
    about = "Solid: stable rubs; dashed: unstable ones. Beyond the fold where both meet a rub runs away or jumps."
    pictures = [image(branches(dataset, name), f"{name.replace('_', ' ')} along the branches") for name in _ALONG]
    body: list[str] = [tag("h2", "Branches"), tag("p", about, kind="muted"), tag("div", *pictures, kind="panels")]
    return Drawn(body, branches(dataset))


def where_it_settles(dataset: xr.Dataset) -> list[str]:
    """Say in which range of each axis every rub settles, as ``workflow limits`` without bounds."""
    try:
        found = limits(dataset)
    except NothingSteadyError:
        return []
    sentences = [tag("p", prose(limit_sentence(limit, dataset, {})), kind="quoted") for limit in found.limits]
    count = tag("p", f"{found.within} of {found.cases} settle, stay in contact or touch nothing.")
    return [tag("section", tag("h2", "Where it settles"), *sentences, count, kind="answer")]
