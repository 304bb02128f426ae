"""Templates and results for the tests of the archive floor, from no study and no solver."""

import itertools
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from workflow import archive
from workflow.plan import encode

DIMS = (("scheme", 2), ("e", 3), ("alpha", 25))
TEXTS = {
    "key": "key of a study",
    "study": "study: été\ntitle: x\n",
    "versions": "{}",
    "resolved": '{"study": "x"}',
    "hashes": "0123456789abcdef\n" * 5000,
}


def sample_template(
    dims: tuple[tuple[str, int], ...] = DIMS, samples: int = 7, periods: int = 3, precision: str = "f8"
) -> xr.Dataset:
    coords = {name: _coordinate(name, size) for name, size in dims if name != "model"}
    if "model" in dict(dims):  # a zip: two coordinates along one dimension
        for name, values in {"mechanical_modes": [3, 19, 1], "thermal_modes": [12, 19, 4]}.items():
            coords[name] = ("model", np.array(values), {"units": "1", "long_name": name.replace("_", " ")})
    coords["h"] = ((), np.array(1e-4), {"units": "s", "long_name": "time step"})
    coords["lumping"] = ((), np.array("chaîne", object), {"long_name": "model of the blade"})
    tails = {name: size for name, size in {"t": samples, "period": periods}.items() if size}
    sizes = dict(dims) | tails
    results = {
        "status": result(sizes, dims, "i1", 4, flags("ok diverged ill_posed failed not_run")),
        "impacts": result(sizes, dims, "f8", np.nan, {"units": "1", "long_name": "number of impacts"}),
        "processor_time": result(sizes, dims, "f8", np.nan, {"units": "s", "long_name": "processor time"}),
        "batch_width": result(sizes, dims, "f8", np.nan, {"units": "1", "long_name": "cases of the batch"}),
    }
    if samples:
        coords["t"] = ("t", np.arange(samples) * 1e-3, {"units": "s", "long_name": "time since the start"})
        attrs = {"units": "m", "long_name": "displacement of the tip"}
        results["displacement"] = result(sizes, (*dims, "t"), precision, np.nan, attrs)
    if periods:
        coords["period"] = ("period", np.arange(1, periods + 1), {"units": "1", "long_name": "number of the period"})
        attrs = {"units": "N s", "long_name": "impulse of a load period"}
        results["period_impulse"] = result(sizes, (*dims, "period"), "f8", np.nan, attrs)
    attrs = {
        "Conventions": "CF-1.11",
        "title": "Rotor–stator rub",
        "summary": "made for a test",
        "license": "https://creativecommons.org/licenses/by/4.0/",
        "source": "numbers out of a hat",
        "references": "none",
        "history": "2026-01-01T00:00:00Z: made",
    }
    return encode(xr.Dataset(results, coords, attrs))


def result(sizes: Mapping[str, int], dims: Iterable[Any], dtype: str, blank: float, attrs: Any) -> Any:
    names = tuple(dim if isinstance(dim, str) else dim[0] for dim in dims)
    return names, np.full([sizes[name] for name in names], blank, dtype), attrs


def flags(meanings: str) -> dict[str, Any]:
    values = np.arange(len(meanings.split()), dtype=np.int8)
    return {"long_name": "what there is", "flag_values": values, "flag_meanings": meanings}


def branch_template() -> xr.Dataset:
    """A template of branches: metrics and flags along ``point``, orbits along ``phase`` too."""
    template, attrs = sample_template(DIMS[1:], samples=0, periods=0), {"units": "m", "long_name": "displacement"}
    sizes, dims = dict(template.sizes) | {"point": 7, "phase": 4}, DIMS[1:]
    along = {
        "gap": result(sizes, (*dims, "point"), "f8", np.nan, attrs),
        "bifurcation": result(sizes, (*dims, "point"), "i1", 0, flags("none fold")),
        "orbit_displacement": result(sizes, (*dims, "point", "phase"), "f8", np.nan, attrs),
    }
    return encode(template.assign(along))


def _coordinate(name: str, size: int) -> Any:
    if name == "scheme":
        labels = np.array(["moreau", "event_driven", "carpenter"][:size], dtype=object)
        return name, labels, {"long_name": "time-stepping scheme"}
    return name, np.linspace(0.9, 0.0, size), {"units": "1", "long_name": f"axis {name}"}


