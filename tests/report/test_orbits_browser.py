"""Steady rubs on the page in a real browser: a click on a case, or on a point of a branch, shows its orbit."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from browser import MODEL, cell, click, errors, opened, window
from studies import steady_study
from workflow.analysis import labels
from workflow.archive import open_archive
from workflow.report import write_report
from workflow.run import run_study

MODES = {"mechanical_modes": 1, "thermal_modes": 3}


@pytest.fixture
def driver() -> Any:
    return window(1366)


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


def test_a_click_on_the_map_shows_the_steady_rub_of_the_case(driver: Any, tmp_path: Path) -> None:
    axes = {**MODES, "alpha": [0, 2, 30], "scene.casing.gap": [20e-6, 22e-6]}
    dataset = run_study(steady_study(axes), tmp_path / "rubs.nc").dataset
    opened(driver, write_report(tmp_path / "rubs.nc").page)
    for column, row in ((1, 0), (0, 1)):  # α across, gap up
        click(driver, "map", cell(column, row, 3, 2))
        assert_is_orbit(shown(driver), dataset.isel(alpha=column, gap=row))
        about = driver.execute_script("return document.getElementById('orbit-about').textContent")
        assert about == "settles. Phase plane, then one period."
    click(driver, "map", cell(2, 1, 3, 2))
    assert shown(driver)["x"].size == 0
    about = driver.execute_script("return document.getElementById('orbit-about').textContent")
    assert about == "runs away. The page holds no steady rub of this case."
    assert errors(driver) == []


def test_a_click_on_a_point_of_a_branch_shows_its_orbit(driver: Any, tmp_path: Path) -> None:
    axes = {**MODES, "scene.casing.gap": [20e-6, 22e-6], "alpha": {"branch": [0, 12, 12]}}
    run_study(steady_study(axes), tmp_path / "branches.nc")
    opened(driver, write_report(tmp_path / "branches.nc").page)
    with open_archive(tmp_path / "branches.nc") as dataset:
        folds = labels(dataset["bifurcation"]).values == "fold"
        number = int(np.flatnonzero(folds[np.isfinite(dataset["alpha"].values)])[0])
        branch, point = np.argwhere(folds)[0]
        place = f"(({{x, y}}) => [box.x_scale.compute(x[{number}]), box.y_scale.compute(y[{number}])])"
        click(driver, "branches", f"{place}(model('branch_points').data)")
        one = dataset.isel(gap=branch, point=point)
        here = driver.execute_script(MODEL + "const {x, y} = model('branch_here').data; return [x[0], y[0]]")
        assert here == pytest.approx([float(one["alpha"]), float(one["steady_max_temperature"])])
        assert_is_orbit(shown(driver), one)
        about = driver.execute_script("return document.getElementById('orbit-about').textContent")
        assert about.startswith(f"gap {1e6 * float(one['gap']):g} µm: ")
        assert "fold. Phase plane" in about
    assert errors(driver) == []
