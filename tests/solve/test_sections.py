"""The tip at the start of each load period, its impacts and its extremes in it, for every scheme of the project."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from quick import quick
from studies import SCENE, parsed
from workflow import plan_study, plots, run_study
from workflow.archive import ArchiveError
from workflow.cases import arrange, case_hashes
from workflow.solve import _solve, solve
from workflow.study import Study

FREQUENCIES = (50.0, 125.0, 333.3)
SCHEMES = ("event_driven", "moreau", "carpenter", "penalty")


def rub(interval: str = "0.1 ms") -> Study:
    axes = f"scheme: [{', '.join(SCHEMES)}], e: 0.5, alpha: 5, h: 3e-7, scene.load.frequency: {list(FREQUENCIES)}"
    output = f"interval: {interval}, sections: true, histories: [displacement, velocity, temperature]"
    scene = SCENE.replace("frequency: 50 Hz", "frequency: 50")
    return parsed(f"study: rub\n{scene}\naxes: {{{axes}}}\noutput: {{{output}}}\n")


def test_plan_says_that_extremes_of_load_periods_are_taken_of_few_samples() -> None:
    for interval, told in (("1 ms", True), ("0.1 ms", False)):
        warnings = plan_study(rub(interval)).warnings
        assert any("samples per load period" in warning for warning in warnings) == told, warnings


@pytest.fixture(scope="module")
def archive(tmp_path_factory: pytest.TempPathFactory) -> xr.Dataset:
    return run_study(rub(), tmp_path_factory.mktemp("sections") / "rub.nc", threads=1).dataset


@pytest.mark.parametrize("frequency", [50.0, 125.0])
def test_sections_are_the_histories_at_the_starts_of_periods(archive: xr.Dataset, frequency: float) -> None:
    of, count = archive.sel(frequency=frequency), int(0.06 * frequency + 1e-9)
    at = np.round(np.arange(count) / frequency / 1e-4).astype(int)
    for name in ("displacement", "velocity", "temperature"):
        sections, largest = of[f"section_{name}"], float(abs(of[name]).max())
        assert sections.dims == ("scheme", "period")
        assert sections[:, :count].values == pytest.approx(of[name][:, at].values, abs=1e-12 * largest)
        assert np.isnan(sections[:, count:]).all()
    for k in range(count):
        x = of["displacement"][:, at[k] : round((k + 1) / frequency / 1e-4) + 1]
        assert of["period_displacement"][:, k].values == pytest.approx(x.max("t").values, rel=1e-12)
        assert of["period_displacement_min"][:, k].values == pytest.approx(x.min("t").values, rel=1e-12)


def test_sections_lie_between_samples(archive: xr.Dataset, tmp_path: Path) -> None:
    """At 333.3 Hz no start of a period but the first is a sample; samples a hundred times as far apart change none."""
    coarse = run_study(rub("10 ms"), tmp_path / "coarse.nc", threads=1).dataset.sel(frequency=333.3)
    fine = archive.sel(frequency=333.3)
    for name in ("section_displacement", "section_velocity", "section_temperature"):
        assert coarse[name].values == pytest.approx(fine[name].values, rel=1e-6, abs=1e-9)
    between = fine["displacement"].interp(t=np.arange(19) / 333.3)
    assert float(abs(between.values - fine["section_displacement"].values).max()) < 1e-6
    assert float(abs(fine["section_displacement"]).max()) > 1e-5


def test_impacts_of_periods_add_up(archive: xr.Dataset) -> None:
    """Three periods of 50 Hz are the duration; of the others some impacts come after the last complete period."""
    sums = archive["period_impacts"].sum("period")
    assert sums.sel(frequency=50).values == pytest.approx(archive["impacts"].sel(frequency=50).values)
    assert np.all(sums <= archive["impacts"])
    assert np.all(sums > 0)


def test_they_are_kept_where_they_are_asked_for(tmp_path: Path) -> None:
    study, path = quick(), tmp_path / "a.nc"
    assert "sections" not in study.resolved()["output"]
    assert not any("section" in name for name in run_study(study, path, threads=1).dataset)
    asked = study.with_({"output.sections": True})
    assert np.array_equal(case_hashes(arrange(asked)), case_hashes(arrange(study)))
    with pytest.raises(ArchiveError, match="without section_displacement"):
        run_study(asked, path, threads=1)
    run_study(asked, path, threads=1, recompute=True)
    with pytest.raises(ArchiveError, match="section_displacement"):
        run_study(study, path, threads=1)


def test_a_scheme_that_gives_none_leaves_them_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    own = _solve.run_batch
    monkeypatch.setattr(_solve, "run_batch", lambda *batch, **given: replace(own(*batch, **given), sections={}))
    study = quick().with_({"output.sections": True})
    values = solve(arrange(study), 0, np.arange(3)).values
    assert np.isnan(values["section_velocity"]).all()
    assert np.isnan(values["period_impacts"]).all()
    assert np.isfinite(values["period_displacement"]).all()


def test_a_bifurcation_diagram_shows_the_later_half(archive: xr.Dataset) -> None:
    figure = plots.bifurcation(archive.sel(scheme="event_driven"), "frequency")
    (line,) = figure.axes[0].get_lines()
    x, y = np.asarray(line.get_xdata()), np.asarray(line.get_ydata())
    shown = archive["section_displacement"].sel(scheme="event_driven", frequency=125).values[3:7]
    assert y[(x == 125) & np.isfinite(y)] == pytest.approx(shown * 1e6)
    with pytest.raises(ValueError, match=r"`impacts` is not given per load period"):
        plots.bifurcation(archive, "frequency", "impacts")
