"""One self-contained HTML page of one archive or several, with the figure it is built around beside it."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from workflow.analysis import RULE, ranges
from workflow.archive import ArchiveError, commit, open_archive, usable
from workflow.plots import overview, save
from workflow.report import _sections as sections
from workflow.report._answer import answer
from workflow.report._explorer import PAGE_BYTES, interactive
from workflow.report._html import THEN, image, page, short, table, tag
from workflow.report._origin import duration_of, methods_of, origin, scene_of

if TYPE_CHECKING:
    import xarray as xr

_MARGIN = 20_000
"""Bytes of a page beside its parts."""

_RESPONSES = ("displacement", "temperature", "contact_force")


@dataclass(frozen=True)
class Written:
    """Where a report and its figure are."""

    page: Path
    figure: Path | None


def write_report(archive: Path | Sequence[Path], page_path: Path | None = None, *, damaged: bool = False) -> Written:
    """Write the report of an archive: ``ARCHIVE.html``, and its main figure as ``ARCHIVE.png``.

    The main figure is the tip's response; where no histories are kept speed against error, or maps of the scene.

    Several archives give one page, ``report.html``: who stays stable and accurate in all of them, then
    a section for each.

    Parameters
    ----------
    archive
        One archive or several.
    page_path
        The page to write.
    damaged
        Draw a damaged archive too, as far as it can be read; the page says that it is damaged.

    Raises
    ------
    ArchiveError
        There is no such archive, it is damaged and ``damaged`` is false, or the report would overwrite it.
    OSError
        The page cannot be written.
    """
    archives = [archive] if isinstance(archive, Path) else list(archive)
    if page_path is not None:
        _refuse_place(page_path)
    if len(archives) > 1:
        return _write_joint(archives, page_path or Path("report.html"), damaged)
    return _write_single(archives[0], page_path or archives[0].with_suffix(".html"), damaged)


def _refuse_place(written: Path) -> None:
    """Refuse what can be no page before anything is drawn: written aside and renamed, it would replace a device."""
    usable(written)
    if written.is_dir():
        raise ArchiveError(f"{written}: a directory, not a page; name a file in it")
    if not written.parent.is_dir():
        raise ArchiveError(f"{written.parent}: no such directory; make it, or choose another place with -o")


def _refuse_overwriting(archives: Sequence[Path], written: Path, picture: Path | None) -> None:
    if not written.name:
        raise ArchiveError(f"{written}: a directory, not a page; name a file, e.g. {archives[0].stem}.html")
    for archive in archives:
        places = [archive, written] + ([picture] if picture is not None else [])
        if len({os.path.realpath(place) for place in places}) < len(places):
            others = f", the page and the picture {picture}" if picture is not None else " and the page"
            raise ArchiveError(
                f"{written}: the archive {archive}{others} would be one file; "
                f"choose another page with -o, e.g. {archive.stem}-report.html"
            )


def _write_single(archive: Path, written: Path, damaged: bool) -> Written:
    picture = written.with_suffix(".png") if written.name else None
    _refuse_overwriting([archive], written, picture)
    with open_archive(archive, damaged=damaged) as dataset:
        figure = overview(dataset) if any(name in dataset for name in _RESPONSES) and sections.any_ok(dataset) else None
        precision, maps = sections.precision(dataset, duration_of(archive, damaged)), sections.maps(dataset)
        figure = figure or precision.figure or maps.figure
        figure_path = save(figure, picture) if figure is not None and picture is not None else None
        methods, scene = methods_of(archive, damaged), scene_of(archive, damaged)
        first_block = answer(dataset, methods)
        head = [
            tag("h1", _title(dataset, archive)),
            tag("p", str(dataset.attrs.get("summary", "")), kind="muted"),
            *_damage(dataset),
            *first_block.body,
            *maps.body,
        ]
        rest = [
            *sections.cases(dataset),
            *sections.scene_pictures(dataset),
            *sections.standing(dataset),
            *precision.body,
            *sections.effects(dataset),
            *sections.errors(dataset),
            *origin(dataset, archive, damaged),
        ]
        room = PAGE_BYTES - sum(len(part.encode()) for part in [*head, *rest]) - _MARGIN
        shown = interactive(dataset, archive.name, first_block.choice, methods, scene, room)
    commit(written, page(archive.name, [*head, *shown.body, *rest], shown.scripts).encode())
    return Written(written, figure_path)


def _write_joint(archives: Sequence[Path], written: Path, damaged: bool) -> Written:
    _refuse_overwriting(archives, written, None)
    rows, new = [], []
    parts: list[str] = []
    for number, archive in enumerate(archives):
        with open_archive(archive, damaged=damaged) as dataset:
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
            parts += [tag("h2", name), tag("p", f"{title}.")]
            parts += _damage(dataset) + answer(dataset, methods_of(archive, damaged)).body
            if any(one in dataset for one in _RESPONSES) and sections.any_ok(dataset):
                parts.append(image(overview(dataset), "tip response"))
            parts += sections.scene_pictures(dataset)
            parts += sections.standing(dataset)[3:]
            if dataset.sizes.get("h", 1) > 4:
                parts += sections.precision(dataset, duration_of(archive, damaged)).body
    head = [
        "study", "scheme", "ok", "stable up to", "accurate up to", "error at the smallest h", "at the largest stable h",
        "energy residual", "penetration / gap", "verdict, from small h to large",
    ]  # fmt: skip
    body = [
        tag("h1", f"Who stays stable, who is accurate: {len(archives)} studies"),
        tag(
            "p",
            f"{RULE} Errors are the largest of the impulse among ok cases; energy residual and penetration the largest "
            f"of all ok cases. {sections.TERMS}",
            kind="muted",
        ),
        table(head, rows, new),
    ]
    commit(written, page("studies", body + parts).encode())
    return Written(written, None)


def _title(dataset: xr.Dataset, archive: Path) -> str:
    return str(dataset.attrs.get("title") or archive.name)


def _damage(dataset: xr.Dataset) -> list[str]:
    """Return what is said of a damaged archive."""
    what = dataset.attrs.get("damaged")
    return [tag("p", tag("strong", f"Damaged: {what}; any value may be wrong."))] if what else []
