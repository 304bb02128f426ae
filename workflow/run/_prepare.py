"""What a run does before its tasks: it takes what is stored already, and lays out the directory of the shards."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Self

import numpy as np
from numpy.typing import NDArray

from workflow.archive import (
    COPIED,
    SOFTWARE,
    Layout,
    Shards,
    are_saved,
    clear_parts,
    describe,
    find_shards,
    parts_of,
    provenance,
    save_stored_cells,
    start_parts,
)
from workflow.grid import Grid, case_hashes, units_of, warning_lines
from workflow.run._earlier import Hashes, Reuse, begun_texts, cells_there, clear_other_parts, reused_cells
from workflow.run._outcome import WARNINGS
from workflow.run._task import Job

_HASHED_ASIDE = 100_000
"""Cases that are hashed while tasks run; of more, both at once would hold more memory than either."""


class CaseHashes:
    """Hashes of all cases of a grid, computed once in a thread of their own from when they are first asked for."""

    def __init__(self, grid: Grid) -> None:
        self._grid = grid
        self._once = Lock()
        self._aside = ThreadPoolExecutor(1)
        self._hashes: Future[Hashes] | None = None

    def begin(self) -> Future[Hashes]:
        """Begin to compute them, if nobody has."""
        with self._once:
            if self._hashes is None:
                self._hashes = self._aside.submit(case_hashes, self._grid)
            return self._hashes

    def result(self) -> Hashes:
        """Return them, ``(case, byte)``."""
        return self.begin().result()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._aside.shutdown()


@dataclass(frozen=True)
class Prepared:
    """A run that is ready for its tasks.

    Attributes
    ----------
    job
        What its tasks share.
    done
        Shards that an interrupted run has left.
    there
        For each unit whether its results are stored or are copied from an earlier archive.
    resumed
        Cases that are not computed anew.
    """

    job: Job
    done: Shards
    there: NDArray[np.bool_]
    resumed: int

    @property
    def stored(self) -> int:
        """Cases that are stored or copied whole."""
        return int(np.sum(cells_there(self.job.layout, self.there)))


def prepare(grid: Grid, archive: Path, hashes: CaseHashes, reuse: Reuse, here: bool) -> Prepared:
    """Take what an earlier archive and an interrupted run hold of a study, and begin the directory of its shards.

    Processes that are not started ``here`` are not asked by what linear algebra they compute: they count as not pinned.

    Raises
    ------
    ArchiveError
        They hold another study, or cases that this one no longer asks for; they are damaged or cannot be written.
    """
    study, parts, units = grid.study, parts_of(archive), units_of(grid)
    layout = describe(study, grid, units)
    layout = layout if here else replace(layout, provenance={**layout.provenance, "pinned": "false"})
    if layout.cells > _HASHED_ASIDE:
        hashes.result()
    stored_cells = reused_cells(study, archive, layout, hashes.result(), reuse) if archive.exists() else None
    earlier = [begun_texts(study, parts)]
    if stored_cells is not None and np.any(stored_cells.cells >= 0):
        earlier.append(provenance(archive))
    layout = replace(layout, provenance={**layout.provenance, **_made_elsewhere(filter(None, earlier), layout)})
    clear_other_parts(study, parts, layout, hashes.result, reuse.drop)
    warned = "\n".join(warning_lines(grid))
    layout = replace(layout, attrs={**layout.attrs, **({WARNINGS: warned} if warned else {})})
    start_parts(parts, layout)
    if stored_cells is not None and (reuse.retry or reuse.recompute) and not are_saved(parts, stored_cells):
        clear_parts(parts)  # of a run that took other cases, or was killed when its archive was in place
        start_parts(parts, layout)
    save_stored_cells(parts, stored_cells)
    done = find_shards(parts, layout)
    there = done.owner >= 0
    if stored_cells is not None:
        there |= stored_cells.copies(layout) >= 0
    cells = cells_there(layout, there)
    resumed = int(np.sum(cells if stored_cells is None else cells | (stored_cells.cells >= 0)))
    return Prepared(Job(grid, units, layout, parts, stored_cells), done, there, resumed)


def _made_elsewhere(earlier: Iterable[Mapping[str, str]], layout: Layout) -> dict[str, str]:
    """Return the attribute :data:`COPIED` where other software or another processor ran earlier cases, by texts."""
    same = all(COPIED not in texts and texts.get(n) == layout.provenance[n] for texts in earlier for n in SOFTWARE)
    return {} if same else {COPIED: "cases that other software or another processor ran"}
