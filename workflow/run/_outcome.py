"""How a run ended, read from its archive."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from workflow.archive import open_archive
from workflow.judges.load_periods import SETTLED, change_of_impulse
from workflow.plan import WARNINGS, too_thick
from workflow.schemes import LINEAR, Status
from workflow.variables import COMPARED

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Outcome:
    """How a run ended."""

    archive: Path
    """Where the archive is."""
    counts: dict[str, int]
    """Number of cases by name of their status."""
    seconds: float
    """Wall time of this run."""
    resumed: int
    """Cases that were stored before; all of them where there was nothing to do."""
    without_error: int = 0
    """Cases that are ok and have an error against the reference that cannot be formed."""
    written: bool = True
    """Whether this run wrote the archive: it did not where there was nothing to do."""
    warnings: tuple[str, ...] = ()
    """What to beware of, one sentence each, see :func:`warnings_of`."""

    @cached_property
    def dataset(self) -> xr.Dataset:
        """The archive, opened lazily when it is first asked for."""
        return open_archive(self.archive)

    @property
    def ok(self) -> bool:
        """Whether every case is ok and has its errors against the reference, where the study has one."""
        return set(self.counts) <= {Status.OK.name.lower()} and not self.without_error

    def _repr_html_(self) -> str:
        """Return what a notebook shows: the counts, and what to beware of."""
        counts = ", ".join(f"{number} {name}" for name, number in self.counts.items())
        warned = "".join(f"<li>beware: {escape(warning)}</li>" for warning in self.warnings)
        return f"<p><code>{escape(str(self.archive))}</code>: {counts}, {self.seconds:.1f} s</p><ul>{warned}</ul>"


_ERRORS = tuple(f"{name}_error" for name in COMPARED)


_PARTS = 64
"""Parts in which load periods are read."""


def status_name(value: int) -> str:
    """Return the name of a status, also of one that no version of this workflow has written."""
    return Status(value).name.lower() if value in Status._value2member_map_ else f"status {value}"


def status_counts(dataset: xr.Dataset) -> dict[str, int]:
    """Return the number of cases by name of their status."""
    values, number = np.unique(dataset["status"].values, return_counts=True)
    return {status_name(int(value)): int(n) for value, n in zip(values, number, strict=True)}


def labels_of_case(dataset: xr.Dataset, number: int) -> str:
    """Return the coordinates that identify a case, given by its number, without units; floats in six digits."""
    dims, case = dataset["status"].dims, case_of(dataset, number)
    return ", ".join(
        f"{name} = {value:.6g}" if isinstance(value := case[name].item(), float) else f"{name} = {value}"
        for dim in dims
        for name in dataset.coords
        if dataset[name].dims == (dim,)
    )


def warnings_of(dataset: xr.Dataset) -> tuple[str, ...]:
    """Return what to beware of in an archive, a sentence each: temperatures, settling, what its plan warned of."""
    return (
        *_hottest(dataset),
        *_coarse_tip(dataset),
        *_moving(dataset),
        *_unsettled(dataset),
        *str(dataset.attrs.get(WARNINGS, "")).splitlines(),
    )


def _hottest(dataset: xr.Dataset) -> Iterator[str]:
    """Yield how many ok cases exceed :data:`LINEAR`, and the hottest of them."""
    if "max_temperature" in dataset:
        for cases, hottest, where in _beyond(dataset, dataset["max_temperature"].values, LINEAR):
            yield (
                f"{cases} are hotter than {LINEAR:g} K, above which a linear model means nothing; "
                f"the hottest reaches {hottest:.4g} K: {where}"
            )


def _beyond(dataset: xr.Dataset, values: NDArray[np.float64], limit: float) -> Iterator[tuple[str, float, str]]:
    """Yield, where ok cases exceed a limit at some contact, how many do, the largest value and its case."""
    ok = dataset["status"].values == Status.OK
    largest = np.where(ok, np.fmax.reduce(values.reshape(*ok.shape, -1), axis=-1), np.nan)
    if count := int(np.sum(largest > limit)):
        most = int(np.nanargmax(largest))
        where = labels_of_case(dataset, most) or "the only case"
        yield f"{count} of {np.sum(ok)} ok cases", float(largest.flat[most]), where


def _coarse_tip(dataset: xr.Dataset) -> Iterator[str]:
    """Yield that the cell at the tip is thicker than heat enters in the mean contact of the ok cases.

    Impacts, in steps contacts of one step, heat by α (1 + e) v/c at any mesh. At e > 0 a tip bounces before it rests:
    a load period has one contact then.
    """
    about = dataset["max_temperature"].attrs if "max_temperature" in dataset else {}
    if "depth" in about:
        time, impacts, step = dataset["contact_time"], dataset["impacts"], dataset["h"]
        lasts = time > 1.001 * impacts * step.where(dataset["scheme"] != "event_driven", 0.0)
        contacts = impacts.where(dataset["e"] == 0, impacts.clip(max=dataset.sizes.get("period"))).clip(min=1)
        counted = lasts & (dataset["status"] == Status.OK) & (dataset["alpha"] > 0)
        total, count = (float(values.where(counted).sum()) for values in (time, contacts))
        yield from too_thick(about, total / max(count, 1.0), "a mean contact")


def _unsettled(dataset: xr.Dataset) -> Iterator[str]:
    """Yield how many ok cases have not settled, by the impulses of load periods, where no steady rubs are asked for."""
    if "period_impulse" not in dataset or "steady_state" in dataset:
        return
    periods = dataset["period_impulse"].transpose(..., "period")
    along, size = periods.dims[0], periods.shape[0]
    width = size if along == "period" else 1 + size // _PARTS
    parts = (periods.isel({along: slice(k, k + width)}) for k in range(0, size, width))
    change = np.concatenate([np.ravel(change_of_impulse(part.values)) for part in parts])
    remedy = "make `duration` longer" + ", or ask for `output.steady`" * ("worn_depth" not in dataset)
    for cases, most, where in _beyond(dataset, change, SETTLED):
        yield (
            f"{cases} have not settled: the mean impulse of a load period changes by more than {SETTLED:.0%} between "
            f"the last two quarters of the periods; most, {most:.0%}: {where}; {remedy}"
        )


def _moving(dataset: xr.Dataset) -> Iterator[str]:
    """Yield how far the largest temperature, or worn depth, still moves between the two finest meshes of an axis."""
    decided = {"nodes": "max_temperature", "tip_cell": "max_temperature", "sectors": "max_worn_depth"}
    for name, values in dataset.coords.items():
        word = str(values.attrs.get("study_path", "")).rsplit(".", 1)[-1]
        metric = decided.get(word, "")
        if metric in dataset and values.size > 1:
            coarse, fine = np.argsort(-values.values if word == "tip_cell" else values.values)[-2:]
            largest = dataset[metric].where(dataset["status"] == Status.OK)
            before, last = (largest.isel({values.dims[0]: k}) for k in (coarse, fine))
            change = float(np.abs(1 - before / last.where(last != 0)).max())
            ends = f"{name} = {values.values[coarse]:g} to {values.values[fine]:g}"
            if change >= 0:  # some case is warm, or worn
                yield f"{metric} still changes by up to {100 * change:.2g} % from {ends}"


def case_of(dataset: xr.Dataset, number: int) -> xr.Dataset:
    """Return a case, given by its number."""
    dims = dataset["status"].dims
    index = np.unravel_index(number, dataset["status"].shape) if dims else ()
    return dataset.isel({dim: int(i) for dim, i in zip(dims, index, strict=True)})


def summarise(archive: Path, resumed: int | None) -> Outcome:
    """Read from an archive how its cases ended; the seconds of the run are left to fill in.

    ``resumed`` is ``None`` where there was nothing to do.
    """
    with open_archive(archive) as dataset:
        status = dataset["status"].values
        missing = [np.isnan(dataset[name].values) for name in _ERRORS if name in dataset]
        without_error = (status == Status.OK) & np.any(missing, axis=0)
        return Outcome(
            archive,
            status_counts(dataset),
            0.0,
            status.size if resumed is None else resumed,
            int(np.sum(without_error)),
            resumed is not None,
            warnings_of(dataset),
        )
