"""What a worker of a dask cluster does: it makes a run's grid once, then runs tasks of a few numbers each."""

from __future__ import annotations

import importlib.metadata
import threading
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from workflow.archive import ArchiveError, Command, code_revision, grid_of, read_command, study_key
from workflow.grid import ReferenceBlock, ReferenceSolutions, Task, compute_block
from workflow.models import FACTORISING, has_cholmod, one_thread
from workflow.run._task import Job, Report, store_task
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
    begun
        Number of the run's command, as it stands there.
    software
        Name and version of what decides the bits of a result.
    """

    parts: str
    begun: int
    software: tuple[tuple[str, str], ...]


def software() -> tuple[tuple[str, str], ...]:
    """Return name and version of what decides the bits of a result in this process."""
    packages = ((name, importlib.metadata.version(name)) for name in ("numpy", "scipy", "numba"))
    factors = ((name, importlib.metadata.version(name) if has_cholmod() else "none") for name in FACTORISING)
    return (("solver", str(SOLVER_VERSION)), ("code", code_revision()[:12]), *packages, *factors)


def join(session: Session) -> Command:
    """Check that a worker may work for a run, and return the run's command.

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
        command = read_command(session.parts)
    except ArchiveError as error:
        raise ClusterError(str(error)) from None
    if command is None or command.begun != session.begun:
        raise ClusterError(
            f"the worker does not share {session.parts} with this run; put the archive (-o) on a file system that all "
            "workers see under the same path and can write to"
        )
    return command


def run_block(session: Session, block: ReferenceBlock) -> ReferenceSolutions:
    """Compute a block of solutions that tasks need."""
    with one_thread():
        return compute_block(_job(session).grid, block)


def run_task(session: Session, task: Task, *words: Any) -> Report:
    """Compute a task on this worker and store it, as :func:`store_task`.

    Raises
    ------
    ArchiveError
        A shard could not be written.
    ClusterError
        This worker may not work for the run; it came after the run had asked all workers.
    """
    with one_thread():
        return store_task(_job(session), task, *words)


def _job(session: Session) -> Job:
    with _MAKING:  # threads of one worker share one grid
        return _prepared(session)


@lru_cache(maxsize=_MOST_JOBS)
def _prepared(session: Session) -> Job:
    from distributed import get_worker

    try:
        command = join(session)
    except ClusterError as error:
        raise ClusterError(f"worker {get_worker().address}: {error}") from None
    grid = grid_of(command.texts)
    if study_key(grid.study) != command.key:  # as of large files, which do not travel
        raise ClusterError(
            f"worker {get_worker().address}: files or modules that the study names are others there than when the run "
            "read them; bring them back and give the command again"
        )
    return Job(grid, Path(session.parts), command.begun)
