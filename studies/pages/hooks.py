"""What MkDocs makes of files that are no pages: ``hooks`` of mkdocs.yml names this one.

GUIDE.md becomes a page for each of its sections, the nav's notebooks a gallery in its groups; what stands outside of
``studies`` (table of costs, CHANGELOG, CONTRIBUTING, parts of ARCHITECTURE) is put where a page says ``<!-- insert:
NAME -->``, a study where it says ``<!-- study: NAME -->``. Formulas become MathML. Figures of some studies and the live
page are made anew.
"""

from __future__ import annotations

import base64
import html as markup
import io
import json
import re
import tempfile
from functools import cache
from pathlib import Path
from typing import Any

import latex2mathml.converter
import yaml
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import workflow
from workflow.report import write_report

ROOT = Path(__file__).parents[2]

LEARNED = yaml.safe_load((ROOT / "studies" / "pages" / "gallery.yml").read_text(encoding="utf-8"))
"""What each notebook teaches, by its name."""


def on_config(config: Any) -> Any:
    """Leave out the page 404, whose links are absolute: the site is opened as files."""
    config.theme.static_templates.discard("404.html")
    return config


def on_files(files: Files, *, config: Any) -> Files:
    """Put the pages of the guide in the place of GUIDE.md, and add the gallery, figures and the live page."""
    guide = files.get_file_from_path("GUIDE.md")
    files.remove(guide)
    pages = sections(guide.content_string)
    next(entry for entry in config.nav if "Guide" in entry)["Guide"] = list(pages)
    made: dict[str, str | bytes] = {**pages, "blade.html": live_page(), "gallery.md": gallery(config.nav)}
    for name in LEARNED:
        made[f"gallery/{name}.png"] = picture(ROOT / "studies" / f"{name}.ipynb")
    for name in ("two_masses", "valve"):
        made[f"figures/{name}.png"] = response(name)
    for name, content in made.items():
        files.append(File.generated(config, name, content=content))
    return files


def gallery(nav: list[Any]) -> str:
    """Return the page of the notebooks in the groups of the nav."""
    text = "# Gallery\n\nEach notebook answers a question; all were executed as they are shown.\n"
    for group in next(entry["Gallery"] for entry in nav if "Gallery" in entry)[1:]:
        ((title, notebooks),) = group.items()
        cards = "".join(card(question, notebook) for entry in notebooks for question, notebook in entry.items())
        text += f'\n## {title}\n\n<div class="gallery" markdown>\n{cards}</div>\n'
    return text


def card(question: str, notebook: str) -> str:
    """Return a picture with its question and what one learns, both links to the notebook."""
    name = Path(notebook).stem
    linked = f"[![{question}](gallery/{name}.png){{ loading=lazy }}]({notebook})"
    caption = f"[{question}]({notebook})<br>{LEARNED[name]}"
    return f"<figure markdown>\n{linked}\n<figcaption markdown>{caption}</figcaption>\n</figure>\n"


@cache
def live_page() -> str:
    """Return the page of the blade's study, with fewer steps than it has: they take seconds."""
    with tempfile.TemporaryDirectory() as place:
        study = workflow.read_study(ROOT / "studies" / "blade.yaml", {"axes.h": {"log": [1e-5, 1e-4, 3]}})
        done = workflow.run_study(study, Path(place) / "blade.nc")
        return write_report(done.archive, Path(place) / "blade.html").page.read_text(encoding="utf-8")


@cache
def response(name: str) -> bytes:
    """Return the histories of a study's exact cases as a picture."""
    with tempfile.TemporaryDirectory() as place:
        exact = {"axes.scheme": "event_driven", "output.histories": ["displacement", "contact_force"]}
        done = workflow.run_study(workflow.read_study(ROOT / "studies" / f"{name}.yaml", exact), Path(place) / "a.nc")
        picture = io.BytesIO()
        workflow.plots.histories(done.dataset.load(), along="e").savefig(picture, dpi=110)
        return picture.getvalue()


def sections(guide: str) -> dict[str, str]:
    """Return the pages of the guide by their names: each section with its headings a level higher."""
    texts = guide.split("\n## ")[1:]
    names = {f"guide_{re.sub('[^a-z]+', '_', text.splitlines()[0].lower())}.md": text for text in texts}
    titles = {
        name: [text.splitlines()[0], *re.findall(r"^###+ (.*)$", text, re.MULTILINE)] for name, text in names.items()
    }
    headings = {anchor(title): name for name, each in titles.items() for title in each}

    def elsewhere(link: re.Match[str]) -> str:
        page = headings.get(link[1])
        return link[0] if page is None else f"]({page}#{link[1]})"

    raised = {name: re.sub(r"^#(##+ )", r"\1", f"# {text}\n", flags=re.MULTILINE) for name, text in names.items()}
    return {name: re.sub(r"\]\(#([\w-]+)\)", elsewhere, text) for name, text in raised.items()}


