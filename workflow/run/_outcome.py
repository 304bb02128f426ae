"""How a run ended, read from its archive."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from workflow.archive import endings, open_archive
from workflow.schemes import Status

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Attributes
    ----------
    archive
        Where the archive is.
    counts
        Number of cases by name of their status.
    failures
        Labels and message of the first cases that are not ok or lack an error, at most :data:`SHOWN`.
    seconds
        Wall time of this run.
    resumed
        Cases that were stored before; all of them where there was nothing to do.
    """

    archive: Path
    counts: dict[str, int]
    failures: tuple[tuple[str, str], ...]
    seconds: float
    resumed: int
    without_error: int = 0
    """Cases that are ok and have an error against the reference that cannot be formed."""
    written: bool = True
    """Whether this run wrote the archive: it did not where there was nothing to do."""

    @cached_property
    def dataset(self) -> xr.Dataset:
        """The archive, opened lazily when it is first asked for."""
        return open_archive(self.archive)

    @property
    def ok(self) -> bool:
        """Whether every case is ok and has its errors against the reference, where the study has one."""
        return set(self.counts) <= {Status.OK.name.lower()} and not self.without_error


SHOWN = 10
"""Failed cases that a summary names."""


def status_name(value: int) -> str:
    """Return the name of a status, also of one that no version of this workflow has written."""
    return Status(value).name.lower() if value in Status._value2member_map_ else f"status {value}"


def status_counts(dataset: xr.Dataset) -> dict[str, int]:
    """Return the number of cases by name of their status."""
    return _counted(dataset["status"].values)


def _counted(status: NDArray[Any]) -> dict[str, int]:
    values, number = np.unique(status, return_counts=True)
    return {status_name(int(value)): int(n) for value, n in zip(values, number, strict=True)}


def labels_of_case(dataset: xr.Dataset, cell: int) -> str:
    """Return the coordinates that identify a case, given by its number, as ``sel`` takes them: all digits, no units."""
    dims, case = dataset["status"].dims, _case(dataset, cell)
    return ", ".join(
        f"{name} = {case[name].item()}" for dim in dims for name in dataset.coords if dataset[name].dims == (dim,)
    )


def _case(dataset: xr.Dataset, cell: int) -> xr.Dataset:
    dims = dataset["status"].dims
    index = np.unravel_index(cell, dataset["status"].shape) if dims else ()
    return dataset.isel({dim: int(i) for dim, i in zip(dims, index, strict=True)})


def summarise(archive: Path, resumed: int | None) -> Outcome:
    """Read from an archive how its cases ended; the seconds of the run are left to fill in.

    ``resumed`` is ``None`` where there was nothing to do.
    """
    status, without_error = endings(archive)
    telling = np.flatnonzero((status != Status.OK).ravel() | without_error.ravel())[:SHOWN].tolist()
    failures = _labelled_messages(archive, telling) if telling else ()
    before = status.size if resumed is None else resumed
    missing = int(np.sum(without_error))
    return Outcome(archive, _counted(status), failures, 0.0, before, missing, written=resumed is not None)


def _labelled_messages(archive: Path, cells: list[int]) -> tuple[tuple[str, str], ...]:
    """Return labels and message of some cases."""
    with open_archive(archive) as dataset:
        return tuple(
            (labels_of_case(dataset, cell) or "the case", str(_case(dataset, cell)["message"].item())) for cell in cells
        )
