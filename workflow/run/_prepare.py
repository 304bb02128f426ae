"""What a run does before its tasks: it takes what is stored already, and begins the directory of its shards."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    COPIED,
    SOFTWARE,
    ArchiveError,
    Command,
    Hashes,
    Source,
    Stored,
    file_of,
    find_shards,
    parts_of,
    provenance_of,
    read_command,
    start_parts,
)
from workflow.grid import Grid, Task, case_hashes, warning_lines
from workflow.run._reuse import Reuse, in_archive, in_shards
from workflow.run._task import Job, next_command, not_ok, shard_prefix


@dataclass(frozen=True, eq=False)
class Prepared:
    """A run that is ready for its tasks.

    Attributes
    ----------
    job
        What its tasks share.
    texts
        Those of the provenance group.
    sources
        Cases of the archive and of earlier shards.
    reuse
        What is done with them, and with shards of this run.
    hashes
        Identity of every case, ``(case, byte)``.
    missing
        For each case whether it is to be computed, ``(outer, inner)``.
    """

    job: Job
    texts: Mapping[str, str]
    sources: tuple[Source, ...]
    reuse: Reuse
    hashes: Hashes
    missing: NDArray[np.bool_]

    def hashes_of(self, task: Task) -> Hashes:
        """Return the identity of each case of a task."""
        cases = np.concatenate([batch.outer * self.missing.shape[1] + batch.inner for batch in task.batches])
        return np.asarray(self.hashes[cases])

    def stored(self) -> Stored:
        """Return what is stored by now."""
        written = find_shards(self.job.parts, since=shard_prefix(self.job.begun))
        return self.reuse.taken([*self.sources, *written], self.job)

    def progress(self) -> tuple[int, Counter[str]]:
        """Return how many cases are stored by now, and those of them that are not ok by their status."""
        status = self.stored().status(self.hashes)
        return status.size, not_ok(status)


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
    earlier, there = read_command(parts), file_of(archive)
    begun = next_command(parts, 0 if earlier is None else earlier.begun)
    job = Job(grid, parts, begun, "\n".join(warning_lines(grid)))
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
    hashes = case_hashes(grid)
    held, unfinished = in_archive(archive, job, texts, hashes, reuse.recompute), in_shards(job, hashes)
    elsewhere: set[str] = set()
    for found in (held, unfinished):
        found.require(reuse.drop)
        if found.texts and reuse.taken(found.sources, job).holds(hashes).any():
            elsewhere |= {name for name in SOFTWARE if found.texts.get(name) != texts[name]}
            elsewhere.update(filter(None, found.texts.get(COPIED, "").split(", ")))
    if elsewhere:
        texts[COPIED] = ", ".join(sorted(elsewhere))
    sources = (*held.sources, *unfinished.sources)
    start_parts(parts, Command(texts, job.warnings, there, job.begun, **asdict(reuse)))
    missing = ~reuse.taken(sources, job).holds(hashes).reshape(grid.outer_count, grid.inner_count)
    return Prepared(job, texts, sources, reuse, hashes, missing)
