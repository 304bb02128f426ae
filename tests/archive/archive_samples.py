"""Layouts and results for the tests of the archive floor, from no study and no solver."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from workflow import archive

STATUS_ATTRS = {
    "long_name": "how the case ended",
    "flag_values": [0, 1, 2, 3, 4],
    "flag_meanings": "ok diverged ill_posed failed not_run",
}
DIMS = (("scheme", 2), ("e", 3), ("alpha", 25))


def sample_layout(
    dims: tuple[tuple[str, int], ...] = DIMS,
    samples: int = 7,
    periods: int = 3,
    precision: str = "f8",
    key: str = "key of a study",
) -> archive.Layout:
    coordinates = [_coordinate(name, size) for name, size in dims]
    if any(name == "model" for name, _ in dims):  # a zip: two coordinates along one dimension
        coordinates = [c for c in coordinates if c.name != "model"]
        for name, values in {"mechanical_modes": [3, 19, 1], "thermal_modes": [12, 19, 4]}.items():
            attrs = {"units": "1", "long_name": name.replace("_", " ")}
            coordinates.append(archive.Coordinate(name, ("model",), np.array(values), attrs))
    coordinates.append(archive.Coordinate("h", (), np.array(1e-4), {"units": "s", "long_name": "time step"}))
    label = {"long_name": "model of the blade"}
    coordinates.append(archive.Coordinate("lumping", (), np.array("chaîne", object), label))
    variables = [
        archive.Variable("status", "flag", "i1", STATUS_ATTRS),
        archive.Variable("impacts", "metric", "f8", {"units": "1", "long_name": "number of impacts"}),
        archive.Variable("processor_time", "metric", "f8", {"units": "s", "long_name": "processor time"}),
        archive.Variable("batch_width", "metric", "f8", {"units": "1", "long_name": "cases of the batch"}),
    ]
    if samples:
        attrs = {"units": "s", "long_name": "time since the start"}
        coordinates.append(archive.Coordinate("t", ("t",), np.arange(samples) * 1e-3, attrs))
        attrs = {"units": "m", "long_name": "displacement of the tip"}
        variables.append(archive.Variable("displacement", "history", precision, attrs))
    if periods:
        attrs = {"units": "1", "long_name": "number of the load period"}
        coordinates.append(archive.Coordinate("period", ("period",), np.arange(1, periods + 1), attrs))
        attrs = {"units": "N s", "long_name": "impulse of a load period"}
        variables.append(archive.Variable("period_impulse", "period", "f8", attrs))
    return archive.Layout(
        dims=dims,
        tails={name: size for name, size in {"t": samples, "period": periods}.items() if size},
        coordinates=tuple(coordinates),
        variables=tuple(variables),
        attrs={
            "title": "Rotor–stator rub",
            "summary": "made for a test",
            "license": "https://creativecommons.org/licenses/by/4.0/",
            "source": "numbers out of a hat",
            "references": "none",
            "history": "2026-01-01T00:00:00Z: made",
        },
        provenance={
            "study": "study: été\ntitle: x\n",
            "versions": "{}",
            "resolved": '{"study": "x"}',
            "hashes": "0123456789abcdef\n" * 5000,
        },
        key=key,
    )


def branch_layout() -> archive.Layout:
    """A layout of branches: metrics and flags along ``point``, orbits along ``phase`` too."""
    layout, attrs = sample_layout(DIMS[1:], samples=0, periods=0), {"units": "m", "long_name": "displacement"}
    flags = {"long_name": "what happens at a point", "flag_values": [0, 1], "flag_meanings": "none fold"}
    along = (
        archive.Variable("gap", "point", "f8", attrs),
        archive.Variable("bifurcation", "point", "i1", flags),
        archive.Variable("orbit_displacement", "point phase", "f8", attrs),
    )
    return dataclasses.replace(layout, tails={"point": 7, "phase": 4}, variables=(*layout.variables, *along))


def _coordinate(name: str, size: int) -> archive.Coordinate:
    if name == "scheme":
        labels = np.array(["moreau", "event_driven", "carpenter"][:size], dtype=object)
        return archive.Coordinate(name, (name,), labels, {"long_name": "time-stepping scheme"})
    values = np.linspace(0.9, 0.0, size)
    return archive.Coordinate(name, (name,), values, {"units": "1", "long_name": f"axis {name}"})


def sample_results(layout: archive.Layout, seed: int = 0) -> dict[str, Any]:
    """Results of all cases, shaped as in the archive; every seventh case diverged and is NaN."""
    random = np.random.default_rng(seed)
    results: dict[str, Any] = {}
    failed = np.arange(layout.cells).reshape(layout.shape) % 7 == 6
    for variable in layout.variables:
        shape = tuple(layout.sizes[name] for name in layout.dims_of(variable))
        if variable.name == "status":
            results["status"] = failed.astype("i1")
        else:
            values = random.normal(size=shape).astype(variable.dtype)
            values[failed] = variable.fill
            results[variable.name] = values
    return results


def sample_messages(layout: archive.Layout, results: Mapping[str, Any]) -> dict[int, str]:
    """What each failed case did, by cell."""
    failed = np.flatnonzero(results["status"].ravel())
    return {int(cell): f"case {cell} diverged: ρ = 1.2" for cell in failed}


def sample_hashes(layout: archive.Layout) -> np.ndarray:
    """Hashes of all cases, the first ones of any layout the same."""
    return np.random.default_rng(3).integers(0, 256, size=(layout.cells, 16), dtype=np.uint8)


def put_shard(
    parts: Path, layout: archive.Layout, results: Mapping[str, Any], first: int, stop: int, task: int | None = None
) -> Path:
    """Write cells ``first`` to ``stop - 1`` of the results."""
    texts = sample_messages(layout, results)
    values = {v.name: results[v.name].reshape(-1, *layout.tail_shape(v))[first:stop] for v in layout.variables}
    messages = {cell - first: text for cell, text in texts.items() if first <= cell < stop}
    name = f"{first if task is None else task:08d}"
    return archive.write_shard(parts, name, sample_hashes(layout)[first:stop], values, messages, layout)


def begin(path: Path, layout: archive.Layout) -> Path:
    """Begin the shards of an archive; return their directory."""
    parts = archive.parts_of(path)
    archive.start_parts(parts, archive.Command(layout.key, layout.provenance))
    return parts


def put_all(path: Path, layout: archive.Layout, results: Mapping[str, Any], bounds: Iterable[int] = ()) -> Path:
    """Begin and fill the shards of an archive, cut at ``bounds``; return their directory."""
    parts = begin(path, layout)
    for task, (first, stop) in enumerate(itertools.pairwise([0, *bounds, layout.cells])):
        put_shard(parts, layout, results, first, stop, task)
    return parts


def stored_in(parts: Path) -> archive.Stored:
    return archive.Stored(archive.find_shards(parts)[0])


def gather(parts: Path, layout: archive.Layout, path: Path) -> None:
    archive.gather(layout, parts, path, sample_hashes(layout), stored_in(parts))


def make_archive(path: Path, layout: archive.Layout, results: Mapping[str, Any], bounds: Iterable[int] = ()) -> Path:
    parts = put_all(path, layout, results, bounds)
    gather(parts, layout, path)
    archive.remove_parts(parts)
    return path


def check_dataset(
    dataset: Any, layout: archive.Layout, results: Mapping[str, Any], without: tuple[str, ...] = ()
) -> None:
    """Compare an opened archive with what was put in, bit by bit."""
    assert set(dataset.data_vars) == {*results, "message"} - {*without}
    for variable in (each for each in layout.variables if each.name not in without):
        stored = dataset[variable.name]
        assert stored.dims == layout.dims_of(variable)
        assert stored.dtype == variable.dtype
        np.testing.assert_array_equal(stored.values, results[variable.name])
    texts = np.full(layout.cells, "", dtype=object)
    for cell, text in sample_messages(layout, results).items():
        texts[cell] = text
    assert dataset["message"].dims == tuple(name for name, _ in layout.dims)
    assert dataset["message"].values.ravel().tolist() == texts.tolist()
    assert ((dataset["message"] != "").values.ravel() == (texts != "")).all()
    assert set(dataset.coords) == {c.name for c in layout.coordinates}
    for coordinate in layout.coordinates:
        assert dataset[coordinate.name].dims == coordinate.dims
        assert dataset[coordinate.name].values.tolist() == coordinate.values.tolist()
