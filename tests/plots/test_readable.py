"""Pictures can be read: no text lies on another, each axis has its unit, each curve its own colour."""

from itertools import combinations
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from errors_over_steps import H, over_steps
from workflow.plots import Curve, convergence, metric_by_axis, scene_map, tip_response, work_precision
from workflow.report._figures import SELECTED, STATUS_COLOURS

SCHEMES = ("implicit_euler", "midpoint", "carpenter", "penalty_10", "penalty_100", "penalty_implicit", "event_driven")


def places(figure: Figure, texts: list[Any]) -> list[Any]:
    """Where some texts are in the drawn figure, without those that say nothing or are not drawn."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return [text.get_window_extent(canvas.get_renderer()) for text in texts if text.get_text() and text.get_visible()]


def assert_apart(figure: Figure, texts: list[Any], at_least: int) -> None:
    boxes = places(figure, texts)
    assert len(boxes) >= at_least
    assert not [(one, other) for one, other in combinations(boxes, 2) if one.overlaps(other)]


def grid(**axes: list[Any]) -> xr.Dataset:
    shape = tuple(map(len, axes.values()))
    return xr.Dataset(
        {
            "status": (tuple(axes), np.zeros(shape, np.int8)),
            "contact_impulse": (tuple(axes), np.arange(np.prod(shape), dtype=float).reshape(shape), {"units": "N s"}),
        },
        coords={name: list(values) for name, values in axes.items()},
    )


def test_ticks_of_a_metric_along_axes_are_apart() -> None:
    archive = grid(scheme=list(SCHEMES), h=list(H), gap=[1e-5 * k for k in range(2, 11)], alpha=[0.0, 1.0, 30.0])
    archive["gap"].attrs["units"], archive["alpha"].attrs["units"], archive["h"].attrs["units"] = "m", "W N-1", "s"
    figure = metric_by_axis(archive, "contact_impulse")
    assert [panel.get_xlabel() for panel in figure.axes] == ["scheme", "h [s]", "gap [µm]", "alpha [W/N]"]
    assert figure.axes[0].get_ylabel() == "contact impulse [N s]"
    assert_apart(figure, [tick for panel in figure.axes for tick in panel.get_xticklabels()], 20)
    assert [tick.get_text() for tick in figure.axes[0].get_xticklabels()] == list(SCHEMES)


def test_axes_that_vary_together_show_their_values() -> None:
    archive = grid(rub=[0, 1], alpha=[0.0, 1.0]).drop_vars("rub")
    archive = archive.assign_coords(
        mean=("rub", [30.0, 0.0], {"units": "N"}), gap=("rub", [1e-5, 2e-5], {"units": "m"})
    )
    panel = metric_by_axis(archive, "contact_impulse").axes[0]
    assert [tick.get_text() for tick in panel.get_xticklabels()] == ["30 + 10", "0 + 20"]
    assert panel.get_xlabel() == "mean [N] + gap [µm]"


@pytest.mark.parametrize("decades", [0.1, 0.7, 1.5, 4.0])
def test_times_of_work_precision_are_apart(decades: float) -> None:
    figure = work_precision(over_steps({"one": 100 * H}, seconds=np.logspace(-2, -2 - decades, H.size)))
    for panel in figure.axes:
        ticks = [*panel.get_xticklabels(), *panel.get_xticklabels(minor=True)]
        low, high = panel.get_xlim()
        assert_apart(figure, [tick for tick in ticks if low <= tick.get_position()[0] <= high], 2)


def test_names_of_slopes_are_below_the_crosses() -> None:
    """Up to six rows of crosses stand above what is drawn."""
    lost = dict.fromkeys(SCHEMES[1:5], 50 * H)
    figure = convergence(over_steps({"robust": 100 * H, **lost}, dict.fromkeys(lost, H < 2e-6)))
    FigureCanvasAgg(figure).draw()
    for panel in figure.axes[:3]:
        names = places(figure, [text for text in panel.texts if "slope" in text.get_text()])
        crosses = [one for one in panel.get_lines() if one.get_marker() == "x" and np.size(one.get_xdata())]
        lowest = min(panel.transAxes.transform((0, float(one.get_ydata()[0])))[1] for one in crosses)
        assert len(names) == 2
        assert max(box.y1 for box in names) < lowest


def test_names_of_slopes_are_apart_where_errors_hardly_change() -> None:
    figure = convergence(over_steps({"flat": 1e-3 * H**0.1}))
    for panel in figure.axes[:3]:
        assert_apart(figure, [text for text in panel.texts if "slope" in text.get_text()], 2)


def test_gaps_that_are_compared_are_named_where_there_is_room() -> None:
    t = np.linspace(0, 1, 11)
    curves = []
    for gap in np.append(1e-5 * np.arange(2, 11), 3e-4):
        data = {"displacement": ("t", gap * np.sin(t)), "status": ((), 0)}
        curves.append(Curve(xr.Dataset(data, coords={"t": t, "gap": gap}), f"gap {gap:g} m"))
    figure = tip_response(curves)
    assert_apart(figure, list(figure.axes[0].texts), 2)
    assert figure.axes[0].texts[-1].get_text() == "gap 300 µm"


def test_maps_without_a_value_are_left_out() -> None:
    """A tip at rest meets nothing in the first load period, so that no growth is known: that map was all grey."""
    archive = grid(gap=[1e-6, 2e-6, 3e-6, 4e-6], alpha=[0.0, 1.0, 2.0, 3.0])
    dims = ("gap", "alpha")
    impulse = archive["contact_impulse"] + 1.0
    archive = archive.assign(
        contact_impulse=impulse,
        period_impulse=xr.concat([0 * impulse, impulse], "period").transpose(*dims, "period"),
        period_contact=xr.concat([0 * impulse, 0.1 * impulse], "period").transpose(*dims, "period"),
        impacts=impulse, max_temperature=impulse, critical_alpha=0 * impulse + 2.5,
    )  # fmt: skip
    figure = scene_map(archive, "alpha", "gap")
    titles = [panel.get_title().split(" ")[0] for panel in figure.axes if panel.get_title()]
    assert titles == ["share", "impacts", "largest"]


def test_the_frame_of_the_selected_case_is_seen_on_every_status() -> None:
    assert SELECTED not in STATUS_COLOURS
    assert len(set(STATUS_COLOURS)) == len(STATUS_COLOURS)
