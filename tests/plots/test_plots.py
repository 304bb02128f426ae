"""Pictures show what they should on archives whose content is known, and can be read: no text lies on another."""

from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from errors_over_steps import H, archive_of, over_steps
from workflow.analysis import ERRORS
from workflow.plots import (
    Curve,
    convergence,
    histories,
    map_dims,
    metric_by_axis,
    save,
    scene_map,
    tip_response,
    work_precision,
)
from workflow.report._figures import SELECTED, STATUS_COLOURS

FOUND = over_steps(
    {"robust": 100 * H, "limited": 1e4 * H**2, "wild": np.where(H < 2e-6, 1e-3, 1e90), "exact": 0 * H},
    {"limited": H < 5e-6},
)


def crosses(panel: object) -> list[np.ndarray]:
    return [np.asarray(drawn.get_xdata()) for drawn in panel.get_lines() if drawn.get_marker() == "x"]  # type: ignore[attr-defined]


def test_work_precision(tmp_path: Path) -> None:
    figure = work_precision(FOUND, over_steps({"robust": 200 * H}))
    assert [panel.get_title() for panel in figure.axes] == ["impulse", "temperature", "displacement"]
    panel = figure.axes[0]
    labels = {drawn.get_label(): np.asarray(drawn.get_xdata()) for drawn in panel.get_lines()}
    assert labels["robust"].size == H.size
    assert labels["limited"].size == np.count_nonzero(H < 5e-6)
    assert labels["wild"].size == np.count_nonzero(H < 2e-6)
    assert any(label.startswith("exact: exact") for label in labels)
    lost = [x for x in crosses(panel) if x.size]
    assert [x.size for x in lost] == [np.count_nonzero(H > 5e-6), np.count_nonzero(H > 2e-6)]
    assert save(figure, tmp_path / "a.png").stat().st_size > 10_000


def test_convergence(tmp_path: Path) -> None:
    figure = convergence(FOUND)
    titles = [panel.get_title() for panel in figure.axes]
    assert titles[:3] == [f"{about}: relative L2 error" for about in ERRORS.values()]
    assert titles[3:] == ["largest penetration [m]", "|energy residual| / largest energy"]
    orders = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert orders == [f"order {order}, scatter 0.00" for order in ("1.00", "2.00", "0.00")]
    for panel in figure.axes[:3]:  # both slopes are named inside the panel
        slopes = [text for text in panel.texts if "slope" in text.get_text()]
        assert [text.get_text() for text in slopes] == ["slope 1", "slope 2"]
        assert all(text.xy[1] < panel.get_ylim()[1] for text in slopes)
    assert save(figure, tmp_path / "a.png").stat().st_size > 10_000


def test_a_line_of_too_few_points_has_neither_order_nor_scatter() -> None:
    figure = convergence(over_steps({"short": 100 * H, "exact": 0 * H}, {"short": H < 5e-7}))
    assert figure.axes[0].get_legend() is None


def test_residuals_of_rounding_are_drawn_and_every_column_has_its_steps() -> None:
    """A residual below 1e-12 had no point, and the third column, of one row, no numbers at its axis."""
    exact_balance = FOUND.copy(deep=True)
    exact_balance["energy_residual"][0] = 1e-16
    figure = convergence(exact_balance)
    *_, third, _, residuals = figure.axes
    assert np.asarray(residuals.get_lines()[0].get_ydata()).tolist() == [1e-16] * H.size
    assert third.get_xlabel() == "step h [s]"
    assert all(tick.label1.get_visible() for tick in third.xaxis.get_major_ticks())


def test_convergence_of_schemes_that_are_all_lost(tmp_path: Path) -> None:
    lost = over_steps({"lost": H, "exact": 0 * H}, {"lost": H < 0})
    save(convergence(lost), tmp_path / "a.png")
    save(work_precision(lost.isel(scheme=[0])), tmp_path / "b.png")


def test_an_overview_leaves_out_what_is_not_ok() -> None:
    t = np.linspace(0, 1, 11)
    archive = xr.Dataset(
        {
            "status": (("scheme", "h"), np.array([[0, 1], [1, 1], [0, 0]], dtype=np.int8)),
            "displacement": (("scheme", "h", "t"), np.ones((3, 2, 11)) * np.array([1.0, 1e30, 2.0])[:, None, None]),
        },
        coords={"scheme": ["a", "b", "c"], "h": [1e-4, 1e-3], "t": t, "gap": 3.0},
    )
    figure = histories(archive)
    drawn = [one for one in figure.axes[0].get_lines() if len(np.asarray(one.get_xdata())) == t.size]
    assert [one.get_label() for one in drawn] == ["scheme a", "scheme c"]
    assert figure.axes[0].get_ylim()[1] < 10
    lost = archive.copy(deep=True)
    lost["status"][:, 0] = 1
    assert len(histories(lost).axes) == 1  # the finest is lost in every scheme: whatever is ok


