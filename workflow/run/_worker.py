"""What a worker of a dask cluster does: it makes a run's grid once, then runs tasks of a few numbers each."""

from __future__ import annotations

import importlib.metadata
import threading
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

from workflow.archive import ArchiveError, code_revision, grid_of, read_command, study_key
from workflow.grid import Block, CaseHashes, ReferenceSolution, Task, compute_block, solutions_of
from workflow.models import FACTORISING, has_cholmod
from workflow.run._task import Job, Stored, store_task
from workflow.schemes import SOLVER_VERSION

_MOST_JOBS = 4
"""Runs whose grids a worker keeps: a cluster may serve several runs in turn."""

_MAKING = threading.Lock()


class ClusterError(Exception):
    """A cluster cannot be used for a run; the message says what is wrong and what would be right."""


@dataclass(frozen=True)
class Session:
    """What a worker must know of a run and agree with.

    Attributes
    ----------
    parts
        Directory of the shards, which workers and the run itself share.
    key
        Identity of study and solver version.
    token
        Name of this run, and what its token file holds.
    software
        Name and version of what decides the bits of a result.
    """

    parts: str
    key: str
    token: str
    software: tuple[tuple[str, str], ...]

    @property
    def question(self) -> Path:
        """File by which a worker sees that it shares the directory; swept like any leftover."""
        return Path(self.parts) / f"{self.token}.tmp"

    def answer(self, worker: str) -> Path:
        """Return the file by which a worker is seen to share the directory."""
        return Path(self.parts) / f"{self.token}-{worker}.tmp"


def software() -> tuple[tuple[str, str], ...]:
    """Return name and version of what decides the bits of a result in this process."""
    packages = ((name, importlib.metadata.version(name)) for name in ("numpy", "scipy", "numba"))
    factors = ((name, importlib.metadata.version(name) if has_cholmod() else "none") for name in FACTORISING)
    return (("solver", str(SOLVER_VERSION)), ("code", code_revision()[:12]), *packages, *factors)


def join(session: Session, dask_worker: Any) -> str:
    """Check that a worker may work for a run, leave a file that shows it, and return the worker's name.

    Raises
    ------
    ClusterError
        It has other software, or does not share the directory of the shards.
    """
    other = [(name, mine, expected) for (name, mine), (_, expected) in zip(software(), session.software, strict=True)]
    differences = ", ".join(
        f"{name} {mine} instead of {expected}" for name, mine, expected in other if mine != expected
    )
    if differences:
        raise ClusterError(
            f"the worker has other software than this run: {differences}; install the same version for both, "
            "start its workers anew and give the command again"
        )
    try:
        same = session.question.read_text(encoding="ascii") == session.token
        session.answer(dask_worker.id).touch()
    except OSError as error:
        raise ClusterError(unshared(session, (error.strerror or str(error)).lower())) from None
    if not same:
        raise ClusterError(unshared(session, "it holds something else there"))
    return str(dask_worker.id)


def unshared(session: Session, why: str) -> str:
    return (
        f"the worker does not share {session.parts} with this run ({why}); put the archive (-o) on a file system "
        "that all workers see under the same path and can write to"
    )


def run_block(session: Session, block: Block) -> list[ReferenceSolution]:
    """Compute a block of solutions that tasks need."""
    with _single_threaded_blas().limit(limits=1, user_api="blas"):
        return compute_block(_job(session).grid, block)


def run_task(session: Session, task: Task, blocks: list[Block], solutions: list[list[ReferenceSolution]]) -> Stored:
    """Compute a task on this worker and store it; ``solutions`` are those of the blocks that its cases need.

    Raises
    ------
    ArchiveError
        A shard could not be written.
    ClusterError
        This worker may not work for the run; it came after the run had asked all workers.
    """
    with _single_threaded_blas().limit(limits=1, user_api="blas"):
        job = _job(session)
        return store_task(job, task, solutions_of(job.grid, zip(blocks, solutions, strict=True)))


def _job(session: Session) -> Job:
    with _MAKING:  # threads of one worker share one grid
        return _prepared(session)


@lru_cache(maxsize=_MOST_JOBS)
def _prepared(session: Session) -> Job:
    from distributed import get_worker

    worker = get_worker()
    try:
        session.answer(join(session, worker)).unlink()
        command = read_command(session.parts)
    except (ClusterError, ArchiveError) as error:
        raise ClusterError(f"worker {worker.address}: {error}") from None
    grid = None if command is None else grid_of(command.texts)
    if command is None or grid is None or study_key(grid.study) != session.key:
        raise ClusterError(f"worker {worker.address}: {session.parts} does not hold the study of this run")
    return Job(grid, Path(session.parts), command.begun, CaseHashes(grid))


@cache
def _single_threaded_blas() -> Any:
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
