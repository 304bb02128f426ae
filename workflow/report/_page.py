"""One self-contained HTML page of one archive or several, with the figure it is built around beside it."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflow.analysis import RULE, ranges
from workflow.archive import ArchiveError, open_archive, provenance
from workflow.plots import overview, save
from workflow.report import _sections as sections
from workflow.report._html import THEN, image, page, short, table

if TYPE_CHECKING:
    import xarray as xr

_RESPONSES = ("displacement", "temperature", "contact_force")


@dataclass(frozen=True)
class Written:
    """Where a report and its figure are."""

    page: Path
    figure: Path | None


def write_report(archive: Path | Sequence[Path], page_path: Path | None = None) -> Written:
    """Write the report of an archive: ``ARCHIVE.html``, and its main figure as ``ARCHIVE.png``.

    The main figure is the tip's response, or speed against error where no histories are kept.

    Several archives give one page, ``report.html``: who stays stable and accurate in all of them, then
    a section for each.

    Raises
    ------
    ArchiveError
        There is no such archive, or the report would overwrite it.
    OSError
        The page cannot be written.
    """
    archives = [archive] if isinstance(archive, Path) else list(archive)
    if len(archives) > 1:
        return _write_joint(archives, page_path or Path("report.html"))
    return _write_single(archives[0], page_path or archives[0].with_suffix(".html"))


def _refuse_overwriting(archives: Sequence[Path], written: Path, picture: Path | None) -> None:
    if not written.name:
        raise ArchiveError(f"{written}: a directory, not a page; name a file, e.g. {archives[0].stem}.html")
    for archive in archives:
        places = [archive, written] + ([picture] if picture is not None else [])
        if len({place.resolve() for place in places}) < len(places):
            told = f", the page and the picture {picture}" if picture is not None else " and the page"
            raise ArchiveError(
                f"{written}: the archive {archive}{told} would be one file; "
                f"choose another page with -o, e.g. {archive.stem}-report.html"
            )


def _write_single(archive: Path, written: Path) -> Written:
    picture = written.with_suffix(".png") if written.name else None
    _refuse_overwriting([archive], written, picture)
    with open_archive(archive) as dataset:
        figure_path = None
        body = [f"<h1>{html.escape(_title(dataset, archive))}</h1>"]
        body.append(f'<p class="muted">{html.escape(str(dataset.attrs.get("summary", "")))}</p>')
        body += sections.cases(dataset)
        if any(name in dataset for name in _RESPONSES) and sections.any_ok(dataset) and picture is not None:
            figure = overview(dataset)
            figure_path = save(figure, picture)
            body += ["<h2>Tip response</h2>", image(figure, "tip response")]
        body += sections.scene_pictures(dataset)
        body += sections.standing(dataset)
        precision = sections.precision(dataset, duration_of(archive))
        if precision is not None and picture is not None:
            body += precision.body
            figure_path = figure_path or save(precision.figure, picture)
        body += sections.effects(dataset)
        body += sections.errors(dataset)
        body += _provenance(archive)
    written.write_text(page(archive.name, body), encoding="utf-8")
    return Written(written, figure_path)


def _write_joint(archives: Sequence[Path], written: Path) -> Written:
    _refuse_overwriting(archives, written, None)
    rows, new, parts = [], [], []
    for number, archive in enumerate(archives):
        with open_archive(archive) as dataset:
            name, title = str(dataset.attrs.get("study", archive.stem)), _title(dataset, archive)
            for k, row in enumerate(ranges(dataset)):
                rows.append(
                    [
                        name if k == 0 else "", row.scheme, f"{row.ok}/{row.cases}", row.stable, row.accurate or "–",
                        short(row.finest), short(row.coarsest), short(row.residual, "+.1e"), short(row.penetration),
                        THEN.join(row.verdicts),
                    ]
                )  # fmt: skip
                new.append(k == 0 and number > 0)
            parts += [f"<h2>{html.escape(name)}</h2>", f"<p>{html.escape(title)}.</p>"]
            if any(one in dataset for one in _RESPONSES) and sections.any_ok(dataset):
                parts.append(image(overview(dataset), "tip response"))
            parts += sections.scene_pictures(dataset)
            parts += sections.standing(dataset)[2:]
            if dataset.sizes.get("h", 1) > 4:
                precision = sections.precision(dataset, duration_of(archive))
                parts += precision.body if precision is not None else []
    head = [
        "study", "scheme", "ok", "stable up to", "accurate up to", "error at the smallest h", "at the largest stable h",
        "energy residual", "penetration / gap", "verdict, from small h to large",
    ]  # fmt: skip
    body = [
        f"<h1>Who stays stable, who is accurate: {len(archives)} studies</h1>",
        f'<p class="muted">{RULE} Errors are the largest of the impulse among ok cases; energy residual and '
        "penetration the largest of all ok cases.</p>",
        table(head, rows, new),
    ]
    written.write_text(page("studies", body + parts), encoding="utf-8")
    return Written(written, None)


def _title(dataset: xr.Dataset, archive: Path) -> str:
    return str(dataset.attrs.get("title") or archive.name)


def duration_of(archive: Path) -> float:
    """Return the simulated time of an archive's study, s."""
    return float(json.loads(provenance(archive)["resolved"])["scene"]["duration"])


def _provenance(archive: Path) -> list[str]:
    told = provenance(archive)
    rows = [
        [name, told[name]] for name in ("content_hash", "solver_version", "code_revision", "platform") if name in told
    ]
    return [
        "<h2>Where this comes from</h2>",
        table(["", ""], rows),
        f"<pre>{html.escape(told.get('study', ''))}</pre>",
    ]
