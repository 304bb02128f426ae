"""The site that MkDocs builds: no broken link, nothing of another host, and a search that works from a file."""

import re
import subprocess
import sys
import time
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

from browser import errors, opened, window

ROOT = Path(__file__).parents[1]
pytestmark = pytest.mark.slow


class Links(HTMLParser):
    """What a page names: links, what it loads, and where it can be entered."""

    def __init__(self, page: Path) -> None:
        super().__init__()
        self.links: set[str] = set()
        self.loaded: set[str] = set()
        self.anchors: set[str] = set()
        self.feed(page.read_text(encoding="utf-8"))

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.add(given["href"])
        elif tag == "link" and given.get("rel") not in ("canonical", "next", "prev"):
            self.loaded.add(given["href"])
        elif "src" in given:
            self.loaded.add(given["src"])


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built where the extra ``docs`` is installed."""
    for module in ("latex2mathml", "mkdocs_jupyter", "mkdocstrings_handlers.python", "material"):
        pytest.importorskip(module)
    place = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(place)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return place


@pytest.fixture(scope="module")
def pages(site: Path) -> dict[Path, Links]:
    return {page: Links(page) for page in site.rglob("*.html")}


def test_no_link_is_broken(pages: dict[Path, Links]) -> None:
    broken = []
    for page, found in pages.items():
        for link in found.links | found.loaded:
            parts = urlsplit(link)
            if parts.scheme or parts.netloc:
                continue
            target = (page.parent / unquote(parts.path)).resolve() if parts.path else page
            anchors = pages[target].anchors if target in pages else set()
            if not target.is_file() or (parts.fragment and anchors and unquote(parts.fragment) not in anchors):
                broken.append(f"{page.name}: {link}")
    assert broken == []


def test_nothing_is_loaded_from_another_host(site: Path, pages: dict[Path, Links]) -> None:
    foreign = {link for found in pages.values() for link in found.loaded if urlsplit(link).scheme not in ("", "data")}
    assert foreign == set()
    assert sum(file.stat().st_size for file in site.rglob("*") if file.is_file()) < 40e6


def test_every_public_name_is_in_the_api(pages: dict[Path, Links]) -> None:
    import workflow

    anchors = set().union(*(found.anchors for page, found in pages.items() if page.parent.name == "api"))
    for name in workflow._EXPORTS:
        assert name == "plots" or f"{workflow._EXPORTS[name]}.{name}" in anchors


def test_formulas_are_set_headings_imported_and_the_page_of_a_study_is_live(site: Path) -> None:
    equations = (site / "pages" / "equations.html").read_text(encoding="utf-8")
    assert equations.count("<math") > 40
    assert "arithmatex" not in equations
    api = (site / "pages" / "api" / "python.html").read_text(encoding="utf-8")
    assert re.search(r"<h3[^>]*>\s*workflow\.read_study", api)
    assert not (site / "404.html").exists()  # its links would be absolute
    driver = window(400)
    opened(driver, site / "blade.html")
    assert driver.find_element("id", "figure-map").is_displayed()


def test_it_is_searched_from_a_file(site: Path) -> None:
    driver = window(1366)
    driver.get((site / "index.html").as_uri())
    field = driver.find_element("css selector", "input.md-search__input")
    driver.execute_script("arguments[0].focus()", field)
    field.send_keys("clearance")
    for _ in range(100):
        found = driver.find_elements("css selector", ".md-search-result__item")
        if found:
            break
        time.sleep(0.1)
    assert found
    assert errors(driver) == []
