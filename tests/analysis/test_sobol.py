"""Sobol' indices against SciPy, a function with known ones, and a tip that is pressed by a constant load."""

from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from scipy.stats import sobol_indices

from workflow import open_archive, plots, read_study, recommend, run_study, sobol
from workflow.report import write_report
from workflow.study.ranges import Drawn, Range

NUMBERS = ("x", "y", "z")


def table(f: np.ndarray, zipped: Drawn) -> xr.Dataset:
    """Return values ``(…, case)`` as an archive has them."""
    dims = (*("e", "alpha")[: f.ndim - 1], "design")
    about = {"sample_point": np.repeat(np.arange(zipped.points), len(zipped.matrices))}
    about |= {"sample_matrix": np.array(zipped.matrices * zipped.points, dtype=object)}
    numbers = {path: ("design", list(values), {"study_path": path}) for path, values in zipped.columns().items()}
    coords = numbers | {name: ("design", values) for name, values in about.items()}
    return xr.Dataset({"f": (dims, f), "status": (dims, np.zeros(f.shape, np.int8))}, coords)


def ishigami(points: int) -> xr.Dataset:
    zipped = Drawn("sobol_indices", points, 1, dict.fromkeys(NUMBERS, Range("lin", -np.pi, np.pi)))
    x, y, z = zipped.columns().values()
    return table(np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * np.power(z, 4) * np.sin(x), zipped)


def test_estimates_are_those_of_scipy() -> None:
    dataset = ishigami(64)
    a, b, *mixed = dataset["f"].values.reshape(64, 5).T
    scipy = sobol_indices(func={"f_A": a[None], "f_B": b[None], "f_AB": np.array(mixed)[:, None]}, n=64)
    indices = sobol(dataset.isel(design=np.random.default_rng(3).permutation(320)), "f").sel(number=list(NUMBERS))
    assert indices["first"].values == pytest.approx(scipy.first_order, rel=1e-12, abs=1e-12)
    assert indices["total"].values == pytest.approx(scipy.total_order, rel=1e-12, abs=1e-12)


def test_an_interval_is_that_of_resampled_points() -> None:
    dataset, generator = ishigami(16), np.random.default_rng(0)
    f = dataset["f"].values.reshape(16, 5)
    again = [f[generator.integers(16, size=16)] for _ in range(999)]
    both = [sobol(dataset.assign(f=("design", one.ravel())), "f") for one in again[:40]]
    a, b, mixed = (np.array([one[:, at] for one in again]) for at in (0, 1, slice(2, None)))
    centre, variance = np.concatenate([a, b], 1).mean(1)[:, None], np.concatenate([a, b], 1).var(1)[:, None]
    first = ((b - centre)[..., None] * (mixed - a[..., None])).mean(1) / variance
    total = ((mixed - a[..., None]) ** 2).mean(1) / 2 / variance
    assert np.array([one["first"].values for one in both]) == pytest.approx(first[:40])
    indices = sobol(dataset, "f")
    assert pytest.approx(np.percentile(first, [2.5, 97.5], axis=0)) == indices["first_interval"].values.T
    assert pytest.approx(np.percentile(total, [2.5, 97.5], axis=0)) == indices["total_interval"].values.T


def test_other_dimensions_stay_and_what_is_missing_has_no_index() -> None:
    one = ishigami(8)
    dataset = table(np.stack([one["f"].values, np.full(40, 0.1), 2 * one["f"].values]), Drawn(
        "sobol_indices", 8, 1, dict.fromkeys(NUMBERS, Range("lin", -np.pi, np.pi))
    ))  # fmt: skip
    dataset["status"][2, 3] = 1  # the second number of B in the first point
    indices = sobol(dataset, "f")
    assert indices["first"].dims == ("e", "number")
    assert list(indices["number"].values) == list(NUMBERS)
    assert indices["total"][0].values == pytest.approx(sobol(one, "f")["total"].values)
    assert np.isnan(indices["first"][1]).all()
    assert np.isnan(indices["total_interval"][1]).all()
    assert np.isnan(indices["first"][2]).values.tolist() == [False, True, False]
    with pytest.raises(ValueError, match="`g` is no metric along `design`"):
        sobol(dataset, "g")
    with pytest.raises(ValueError, match="draw a zip with `sample: sobol_indices`"):
        sobol(dataset.isel(design=slice(0, None, 5)), "f")


PRESSED = """
study: pressed
scene:
  chain: {nodes: 3, mass: 2.5e-3, stiffness: 4.0e6, damping: {mass: 10}, heat_capacity: 1}
  casing: {gap: 20 um}
  load: {mean: 120}
  initial: static
  duration: 20 ms
axes: {scheme: [moreau, event_driven], h: 1e-4}
zip:
  design: {sample: sobol_indices, points: 128, of: {scene.load.mean: [60, 90], scene.casing.gap: [10 um, 30 um]}}
reference: {scheme: event_driven}
output: {interval: 1 ms}
"""


def test_a_pressed_tip_divides_its_impulse_between_load_and_gap(tmp_path: Path) -> None:
    """The impulse is T (F − d/S), S = 3/4e6 m/N: shares of (30 N)² and (20 µm/S)², nothing together."""
    study = read_study(PRESSED)
    run_study(study, tmp_path / "pressed.nc", threads=1)
    outcome = run_study(study.with_({"zip.design.points": 256}), tmp_path / "pressed.nc", threads=1)
    assert outcome.resumed == 1024
    dataset, flexibility = open_archive(tmp_path / "pressed.nc"), 3 / 4e6
    force = dataset["mean"] - dataset["gap"] / flexibility
    assert dataset["contact_impulse"].values == pytest.approx(np.array([0.02 * force.values] * 2), rel=1e-6)
    indices = sobol(dataset, "contact_impulse")
    load, gap = 30**2, (20e-6 / flexibility) ** 2
    for name in ("first", "total"):
        assert indices[name].sel(number=["mean", "gap"]).values == pytest.approx(
            np.array([[load, gap]] * 2) / (load + gap),
            abs=4e-3,  # of 256 points
        )
    assert "sample_point" not in recommend(dataset).choice.worst.case
    figure = plots.sobol_indices(dataset.sel(scheme="event_driven"), "contact_impulse")
    first, total = (line for line in figure.axes[0].get_lines() if line.get_marker() != "None")
    assert first.get_ydata() == pytest.approx(indices["first"].sel(scheme="event_driven").values)
    assert total.get_ydata() == pytest.approx(indices["total"].sel(scheme="event_driven").values)
    page = write_report(tmp_path / "pressed.nc").page.read_text(encoding="utf-8")
    assert "What the drawn numbers do" in page
    assert "What the axes do" not in page