def by_case(template: xr.Dataset, name: str, values: Any) -> Any:
    """Return values of a variable with the cases along one axis, ``(case, …)``."""
    return values.reshape(-1, *template[name].shape[template["status"].ndim :])


def sample_results(template: xr.Dataset, seed: int = 0) -> dict[str, Any]:
    """Results of all cases, shaped as in the archive; every seventh case diverged and is NaN."""
    random = np.random.default_rng(seed)
    results: dict[str, Any] = {}
    failed = np.arange(template["status"].size).reshape(template["status"].shape) % 7 == 6
    for name, variable in template.data_vars.items():
        if name == "status":
            results["status"] = failed.astype("i1")
        else:
            values = random.normal(size=variable.shape).astype(variable.dtype)
            values[failed] = variable.values.flat[0]
            results[str(name)] = values
    return results


def sample_messages(template: xr.Dataset, results: Mapping[str, Any]) -> dict[int, str]:
    """What each failed case did, by cell."""
    failed = np.flatnonzero(results["status"].ravel())
    return {int(cell): f"case {cell} diverged: ρ = 1.2" for cell in failed}


def sample_hashes(template: xr.Dataset) -> np.ndarray:
    """Hashes of all cases, the first ones of any template the same."""
    return np.random.default_rng(3).integers(0, 256, size=(template["status"].size, 16), dtype=np.uint8)


def put_shard(
    parts: Path, template: xr.Dataset, results: Mapping[str, Any], first: int, stop: int, task: int | None = None
) -> Path:
    """Write cells ``first`` to ``stop - 1`` of the results."""
    texts = sample_messages(template, results)
    values = {name: by_case(template, name, results[name])[first:stop] for name in map(str, template.data_vars)}
    messages = {cell - first: text for cell, text in texts.items() if first <= cell < stop}
    name = f"{first if task is None else task:08d}"
    return archive.write_shard(parts, name, sample_hashes(template)[first:stop], values, messages, template)


def begin(path: Path) -> Path:
    parts = archive.parts_of(path)
    archive.start_parts(parts, archive.Command(TEXTS))
    return parts


def put_all(path: Path, template: xr.Dataset, results: Mapping[str, Any], bounds: Iterable[int] = ()) -> Path:
    """Begin and fill the shards of an archive, cut at ``bounds``; return their directory."""
    parts = begin(path)
    for task, (first, stop) in enumerate(itertools.pairwise([0, *bounds, template["status"].size])):
        put_shard(parts, template, results, first, stop, task)
    return parts


def stored_in(parts: Path) -> archive.Stored:
    return archive.Stored(archive.find_shards(parts))


def gather(parts: Path, template: xr.Dataset, path: Path) -> None:
    archive.gather(template, TEXTS, parts, path, sample_hashes(template), stored_in(parts))


def make_archive(path: Path, template: xr.Dataset, results: Mapping[str, Any], bounds: Iterable[int] = ()) -> Path:
    parts = put_all(path, template, results, bounds)
    gather(parts, template, path)
    archive.remove_parts(parts)
    return path


def check_dataset(dataset: Any, template: xr.Dataset, results: Mapping[str, Any]) -> None:
    """Compare an opened archive with what was put in, bit by bit."""
    assert set(dataset.data_vars) == {*results, "message"}
    for name, variable in template.data_vars.items():
        stored = dataset[name]
        assert stored.dims == variable.dims
        assert stored.dtype == variable.dtype
        np.testing.assert_array_equal(stored.values, results[str(name)])
    texts = np.full(template["status"].size, "", dtype=object)
    for cell, text in sample_messages(template, results).items():
        texts[cell] = text
    assert dataset["message"].dims == template["status"].dims
    assert dataset["message"].values.ravel().tolist() == texts.tolist()
    assert ((dataset["message"] != "").values.ravel() == (texts != "")).all()
    assert set(dataset.coords) == set(template.coords)
    for name, coordinate in template.coords.items():
        assert dataset[name].dims == coordinate.dims
        assert dataset[name].values.tolist() == coordinate.values.tolist()
