"""What a run does before its tasks: it finds the cases that are stored and those that are not.

A case is not run again that is stored under its hash, with all that the study asks for, in the archive or in the shards
of a run that was stopped. ``--recompute`` marks all of these as not run, ``--retry`` those that are not ok. A run that
would lose stored results does not begin without ``--drop``.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow import archive
from workflow.cases import Grid, arrange, case_hashes, read_choices
from workflow.plan import warning_lines
from workflow.run._task import Job, next_command, not_ok, shard_name
from workflow.schemes import SOLVER_VERSION, Status
from workflow.solve import Task
from workflow.study import Study, StudyError


@dataclass(frozen=True)
class Reuse:
    """What a run does with cases that are stored already; without any of these it keeps them."""

    retry: bool = False
    """Run the cases again that are not ok."""
    recompute: bool = False
    """Run all cases again, whatever version of the solver made those that are stored."""
    drop: bool = False
    """Leave out stored cases that the study no longer asks for."""


@dataclass(frozen=True)
class Holdings:
    """What an archive, or what is stored of its unfinished run, holds of a study."""

    stored: int
    """Cases of the study that a run would take as they are."""
    missing: int
    """Cases that a run would compute."""
    dropped: int
    """Stored cases that the study no longer asks for; ``run`` refuses to leave them out without ``--drop``."""
    note: str = ""
    """Why a run refuses, or what it would leave out; empty where it takes all."""


@dataclass(frozen=True)
class Found:
    """What an archive, or the shards of its unfinished run, hold under the name of a study."""

    sources: tuple[archive.Source, ...] = ()
    """Shards and chunks whose cases can be taken: with all variables of the study, in no lower precision."""
    texts: Mapping[str, str] = field(default_factory=dict)
    """Texts of the provenance group, by name."""
    dropped: int = 0
    """Number of stored cases that the study does not ask for."""
    refused: str = ""
    """Why none can be taken: a run does not begin."""
    lost: str = ""
    """What would be lost, cases or variables of them: a run does not begin without ``--drop``."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run that is ready for its tasks."""

    job: Job
    """What its tasks share."""
    texts: Mapping[str, str]
    """Texts of the provenance group, by name."""
    before: archive.Stored
    """Cases that are not run again."""
    hashes: archive.Hashes
    """Identity of every case, ``(case, byte)``."""
    missing: NDArray[np.bool_]
    """For each case whether it is to be computed, ``(outer, inner)``."""

    def hashes_of(self, task: Task) -> archive.Hashes:
        """Return the identity of each case of a task."""
        cases = np.concatenate([batch.outer * self.missing.shape[1] + batch.inner for batch in task.batches])
        return np.asarray(self.hashes[cases])

    def stored(self) -> archive.Stored:
        """Return what is stored by now, shards of this run with it."""
        written = archive.find_shards(self.job.parts, shard_name(self.job.begun), check=False)
        return archive.Stored([*self.before.sources, *written])

    def count(self, stored: archive.Stored) -> tuple[int, Counter[str]]:
        """Return how many cases of the study are stored, and those of them that are not ok by their status."""
        status = stored.status_of(self.hashes)
        status = status[status != Status.NOT_RUN]
        return status.size, not_ok(status)


