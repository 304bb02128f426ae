"""How far a run is: by work, not by cases; how cases ended by name; throughput and the time left as measured."""

import time
from collections import Counter
from pathlib import Path

import nbformat
import numpy as np
import pytest
from nbclient import NotebookClient

from quick import interrupted, quick
from studies import ILL, cut_finely, parsed
from workflow.archive import parts_of
from workflow.cases import _waiting_for, seconds_compiled, waiting_for
from workflow.run import Advance, _progress, in_words, run_study
from workflow.run._progress import ProgressCounter
from workflow.run._task import Report


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
