"""What decides that a case is not run again: it is stored under its hash, with all that the study asks for.

Cases are stored in the archive and in the shards of a run that was stopped. ``--recompute`` takes away what was stored
before it was given, ``--retry`` what is not ok of that. Of what is left a shard counts before the archive, and a later
shard before an earlier one.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from workflow.archive import (
    ArchiveError,
    Hashes,
    Source,
    Stored,
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
from workflow.grid import arrange, case_hashes, read_choices
from workflow.run._task import Job, shard_prefix
from workflow.schemes import SOLVER_VERSION
from workflow.study import Study, StudyError


@dataclass(frozen=True)
class Reuse:
    """What a run does with cases that are stored already; without any of these it keeps them.

    Attributes
    ----------
    retry
        Run the cases again that are not ok.
    recompute
        Run all cases again, whatever version of the solver made those that are stored.
    drop
        Leave out stored cases that the study no longer asks for.
    since
        Number of the command that first asked for this: its shards and those of later ones are results of it.
    """

    retry: bool = False
    recompute: bool = False
    drop: bool = False
    since: int = 0

    def taken(self, sources: Iterable[Source], job: Job) -> Stored:
        """Return the cases that are not run again: with all variables of a study, in no lower precision."""
        taken, first = [], shard_prefix(self.since)
        for source in sources:
            is_earlier = source.name < first
            if not lacking(job.template, source.kinds) and not (is_earlier and self.recompute):
                taken.append(source.only_ok() if is_earlier and self.retry else source)
        return Stored(taken)


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
        Why a run refuses, or what it would leave out; empty where it takes all.
    """

    stored: int
    missing: int
    dropped: int
    note: str = ""


@dataclass(frozen=True)
class Found:
    """What an archive, or the shards of its unfinished run, hold under the name of a study.

    Attributes
    ----------
    sources
        Cases that may be taken.
    texts
        Of the provenance group.
    dropped
        Cases that are not asked for.
    refused
        Why none can be taken: a run does not begin.
    lost
        What would be lost, cases or variables of them: a run does not begin without ``--drop``.
    """

    sources: tuple[Source, ...] = ()
    texts: Mapping[str, str] = field(default_factory=dict)
    dropped: int = 0
    refused: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()

    def require(self, drop: bool) -> None:
        """Refuse to go on with a run that cannot take what is stored, or would lose some of it.

        Raises
        ------
        ArchiveError
            It is so.
        """
        if reasons := (*self.refused, *(() if drop else self.lost)):
            raise ArchiveError(reasons[0])


def in_archive(archive: Path, job: Job, now: Mapping[str, str], hashes: Hashes, recompute: bool) -> Found:
    """Return what of a study its archive holds; ``now`` are the texts of the provenance group that a run will write.

    Raises
    ------
    ArchiveError
        The archive is another study's, or it is damaged.
    """
    if not archive.exists():
        return Found()
    texts = provenance(archive)
    check_name(job.grid.study, archive, texts)
    dropped, cases = _unasked(archive, texts, hashes)
    lost = [_unasked_text(archive, dropped, cases, texts, now)] if dropped else []
    if recompute:
        return Found((), texts, dropped, (), tuple(lost))
    sources, refused = archive_sources(archive), _of_other_version(archive, texts)
    missing, wider = lacking(job.template, sources[0].kinds), surplus(job.template, sources[0].kinds)
    if not refused and missing and Stored(sources).holds(hashes).any():
        refused = (
            f"{archive}: holds cases of this study, but without {', '.join(missing)}; "
            "--recompute runs all cases again and replaces it, -o chooses another archive",
        )
    if not refused and wider:
        lost.append(
            f"{archive}: holds {', '.join(wider)} of its cases, which this study no longer keeps; "
            "--drop (in Python drop=True) leaves them out, -o chooses another archive"
        )
    return Found(() if refused else tuple(sources), texts, dropped, refused, tuple(lost))


def in_shards(job: Job, hashes: Hashes) -> Found:
    """Return what of a study the shards of an unfinished run hold."""
    shards, command = find_shards(job.parts), read_command(job.parts)
    if not shards:
        return Found()
    every = Stored(shards).hashes
    wider = Stored([each for each in shards if lacking(job.template, each.kinds) or surplus(job.template, each.kinds)])
    gone = int(np.sum(~are_among(every, hashes) | wider.holds(every)))
    lost = (
        f"{job.parts}: holds {len(every)} cases of an unfinished run of this study as it was, {gone} of which it "
        "no longer asks for, or not with all that is stored of them; finish that run with the study as it was, "
        "--drop leaves them out, -o chooses another archive"
    )
    return Found(tuple(shards), {} if command is None else command.texts, gone, (), (lost,) if gone else ())


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
    job, hashes = Job(grid, parts_of(archive), 0), case_hashes(grid)
    found = in_archive(archive, job, provenance_of(grid), hashes, recompute=False), in_shards(job, hashes)
    taken = Reuse().taken((source for one in found for source in one.sources), job)
    stored, dropped = int(np.sum(taken.holds(hashes))), sum(one.dropped for one in found)
    note = "; ".join(text for one in found for text in (*one.refused, *one.lost))
    return Holdings(stored, len(hashes) - stored, dropped, note)


def check_name(study: Study, archive: Path, texts: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the resolved study of which an archive holds an earlier state; refuse the archive of another one.

    Raises
    ------
    ArchiveError
        It has another name, or none.
    """
    try:
        resolved: Mapping[str, Any] = json.loads(texts["resolved"])
        name = str(resolved["study"])
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise ArchiveError(
            f"{archive}: does not say which study it holds; choose another archive with -o, or move it away"
        ) from error
    if name != study.name:
        raise ArchiveError(
            f"{archive}: holds another study, {name!r} and not {study.name!r}; "
            "choose another archive with -o, or move this one away"
        )
    return resolved


def _of_other_version(archive: Path, texts: Mapping[str, str]) -> tuple[str, ...]:
    """Say that another version of the solver has made an archive, whose cases are not taken then."""
    version = texts.get("solver_version")
    if version == str(SOLVER_VERSION):
        return ()
    return (
        f"{archive}: made by version {version} of the solver, this is {SOLVER_VERSION}, whose results differ and "
        "are not mixed with them; --recompute runs all cases again, -o chooses another archive",
    )


def _unasked_text(archive: Path, unasked: int, cases: int, was: Mapping[str, str], now: Mapping[str, str]) -> str:
    none = "holds another study of the same name: none of its cases is"
    which = none if unasked == cases else f"{unasked} of its {cases} cases are not"
    before, after = ({str(one) for one in read_choices(texts.get("choices", "{}")).values()} for texts in (was, now))
    is_other = not before <= after
    decided = ", as its tolerance decides `auto` by other cases" if is_other else ""
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
        is_same = texts.get("solver_version") == str(SOLVER_VERSION)
        stored = stored_hashes(archive) if is_same else case_hashes(grid_of(texts))
    except (ArchiveError, StudyError, LookupError, ValueError, TypeError):  # damaged, where all is computed again
        cases = statuses(archive).size
        return cases, cases
    return int(np.sum(~are_among(stored, hashes))), len(stored)
