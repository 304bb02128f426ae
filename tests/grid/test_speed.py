"""What runs remember of a machine's speed, and what plan makes of it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from studies import HEAVY_SCENE, parsed
from workflow.grid import _speed, arrange, estimate, tasks
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


def test_a_run_measures_the_machine_and_plan_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    requested = study("[1, 2]")
    grid = arrange(requested)
    assert not estimate(grid).measured
    run_study(requested, tmp_path / "a.nc", threads=1)
    assert not estimate(grid).measured  # too short to tell anything
    monkeypatch.setattr(_speed, "LEAST_SECONDS", 0.0)
    run_study(requested, tmp_path / "b.nc", threads=1)
    assert estimate(grid).measured
    sums = json.loads(_speed.speed_file().read_text())
    assert 0 < sums["model"] < sums["measured"] < 60


def test_a_slow_machine_is_planned_slow() -> None:
    requested = study("{lin: [0, 50, 500]}", "")
    before = planned(requested)
    remembered(1.0, 10.0)
    kernels = (planned(requested) - before) / 9
    assert kernels > 0
    remembered(29.0, 19 * 29.0)  # the last run counts
    assert planned(requested) - before == pytest.approx(kernels * 18, rel=1e-6)


def remembered(model: float, measured: float) -> float | None:
    """Remember a run, and return the factor that plans then take."""
    _speed.add(model, measured)
    _speed.remember()
    return _speed.factor()


def test_what_is_left_out_does_not_count() -> None:
    """Compilation, say."""
    with _speed.timed(1.0):
        with _speed.untimed():
            sum(range(3_000_000))
        sum(range(1000))
    _speed.remember()
    assert json.loads(_speed.speed_file().read_text())["measured"] < 0.01


@pytest.mark.parametrize("content", ["", "{}", "[1]", '{"model": 1}', '{"model": "a", "measured": 3}', "\0"])
def test_a_damaged_file_is_replaced(content: str) -> None:
    path = _speed.speed_file()
    path.parent.mkdir(parents=True)
    path.write_text(content)
    assert _speed.factor() is None
    assert remembered(1.0, 3.0) == 3.0


def test_another_version_s_speed_is_not_used(monkeypatch: pytest.MonkeyPatch) -> None:
    assert remembered(1.0, 3.0) == 3.0
    monkeypatch.setattr(_speed, "SOLVER_VERSION", 0)
    assert _speed.factor() is None


def test_a_run_whose_speed_cannot_be_kept_succeeds(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    assert run_study(study("[1, 2]"), tmp_path / "a.nc", threads=1).ok


def test_the_estimate_counts_what_takes_time() -> None:
    """References, balances, whole packs, distinct couplings of the exact scheme and threads."""
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


def test_fast_waves_cost_the_exact_scheme_more() -> None:
    """A load harmonic of order 40 asks for forty times the certified steps of the load's own period."""
    exact = TEXT.replace("h: 1e-4", "scheme: event_driven, e: 0.5").replace("ALPHA", "{lin: [0, 1, 1000]}")
    waves = exact.replace("frequency: 20}", "frequency: 20, harmonics: [{order: 40, amplitude: 1}]}\n  speed: 20")
    assert seconds_of(waves) > 5 * seconds_of(exact)


def seconds_of(text: str) -> float:
    return sum(task.seconds for task in tasks(arrange(parsed(text))))
