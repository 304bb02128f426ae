"""Pictures show what they should: lines, crosses, predictions, on archives whose content is known."""

from pathlib import Path

import numpy as np
import xarray as xr

from errors_over_steps import H, over_steps
from workflow.analysis import ERRORS
from workflow.plots import convergence, histories, map_dims, save, scene_map, work_precision

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