def prepare(grid: Grid, path: Path, reuse: Reuse, here: bool) -> Prepared:
    """Take what an earlier archive and an interrupted run hold of a study, and begin the directory of its shards.

    A plain run finishes the command that was interrupted, and so does the same command unless the program was edited
    meanwhile. Where cases are not computed ``here``, in this process, but on workers, the archive does not say that its
    linear algebra is pinned: theirs may be another one. Another study is refused, as are cases that would be lost.
    """
    parts, texts = archive.parts_of(path), {**archive.provenance_of(grid), **({} if here else {"pinned": "false"})}
    earlier, there = archive.read_command(parts), archive.file_of(path)
    job = Job(grid, parts, next_command(parts), "\n".join(warning_lines(grid)))
    if earlier is not None and earlier.study != grid.study.name:
        raise archive.ArchiveError(
            f"{parts}: holds unfinished results of another study, {earlier.study!r}; finish that one, remove the "
            "directory, or choose another archive with -o"
        )
    goes_on = False
    if earlier is not None and (earlier.key, earlier.archive) == (texts["key"], there):
        asked, before = (reuse.retry, reuse.recompute), (earlier.retry, earlier.recompute)
        goes_on = not any(asked) or (asked == before and texts["code_revision"] == earlier.texts.get("code_revision"))
        reuse = replace(reuse, drop=reuse.drop or earlier.drop)
        reuse = Reuse(*before, reuse.drop) if goes_on else reuse
    hashes = case_hashes(grid)
    found = in_archive(path, job, texts, hashes, reuse.recompute), in_shards(job, hashes)
    for one in found:
        if reason := one.refused or ("" if reuse.drop else one.lost):
            raise archive.ArchiveError(reason)
    stored = _kept(found, job, Reuse() if goes_on else reuse)
    source, _ = stored.find(hashes)
    if elsewhere := _elsewhere(found, source, texts):
        texts[archive.COPIED] = ", ".join(sorted(elsewhere))
    archive.start_parts(parts, archive.Command(texts, job.warnings, there, job.begun, **asdict(reuse)))
    return Prepared(job, texts, stored, hashes, (source < 0).reshape(grid.outer_count, grid.inner_count))


def _kept(found: tuple[Found, Found], job: Job, reuse: Reuse) -> archive.Stored:
    """Return the stored cases that a run keeps; those that it runs again are taken back, by a shard of their hashes."""
    stored = archive.Stored([source for one in found for source in one.sources])
    again = stored.hashes if reuse.recompute else stored.hashes[reuse.retry & (stored.status != Status.OK)]
    if not again.size:
        return stored
    return archive.Stored([*stored.sources, archive.take_back(job.parts, shard_name(job.begun, 0), again)])


def _elsewhere(found: tuple[Found, Found], source: NDArray[np.int64], now: Mapping[str, str]) -> set[str]:
    """Return the packages whose version is not that of the cases kept; ``source`` is that of each case, by index."""
    names: set[str] = set()
    is_of_archive = source < len(found[0].sources)
    for one, cases in zip(found, (is_of_archive, ~is_of_archive), strict=True):
        if one.texts and np.any(cases & (source >= 0)):
            names |= {name for name in archive.SOFTWARE if one.texts.get(name) != now[name]}
            names.update(filter(None, one.texts.get(archive.COPIED, "").split(", ")))
    return names


def holdings(study: Study, path: str | Path) -> Holdings:
    """Return what an archive and its unfinished run hold of a study, or refuse them; nothing is changed."""
    path, grid = Path(path), arrange(study)
    if path.exists():
        archive.require_whole(path)
    job, hashes = Job(grid, archive.parts_of(path), 0), case_hashes(grid)
    found = in_archive(path, job, archive.provenance_of(grid), hashes, recompute=False), in_shards(job, hashes)
    stored = int(np.sum(_kept(found, job, Reuse()).holds(hashes)))
    note = "; ".join(text for one in found for text in (one.refused, one.lost) if text)
    return Holdings(stored, len(hashes) - stored, sum(one.dropped for one in found), note)


def in_archive(path: Path, job: Job, now: Mapping[str, str], hashes: archive.Hashes, recompute: bool) -> Found:
    """Return what of a study its archive holds; ``now`` are the texts of the provenance group that a run will write."""
    if not path.exists():
        return Found()
    texts = archive.provenance(path)
    check_name(job.grid.study, path, texts)
    dropped, cases = _unasked(path, texts, hashes)
    lost = _unasked_text(path, dropped, cases, texts, now) if dropped else ""
    if recompute:
        return Found((), texts, dropped, "", lost)
    if (version := texts.get("solver_version")) != str(SOLVER_VERSION):
        refused = (
            f"{path}: made by version {version} of the solver, this is {SOLVER_VERSION}, whose results differ and "
            "are not mixed with them; --recompute runs all cases again, -o chooses another archive"
        )
        return Found((), texts, dropped, refused, lost)
    sources = archive.archive_sources(path)
    missing, wider = archive.lacking(job.template, sources[0].kinds), archive.surplus(job.template, sources[0].kinds)
    if missing:
        refused = (
            f"{path}: holds cases of this study, but without {', '.join(missing)}; "
            "--recompute runs all cases again and replaces it, -o chooses another archive"
        )
        return Found((), texts, dropped, refused if dropped < cases else "", lost)
    if wider:
        too_wide = (
            f"{path}: holds {', '.join(wider)} of its cases, which this study no longer keeps; "
            "--drop (in Python drop=True) leaves them out, -o chooses another archive"
        )
        lost = f"{lost}; {too_wide}" if lost else too_wide
    return Found(tuple(sources), texts, dropped, "", lost)


