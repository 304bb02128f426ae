"""``workflow show``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

from workflow.cli._terminal import say, write_json
from workflow.cli._words import ArchiveFiles, AsJson

if TYPE_CHECKING:
    import xarray as xr

VALUES_SHOWN = 8
FAILURES_SHOWN = 20


def show(
    archives: ArchiveFiles,
    as_json: AsJson = False,
) -> None:
    """Say what archives hold: dimensions, statuses, what failed and why; as JSON in a line for each archive."""
    from workflow.archive import open_archive

    for archive in archives:
        with open_archive(archive) as dataset:
            if as_json:
                write_json(_entries(archive, dataset))
            else:
                for line in _lines(archive, dataset):
                    say(line)


def _lines(archive: Path, dataset: xr.Dataset) -> Iterator[str]:
    from workflow.run import warnings_of

    yield f"{archive}: {dataset.attrs.get('title', 'without a title')}"
    yield from (f"  beware: {warning}" for warning in warnings_of(dataset))
    yield from _coordinates(dataset)
    yield from decided_lines(dataset)
    yield from _statuses(dataset)


def _entries(archive: Path, dataset: xr.Dataset) -> dict[str, Any]:
    """Return what is shown as the entries of its JSON, with all values of the coordinates."""
    from workflow.analysis import failures
    from workflow.run import status_counts, warnings_of

    coordinates = {
        str(name): {
            "dims": list(values.dims),
            "units": values.attrs.get("units", ""),
            "values": values.values.tolist(),
        }
        for name, values in dataset.coords.items()
        if name != "t"
    }
    return {
        "archive": str(archive),
        "title": dataset.attrs.get("title", ""),
        "warnings": warnings_of(dataset),
        "dimensions": {str(name): size for name, size in dataset.sizes.items()},
        "coordinates": coordinates,
        "status": status_counts(dataset),
        "runaway": int(dataset["runaway"].sum()) if "runaway" in dataset else 0,
        "failures": failures(dataset),
    }


def _coordinates(dataset: xr.Dataset) -> Iterator[str]:
    from workflow.analysis import case_dims, exact, labels_of

    for dim in case_dims(dataset):
        values = labels_of(dataset, dim, named=False)
        more = f"; … {len(values)} in all" if len(values) > VALUES_SHOWN else ""
        yield f"  {dim} ({len(values)}): {'; '.join(values[:VALUES_SHOWN])}{more}"
    for name in dataset.coords:
        if dataset[name].ndim == 0:
            yield f"  {name} = {labels_of(dataset.expand_dims(name), str(name), named=False)[0]}"
    if "t" in dataset.sizes:
        t = dataset["t"].values
        yield f"  t: {t.size} samples to {exact(t[-1])} s"


def decided_lines(dataset: xr.Dataset) -> Iterator[str]:
    """Yield counts of modes that tolerances decided, and in how many conditions they meet them."""
    from workflow.analysis import decided

    models = decided(dataset)
    for one in models[:VALUES_SHOWN]:
        yield f"  auto: {one.text}"
    if len(models) > VALUES_SHOWN:
        yield f"  auto: … {len(models)} in all"


def _statuses(dataset: xr.Dataset) -> Iterator[str]:
    from workflow.analysis import failures, runaways
    from workflow.run import status_counts

    counts = status_counts(dataset)
    yield "  status: " + ", ".join(f"{number} {name}" for name, number in counts.items())
    above, flutter = runaways(dataset)
    if above:
        yield f"  {above} ok cases above their critical alpha (flag runaway)"
    if flutter:
        yield f"  {flutter} ok cases whose contact would flutter below it (flag runaway)"
    groups = failures(dataset)
    for group in groups[:FAILURES_SHOWN]:
        many = "" if group.cases == 1 else f" and {group.cases - 1} more"
        yield f"  {group.status}: {group.first}{many}: {group.message}"
    if len(groups) > FAILURES_SHOWN:
        yield f"  … and {len(groups) - FAILURES_SHOWN} more messages"
