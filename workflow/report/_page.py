"""One self-contained HTML page of one archive or several, with the figure it is built around beside it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflow.analysis import RULE, ranges
from workflow.archive import ArchiveError, commit, open_archive, usable
from workflow.plots import HISTORIES, MADE_BY, histories, save
from workflow.report import _sections as sections
from workflow.report._answer import answer
from workflow.report._branches import along_branches, interactive_branches, where_it_settles
from workflow.report._explorer import PAGE_BYTES, interactive
from workflow.report._html import THEN, image, note, page, paragraph, short, table, tag
from workflow.report._origin import origin, study_of
from workflow.report._shares import shares
from workflow.run import warnings_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_HEAD = 4096
"""Bytes of a page or figure that name its maker."""

_MARGIN = 20_000
"""Bytes of a page beside its parts."""

_FIGURES = (".png", ".svg", ".pdf")


_DRAWN = (sections.precision, sections.maps, along_branches, shares)
"""Sections with figures; the first that an archive has is its main one where it keeps no histories."""


@dataclass(frozen=True)
class ReportFiles:
    """Where a report and its figure are."""

    page: Path | None
    figure: Path | None


def write_report(archive: Path | Sequence[Path], output: Path | None = None) -> ReportFiles:
    """Write the report of an archive: ``ARCHIVE.html``, and its main figure as ``ARCHIVE.png``.

    The main figure is the tip's response; where no histories are kept speed against error, or maps of the scene.

    Several archives give one page, ``report.html``: who stays stable and accurate in all of them, then
    a section for each.

    Parameters
    ----------
    archive
        One archive or several.
    output
        The page to write, ``.html``; or its figure alone, ``.png``, ``.svg`` or ``.pdf``.

    Raises
    ------
    ArchiveError
        There is no such archive, the report would overwrite it, or there is no
        figure.
    OSError
        The page cannot be written.
    """
    archives = [archive] if isinstance(archive, Path) else list(archive)
    if output is not None:
        _refuse_place(output, len(archives))
        if output.suffix.lower() in _FIGURES:
            return _write_figure(archives[0], output)
    written = output or (archives[0].with_suffix(".html") if len(archives) == 1 else Path("report.html"))
    picture = written.with_suffix(".png")
    unnamed = [*([] if output else [written]), *([picture] if len(archives) == 1 else [])]
    _refuse_overwriting(archives, written, *unnamed)
    _refuse_foreign(unnamed)
    if len(archives) > 1:
        return _write_joint(archives, written)
    return _write_single(archives[0], written, picture)


def _refuse_place(written: Path, archives: int) -> None:
    """Refuse what can be no report before anything is drawn: written aside and renamed, it would replace a device."""
    usable(written)
    if written.is_dir():
        raise ArchiveError(f"{written}: a directory, not a page; name a file in it")
    if not written.parent.is_dir():
        raise ArchiveError(f"{written.parent}: no such directory; make it, or choose another place with -o")
    if written.suffix.lower() not in (".html", *(_FIGURES if archives == 1 else ())):
        raise ArchiveError(
            f"{written}: a report is a page, .html, or of one archive its figure alone, {', '.join(_FIGURES)}"
        )


def _refuse_overwriting(archives: Sequence[Path], *written: Path) -> None:
    for archive in archives:
        for place in written:
            if os.path.realpath(place) == os.path.realpath(archive):
                raise ArchiveError(
                    f"{place}: the archive and its report would be one file; "
                    f"choose another with -o, e.g. {archive.stem}-report.html"
                )


def _refuse_foreign(unnamed: Sequence[Path]) -> None:
    """Refuse to write over what no report has written and nobody has named."""
    for place in filter(Path.exists, unnamed):
        with open(place, "rb") as file:
            if MADE_BY.encode() not in file.read(_HEAD):
                raise ArchiveError(f"{place}: is there, and no report wrote it; move it away, or choose a page with -o")


def _write_single(archive: Path, written: Path, picture: Path) -> ReportFiles:
    with open_archive(archive) as dataset:
        precision, maps, branches, drawn = (section(dataset) for section in _DRAWN)
        figure = _response(dataset) or precision.figure or maps.figure or branches.figure or drawn.figure
        figure_path = None if figure is None else save(figure, picture)
        methods, scene = study_of(archive)
        first_block, choice = answer(dataset, methods)
        head = [
            tag("h1", _title(dataset, archive)),
            note(str(dataset.attrs.get("summary", ""))),
            *_warnings(dataset),
            *where_it_settles(dataset),
            *first_block,
            *maps.body,
            *branches.body,
        ]
        has_transients = "point" not in dataset.dims  # an archive of branches has steady rubs alone
        rest = [*sections.cases(dataset)]
        if has_transients:
            rest += [
                *sections.standing(dataset),
                *precision.body,
                *(drawn.body or sections.effects(dataset, methods)),
                *sections.errors(dataset),
            ]
        rest += origin(dataset, archive)
        room = PAGE_BYTES - sum(len(part.encode()) for part in [*head, *rest]) - _MARGIN
        shown, scripts = (
            interactive(dataset, archive.name, choice, methods, scene, room)
            if has_transients
            else interactive_branches(dataset)
        )
    commit(written, page(archive.name, [*head, *shown, *rest], scripts).encode())
    return ReportFiles(written, figure_path)


def _response(dataset: xr.Dataset) -> Figure | None:
    """Draw the tip's response, where its histories are kept and a case is ok."""
    has_one = any(name in dataset for name in HISTORIES) and sections.any_ok(dataset)
    return histories(dataset) if has_one else None


def _write_figure(archive: Path, written: Path) -> ReportFiles:
    """Write the main figure of an archive without its page."""
    _refuse_overwriting([archive], written)
    with open_archive(archive) as dataset:
        figure = _response(dataset)
        for section in _DRAWN:
            figure = figure or section(dataset).figure
        if figure is None:
            raise ArchiveError(
                f"{archive}: has no figure: it keeps no histories, no errors at three steps and no two axes of four "
                f"values, or no case is ok; {archive.stem}.html would be its page"
            )
        return ReportFiles(None, save(figure, written))


def _write_joint(archives: Sequence[Path], written: Path) -> ReportFiles:
    rows, new = [], []
    parts: list[str] = []
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
            parts += [tag("h2", name), paragraph(f"{title}.")]
            parts += _warnings(dataset) + answer(dataset, study_of(archive)[0])[0]
            response = _response(dataset)
            parts += [] if response is None else [image(response, "tip response")]
            parts += sections.standing(dataset)[3:]
            if dataset.sizes.get("h", 1) > 4:
                parts += sections.precision(dataset).body
    head = [
        "study", "scheme", "ok", "stable up to", "accurate up to", "error at the smallest h", "at the largest stable h",
        "energy residual", "penetration / gap", "verdict, from small h to large",
    ]  # fmt: skip
    body = [
        tag("h1", f"Who stays stable, who is accurate: {len(archives)} studies"),
        note(
            f"{RULE} Errors are the largest of the impulse among ok cases; energy residual and penetration the largest "
            f"of all ok cases. {sections.TERMS}"
        ),
        table(head, rows, new),
    ]
    commit(written, page("studies", body + parts).encode())
    return ReportFiles(written, None)


def _title(dataset: xr.Dataset, archive: Path) -> str:
    return str(dataset.attrs.get("title", "")) or archive.name


def _warnings(dataset: xr.Dataset) -> list[str]:
    """Return what is to be aware of before anything is read off the results."""
    return [paragraph(f"Beware: {warning}.") for warning in warnings_of(dataset)]
