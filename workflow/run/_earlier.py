"""What is stored already under the name of a study's archive: what a run takes of it, and what it would lose."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    ArchiveError,
    Layout,
    Shards,
    StoredCells,
    archive_origin,
    clear_parts,
    count_unmatched,
    describe,
    find_shards,
    find_stored_cells,
    is_begun,
    match_hashes,
    narrowed,
    parts_of,
    provenance,
    read_layout,
    require_whole,
    statuses,
    stored_hashes,
    study_key,
)
from workflow.grid import Decided, arrange, case_hashes, read_choices, units_of
from workflow.schemes import SOLVER_VERSION
from workflow.study import Study, StudyError, parse_study, unpacked

Hashes = NDArray[np.uint8]


@dataclass(frozen=True)
class Reuse:
    """What a run does with cases that are stored already; without any of these it keeps them.

    Attributes
    ----------
    retry
        Run the cases again that are not ok.
    recompute
        Run all cases again, and take none from an archive, whatever version of the solver made it.
    drop
        Leave out stored cases that the study no longer asks for.
    """

    retry: bool = False
    recompute: bool = False
    drop: bool = False


@dataclass(frozen=True)
class Holdings:
    """What an archive, or what is stored of its unfinished run, holds of a study.

    Attributes
    ----------
    stored
        Cases of the study that a run would take as they are.
    missing
        Cases that a run would compute.
    dropped
        Stored cases that the study no longer asks for; ``run`` refuses to leave them out without ``--drop``.
    note
        Why stored cases cannot be taken, or not as they are; empty where they can.
    """

    stored: int
    missing: int
    dropped: int
    note: str = ""


def holdings(study: Study, archive: str | Path) -> Holdings:
    """Return what an archive and its unfinished run hold of a study; nothing is changed.

    Raises
    ------
    ArchiveError
        The archive is another study's, damaged, or cannot be read.
    """
    archive = Path(archive)
    parts = parts_of(archive)
    grid = arrange(study)
    layout, hashes = describe(study, grid, units_of(grid)), case_hashes(grid)
    there, dropped, notes = np.zeros(layout.cells, dtype=bool), 0, []
    if archive.exists():
        require_whole(archive)
        texts = provenance(archive)
        check_name(study, archive, texts)
        dropped += _unasked(archive, texts, hashes)[0]
        try:
            check_version(archive, texts)
            there |= find_stored_cells(archive, layout, hashes).cells >= 0
            lost = narrowed(archive, layout)
            notes += [f"it holds {', '.join(lost)} too, which a run leaves out with --drop only"] if lost else []
        except ArchiveError as error:
            notes.append(str(error))
    left = _unfinished(parts)
    if left is not None:
        done = find_shards(parts, left)
        if left.key == layout.key:
            there |= cells_there(layout, done.owner >= 0)
        else:
            cases, unasked = _unasked_parts(left, done, hashes)
            dropped += unasked
            notes += [_unfinished_text(parts, cases, unasked)] if cases else []
    stored = int(np.sum(there))
    return Holdings(stored, layout.cells - stored, dropped, "; ".join(notes))


def reused_cells(study: Study, archive: Path, layout: Layout, hashes: Hashes, reuse: Reuse) -> StoredCells:
    """Return which cases of a study a run copies from the archive under its name.

    Raises
    ------
    ArchiveError
        Another version of the solver made it, it lacks variables, is damaged, or holds cases or histories that the
        study no longer asks for: those are left out where ``reuse`` says so, or did when this very run began.
    """
    texts = provenance(archive)
    if not reuse.recompute:
        check_version(archive, texts)
    if not reuse.drop and not is_begun(parts_of(archive), layout, archive):
        unasked, cases = _unasked(archive, texts, hashes)
        if unasked:
            none = "holds another study of the same name: none of its cases is"
            which = none if unasked == cases else f"{unasked} of its {cases} cases are not"
            was, now = stored_choices(texts), stored_choices(layout.provenance)
            other = any(set(a.values()) - set(b.values()) for a, b in zip(was, now, strict=True))
            decided = ", as its tolerance decides `auto` by other cases" if other else ""
            raise ArchiveError(
                f"{archive}: {which} asked for by this study as it is now{decided}: {unasked} stored cases would be "
                "lost; --drop leaves them out, -o chooses another archive"
            )
    if reuse.recompute:
        return StoredCells(archive, np.full(layout.cells, -1, dtype=np.int64))
    reused = find_stored_cells(archive, layout, hashes)
    lost = [] if reuse.drop or is_begun(parts_of(archive), layout, archive) else narrowed(archive, layout)
    if lost:
        raise ArchiveError(
            f"{archive}: holds {', '.join(lost)} of its cases, which this study no longer keeps; "
            "--drop leaves them out, -o chooses another archive"
        )
    return reused.without_failures() if reuse.retry else reused


def clear_other_parts(study: Study, parts: Path, layout: Layout, hashes: Callable[[], Hashes], drop: bool) -> None:
    """Remove what an unfinished run of the study as it was has left, if ``drop`` is given or it holds no case.

    What is left after this :func:`workflow.archive.start_parts` refuses.

    Raises
    ------
    ArchiveError
        Cases are stored there and ``drop`` is false.
    """
    left = _unfinished(parts)
    if left is None or left.key == layout.key or left.attrs.get("study") != study.name:
        return
    if not drop:
        cases, unasked = _unasked_parts(left, find_shards(parts, left), hashes())
        if cases:
            raise ArchiveError(_unfinished_text(parts, cases, unasked))
    clear_parts(parts)


def check_name(study: Study, archive: Path, texts: dict[str, str]) -> None:
    """Refuse the archive of another study.

    Raises
    ------
    ArchiveError
        It has another name, or none.
    """
    name = archive_origin(archive, texts).study
    if name != study.name:
        raise ArchiveError(
            f"{archive}: holds another study, {name!r} and not {study.name!r}; "
            "choose another archive with -o, or move this one away"
        )


def check_version(archive: Path, texts: dict[str, str]) -> None:
    """Refuse to take cases that another version of the solver has made.

    Raises
    ------
    ArchiveError
        The version differs.
    """
    version = archive_origin(archive, texts).solver
    if version != str(SOLVER_VERSION):
        raise ArchiveError(
            f"{archive}: made by version {version} of the solver, this is {SOLVER_VERSION}, whose results differ and "
            "are not mixed with them; --recompute runs all cases again, -o chooses another archive"
        )


def cells_there(layout: Layout, there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return for each cell whether its unit is stored."""
    stored = np.zeros(layout.cells, dtype=bool)
    for unit in np.flatnonzero(there).tolist():
        cells = layout.cells_of(unit)
        stored[cells.start : cells.stop] = True
    return stored


