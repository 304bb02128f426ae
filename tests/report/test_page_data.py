"""What a page holds of an archive: thinned histories, rounded metrics, notable cases, and bounds of size."""

from typing import Any

import numpy as np
import pytest
import xarray as xr

from errors_over_steps import archive_of
from workflow.analysis import exact_partners, notable_cases, recommend
from workflow.plots._units import scaled
from workflow.report._explorer import described, on_screen, shown_part, thinned, thinned_times, three_digits
from workflow.report._figures import case_figures
from workflow.study import readable

RNG = np.random.default_rng(1)


def archive(**sizes: int) -> xr.Dataset:
    """An archive with errors that grow with h, scheme ``b`` exact; the last case diverges."""
    coords: dict[str, Any] = {name: np.arange(1, size + 1) * 1e-6 for name, size in sizes.items()}
    coords |= {"scheme": ["a", "b", "c"][: sizes["scheme"]] if "scheme" in sizes else "a"}
    scheme, h = (xr.DataArray(coords.get(name, 1e-3), dims=[name] * (name in sizes)) for name in ("scheme", "h"))
    error = (1e3 * h * (scheme != "b")).broadcast_like(xr.Dataset(coords=coords)).transpose(*sizes)
    dataset = archive_of(error.values, coords, processor_time=2e-3, max_temperature=RNG.random([*sizes.values()]))
    dataset["status"][(-1,) * len(sizes)] = 1
    return dataset


def test_thinning_keeps_the_least_and_the_largest_of_every_piece() -> None:
    values = RNG.normal(size=10_007)
    values[5000] = 50
    thin = thinned(values, 400)
    assert thin.size == thinned_times(np.linspace(0, 1, values.size), 400).size == 800
    assert (thin.min(), thin.max()) == (values.min(), 50)
    assert np.argmax(thin) / thin.size == pytest.approx(5000 / values.size, abs=2e-3)
    assert np.array_equal(thinned(values[:800], 400), values[:800])


def test_curves_are_rounded_within_a_thousandth_of_their_range() -> None:
    for scale in (1e-9, 1.0, 3e7):
        values = scale * np.array([1.0, -2.0, np.nan, 1e-3, np.inf, 3.0, np.pi / 4])
        finite = np.isfinite(values)
        kept = on_screen(values)
        assert np.array_equal(np.isfinite(kept), finite)
        assert kept[finite] == pytest.approx(values[finite], abs=5.01e-3 * scale)
        assert all(len(f"{value:.15g}") < 12 for value in kept[finite])
    for extreme in (np.zeros(4), np.full(4, np.nan), np.array([-1.7e308, 1.7e308])):
        assert np.array_equal(on_screen(extreme), extreme, equal_nan=True)


def test_metrics_keep_the_three_digits_that_a_page_shows() -> None:
    values = [2.7555631955617828, 9.994, -9.986, 0.9999, 0.0, *np.exp(RNG.uniform(-80, 80, 1000))]
    assert [f"{value:.3g}" for value in three_digits(np.array(values))] == [f"{value:.3g}" for value in values]
    assert np.isnan(three_digits(np.array([np.inf, np.nan]))).all()


def test_units_are_those_of_what_is_small() -> None:
    assert scaled("m", np.array([2e-5, 5e-5, 1e86])) == ("µm", 1e6)
    assert scaled("m", np.array([0.0, np.nan])) == ("m", 1.0)
    assert scaled("s", np.array([2e-3]))[0] == "ms"
    assert [readable(unit) for unit in ("m s-1", "W N-1", "s-1", "N s", "1")] == ["m/s", "W/N", "1/s", "N s", ""]


def test_the_first_case_is_the_worst_of_the_choice_and_each_extreme_is_named() -> None:
    dataset = archive(scheme=3, h=4, gap=5)
    notable = notable_cases(dataset, recommend(dataset, 0.0025).choice)
    scheme, step, _ = np.unravel_index(next(iter(notable)), (3, 4, 5))
    assert (scheme, step) == (0, 0) or scheme == 1
    named = {why: case for case, why in notable.items()}
    assert named["the first case that is diverged"] == 59
    hottest = np.where(dataset["status"] == 0, dataset["max_temperature"], 0)
    assert named["hottest tip"] == int(np.argmax(hottest))


def test_exact_partners_have_the_frequency_that_a_zip_gives_with_the_step() -> None:
    dataset = archive(scheme=2, f=3).assign_coords(h=("f", [4e-4, 2e-4, 1e-4]), frequency=("f", [1.0, 2.0, 4.0]))
    partners = exact_partners(dataset, {"b": "event_driven"}).reshape(2, 3)
    assert partners.tolist() == [[3, 4, -1]] * 2  # the last one diverged


def test_a_large_archive_is_shown_in_part_and_the_page_says_which() -> None:
    dataset = archive(h=3, alpha=90_000)
    notable = notable_cases(dataset, recommend(dataset, 0.0025).choice)
    shown = shown_part(dataset, notable)
    assert shown.dataset.sizes["h"] == 3
    assert 2000 <= shown.dataset.sizes["alpha"] <= 2000 + len(notable) + 1
    assert shown.left_out == (f"alpha: {shown.dataset.sizes['alpha']} of its 90000 values",)
    for one, case in zip(notable, shown.cases, strict=True):
        whole, part = np.unravel_index(one, (3, 90_000)), np.unravel_index(case, shown.dataset["status"].shape)
        assert dataset["alpha"][whole[1]] == shown.dataset["alpha"][part[1]]


def test_a_page_holds_as_many_metrics_as_fit_and_tells_which_it_leaves_out() -> None:
    dataset = archive(h=2, alpha=1000, gap=50)
    for k in range(20):
        dataset[f"extra_{k}"] = (dataset["status"].dims, RNG.random(dataset["status"].shape))
    notable = notable_cases(dataset, recommend(dataset, 0.0025).choice)
    shown = shown_part(dataset, notable)
    about = described(shown.dataset, shown.cases, {}, {})
    assert len(about["metrics"]) == 20
    assert about["left_out"][-1] == "extra 19"
    assert about["metrics"][0]["name"] == "error"
    values = about["metrics"][0]["values"]
    assert values[:-1] == pytest.approx(np.ravel(dataset["impulse_error"])[:-1], rel=5e-3)
    assert np.isnan(values[-1])  # it diverged


def test_panels_are_there_where_the_archive_has_their_axes() -> None:
    for dataset, parts in (
        (archive(scheme=3, h=4, gap=5), {"map", "controls", "cost", "order"}),
        (archive(gap=4), {"map", "controls"}),
    ):
        about = described(dataset, (0,), {}, {})
        assert set(case_figures(about | {"chosen_modes": None})) == parts


def test_orders_of_the_page_are_those_of_the_scheme_in_its_scene() -> None:
    dataset = archive(scheme=3, h=4, gap=5)
    order = described(dataset, (0,), {}, {})["order"].reshape(3, 4, 5)
    assert np.isnan(order[1]).all()  # without error
    assert order[0] == pytest.approx(np.ones((4, 5)))
