"""What MkDocs makes of files that are no pages: ``hooks`` of mkdocs.yml names this one.

GUIDE.md becomes a page for each of its sections, the nav's notebooks a gallery, and what stands outside of ``studies``
(table of costs, CONTRIBUTING, the recipes of ARCHITECTURE) is put where a page says ``<!-- insert: NAME -->``.
"""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

ROOT = Path(__file__).parents[2]


def on_files(files: Files, *, config: Any) -> Files:
    """Put the pages of the guide in the place of GUIDE.md, and add the gallery."""
    guide = files.get_file_from_path("GUIDE.md")
    files.remove(guide)
    pages = sections(guide.content_string)
    next(entry for entry in config.nav if "Guide" in entry)["Guide"] = list(pages)
    for name, text in pages.items():
        files.append(File.generated(config, name, content=text))
    notebooks = next(entry["Gallery"] for entry in config.nav if "Gallery" in entry)[1:]
    cards = []
    for entry in notebooks:
        ((title, notebook),) = entry.items()
        name = f"gallery/{Path(notebook).stem}.png"
        files.append(File.generated(config, name, content=picture(ROOT / "studies" / notebook)))
        cards.append(card(title, notebook, name))
    text = "# Gallery\n\nEach notebook answers a question; all were executed as they are shown.\n\n"
    text += f'<div class="gallery" markdown>\n{"".join(cards)}</div>\n'
    files.append(File.generated(config, "gallery.md", content=text))
    return files


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


def card(title: str, notebook: str, name: str) -> str:
    """Return a picture with its question, both links to the notebook."""
    linked = f"[![{title}]({name}){{ loading=lazy }}]({notebook})"
    return f"<figure markdown>\n{linked}\n<figcaption markdown>[{title}]({notebook})</figcaption>\n</figure>\n"


def on_page_markdown(markdown: str, *, page: Page, config: Any, files: Files) -> str:
    """Insert texts of the repository, and write a link that leads out of the site as its text.

    A page that stands alone in the nav has the room beside it.
    """
    if page.parent is None:
        page.meta["hide"] = ["navigation"]
    markdown = re.sub(r"<!-- insert: (\w+) -->", lambda place: INSERTED[place[1]](), markdown)
    return re.sub(r"\[([^]]+)\]\((?:\.\./)*(?:tests/|workflow/|ARCHITECTURE)[^)]*\)", r"\1", markdown)


def costs() -> str:
    """Return the table of costs without its title."""
    return (ROOT / "tests" / "benchmarks" / "TABLE.md").read_text(encoding="utf-8").split("\n", 1)[1]


def contributing() -> str:
    """Return CONTRIBUTING without its title."""
    return (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8").split("\n", 1)[1]


def recipes() -> str:
    """Return the recipes of ARCHITECTURE."""
    text = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    return text.split("\n## Recipes\n")[1].split("\n## ")[0]


INSERTED = {"costs": costs, "contributing": contributing, "recipes": recipes}


def on_page_content(html: str, *, page: Page, config: Any, files: Files) -> str:
    """Lead links inside of notebooks, which MkDocs leaves as they are, to pages; drop Sphinx's roles of docstrings."""
    if page.file.src_uri.endswith(".ipynb"):
        return re.sub(r'href="([\w/.]+)\.(?:ipynb|md)(#[^"]*)?"', r'href="\1.html\2"', html)
    return re.sub(r":(?:attr|class|func|meth|mod):(?=<code>)", "", html)
