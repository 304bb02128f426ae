"""What runs remember of a machine's speed, and what plan makes of it."""

from __future__ import annotations

import json
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from studies import HEAVY_SCENE, parsed
from workflow.archive import content_hash
from workflow.grid import _estimate, _speed, arrange, estimate, tasks
from workflow.grid._conditions import conditions
from workflow.grid._costs import case_seconds
from workflow.grid._frequencies import fastest_frequency
from workflow.grid._operators import reduced_structure, structure_of
from workflow.run import run_study
from workflow.study import Study

TEXT = f"study: a{HEAVY_SCENE}axes: {{h: 1e-4, alpha: ALPHA}}\noutput: {{interval: 0.1}}\n"


def study(alpha: str, more: str = "") -> Study:
    return parsed(TEXT.replace("ALPHA", alpha) + more)


@pytest.fixture(autouse=True)
def empty_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A machine on which nothing has run yet."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    _speed.forget()
    return tmp_path / "cache"


def planned(of: Study, threads: int = 1) -> float:
    grid = arrange(of)
    return estimate(grid, threads).core_seconds


def test_a_run_measures_the_machine_and_plan_says_so(tmp_path: Path) -> None:
    requested = study("[1, 2]")
    grid = arrange(requested)
    assert not estimate(grid).measured
    run_study(requested, tmp_path / "a.nc", threads=1)
    assert estimate(grid).measured
    parts = json.loads(_speed.speed_file().read_text())["parts"]
    assert parts["moreau  balances"] == parts["moreau  balances/20+20"]
    assert parts["moreau  balances"][1] > 0
    assert parts["beside"][1] > 0


def test_a_slow_machine_is_planned_slow(tmp_path: Path) -> None:
    """Ten times the model's seconds on the scheme of this study and nothing else known."""
    requested = study("{lin: [0, 50, 500]}", "")
    before = planned(requested)
    _speed.add(1.0, 10.0, "moreau  balances", "moreau  balances/20+20")
    _speed.remember()
    after = planned(requested)
    kernels = after - before
    assert kernels > 0
    _speed.add(29.0, 19 * 29.0, "moreau  balances/20+20")  # the sum of both is (1 + 29, 10 + 551): 18.7 times
    _speed.remember()
    assert (planned(requested) - before) / kernels == pytest.approx((561 / 30 - 1) / 9, rel=1e-6)


def test_sums_do_not_grow_for_ever() -> None:
    for _ in range(3):
        _speed.add(100.0, 50.0, "part")
        _speed.remember()
    assert _speed.speeds().ratio("part") == 0.5
    _speed.add(_speed.MOST_SECONDS, 2 * _speed.MOST_SECONDS, "part")
    _speed.remember()
    assert _speed.speeds().ratio("part") == 2.0


def test_what_raises_is_not_measured() -> None:
    with pytest.raises(ValueError, match="for a test"), _speed.timed(1.0, "outer"), _speed.timed(1.0, "inner"):
        raise ValueError("for a test")
    with _speed.timed(1.0, "outer"), _speed.timed(2.0, "inner"):
        sum(range(100_000))
    _speed.remember()
    sums = _speed.speeds().sums
    assert (sums["outer"][0], sums["inner"][0]) == (1.0, 2.0)
    assert sums["outer"][1] < sums["inner"][1]  # what is measured inside does not count outside


@pytest.mark.parametrize("content", ["", "{}", "[1]", '{"format": 1}', '{"format": 1, "machine": 3, "parts": 4}', "\0"])
def test_a_damaged_file_is_replaced(content: str) -> None:
    path = _speed.speed_file()
    path.parent.mkdir(parents=True)
    path.write_text(content)
    assert _speed.speeds().ratio("part") is None
    _speed.add(1.0, 3.0, "part")
    _speed.remember()
    assert _speed.speeds().ratio("part") == 3.0


def test_another_version_s_speed_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    _speed.add(1.0, 3.0, "part")
    _speed.remember()
    path = _speed.speed_file()
    content = json.loads(path.read_text())
    path.write_text(json.dumps(content | {"machine": content["machine"].replace("solver", "solver 9")}))
    assert _speed.speeds().ratio("part") is None


