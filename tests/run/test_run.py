"""A study to its archive: whole, resumed, refused, on any number of threads; how far it is; unsettled rubs."""

import json
import time
from collections import Counter
from functools import partial
from pathlib import Path
from typing import Any

import nbformat
import numpy as np
import pytest
import xarray as xr
from nbclient import NotebookClient

from quick import interrupted, quick
from studies import ILL, SINGLE, SMALL, cut_finely, parsed
from workflow.analysis import failures, labels
from workflow.archive import content_hash, open_archive, parts_of
from workflow.cases import _waiting_for, seconds_compiled, waiting_for
from workflow.judges.load_periods import change_of_impulse
from workflow.plan import plan_study
from workflow.run import Advance, Outcome, _progress, _threads, in_words, run_study, warnings_of
from workflow.run._progress import ProgressCounter
from workflow.run._task import Report


def test_a_study_becomes_one_labelled_archive(tmp_path: Path) -> None:
    archive = tmp_path / "small.nc"
    outcome = run_study(parsed(SMALL), archive)
    assert outcome.ok
    assert outcome.counts == {"ok": 60}
    assert not parts_of(archive).exists()
    assert list(tmp_path.iterdir()) == [archive]
    with xr.open_dataset(archive) as data:
        assert dict(data["displacement"].sizes) == {"model": 2, "h": 2, "e": 3, "alpha": 5, "t": 61}
        assert data["t"].values.tolist() == [k / 1000 for k in range(61)]  # decimals, found by their labels
        assert data["alpha"].attrs["units"] == "W N-1"
        assert data["mechanical_modes"].values.tolist() == [1, 3]
        assert data["scheme"].item() == "moreau"
        case = data.sel(h=1e-4, e=0.5, alpha=20).isel(model=1)
        assert case["contact_impulse"].item() > 0
        force, dt = case["contact_force"].values, 1e-3
        assert force[0] == 0
        assert force.sum() * dt == pytest.approx(case["contact_impulse"].item(), rel=1e-9)
        assert not np.isnan(data["displacement"].values).any()
        assert data["temperature" if "temperature" in data else "max_temperature"].sel(alpha=0).max() == 0


def test_failed_cases_are_told_and_the_rest_is_stored(tmp_path: Path) -> None:
    outcome = run_study(parsed(ILL), tmp_path / "ill.nc")
    assert outcome.counts == {"ok": 4, "ill_posed": 4}
    assert not outcome.ok
    assert "alpha 1e+09 W/N" in failures(outcome.dataset)[0].first
    assert "ill.nc</code>: 4 ok, 4 ill_posed" in outcome._repr_html_()
    with open_archive(tmp_path / "ill.nc") as data:
        assert np.isfinite(data["contact_impulse"].sel(alpha=[0, 5]).values).all()
        assert np.isnan(data["contact_impulse"].sel(alpha=[1e9, 2e9]).values).all()
        assert (data["runaway"].sel(alpha=[1e9, 2e9]) == 1).all()


@pytest.mark.parametrize("name", ["gap", "alpha_and_e", "point", "phase"])
def test_a_zip_of_any_admissible_name_can_be_opened(name: str, tmp_path: Path) -> None:
    """Also of the name of one of its numbers, or of a dimension that the archive lacks."""
    text = SINGLE + f"zip: {{{name}: {{scene.casing.gap: [5e-5, 4e-5], e: [0, 1]}}}}\n"
    with run_study(parsed(text), tmp_path / "a.nc").dataset as data:
        assert (data["status"] == 0).all()
        assert data["contact_impulse"].dims == (name,)
        assert name not in data.coords


def test_parts_that_outlived_their_archive_go(tmp_path: Path) -> None:
    archive = tmp_path / "a.nc"
    run_study(parsed(SINGLE), archive)
    parts_of(archive).mkdir()
    assert run_study(parsed(SINGLE), archive).resumed == 1
    assert list(tmp_path.iterdir()) == [archive]