def _unasked(archive: Path, texts: dict[str, str], hashes: Hashes) -> tuple[int, int]:
    """Return how many cases of an archive the study with these ``hashes`` does not ask for, and how many it has.

    Cases of another version of the solver are reused by the settings in the study that the archive keeps; all count
    where that cannot be read any more.
    """
    if archive_origin(archive, texts).solver == str(SOLVER_VERSION):
        try:
            stored = stored_hashes(archive)
            return count_unmatched(stored, hashes), len(stored)
        except ArchiveError:
            pass  # damaged, where all is computed again
    was = _hashes_of(texts)
    if was is None:
        cases = statuses(archive).size
        return cases, cases
    return count_unmatched(was, hashes), len(was)


def _unasked_parts(layout: Layout, done: Shards, hashes: Hashes) -> tuple[int, int]:
    """Return how many cases an unfinished run has stored, and how many of them are not asked for."""
    there = cells_there(layout, done.owner >= 0)
    cases, was = int(np.sum(there)), _hashes_of(layout.provenance)
    if was is None or len(was) != layout.cells:
        return cases, cases
    return cases, int(np.sum(match_hashes(was[there], hashes) < 0)) if cases else 0


def _hashes_of(texts: Mapping[str, str]) -> Hashes | None:
    """Return the hashes that the cases of a stored study have in this version, ``None`` if it cannot be read."""
    try:
        study = parse_study(texts["study"], "study", attached=unpacked(texts.get("files", "")))
        return case_hashes(arrange(study, stored_choices(texts)))
    except (StudyError, LookupError, ValueError, TypeError):
        return None


def stored_choices(texts: Mapping[str, str]) -> Decided:
    """Return the counts of modes that tolerances decided, from the texts of an archive or of an unfinished run.

    None where they cannot be read: they are decided anew then.
    """
    try:
        return read_choices(texts.get("choices", "{}"))
    except (ValueError, LookupError, TypeError, AttributeError):
        return Decided()


def begun_texts(study: Study, parts: Path) -> Mapping[str, str]:
    """Return the texts of provenance with which an unfinished run of a study began; none where there is no such run."""
    left = _unfinished(parts)
    return left.provenance if left is not None and left.key == study_key(study) else {}


def is_unfinished(study: Study, archive: Path) -> bool:
    """Tell whether a run was stopped that had the archive of a study before it, rather than made it."""
    left = _unfinished(parts_of(archive))
    return left is not None and (left.key != study_key(study) or is_begun(parts_of(archive), left, archive))


def _unfinished(parts: Path) -> Layout | None:
    """Return the layout of an unfinished run, ``None`` where there is none or it cannot be read."""
    try:
        return read_layout(parts) if parts.is_dir() else None
    except ArchiveError:
        return None


def _unfinished_text(parts: Path, cases: int, unasked: int) -> str:
    return (
        f"{parts}: holds {cases} cases of an unfinished run of this study as it was, {unasked} of which it no longer "
        f"asks for; finish that run with the study as it was, --drop removes all {cases}, -o chooses another archive"
    )
