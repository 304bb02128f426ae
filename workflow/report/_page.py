"""One self-contained HTML page of one archive or several, with the figure it is built around beside it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workflow.analysis import RULE, contact_text, most_loaded, ranges
from workflow.archive import ArchiveError, commit, open_archive, usable
from workflow.plots import HISTORIES, MADE_BY, histories, save
from workflow.report import _sections as sections
from workflow.report._html import interactive_scripts, page, picture, short
from workflow.run import warnings_of

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

_HEAD = 4096
"""Bytes of a page or figure that name its maker."""

_FIGURES = (".png", ".svg", ".pdf")

_DRAWN = (sections.precision, sections.maps, sections.over_speed, sections.along_branches, sections.shares)
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
        There is no such archive, the report would overwrite it, or there is no figure.
    OSError
        The page cannot be written.
    """
    from matplotlib import style

    archives = [archive] if isinstance(archive, Path) else list(archive)
    with style.context("default"):  # what a user's matplotlibrc says of fonts, colours and TeX is for other figures
        return _write_report(archives, output)


def _write_report(archives: Sequence[Path], output: Path | None) -> ReportFiles:
    if output is not None:
        _refuse_place(output, len(archives))
        if output.suffix.lower() in _FIGURES:
            _refuse_overwriting(archives, output)
            return _write_figure(archives[0], output)
    written = output or (archives[0].with_suffix(".html") if len(archives) == 1 else Path("report.html"))
    picture = written.with_suffix(".png")
    unnamed = [*([] if output else [written]), *([picture] if len(archives) == 1 else [])]
    _refuse_overwriting(archives, written, unnamed)
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


def _refuse_overwriting(archives: Sequence[Path], written: Path, unnamed: Sequence[Path] = ()) -> None:
    """Refuse to write over an archive, or over what no report has written and nobody has named."""
    for place, archive in product((written, *unnamed), archives):
        if os.path.realpath(place) == os.path.realpath(archive):
            raise ArchiveError(
                f"{place}: the archive and its report would be one file; "
                f"choose another with -o, e.g. {archive.stem}-report.html"
            )
    for place in filter(Path.exists, unnamed):
        with open(place, "rb") as file:
            if MADE_BY.encode() not in file.read(_HEAD):
                raise ArchiveError(f"{place}: is there, and no report wrote it; move it away, or choose a page with -o")


def _write_single(archive: Path, written: Path, beside: Path) -> ReportFiles:
    from workflow.report._explorer import explored_branches, explored_cases, with_contacts

    with open_archive(archive) as opened:
        dataset = most_loaded(opened)
        drawn = precision, maps, over_speed, branches, shares = [section(dataset) for section in _DRAWN]
        figures = [section["figure"] for section in drawn if section]
        figure = next(filter(None, [_response(dataset), *figures]), None)
        figure_path = None if figure is None else save(figure, beside)
        methods, scene = sections.study_of(archive)
        answer, choice = sections.answered(dataset, methods)
        has_transients = "point" not in dataset.dims  # an archive of branches has steady rubs alone
        every = with_contacts(dataset, opened)
        explore = explored_cases(every, archive.name, choice, methods, scene) if has_transients else None
        if not has_transients and branches:
            explore = explored_branches(dataset, sections.varied_along_branches(dataset)[0])
        text = page(
            archive.name,
            interactive_scripts() if explore else [],
            **_about(dataset, archive),
            summary=str(dataset.attrs.get("summary", "")),
            limits=sections.where_it_settles(dataset),
            answer=answer,
            maps=maps,
            over_speed=over_speed,
            branches=branches,
            explore=explore,
            cases=sections.cases(dataset),
            rule=RULE,
            standing=sections.standing(dataset) if has_transients else None,
            precision=precision,
            shares=shares if has_transients else None,
            effects=sections.effects(dataset, methods) if has_transients and not shares else None,
            origin=sections.origin(dataset, archive),
        )
    commit(written, text.encode())
    return ReportFiles(written, figure_path)


def _response(dataset: xr.Dataset) -> Figure | None:
    """Draw the tip's response, where its histories are kept and a case is ok."""
    has_one = any(name in dataset for name in HISTORIES) and sections.any_ok(dataset)
    return histories(dataset) if has_one else None


def _write_figure(archive: Path, written: Path) -> ReportFiles:
    """Write the main figure of an archive without its page."""
    with open_archive(archive) as opened:
        dataset = most_loaded(opened)
        figure = _response(dataset)
        for section in _DRAWN:
            figure = figure or (section(dataset) or {}).get("figure")
        if figure is None:
            raise ArchiveError(
                f"{archive}: has no figure: it keeps no histories, no errors at three steps and no two axes of four "
                f"values, or no case is ok; {archive.stem}.html would be its page"
            )
        return ReportFiles(None, save(figure, written))


def _write_joint(archives: Sequence[Path], written: Path) -> ReportFiles:
    rows: list[Any] = []
    new, parts = [], []
    with ExitStack() as every:
        datasets = [most_loaded(every.enter_context(open_archive(archive))) for archive in archives]
        swept = sections.sweeps(datasets)
        for dataset, archive in zip(datasets, archives, strict=True):
            about = _about(dataset, archive)
            new.append(len(rows))
            has_transients = "point" not in dataset.dims
            for k, row in enumerate(ranges(dataset) if has_transients else []):
                rows.append(
                    [
                        about["name"] if k == 0 else "", row.scheme, f"{row.ok}/{row.cases}", row.stable,
                        row.accurate or "–", short(row.finest), short(row.coarsest), short(row.residual, "+.1e"),
                        short(row.penetration), row.verdicts,
                    ]
                )  # fmt: skip
            response = _response(dataset)
            about["response"] = [] if response is None else [picture(response, "tip response")]
            about["branches"] = sections.along_branches(dataset)
            about["answer"], _ = sections.answered(dataset, sections.study_of(archive)[0])
            about["standing"] = sections.standing(dataset) if has_transients else None
            about["precision"] = sections.precision(dataset) if dataset.sizes.get("h", 1) > 4 else None
            parts.append(about)
    commit(written, page("studies", rule=RULE, archives=parts, rows=rows, new=new[1:], sweeps=swept).encode())
    return ReportFiles(written, None)


def _about(dataset: xr.Dataset, archive: Path) -> dict[str, Any]:
    """Return an archive's name and title, and what is to be aware of before anything is read off the results."""
    heading, contact = str(dataset.attrs.get("title", "")) or archive.name, contact_text(dataset)
    return {
        "name": str(dataset.attrs.get("study", archive.stem)),
        "heading": f"{heading}: {contact}, the most loaded" if contact else heading,
        "warnings": warnings_of(dataset),
    }