@pytest.mark.parametrize("has_balances", [True, False])
def test_balances_are_kept_where_they_are_wanted(has_balances: bool, tmp_path: Path) -> None:
    text = SINGLE.replace("interval: 1 ms", f"interval: 1 ms, balances: {str(has_balances).lower()}")
    text = text.replace("output:", "axes: {scheme: [moreau, event_driven]}\noutput:")
    run_study(parsed(text), tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc") as archive:
        assert ("energy_residual" in archive) == ("heat_residual" in archive) == has_balances
        if has_balances:
            assert archive["energy_residual"].sel(scheme="moreau") < -1e-3
            for name in ("energy_residual", "heat_residual"):
                assert np.isnan(archive[name].sel(scheme="event_driven"))
                assert "NaN for event_driven" in archive[name].attrs["comment"]


STUDY = quick({"h": [1e-4, 5e-5]}, reference={"scheme": "moreau", "h": 2e-5})


def computed(monkeypatch: pytest.MonkeyPatch, archive: Path, threads: int = 2) -> list[int]:
    """Run the study and return how many reference solutions each block had that was computed."""
    compute, sizes = _threads.compute_block, list[int]()

    def counting(grid: Any, block: Any) -> Any:
        sizes.append(len(block.inner))
        return compute(grid, block)

    monkeypatch.setattr(_threads, "compute_block", counting)
    run_study(STUDY, archive, threads=threads)
    monkeypatch.setattr(_threads, "compute_block", compute)
    return sizes


def test_pieces_of_a_graph_make_the_same_archive(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """References are computed once in a graph, and again in the next one that needs them; on any number of threads."""
    assert sum(computed(monkeypatch, tmp_path / "whole.nc", 1)) == 2 * 9  # references and exact solutions beside them
    cut_finely(monkeypatch)
    assert sum(computed(monkeypatch, tmp_path / "cut.nc", 4)) == 2 * 9
    monkeypatch.setattr(_threads, "graphs", partial(_threads.graphs, most=3))
    assert sum(computed(monkeypatch, tmp_path / "pieces.nc")) == 4 * 9
    assert len({content_hash(tmp_path / f"{name}.nc") for name in ("whole", "cut", "pieces")}) == 1


def test_an_axis_may_have_the_name_of_a_dimension_that_the_archive_lacks(tmp_path: Path) -> None:
    phases = quick({"e": None, "scene.load.phase": [0.2, 0.6, 1.0]})
    with run_study(phases, tmp_path / "phases.nc").dataset as data:
        assert data["phase"].values.tolist() == [0.2, 0.6, 1.0]
        assert data["phase"].attrs["units"] == "rad"


def test_a_dictionary_is_planned_and_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As a notebook does; a strong heat coupling ends ``ill_posed``."""
    monkeypatch.chdir(tmp_path)
    study = json.loads(quick({"alpha": [5.0, 1e9]}).text)
    assert plan_study(study).cases == 6
    done = run_study(study)
    assert done.archive == Path("quick.nc")
    status = done.dataset["status"]
    words = labels(status)
    assert words.dims == status.dims
    assert set(words.values.flat) == {"ok", "ill_posed"}
    assert set(labels(done.dataset["runaway"]).values.flat) <= {"bounded", "runaway"}
    with pytest.raises(ValueError, match="flag_meanings"):
        labels(done.dataset["impacts"])
    assert ((words == "ok") == (status == 0)).all()


def ran(place: Path, periods: int = 16, **more: Any) -> Outcome:
    """A lump near its resonance, undamped, and one that settles in some periods."""
    axes = {"scheme": "event_driven", "h": None, "e": 0.5, "alpha": 0, "scene.chain.damping.mass": [0, 4e3]}
    scene = {"load.frequency": 6.25e3, "load.amplitude": 40, "casing.gap": 5e-5, "duration": periods / 6.25e3}
    study = quick(axes, scene=scene, output={"interval": 4 / 6.25e3 / 16, "histories": [], **more})
    return run_study(study, place / "a.nc", threads=1)


def told(outcome: Outcome) -> list[str]:
    return [line for line in outcome.warnings if "settled" in line]


def test_a_rub_that_has_not_settled_is_told_with_the_case_that_changes_most(tmp_path: Path) -> None:
    outcome = ran(tmp_path)
    (line,) = told(outcome)
    assert line.startswith(
        "1 of 2 ok cases have not settled: the mean impulse of a load period changes by more than 5%"
    )
    with outcome.dataset as archive:
        impulse = archive["period_impulse"].squeeze(drop=True).transpose("mass", "period").values
        last, before = impulse[:, 12:].mean(axis=1), impulse[:, 8:12].mean(axis=1)
        change = np.abs(last - before) / np.maximum(last, before)
        assert change[0] > 0.05 > change[1] > 0
        np.testing.assert_allclose(change_of_impulse(impulse), change)
        assert f"most, {change[0]:.0%}: mass = 0; make `duration` longer" in line
        assert line in warnings_of(archive)
        assert not [one for one in warnings_of(archive.isel(mass=1)) if "settled" in one]


@pytest.mark.parametrize(("periods", "output"), [(7, {}), (16, {"steady": True})])
def test_few_periods_are_not_judged_and_steady_rubs_say_it_themselves(
    periods: int, output: dict[str, Any], tmp_path: Path
) -> None:
    assert told(ran(tmp_path, periods, **output)) == []


@pytest.fixture
def many_tasks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Cut even the smallest study in a task per unit."""
    cut_finely(monkeypatch)


def test_progress_counts_every_case_by_its_status(tmp_path: Path, many_tasks: None) -> None:
    reported: list[Advance] = []
    run_study(parsed(ILL), tmp_path / "ill.nc", progress=reported.append)
    first, last = reported[0], reported[-1]
    assert (first.stored, first.cases, first.work, first.endings) == (0, 8, 0.0, {})
    assert (last.stored, last.cases, last.endings) == (8, 8, {"ill_posed": 4})
    assert last.work == pytest.approx(1)
    assert last.left == pytest.approx(0, abs=1e-9)
    for name in ("stored", "work", "elapsed"):
        values = [getattr(advance, name) for advance in reported]
        assert values == sorted(values)
    assert all(advance.left >= 0 and advance.rate > 0 for advance in reported[1:])


def test_cases_that_share_results_are_counted_each(tmp_path: Path) -> None:
    """The exact solution does not read h, nor a contact spring e: 9 + 6 of 36 cases are computed."""
    reported: list[Advance] = []
    study = quick({"scheme": ["event_driven", "penalty"], "h": [1e-4, 2e-4]})
    run_study(study, tmp_path / "a.nc", progress=reported.append)
    assert (reported[-1].stored, reported[-1].cases) == (36, 36)
    assert reported[-1].work == pytest.approx(1)


def test_a_damaged_shard_is_not_counted(tmp_path: Path, many_tasks: None) -> None:
    archive, reported, study = tmp_path / "a.nc", list[Advance](), quick()
    held = interrupted(study, archive, 2)
    first = sorted(parts_of(archive).glob("*.shard"))[0]
    changed = bytearray(first.read_bytes())
    changed[len(changed) // 2] ^= 0xFF
    first.write_bytes(changed)
    run_study(study, archive, progress=reported.append)
    assert 0 < reported[0].stored < len(held)
    assert (reported[-1].stored, reported[-1].cases) == (9, 9)


def test_work_counts_what_cases_cost(tmp_path: Path, many_tasks: None) -> None:
    """Two steps, one a hundredth of the other: the longer half of the cases, which begins, is most of the work."""
    reported: list[Advance] = []
    axes = {"h": [1e-4, 1e-6], "e": [0.0, 0.5], "alpha": [0.0]}
    study = quick(axes, scene={"duration": 0.4}, output={"histories": [], "interval": 4e-3})
    run_study(study, tmp_path / "a.nc", 1, reported.append)
    half = next(advance for advance in reported if advance.stored >= 2)
    assert half.stored == 2
    assert half.work > 0.7


def test_a_run_that_goes_on_begins_where_it_stopped(tmp_path: Path, many_tasks: None) -> None:
    class StopError(Exception):
        pass

    def stop(advance: Advance) -> None:
        if advance.stored == 4:
            raise StopError

    with pytest.raises(StopError):
        run_study(parsed(ILL), tmp_path / "ill.nc", 1, stop)
    reported: list[Advance] = []
    run_study(parsed(ILL), tmp_path / "ill.nc", 1, reported.append)
    assert reported[0].stored == 4
    assert reported[0].endings == {"ill_posed": 2}
    assert 0 < reported[0].work < 1
    assert reported[-1].endings == {"ill_posed": 4}
    assert reported[-1].work == pytest.approx(1)


def test_a_tally_tells_shares_throughput_and_times(monkeypatch: pytest.MonkeyPatch) -> None:
    """Throughput is of the cases of this run, the time left of its work, both without compilation."""
    now, compiled, reported = [10.0], [50.0], []
    monkeypatch.setattr(_progress, "seconds_compiled", lambda: compiled[0])
    counter = ProgressCounter(100, 8.0, 2.0, 5.0, reported.append, lambda: now[0])
    counter.set(20, {})
    now[0], compiled[0] = 24.0, 60.0
    counter.add(Report(6.0, 60, {"diverged": 2}))
    now[0] = 25.0
    counter.add(Report(2.0, 20, {"diverged": 1, "failed": 1}))
    assert [advance.stored for advance in reported] == [20, 80, 100]
    assert [advance.work for advance in reported] == pytest.approx([0.2, 0.8, 1.0])
    assert [advance.elapsed for advance in reported] == [5.0, 19.0, 20.0]
    assert [advance.rate for advance in reported] == pytest.approx([np.nan, 60 / 4, 80 / 5], nan_ok=True)
    assert [advance.left for advance in reported] == pytest.approx([np.nan, 4.0 / 3, 0.0], nan_ok=True)
    assert reported[-1].endings == {"diverged": 3, "failed": 1}


def test_what_compiles_is_timed_once() -> None:
    """Of two threads that wait for the same kernels the time is not twice theirs."""
    before, begun = seconds_compiled(), time.perf_counter()
    with waiting_for("compiling (once)"), waiting_for("compiling (once)"):
        time.sleep(0.02)
    assert 0.02 <= seconds_compiled() - before <= time.perf_counter() - begun


def test_words() -> None:
    advance = Advance(540, 204, {"ill_posed": 1, "diverged": 2}, 0.349, 12.4, 16.45, 3725.0)
    assert in_words(None, 0.4) == "0:00 elapsed"
    line = "34 %, 0:12 elapsed, 1:02:04 left; 204 of 540 cases, 16/s, 1 ill-posed, 2 diverged"
    assert in_words(advance, 12.9, 0.5) == line
    unknown = Advance(5, 0, {}, 0.0, 61.0, float("nan"), float("nan"))
    assert in_words(unknown, 61.0) == "0 %, 1:01 elapsed; 0 of 5 cases"
    late = Advance(5, 4, {}, 0.8, 61.0, 0.0656, 2.0)
    assert in_words(late, 64.0, 3.0) == "80 %, 1:04 elapsed, 0:00 left; 4 of 5 cases, 0.066/s"
    with waiting_for("compiling (once)"):
        compiling = "compiling (once); 34 %, 1:00 elapsed; 204 of 540 cases, 1 ill-posed, 2 diverged"
        assert in_words(advance, 60.0, 47.0) == compiling


def test_a_run_names_what_it_waits_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    named: list[str] = []

    class Told(Counter[str]):
        def __setitem__(self, what: str, number: int) -> None:
            named.append(what)
            super().__setitem__(what, number)

    monkeypatch.setattr(_waiting_for, "_UNDER_WAY", Told())
    auto = {"h": 1e-4, "mechanical_modes": "auto", "thermal_modes": "auto", "tolerance": 1e-3}
    scene = {"chain.nodes": 3}
    run_study(quick(auto, scene=scene, reference={"scheme": "event_driven"}), tmp_path / "a.nc")
    stages = [name for name in dict.fromkeys(named) if name in ("trials of `auto`", "references", "cases", "gathering")]
    assert stages == ["trials of `auto`", "cases", "references", "gathering"]


NOTEBOOK = """
import sys
sys.path.insert(0, {tests!r})
from quick import interrupted, quick
from workflow import run_study
run_study(quick(), {archive!r})
run_study(quick(), {other!r}, progress=False).counts
"""


def test_a_notebook_shows_a_line(tmp_path: Path) -> None:
    places = {"archive": str(tmp_path / "quick.nc"), "other": str(tmp_path / "other.nc")}
    source = NOTEBOOK.format(tests=str(Path(__file__).parents[1]), **places)
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source)])
    NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(tmp_path)}}).execute()
    lines = [o for o in notebook.cells[0].outputs if o.output_type == "display_data"]
    assert len(lines) == 1
    assert "quick.nc: 9 cases in" in lines[0]["data"]["text/plain"]
    assert "(9 ok)" in lines[0]["data"]["text/plain"]