def in_shards(job: Job, hashes: archive.Hashes) -> Found:
    """Return what of a study the shards of an unfinished run hold."""
    shards, command = archive.find_shards(job.parts), archive.read_command(job.parts)
    if not shards:
        return Found()
    every, results = archive.Stored(shards).hashes, [each for each in shards if not each.takes_back]
    unlike = archive.lacking, archive.surplus
    other = archive.Stored([each for each in results if any(of(job.template, each.kinds) for of in unlike)])
    gone = int(np.sum(~archive.are_among(every, hashes) | other.holds(every)))
    lost = (
        f"{job.parts}: holds {len(every)} cases of an unfinished run of this study as it was, and the study no "
        f"longer asks for {gone} of them, or for all that is stored of them; finish that run with the study as it was, "
        "--drop leaves them out, -o chooses another archive"
    )
    whole = [each for each in shards if each.takes_back or not archive.lacking(job.template, each.kinds)]
    return Found(tuple(whole), {} if command is None else command.texts, gone, "", lost if gone else "")


def check_name(study: Study, path: Path, texts: Mapping[str, str]) -> Mapping[str, Any]:
    """Return the resolved study of which an archive holds an earlier state; refuse the archive of another one."""
    try:
        resolved: Mapping[str, Any] = json.loads(texts["resolved"])
        name = str(resolved["study"])
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        raise archive.ArchiveError(
            f"{path}: does not say which study it holds; choose another archive with -o, or move it away"
        ) from error
    if name != study.name:
        raise archive.ArchiveError(
            f"{path}: holds another study, {name!r} and not {study.name!r}; "
            "choose another archive with -o, or move this one away"
        )
    return resolved


def _unasked_text(path: Path, unasked: int, cases: int, was: Mapping[str, str], now: Mapping[str, str]) -> str:
    none = "holds another study of the same name: none of its cases is"
    which = none if unasked == cases else f"{unasked} of its {cases} cases are not"
    before, after = ({str(one) for one in read_choices(texts.get("choices", "{}")).values()} for texts in (was, now))
    decided = "" if before <= after else ", as its tolerance decides `auto` by other cases"
    differs = ", ".join(islice(_differences(*(json.loads(texts["resolved"]) for texts in (was, now))), 3))
    decided += differs and f" (differs in {differs})"
    return (
        f"{path}: {which} asked for by this study as it is now{decided}: {unasked} stored cases would be "
        "lost; --drop (in Python drop=True) leaves them out, -o chooses another archive"
    )


def _differences(was: Any, now: Any, path: str = "") -> Iterator[str]:
    """Yield the single values by which two studies differ."""
    if path == "scalars":
        was, now, path = *({one["path"]: one["values"][0] for one in study} for study in (was, now)), ""
    if isinstance(was, dict) and isinstance(now, dict):
        for key in sorted(was.keys() & now.keys() - {"title", "license"}):
            yield from _differences(was[key], now[key], f"{path}.{key}".removeprefix("."))
    elif was != now and not isinstance(was, list) and not isinstance(now, list):
        yield f"{path}: {' → '.join(f'{one:.12g}' if isinstance(one, float) else str(one) for one in (was, now))}"


def _unasked(path: Path, texts: Mapping[str, str], hashes: archive.Hashes) -> tuple[int, int]:
    """Return how many cases of an archive the study with these ``hashes`` does not ask for, and how many it has.

    Cases of another version of the solver are told apart by the settings in the study that the archive keeps; all
    count where that cannot be read any more.
    """
    try:
        is_same = texts.get("solver_version") == str(SOLVER_VERSION)
        stored = archive.stored_hashes(path) if is_same else case_hashes(archive.grid_of(texts))
    except (
        archive.ArchiveError,
        StudyError,
        LookupError,
        ValueError,
        TypeError,
    ):  # damaged, where all is computed again
        cases = archive.statuses(path).size
        return cases, cases
    return int(np.sum(~archive.are_among(stored, hashes))), len(stored)
