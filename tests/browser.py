"""A real browser for tests of pages: Chromium without a window, driven by Selenium."""

import atexit
import os
import shutil
import time
from functools import cache
from pathlib import Path
from typing import Any

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")

MODEL = """
const model = (name) => Bokeh.documents.map((one) => one.get_model_by_name(name)).find((one) => one != null) ?? null;
"""
"""JavaScript that finds a part of the page's figures by its name."""

DEEP = """
const deep = (root, kind) => [...root.querySelectorAll(kind),
  ...[...root.querySelectorAll("*")].flatMap((one) => (one.shadowRoot ? deep(one.shadowRoot, kind) : []))];
"""
"""JavaScript that finds elements in shadow trees too."""


def _executable(*names: str) -> str:
    """Return the path of a program; without it the test is skipped, or fails where ``REQUIRE_BROWSER`` is set."""
    path = next(filter(None, map(shutil.which, names)), None)
    if path is None and os.environ.get("REQUIRE_BROWSER"):
        pytest.fail(f"no {names[0]} on this machine: apt-get install chromium chromium-driver")
    if path is None:
        pytest.skip(f"no {names[0]} on this machine")
    return path


def window(width: int) -> Any:
    """Return the browser of this process, its window so many pixels wide; skip or fail where there is none."""
    driver = _driver()
    metrics = {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": width < 600}
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)
    errors(driver)  # of pages before
    return driver


@cache
def _driver() -> Any:
    """Start a browser, which ends with this process."""
    browser, driver_path = _executable(*NAMES), _executable("chromedriver")
    from selenium import webdriver
    from selenium.webdriver.chrome.service import Service

    options = webdriver.ChromeOptions()
    options.binary_location = browser
    for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--hide-scrollbars"):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(driver_path))
    atexit.register(driver.quit)
    return driver


def opened(driver: Any, page: Path) -> None:
    """Open a page and wait until its script has drawn everything."""
    driver.get(page.resolve().as_uri())
    for _ in range(600):
        if driver.execute_script("return document.body.dataset.ready"):
            break
        time.sleep(0.1)
    assert driver.execute_script("return document.body.dataset.ready") == "yes", errors(driver)
    settle(driver)


def text_of(driver: Any, identity: str) -> str:
    """Return what an element of the page says."""
    return str(driver.execute_script("return document.getElementById(arguments[0]).textContent", identity))


def settle(driver: Any) -> None:
    """Wait until what was asked for is painted."""
    driver.execute_async_script("const done = arguments[0]; setTimeout(() => requestAnimationFrame(() => done()), 200)")


def click(driver: Any, figure: str, at: str) -> None:
    """Click on a figure, at x and y in its pixels that JavaScript gives; ``box`` is its frame."""
    from selenium.webdriver.common.action_chains import ActionChains

    script = f"""
      document.getElementById("figure-{figure}").scrollIntoView({{block: "center"}});
      const box = Bokeh.index.get_one(model("{figure}")).frame;
      const seen = document.getElementById("figure-{figure}").firstElementChild.getBoundingClientRect();
      const [x, y] = {at};
      return [seen.left + x, seen.top + y];
    """
    actions = ActionChains(driver)
    actions.w3c_actions.pointer_action.move_to_location(*map(round, driver.execute_script(MODEL + script)))
    actions.w3c_actions.pointer_action.click()
    actions.perform()
    settle(driver)
    settle(driver)


def cell(column: int, row: int, columns: int, rows: int) -> str:
    """Return where a map of so many columns and rows has a cell, for :func:`click`."""
    across, up = (column + 0.4) / columns, (row + 0.4) / rows
    return f"[box.bbox.x0 + box.bbox.width * {across}, box.bbox.y1 - box.bbox.height * {up}]"


def errors(driver: Any) -> list[str]:
    """Return what the console has complained of since it was asked last."""
    return [entry["message"] for entry in driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]