def scene(values: int) -> xr.Dataset:
    """Three loads; the tip touches where the load is above the gap, for a share of the period that grows with α."""
    coords = {
        "amplitude": [4.0, 5.0, 6.0],
        "gap": np.linspace(1e-6, 9e-6, values),
        "alpha": np.linspace(0, 5, values + 1),
    }
    load, gap, alpha = np.meshgrid(*coords.values(), indexing="ij")
    dims, touches = tuple(coords), load > 1e6 * gap
    impulse = np.where(touches, load - 1e6 * gap, 0.0)
    data = {
        "status": (dims, np.zeros(load.shape, np.int8)),
        "contact_impulse": (dims, impulse),
        "period_impulse": ((*dims, "period"), np.stack([impulse, impulse * (1 + alpha), impulse * np.nan], axis=-1)),
        "period_contact": ((*dims, "period"), np.stack([touches * 0.1, touches * alpha / 5, alpha * np.nan], axis=-1)),
        "impacts": (dims, 4.0 * touches),
        "max_temperature": (dims, impulse * alpha),
        "critical_alpha": (dims, np.full(load.shape, 2.75)),
    }
    dataset = xr.Dataset(data, coords=coords)
    dataset["gap"].attrs["units"], dataset["alpha"].attrs["units"] = "m", "W N-1"
    return dataset


def test_maps_of_a_scene(tmp_path: Path) -> None:
    dataset = scene(8)
    dims = map_dims(dataset)
    assert dims == ("alpha", "gap")
    figure = scene_map(dataset, *dims)
    growth, share, impacts, hot = (panel for panel in figure.axes if panel.get_title())
    assert (impacts.get_xlabel(), impacts.get_ylabel()) == ("alpha [W/N]", "gap [µm]")
    touches = dataset["gap"].values < 5e-6
    drawn = {panel: np.ma.filled(panel.collections[0].get_array(), np.nan) for panel in (growth, share, impacts, hot)}
    for panel, expected in ((growth, 1 + dataset["alpha"]), (share, dataset["alpha"] / 5)):
        assert np.allclose(drawn[panel][touches], expected.values)
        assert np.isnan(drawn[panel][~touches]).all()
    assert np.nanmax(drawn[hot]) == 5 * (5 - 1)
    assert any(line.get_xdata()[0] == 2.75 for line in hot.get_lines())
    assert save(figure, tmp_path / "a.png").stat().st_size > 10_000


def test_a_map_along_one_value_is_a_strip() -> None:
    strip = scene(8).isel(gap=[2])
    for figure in (scene_map(strip, "alpha", "gap"), scene_map(strip, "gap", "alpha", "contact_impulse")):
        panel = figure.axes[0]
        low, high = sorted(panel.get_ylim() if panel.get_ylabel() == "gap [µm]" else panel.get_xlim())
        assert low < 1e6 * strip["gap"].item() < high
        assert np.isfinite(panel.collections[0].get_array()).all()


def test_maps_need_two_long_axes_and_load_periods() -> None:
    assert map_dims(scene(3)) is None
    assert map_dims(scene(4).drop_vars("period_impulse")) is None


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
    shape = [len(values) for values in axes.values()]
    dataset = archive_of(0.0, axes, contact_impulse=np.arange(np.prod(shape), dtype=float).reshape(shape))
    dataset["contact_impulse"].attrs["units"] = "N s"
    return dataset


def test_ticks_of_a_metric_along_axes_are_apart() -> None:
    archive = grid(scheme=list(SCHEMES), h=list(H), gap=[1e-5 * k for k in range(2, 11)], alpha=[0.0, 1.0, 30.0])
    archive["gap"].attrs["units"], archive["alpha"].attrs["units"], archive["h"].attrs["units"] = "m", "W N-1", "s"
    figure = metric_by_axis(archive, "contact_impulse")
    assert [panel.get_xlabel() for panel in figure.axes] == ["scheme", "h [s]", "gap [µm]", "alpha [W/N]"]
    assert figure.axes[0].get_ylabel() == "contact impulse [N s]"
    assert_apart(figure, [tick for panel in figure.axes for tick in panel.get_xticklabels()], 20)
    assert [tick.get_text() for tick in figure.axes[0].get_xticklabels()] == list(SCHEMES)


@pytest.mark.parametrize("axes", [{"alpha": [0, 1]}, {"alpha": [0, 1], "gap": [1e-5, 2e-5]}])
def test_the_legend_of_few_axes_is_inside_the_figure(axes: dict[str, list[float]]) -> None:
    figure = metric_by_axis(grid(**axes), "contact_impulse")
    for name in places(figure, figure.legends[0].get_texts()):
        assert name.x0 >= 0
        assert name.x1 <= figure.bbox.x1


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
