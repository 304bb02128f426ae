"""What a run does before its tasks: it takes what is stored already, and begins the directory of its shards."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    COPIED,
    SOFTWARE,
    ArchiveError,
    Command,
    Source,
    Stored,
    file_of,
    find_shards,
    parts_of,
    provenance_of,
    read_command,
    start_parts,
)
from workflow.grid import Batch, CaseHashes, Grid, Task, tasks, warning_lines
from workflow.run._reuse import Reuse, find
from workflow.run._task import Job, not_ok

_STATED = "reference_basis_error"
"""What a study states of its reference, of the corners of its scene, and a stored case of those of an earlier study."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run that is ready for its tasks.

    Attributes
    ----------
    job
        What its tasks share.
    texts
        Those of the provenance group.
    archive
        Cases of the archive.
    reuse
        What is done with them, and with shards.
    missing
        For each case whether it is to be computed.
    """

    job: Job
    texts: Mapping[str, str]
    archive: tuple[Source, ...]
    reuse: Reuse
    missing: NDArray[np.bool_]

    def tasks(self) -> Iterator[Task]:
        """Yield the tasks with the cases that are to be computed."""
        for task in tasks(self.job.grid):
            batches = [Batch(batch.outer, batch.inner[self._is_missing(batch)]) for batch in task.batches]
            left = tuple(batch for batch in batches if batch.inner.size)
            if left:
                share = self.share(task)
                yield replace(task, batches=left, seconds=share * task.seconds, cases=round(share * task.cases))

    def share(self, task: Task) -> float:
        """Return the share of a task's cases that is to be computed."""
        return sum(int(np.sum(self._is_missing(batch))) for batch in task.batches) / task.cases

    def _is_missing(self, batch: Batch) -> NDArray[np.bool_]:
        return self.missing[batch.outer * self.job.grid.inner_count + batch.inner]

    def stored(self) -> Stored:
        """Return what is stored by now."""
        shards = find_shards(self.job.parts, just_written=True)[0]
        taken = self.reuse.taken([*self.archive, *shards], self.job.template)
        return Stored(self._restated(taken) if _STATED in self.job.template else taken)

    def _restated(self, sources: Iterable[Source]) -> Iterator[Source]:
        """Yield sources with the error of the reference's basis as this study has it: those of its own corners."""
        grid, hashes = self.job.grid, self.job.hashes.all()
        cases = Stored([Source(hashes, np.zeros(len(hashes), np.int8), lambda _: hashes, {})])
        chosen = [grid.reference_choice(outer) for outer in range(grid.outer_count)]
        errors = np.array([np.nan if choice is None else choice.error for choice in chosen])
        for source in sources:
            stated = {_STATED: errors[cases.find(source.hashes)[1] // grid.inner_count]}
            yield replace(source, read=partial(_read, stated, source))

    def progress(self) -> tuple[int, Counter[str]]:
        """Return how many cases are stored by now, and those of them that are not ok by their status."""
        stored = self.stored()
        if not stored.sources:
            return 0, Counter()
        status = stored.status(self.job.hashes.all())
        return status.size, not_ok(status)


def _read(stated: Mapping[str, NDArray[Any]], source: Source, name: str) -> NDArray[Any]:
    return stated[name] if name in stated else source.read(name)


def prepare(grid: Grid, archive: Path, reuse: Reuse, here: bool) -> Prepared:
    """Take what an earlier archive and an interrupted run hold of a study, and begin the directory of its shards.

    A plain run finishes the command that was interrupted, and so does the same command unless the program was edited
    meanwhile. Processes that are not started ``here`` are not asked by what linear algebra they compute: they count as
    not pinned.

    Raises
    ------
    ArchiveError
        They hold another study, or cases that this one no longer asks for; they are damaged or cannot be written.
    """
    parts, texts = parts_of(archive), {**provenance_of(grid), **({} if here else {"pinned": "false"})}
    job = Job(grid, parts, time.time_ns(), CaseHashes(grid), "\n".join(warning_lines(grid)))
    earlier, there = read_command(parts), file_of(archive)
    if earlier is not None and earlier.study != grid.study.name:
        raise ArchiveError(
            f"{parts}: holds unfinished results of another study, {earlier.study!r}; finish that one, remove the "
            "directory, or choose another archive with -o"
        )
    reuse = replace(reuse, since=job.begun)
    if earlier is not None and (earlier.key, earlier.archive) == (texts["key"], there):
        reuse = replace(reuse, drop=reuse.drop or earlier.drop)
        asked, code = (reuse.retry, reuse.recompute), earlier.texts.get("code_revision")
        if not any(asked) or (asked, texts["code_revision"]) == ((earlier.retry, earlier.recompute), code):
            reuse = Reuse(earlier.retry, earlier.recompute, reuse.drop, earlier.since)
    found = find(job, texts, archive, reuse)
    found.require(reuse.drop)
    count = grid.outer_count * grid.inner_count
    missing = ~found.stored.holds(job.hashes.all()) if found.stored.sources else np.ones(count, bool)
    if any(COPIED in origin or any(origin.get(n) != texts[n] for n in SOFTWARE) for origin in found.origins):
        texts[COPIED] = "cases that other software or another processor ran"
    start_parts(parts, Command(texts, job.warnings, there, job.begun, **asdict(reuse)))
    return Prepared(job, texts, found.archive, reuse, missing)
