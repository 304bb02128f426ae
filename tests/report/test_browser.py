"""The page of a report in a real browser: nothing complains, sliders, clicks and menus show what the archive holds."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray as xr

from browser import DEEP, MODEL, cell, click, errors, opened, settle, text_of, window
from studies import SCENE, SINGLE, archived, parsed, steady_study
from workflow.analysis import labels
from workflow.archive import open_archive
from workflow.report import write_report
from workflow.run import run_study
from workflow.study import Study

STUDY = (
    "study: page\ntitle: Two schemes, three couplings and a step that diverges\n"
    + SCENE
    + """
axes: {scheme: [moreau, carpenter, event_driven], h: [2e-6, 1e-5, 1e-3], e: [0, 0.5], alpha: [0, 5, 10]}
zip: {model: {mechanical_modes: [1, full], thermal_modes: [2, full]}}
reference: {scheme: event_driven, mechanical_modes: full, thermal_modes: full}
output: {interval: 0.2 ms}
"""
)


archive = archived(parsed(STUDY))


@pytest.fixture(scope="module")
def page(archive: Path) -> Path:
    return write_report(archive).page


@pytest.fixture
def wide() -> Any:
    return window(1366)


def run_and_open(driver: Any, study: Study, place: Path) -> xr.Dataset:
    """Run a study, open the page of its archive and return what that holds."""
    dataset = run_study(study, place / "a.nc").dataset
    opened(driver, write_report(place / "a.nc").page)
    assert errors(driver) == []
    return dataset


def selected(driver: Any) -> dict[str, str]:
    """Values of the sliders, by the name of their axis."""
    names = ["scheme", "model", "h", "e", "alpha"]
    script = MODEL + "return arguments[0].map((name) => model(`slider_${name}`).value)"
    return dict(zip(names, driver.execute_script(script, names), strict=True))


def drawn(driver: Any, source: str, column: str) -> np.ndarray:
    script = MODEL + "return Array.from(model(arguments[0]).data[arguments[1]])"
    return np.asarray(driver.execute_script(script, source, column), dtype=float)


def case(dataset: xr.Dataset, chosen: dict[str, str]) -> xr.Dataset:
    """The case of an archive that sliders name."""
    model = [
        f"{m} + {t}" for m, t in zip(dataset["mechanical_modes"].values, dataset["thermal_modes"].values, strict=True)
    ]
    numbers = {name: float(chosen[name]) for name in ("h", "e", "alpha")}
    return dataset.isel(model=model.index(chosen["model"])).sel(scheme=chosen["scheme"], **numbers)


def assert_shows(driver: Any, dataset: xr.Dataset) -> None:
    """The curves are those of the case that the sliders name, and its exact solution stands behind it."""
    chosen = selected(driver)
    one = case(dataset, chosen)
    exact = dataset.isel(model=-1).sel(
        scheme="event_driven", h=1e-5, e=float(chosen["e"]), alpha=float(chosen["alpha"])
    )
    itself = chosen["scheme"] == "event_driven" and chosen["model"] == "3 + 3" and chosen["h"] == "2e-06"
    for name, factor in (("displacement", 1e6), ("temperature", 1.0), ("contact_force", 1.0)):
        for source, held in (("chosen", one), ("exact", exact)):
            if source == "exact" and itself:
                continue
            values = held[name].values * factor
            if np.isfinite(values).all():
                assert drawn(driver, source, name) == pytest.approx(values, abs=1e-3 * np.ptp(values) + 1e-300)
    assert drawn(driver, "chosen", "t") == pytest.approx(one["t"].values)
    assert drawn(driver, "gap", "gap") == pytest.approx([50.0, 50.0])


def press(driver: Any, place: int, key: str) -> None:
    """Press a key on the handle of a slider."""
    handle = driver.execute_script(DEEP + "return deep(document, '.noUi-handle')[arguments[0]]", place)
    handle.send_keys(key)
    settle(driver)


def test_a_page_opens_without_complaint_and_asks_for_nothing(wide: Any, page: Path) -> None:
    opened(wide, page)
    assert errors(wide) == []
    assert wide.execute_script("return performance.getEntriesByType('resource').length") == 0
    assert wide.execute_script("return document.documentElement.scrollWidth") <= 1366
    assert page.stat().st_size < 6_000_000
    for name in ("map", "case", "controls", "cost", "order", "modes", "periods"):
        assert wide.execute_script("return document.getElementById(arguments[0]).clientHeight", f"figure-{name}") > 100


def test_a_slider_changes_the_curve(wide: Any, page: Path, archive: Path) -> None:
    from selenium.webdriver.common.keys import Keys

    opened(wide, page)
    with open_archive(archive) as dataset:
        assert_shows(wide, dataset)
        before, curve = selected(wide), drawn(wide, "chosen", "temperature")
        key = Keys.ARROW_LEFT if before["alpha"] == "10" else Keys.ARROW_RIGHT
        press(wide, 4, key)
        after = selected(wide)
        assert {name for name in after if after[name] != before[name]} == {"alpha"}
        assert np.ptp(drawn(wide, "chosen", "temperature") - curve) > 0
        assert_shows(wide, dataset)
        assert f"alpha={float(after['alpha']):g}" in text_of(wide, "case-command")
    assert errors(wide) == []


def test_a_click_on_the_map_selects_the_case(wide: Any, page: Path, archive: Path) -> None:
    opened(wide, page)
    with open_archive(archive) as dataset:
        for column, row in ((2, 0), (0, 1), (1, 2)):  # h across, scheme up
            click(wide, "map", cell(column, row, 3, 3))
            now = selected(wide)
            assert float(now["h"]) == float(dataset["h"][column])
            assert now["scheme"] == str(dataset["scheme"].values[row])
            assert_shows(wide, dataset)
    assert errors(wide) == []


def test_a_button_shows_a_hard_case_and_menus_change_the_map(wide: Any, page: Path, archive: Path) -> None:
    opened(wide, page)
    wide.execute_script(
        "for (const button of document.querySelectorAll('button[data-case]'))"
        " if (button.closest('tr').textContent.includes('diverged')) button.click()"
    )
    settle(wide)
    with open_archive(archive) as dataset:
        assert int(case(dataset, selected(wide))["status"]) == 1
    assert "diverged" in text_of(wide, "case-status")
    script = MODEL + "model('metric').value = 'status'; model('across').value = 'alpha'; model('up').value = 'e'"
    wide.execute_script(script)
    settle(wide)
    shown = wide.execute_script(MODEL + "return Array.from(model('cells_statuses').data.image[0])")
    assert shown == [1.0] * 6  # carpenter at 1 ms
    assert errors(wide) == []


def test_the_line_under_the_map_is_of_the_case_that_is_selected(wide: Any, page: Path) -> None:
    """By a button as by a slider, and from the beginning."""
    opened(wide, page)

    first = text_of(wide, "case-labels")
    assert text_of(wide, "map-here").startswith(f"{first}: ")
    wide.execute_script("[...document.querySelectorAll('button[data-case]')].at(-1).click()")
    settle(wide)
    shown = text_of(wide, "case-labels")
    assert shown != first
    assert text_of(wide, "map-here").startswith(f"{shown}: ")


def test_a_page_is_readable_at_400_pixels(page: Path) -> None:
    narrow = window(400)
    opened(narrow, page)
    assert errors(narrow) == []
    assert narrow.execute_script("return document.documentElement.scrollWidth") <= 400
    shown = narrow.execute_script(MODEL + "return model('map_x').ticker.ticks.length")
    assert 1 <= shown <= 3


@pytest.mark.slow
def test_maps_of_a_scene_stand_below_each_other_at_400_pixels(tmp_path: Path) -> None:
    """Two beside each other on a wide screen; on a narrow one nothing of them is out of sight."""
    study = "study: rub\n" + SCENE + "axes: {scheme: event_driven, e: {lin: [0, 0.6, 4]}, alpha: {lin: [0, 2, 5]}}\n"
    run_study(parsed(study + "output: {interval: 1 ms, histories: [], balances: false}\n"), tmp_path / "rub.nc")
    page = write_report(tmp_path / "rub.nc").page
    script = """return [...document.querySelectorAll('.panels img')].map((one) => one.getBoundingClientRect())
      .map((box) => [box.left, box.right, box.top])"""
    for width, rows in ((1366, 2), (400, 4)):
        driver = window(width)
        opened(driver, page)
        boxes = np.array(driver.execute_script(script))
        assert boxes.shape == (4, 3)
        assert boxes[:, 0].min() >= 0
        assert boxes[:, 1].max() <= width
        assert len(set(boxes[:, 2].round())) == rows


def test_one_case_has_a_page(wide: Any, tmp_path: Path) -> None:
    run_and_open(wide, parsed(SINGLE), tmp_path)
    assert drawn(wide, "chosen", "displacement").size == 61
    assert "no reference" in wide.execute_script("return document.querySelector('.answer').textContent")
    assert wide.execute_script("return document.getElementById('figure-map')") is None
    message = text_of(wide, "case-exact")
    assert "holds no exact case" in message


def test_drawn_numbers_are_points_of_the_map(wide: Any, tmp_path: Path) -> None:
    drawn_zip = "zip: {design: {sample: random, points: 4, of: {scene.casing.gap: [40 um, 60 um], alpha: [0, 10]}}}\n"
    study = parsed(
        "study: drawn\n" + SCENE + "axes: {scheme: event_driven}\n" + drawn_zip + "output: {interval: 1 ms}\n"
    )
    dataset = run_and_open(wide, study, tmp_path)
    assert drawn(wide, "points", "x") == pytest.approx(1e6 * dataset["gap"].values)
    assert drawn(wide, "points", "y") == pytest.approx(dataset["alpha"].values)
    images = "return ['linear', 'log', 'states', 'statuses'].map((name) => model(`image_${name}`).visible)"
    assert wide.execute_script(MODEL + images) == [False] * 4  # nothing lies over the points


def test_ticks_of_a_tip_that_has_run_away_are_short(wide: Any, page: Path) -> None:
    opened(wide, page)
    script = MODEL + "return model('panel_temperature').left[0].formatter.doFormat(arguments[0], {loc: 0})"
    assert max(map(len, wide.execute_script(script, [0, 5e16, 1e17, 1.5e17]))) < 10
    assert wide.execute_script(script, [0, 0.0005, 0.001]) == ["0", "0.0005", "0.001"]


def test_load_periods_that_are_alike_are_a_level_line(wide: Any, tmp_path: Path) -> None:
    """Without heat every period is as the one before; ticks that differ by rounding would all read the same."""
    study = "study: alike\n" + SCENE + "axes: {scheme: event_driven, e: 0, alpha: [0, 50], h: 1e-5}\n"
    damped = parsed(study + "output: {interval: 1 ms}\n").with_({"scene.chain.damping.mass": 400.0})
    run_and_open(wide, damped, tmp_path)
    for alpha, alike in (("0", True), ("50", False)):
        wide.execute_script(MODEL + "model('slider_alpha').value = arguments[0]", alpha)
        settle(wide)
        impulse = drawn(wide, "period_impulses", "impulse")
        script = MODEL + "const range = model('periods').y_range; return [range.start, range.end]"
        low, high = wide.execute_script(script)
        assert low < impulse.min()
        assert high > impulse.max()
        assert (np.ptp(impulse) < 1e-3 * impulse.max()) == alike
        assert high - low > 0.9e-3 * impulse.max()
        text = text_of(wide, "periods-about")
        assert ("of the largest." in text) == alike
        script = (
            MODEL
            + """
        const { ticker, formatter } = model("periods_y"), range = model("periods").y_range;
        const ticks = ticker.get_ticks(range.start, range.end, range, NaN).major;
        return [ticks, formatter.doFormat(ticks, { loc: 0 })]"""
        )
        ticks, labels = wide.execute_script(script)
        assert 3 <= len(ticks) <= 8
        assert len(set(labels)) == len(ticks)


def test_the_worn_depth_is_that_of_the_case_that_is_selected(wide: Any, tmp_path: Path) -> None:
    axes = "axes: {scheme: moreau, alpha: [0, 50], h: 1e-5}\n"
    study = parsed("study: worn\n" + SCENE + axes + "output: {interval: 1 ms, balances: false}\n")
    coating = {"yield_force": 20, "hardening": 1e6, "sectors": 8}
    casing = {"gap": 5e-5, "flexibility": 1e-7, "coating": coating}
    dataset = run_and_open(wide, study.with_({"scene.casing": casing, "scene.speed": 50.0}), tmp_path)
    for k, alpha in enumerate(("0", "50")):
        wide.execute_script(MODEL + "model('slider_alpha').value = arguments[0]", alpha)
        settle(wide)
        depth = 1e6 * dataset["worn_depth"][k].values
        assert drawn(wide, "worn_depths", "depth")[::2] == pytest.approx(depth, abs=0.01 * depth.max())
        about = f"At the end; largest {depth.max():.3g} µm, mean {depth.mean():.3g} µm."
        assert text_of(wide, "worn-about") == about


MODES = {"mechanical_modes": 1, "thermal_modes": 3}


def shown(driver: Any) -> dict[str, np.ndarray]:
    """Return the orbit that the page draws."""
    script = "const data = model('orbit').data; return Object.fromEntries("
    script += "Object.keys(data).map((name) => [name, Array.from(data[name])]))"
    return {name: np.array(values) for name, values in driver.execute_script(MODEL + script).items()}


def assert_is_orbit(orbit: dict[str, np.ndarray], kept: Any) -> None:
    """What is drawn is what the archive keeps, closed."""
    for name, factor, variable in (("x", 1e6, "displacement"), ("v", 1, "velocity"), ("temperature", 1, "temperature")):
        values = factor * kept[f"orbit_{variable}"].values
        assert orbit[name] == pytest.approx(np.append(values, values[0]), abs=1e-3 * np.ptp(values) + 1e-300)
    assert (orbit["phase"][0], orbit["phase"][-1]) == (0, 1)


def test_a_click_on_the_map_shows_the_steady_rub_of_the_case(wide: Any, tmp_path: Path) -> None:
    axes = {**MODES, "alpha": [0, 2, 30], "scene.casing.gap": [20e-6, 22e-6]}
    dataset = run_and_open(wide, steady_study(axes), tmp_path)
    for column, row in ((1, 0), (0, 1)):  # α across, gap up
        click(wide, "map", cell(column, row, 3, 2))
        assert_is_orbit(shown(wide), dataset.isel(alpha=column, gap=row))
        assert text_of(wide, "orbit-about") == "settles. Phase plane, then one period."
    click(wide, "map", cell(2, 1, 3, 2))
    assert shown(wide)["x"].size == 0
    assert text_of(wide, "orbit-about") == "runs away. The page holds no steady rub of this case."
    assert errors(wide) == []


def test_a_click_on_a_point_of_a_branch_shows_its_orbit(wide: Any, tmp_path: Path) -> None:
    axes = {**MODES, "scene.casing.gap": [20e-6, 22e-6], "alpha": {"branch": [0, 12, 12]}}
    dataset = run_and_open(wide, steady_study(axes), tmp_path)
    folds = labels(dataset["bifurcation"]).values == "fold"
    number = int(np.flatnonzero(folds[np.isfinite(dataset["alpha"].values)])[0])
    branch, point = np.argwhere(folds)[0]
    place = f"(({{x, y}}) => [box.x_scale.compute(x[{number}]), box.y_scale.compute(y[{number}])])"
    click(wide, "branches", f"{place}(model('branch_points').data)")
    one = dataset.isel(gap=branch, point=point)
    here = wide.execute_script(MODEL + "const {x, y} = model('branch_here').data; return [x[0], y[0]]")
    assert here == pytest.approx([float(one["alpha"]), float(one["steady_max_temperature"])])
    assert_is_orbit(shown(wide), one)
    about = text_of(wide, "orbit-about")
    assert about.startswith(f"gap {1e6 * float(one['gap']):g} µm: ")
    assert "fold. Phase plane" in about
    assert errors(wide) == []
