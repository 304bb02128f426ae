"""Runs that are killed at any moment lose at most the tasks in flight, and never leave half an archive."""

from __future__ import annotations

import random
import signal
import time
from functools import partial
from pathlib import Path

import pytest
from commands import PATIENCE, is_gathered, shards, started, wait_until

from quick import quick
from studies import written
from workflow.archive import content_hash, open_archive, parts_of, provenance
from workflow.grid import arrange, case_hashes
from workflow.run import run_study, verify
from workflow.study import Study

ALPHA = [float(k) for k in range(50)]
"""The innermost dimension, as long as a unit."""

OLD = quick({"e": [0.0, 0.5], "alpha": ALPHA[:30:2]}, study="killed")
NEW = quick({"h": [1e-4, 5e-5], "e": [0.0, 0.5, 0.9], "alpha": ALPHA}, study="killed")
"""300 cases in 6 units; the archive of OLD has some of them."""


def whole(study: Study, directory: Path) -> str:
    archive = directory / "whole.nc"
    run_study(study, archive)
    return content_hash(archive)


def is_reached(archive: Path, count: int) -> bool:
    return parts_of(archive).exists() and shards(archive) >= count


def check_state(archive: Path, before: bytes | None, expected: str) -> None:
    """An archive is absent or the one before, or whole: nothing between."""
    if archive.exists() and archive.read_bytes() != before:
        with open_archive(archive) as data:
            assert (data["status"] != 4).all()
        assert content_hash(archive) == provenance(archive)["content_hash"] == expected


@pytest.mark.slow
@pytest.mark.parametrize("extended", [False, True], ids=["new", "extended"])
def test_killed_at_random_moments(extended: bool, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    kills = request.config.getoption("--kills") // (3 if extended else 1)
    moments = random.Random(20 + extended)
    expected = whole(NEW, tmp_path)
    text, archive = written(NEW.text, tmp_path), tmp_path / "a.nc"
    units = len(case_hashes(arrange(NEW))) // len(ALPHA)
    before = None
    if extended:
        run_study(OLD, tmp_path / "old.nc")
        before = (tmp_path / "old.nc").read_bytes()

    def begin() -> None:
        archive.unlink(missing_ok=True)
        if before is not None:
            archive.write_bytes(before)

    begin()
    killed = gathering = runs = 0
    while killed < kills or gathering < kills // 10:
        there = shards(archive)
        count, late, runs = min(units, there + moments.randrange(1, 3)), runs % 3 == 2, runs + 1
        with started("run", text, "-o", archive, pause=0.1) as process:
            if late:
                wait_until(lambda: is_gathered(archive), process)
                time.sleep(moments.uniform(0, 0.03))
            else:
                wait_until(partial(is_reached, archive, count), process)
                time.sleep(moments.uniform(0, 0.3))
            alive = process.poll() is None
            killed += alive
            gathering += alive and is_gathered(archive)
            process.kill()
            process.wait(PATIENCE)
        check_state(archive, before, expected)
        if archive.exists() and archive.read_bytes() != before:
            begin()
    assert gathering >= kills // 10
    if not shards(archive):  # the last resume has something to go on from
        begin()
        with started("run", text, "-o", archive, pause=0.1) as process:
            assert wait_until(lambda: shards(archive) >= 2, process)
            process.kill()
    there = shards(archive)
    assert run_study(NEW, archive).resumed >= there * len(ALPHA)
    assert content_hash(archive) == expected
    assert all(check.holds for check in verify(archive, 20))
    assert not parts_of(archive).exists()
    assert not list(tmp_path.rglob("*.tmp"))


@pytest.mark.parametrize(
    ("number", "status"),
    [(signal.SIGTERM, 143), pytest.param(signal.SIGINT, 130, marks=pytest.mark.slow)],
    ids=["SIGTERM", "SIGINT"],
)
def test_stopped_it_says_what_is_stored_and_goes_on(number: int, status: int, tmp_path: Path) -> None:
    text, archive = written(NEW.text, tmp_path), tmp_path / "a.nc"
    with started("run", text, "-o", archive, "--threads", "1", pause=0.3) as process:
        assert wait_until(lambda: shards(archive) == 2, process)
        time.sleep(0.1)
        process.send_signal(number)
        _, output = process.communicate(timeout=PATIENCE)
    assert process.returncode == status
    stored = shards(archive)
    assert 2 <= stored < 6
    assert output.startswith(f"stopped; {50 * stored} of 300 cases are stored beside {archive}")
    assert "the same command goes on from there" in output
    assert "Traceback" not in output
    assert not archive.exists()
    assert run_study(NEW, archive).resumed == 50 * stored
    assert content_hash(archive) == whole(NEW, tmp_path)
    assert sorted(e.name for e in tmp_path.iterdir()) == ["a.nc", "study.yaml", "whole.nc"]