def test_a_run_whose_speed_cannot_be_kept_succeeds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert run_study(study("[1, 2]"), tmp_path / "a.nc", threads=1).ok


def test_runs_at_the_same_time_leave_a_sound_file() -> None:
    def measure() -> None:
        for _ in range(20):
            _speed.add(1.0, 2.0, "part")
            _speed.remember()

    threads = [threading.Thread(target=measure) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert _speed.speeds().ratio("part") == pytest.approx(2.0)
    assert {path.suffix for path in _speed.speed_file().parent.iterdir()} == {".json", ".lock"}


def test_speed_is_no_part_of_results_or_tasks(tmp_path: Path) -> None:
    requested = study("[1, 2]")
    grid = arrange(requested)
    run_study(requested, tmp_path / "a.nc", threads=1)
    _speed.add(1.0, 1e4, "moreau  balances", "moreau  balances/20+20")
    _speed.remember()
    again = arrange(replace(requested))
    run_study(requested, tmp_path / "b.nc", threads=1)
    assert content_hash(tmp_path / "a.nc") == content_hash(tmp_path / "b.nc")
    assert [task.cases for task in tasks(grid)] == [task.cases for task in tasks(again)]


def test_the_estimate_counts_what_takes_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """References, balances, whole packs, distinct couplings of the exact scheme and threads."""
    monkeypatch.setattr(_estimate, "is_compiled", lambda variant: False)  # no seconds for loading kernels
    plain = "output: {interval: 0.1, histories: [], balances: false}\n"
    exact = "reference: {scheme: event_driven}\n"
    narrow = TEXT.replace("1e-4", "1e-6").replace("output: {interval: 0.1}\n", "")
    seven, eight, many = (
        planned(parsed(narrow.replace("ALPHA", f"{{lin: [1, 2, {count}]}}") + plain)) for count in (7, 8, 512)
    )
    assert seven == pytest.approx(eight, rel=2e-3)  # but for the growth rate of one more alpha
    with_balances = planned(parsed(narrow.replace("ALPHA", "{lin: [1, 2, 512]}") + plain.replace("false", "true")))
    assert many + 0.1 < with_balances < 1.5 * many
    wide = TEXT.replace("ALPHA", "{lin: [1, 2, 512]}").replace("output: {interval: 0.1}\n", "") + plain
    assert planned(parsed(wide + exact)) > planned(parsed(wide)) + 0.5
    one = parsed(narrow.replace("ALPHA", "{lin: [1, 2, 512]}") + plain)
    grid = arrange(one)
    alone, both = (estimate(grid, threads) for threads in (1, 2))
    assert alone.core_seconds == both.core_seconds
    assert 0.5 * alone.seconds < both.seconds < 0.75 * alone.seconds


def test_what_no_model_knows_is_measured_however_long_it_takes() -> None:
    for slowest in (_speed.SLOWEST, np.inf):
        with _speed.timed(1e-9, f"up to {slowest}", slowest=slowest):
            begun = time.thread_time()
            while time.thread_time() < begun + 1.5 * _speed.UNEXPECTED:
                pass
    _speed.remember()
    assert set(_speed.speeds().sums) == {"up to inf"}


def test_fast_waves_cost_the_exact_scheme_more() -> None:
    """A load harmonic of order 40 asks for forty times the certified steps of the load's own period."""
    exact = TEXT.replace("h: 1e-4", "scheme: event_driven, e: 0.5").replace("ALPHA", "[0, 1]")
    waves = exact.replace("frequency: 20}", "frequency: 20, harmonics: [{order: 40, amplitude: 1}]}\n  speed: 20")
    parts = []
    for text in (exact, waves):
        grid = arrange(parsed(text))
        cell = grid.settings(0)
        cases = conditions(cell, structure_of(cell.scene.model, cell.scene.parameters), {}, 2)
        estimated = fastest_frequency(cell.scene, {}, 2)
        assert np.array_equal(estimated, cases.fastest_frequency)
        periods = float(estimated.max()) * grid.sampling.duration
        parts.append(case_seconds(cell, reduced_structure(cell), grid.sampling, periods))
    assert parts[1] > 5 * parts[0]
