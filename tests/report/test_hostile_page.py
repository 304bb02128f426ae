"""A page shows what an archive claims and does nothing that it says."""

import base64
import hashlib
import json
import re
import zlib
from html.parser import HTMLParser
from pathlib import Path

import pytest

from browser import DEEP, opened, window
from hostile import ESCAPES, SCRIPT, changed, crafted
from studies import SMALL, archived, parsed
from terminal import told
from workflow.report import write_report

LABEL = "a" * 64
"""Room for what is written in its place."""

STUDY = SMALL.replace("axes:", f"schemes: {{{LABEL}: {{method: moreau}}}}\naxes:\n  scheme: [{LABEL}, moreau]")


sound = archived(parsed(STUDY))


class Tags(HTMLParser):
    """The tags and attributes of a page, and its scripts."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.tags: set[str] = set()
        self.attributes: set[str] = set()
        self.policy = ""
        self.scripts: list[str] = []
        self.blocks: list[str] = []
        self._inside: list[str] | None = None
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.add(tag)
        self.attributes |= {name for name, _ in attrs}
        by_name = dict(attrs)
        if by_name.get("http-equiv") == "Content-Security-Policy":
            self.policy = by_name["content"] or ""
        if tag == "script":
            assert by_name.get("type") in (None, "text/plain")
            self._inside = self.scripts if "type" not in by_name else self.blocks
            self._inside.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = None

    def handle_data(self, data: str) -> None:
        if self._inside is not None:
            self._inside[-1] += data

    @property
    def hashes(self) -> set[str]:
        """What a policy has to say so that the scripts run."""
        digests = [hashlib.sha256(script.encode()).digest() for script in self.scripts]
        return {f"'sha256-{base64.b64encode(digest).decode()}'" for digest in digests}


@pytest.fixture(scope="module")
def pages(sound: Path, tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """The page of one crafted archive, and that of two."""
    directory = tmp_path_factory.mktemp("pages")
    archive = changed(sound, directory / "<b>a&'\".nc", crafted(SCRIPT + ESCAPES + r" $\frac"))
    pages = [write_report(archive).page, write_report([archive, sound], directory / "both.html").page]
    return [page.read_text(encoding="utf-8") for page in pages]


CONTROL = "[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]"


def test_what_a_page_shows_is_no_markup(pages: list[str]) -> None:
    for page in pages:
        tags = Tags(page)
        own = page
        for script in tags.scripts:  # Bokeh's are no text of the archive
            own = own.replace(script, "")
        assert not {name for name in tags.attributes if name.startswith("on")}
        assert "b" not in tags.tags
        assert "stable 0 &lt;script&gt;" in own
        assert "<script>document" not in own
        assert not re.search(CONTROL, own)
        for block in tags.blocks:
            data = zlib.decompress(base64.b64decode(block)).decode()
            assert not re.search(CONTROL, json.dumps(json.loads(data), ensure_ascii=False))
            assert not re.search(r"\$\$|\\\\[(\[]", data)


def test_a_page_runs_its_own_scripts_and_connects_to_nothing(pages: list[str]) -> None:
    for page, scripts in zip(pages, (4, 0), strict=True):
        tags = Tags(page)
        policy = dict(rule.split(maxsplit=1) for rule in tags.policy.split("; "))
        assert policy["default-src"] == "'none'"
        assert policy["connect-src"] == "'none'"
        assert policy["img-src"] == "data:"
        assert policy["form-action"] == "'none'"
        assert len(tags.scripts) == scripts
        assert set(policy.get("script-src", "").split()) == tags.hashes


def test_a_browser_runs_nothing_of_a_crafted_archive(sound: Path, tmp_path: Path) -> None:
    """Nor are labels markup in what a library draws, in shadow trees, where sliders and menus are."""
    text = f"<form action=http://127.0.0.1/><i id=planted>x</i>{SCRIPT}"
    page = write_report(changed(sound, tmp_path / "a.nc", crafted(text))).page
    driver = window(1366)
    opened(driver, page)
    shown = driver.execute_script(DEEP + "return deep(document, '*').map((one) => one.textContent).join(' ')")
    assert text in shown
    assert driver.execute_script(DEEP + "return deep(document, 'form, #planted, b').length") == 0
    assert driver.title != "run"
    assert Tags(driver.page_source).hashes == Tags(page.read_text(encoding="utf-8")).hashes


@pytest.mark.parametrize("command", ["show", "verify", "report"])
def test_a_terminal_gets_no_control_characters(command: str, sound: Path, tmp_path: Path) -> None:
    archive = changed(sound, tmp_path / f"a{ESCAPES}.nc", crafted(ESCAPES + "[bold]x[/bold]\nnext"))
    status, said = told(command, archive)
    assert status in (0, 1, 2)
    assert said
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f\u202a-\u202e\u2066-\u2069]", said)
    if command == "show":
        assert "[bold]x[/bold] next" in said