def anchor(heading: str) -> str:
    """Return the anchor of a heading."""
    return re.sub(r"[^\w -]", "", heading.lower()).replace(" ", "-")


def picture(notebook: Path) -> bytes:
    """Return the first picture among a notebook's outputs."""
    cells = json.loads(notebook.read_text(encoding="utf-8"))["cells"]
    outputs = (output.get("data", {}) for cell in cells for output in cell.get("outputs", []))
    return next(base64.b64decode("".join(data["image/png"])) for data in outputs if "image/png" in data)


def on_page_markdown(markdown: str, *, page: Page, config: Any, files: Files) -> str:
    """Insert texts of the repository, and write a link that leads out of the site as its text.

    A page that stands alone in the nav has the room beside it.
    """
    if page.parent is None:
        page.meta["hide"] = ["navigation"]
    markdown = re.sub(r"<!-- insert: (\w+) -->", lambda place: INSERTED[place[1]](), markdown)
    markdown = re.sub(r"<!-- study: (\w+) -->", lambda place: f"```yaml\n{study(place[1])}```", markdown)
    markdown = re.sub(r"^::: workflow\.\w+\.(\w+)$", as_imported, markdown, flags=re.MULTILINE)
    return re.sub(r"\[([^]]+)\]\((?:\.\./)*(?:tests/|workflow/|ARCHITECTURE)[^)]*\)", r"\1", markdown)


def as_imported(reference: re.Match[str]) -> str:
    """Return an entry of the API under the name by which one imports it."""
    if reference[1] not in workflow._EXPORTS:
        return reference[0]
    return f"{reference[0]}\n    options: {{heading: workflow.{reference[1]}, toc_label: {reference[1]}}}"


def study(name: str) -> str:
    """Return a study without its line for editors."""
    text = (ROOT / "studies" / f"{name}.yaml").read_text(encoding="utf-8")
    return re.sub(r"^# yaml-language-server.*\n", "", text)


def below_title(name: str) -> str:
    """Return a document of the repository without its title."""
    return (ROOT / name).read_text(encoding="utf-8").split("\n", 1)[1]


def of_architecture(section: str) -> str:
    """Return a section of ARCHITECTURE."""
    return (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8").split(f"\n## {section}\n")[1].split("\n## ")[0]


def citation() -> str:
    """Return the works of CITATION.cff, the program first."""
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    return "\n".join(map(work, [{**cited, "year": f"version {cited['version']}"}, *cited["references"]]))


def work(entry: dict[str, Any]) -> str:
    """Return an entry of CITATION.cff as an item of a list."""
    names = ", ".join(
        " ".join(filter(None, map(one.get, ("given-names", "family-names", "name")))) for one in entry["authors"]
    )
    place = entry.get("journal") or entry.get("conference", {}).get("name") or entry.get("notes")
    parts = [names, f"*{entry['title']}*", place, entry.get("volume"), entry.get("year"), entry.get("doi")]
    return f"- {', '.join(str(part) for part in parts if part)}"


INSERTED = {
    "changelog": lambda: below_title("CHANGELOG.md"),
    "citation": citation,
    "contributing": lambda: below_title("CONTRIBUTING.md"),
    "costs": lambda: below_title("tests/benchmarks/TABLE.md"),
    "recipes": lambda: of_architecture("Recipes"),
    "symbols": lambda: of_architecture("Symbols"),
}


def formula(found: re.Match[str]) -> str:
    """Return the MathML of a formula that Arithmatex marks, displayed or within a line."""
    text, is_line = markup.unescape(found[1]), found[1].startswith("\\(")
    return latex2mathml.converter.convert(text.strip()[2:-2], display="inline" if is_line else "block")


def on_page_content(html: str, *, page: Page, config: Any, files: Files) -> str:
    """Set formulas; lead links inside of notebooks, which MkDocs leaves as they are, to pages; drop Sphinx's roles."""
    if page.file.src_uri.endswith(".ipynb"):
        return re.sub(r'href="([\w/.]+)\.(?:ipynb|md)(#[^"]*)?"', r'href="\1.html\2"', html)
    html = re.sub(r'<(?:div|span) class="arithmatex">(.*?)</(?:div|span)>', formula, html, flags=re.DOTALL)
    return re.sub(r":(?:attr|class|func|meth|mod):(?=<code>)", "", html)
