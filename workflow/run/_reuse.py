"""What of a study is stored under the name of its archive: what a run takes of it, and what it would lose."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from workflow.archive import (
    ArchiveError,
    Hashes,
    Source,
    Stored,
    archive_kinds,
    archive_sources,
    are_among,
    find_shards,
    grid_of,
    lacking,
    parts_of,
    provenance,
    provenance_of,
    read_command,
    require_whole,
    statuses,
    stored_hashes,
    surplus,
)
from workflow.grid import CaseHashes, Choices, arrange, case_hashes, read_choices
from workflow.run._task import Job
from workflow.schemes import SOLVER_VERSION
from workflow.study import Study, StudyError

if TYPE_CHECKING:
    import xarray as xr


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


@dataclass(frozen=True)
class Found:
    """What is stored under the name of a study's archive.

    Attributes
    ----------
    archive
        What a run takes of the archive.
    shards
        What it takes of an unfinished run.
    ok_alone
        Whether of the archive only cases count that are ok.
    origins
        Texts of provenance of what it takes.
    dropped
        Cases that are stored and not asked for.
    refused
        Why cases of the archive cannot be taken: a run does not begin.
    unasked, lost
        What would be lost: a run does not begin without ``--drop``.
    """

    archive: tuple[Source, ...] = ()
    shards: tuple[Source, ...] = ()
    ok_alone: bool = False
    origins: tuple[Mapping[str, str], ...] = ()
    dropped: int = 0
    refused: str = ""
    unasked: str = ""
    lost: tuple[str, ...] = ()

    @property
    def is_empty(self) -> bool:
        """Whether nothing is stored."""
        return not self.archive and not self.shards

    @cached_property
    def stored(self) -> Stored:
        """What a run takes, a shard before the archive."""
        return Stored([*self.archive, *self.shards], len(self.archive) if self.ok_alone else 0)

    def and_shards(self, job: Job) -> Stored:
        """Return what is stored when shards have been written."""
        shards = find_shards(job.parts, just_written=True)[0]
        return replace(self, shards=tuple(shard for shard in shards if not lacking(job.template, shard.kinds))).stored

    def require(self, drop: bool) -> None:
        """Refuse to go on with a run that cannot take what is stored, or would lose some of it.

        Raises
        ------
        ArchiveError
            It is so.
        """
        for text in (self.refused, *(() if drop else (self.unasked, *self.lost))):
            if text:
                raise ArchiveError(text)


def find(job: Job, now: Mapping[str, str], archive: Path, reuse: Reuse) -> Found:
    """Return what of a study an archive and the shards of an unfinished run hold, a shard before the archive.

    ``now`` are the texts of the provenance group that the run will write.

    Raises
    ------
    ArchiveError
        The archive is another study's, or it is damaged.
    """
    template, hashes, parts = job.template, job.hashes.all(), job.parts
    origins, lost = list[Mapping[str, str]](), list[str]()
    stored: list[Source] = []
    dropped, refused, unasked = 0, "", ""
    if archive.exists():
        texts = provenance(archive)
        check_name(job.grid.study, archive, texts)
        dropped, cases = _unasked(archive, texts, hashes)
        unasked = _unasked_text(archive, dropped, cases, texts, now) if dropped else ""
        if not reuse.recompute:
            refused = _other_version(archive, texts) or _without(archive, template, hashes)
            wider = [] if refused else surplus(template, archive_kinds(archive))
            lost += [_wider_text(archive, wider)] if wider else []
            stored += [] if refused else archive_sources(archive)
            origins += [texts] if Stored(stored).holds(hashes).any() else []
    shards = find_shards(parts)[0]
    every = Stored(shards).hashes
    narrowed = Stored([shard for shard in shards if lacking(template, shard.kinds) or surplus(template, shard.kinds)])
    gone = int(np.sum(~are_among(every, hashes) | narrowed.holds(every)))
    if gone:
        lost.append(
            f"{parts}: holds {len(every)} cases of an unfinished run of this study as it was, {gone} of which it no "
            "longer asks for, or not with all that is stored of them; finish that run with the study as it was, --drop "
            "leaves them out, -o chooses another archive"
        )
    command = read_command(parts) if shards else None
    origins += [] if command is None else [command.texts]
    taken = tuple(shard for shard in shards if not lacking(template, shard.kinds))
    return Found(tuple(stored), taken, reuse.retry, tuple(origins), dropped + gone, refused, unasked, tuple(lost))


def holdings(study: Study, archive: str | Path) -> Holdings:
    """Return what an archive and its unfinished run hold of a study; nothing is changed.

    Raises
    ------
    ArchiveError
        The archive is another study's, damaged, or cannot be read.
    """
    archive, grid = Path(archive), arrange(study)
    if archive.exists():
        require_whole(archive)
    job = Job(grid, parts_of(archive), 0, CaseHashes(grid))
    found, hashes = find(job, provenance_of(grid), archive, Reuse()), job.hashes.all()
    stored = int(np.sum(found.stored.holds(hashes)))
    return Holdings(stored, len(hashes) - stored, found.dropped, "; ".join(filter(None, (found.refused, *found.lost))))


def check_name(study: Study, archive: Path, texts: Mapping[str, str]) -> None:
    """Refuse the archive of another study.

    Raises
    ------
    ArchiveError
        It has another name, or none.
    """
    name = origin(archive, texts).study
    if name != study.name:
        raise ArchiveError(
            f"{archive}: holds another study, {name!r} and not {study.name!r}; "
            "choose another archive with -o, or move this one away"
        )


@dataclass(frozen=True)
class Origin:
    """What an archive was made of: name, title and licence of its study, and version of the solver."""

    study: str
    title: str
    license: str
    solver: str


def origin(archive: Path, texts: Mapping[str, str]) -> Origin:
    """Return what an archive was made of, from its provenance.

    Raises
    ------
    ArchiveError
        They are not there.
    """
    try:
        resolved = json.loads(texts["resolved"])
        named = str(resolved["study"]), str(resolved["title"]), str(resolved.get("license", ""))
        return Origin(*named, texts["solver_version"])
    except (ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ArchiveError(
            f"{archive}: does not say which study it holds; choose another archive with -o, or move it away"
        ) from error


def stored_choices(texts: Mapping[str, str]) -> Choices:
    """Return the counts of modes that tolerances decided, from the texts of an archive or of an unfinished run.

    None where they cannot be read: they are decided anew then.
    """
    try:
        return read_choices(texts.get("choices", "{}"))
    except (ValueError, LookupError, TypeError, AttributeError):
        return {}


def _other_version(archive: Path, texts: Mapping[str, str]) -> str:
    """Say that another version of the solver has made an archive, whose cases are not taken then."""
    version = origin(archive, texts).solver
    if version == str(SOLVER_VERSION):
        return ""
    return (
        f"{archive}: made by version {version} of the solver, this is {SOLVER_VERSION}, whose results differ and "
        "are not mixed with them; --recompute runs all cases again, -o chooses another archive"
    )


def _without(archive: Path, template: xr.Dataset, hashes: Hashes) -> str:
    """Say that an archive holds cases of a study without all of their variables."""
    names = lacking(template, archive_kinds(archive))
    if not names or not are_among(hashes, stored_hashes(archive)).any():
        return ""
    return (
        f"{archive}: holds cases of this study, but without {', '.join(names)}; "
        "--recompute runs all cases again and replaces it, -o chooses another archive"
    )


def _wider_text(archive: Path, names: Iterable[str]) -> str:
    return (
        f"{archive}: holds {', '.join(names)} of its cases, which this study no longer keeps; "
        "--drop (in Python drop=True) leaves them out, -o chooses another archive"
    )


def _unasked_text(archive: Path, unasked: int, cases: int, was: Mapping[str, str], now: Mapping[str, str]) -> str:
    none = "holds another study of the same name: none of its cases is"
    which = none if unasked == cases else f"{unasked} of its {cases} cases are not"
    other = set(stored_choices(was).values()) - set(stored_choices(now).values())
    decided = ", as its tolerance decides `auto` by other cases" if other else ""
    return (
        f"{archive}: {which} asked for by this study as it is now{decided}: {unasked} stored cases would be "
        "lost; --drop (in Python drop=True) leaves them out, -o chooses another archive"
    )


def _unasked(archive: Path, texts: Mapping[str, str], hashes: Hashes) -> tuple[int, int]:
    """Return how many cases of an archive the study with these ``hashes`` does not ask for, and how many it has.

    Cases of another version of the solver are told apart by the settings in the study that the archive keeps; all
    count where that cannot be read any more.
    """
    try:
        same = origin(archive, texts).solver == str(SOLVER_VERSION)
        stored = stored_hashes(archive) if same else case_hashes(grid_of(texts))
    except (ArchiveError, StudyError, LookupError, ValueError, TypeError):  # damaged, where all is computed again
        cases = statuses(archive).size
        return cases, cases
    return int(np.sum(~are_among(stored, hashes))), len(stored)
