"""Commands that are stopped, killed, run out of room or meet another clock lose at most the tasks in flight."""

import os
import random
import re
import resource
import signal
import subprocess
import time
from collections import Counter
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from functools import partial
from pathlib import Path
from shutil import rmtree
from subprocess import TimeoutExpired
from typing import Any

import pytest

from quick import quick
from studies import written
from terminal import started, until
from workflow.archive import content_hash, parts_of, provenance
from workflow.run import holdings, run_study, verify
from workflow.study import Study

ALPHA = [*map(float, range(49)), 1e9]
"""The innermost dimension, as long as a unit; the last case of each row is ill-posed, for ``--retry``."""

OLD = quick({"e": [0.0, 0.5], "alpha": ALPHA[:30:2]}, study="killed")
NEW = quick({"h": [1e-4, 5e-5], "e": [0.0, 0.5, 0.9], "alpha": ALPHA}, study="killed")
"""300 cases in 6 units; the archive of OLD has some of them."""
OTHER = quick({"e": [0.1, 0.5, 0.2], "alpha": ALPHA}, study="killed")
"""A third of its cases are among those of NEW."""

SHORT, SWEPT = (
    quick({"alpha": ALPHA[:20], "scene.load.frequency": {"sweep": [900.0, last, count]}}, study="killed")
    for last, count in ((1000.0, 3), (1100.0, 5))
)
"""60 lines, of three points and of five."""

KINDS: dict[str, tuple[Study | None, Study, tuple[str, ...]]] = {
    "run": (None, NEW, ()),
    "extension": (OLD, NEW, ()),
    "retry": (NEW, NEW, ("--retry",)),
    "recompute": (NEW, NEW, ("--recompute",)),
    "drop": (NEW, OTHER, ()),
    "sweep": (None, SWEPT, ()),
    "longer sweep": (SHORT, SWEPT, ()),
}
"""What each kind of run begins from, its study and its options."""


def has_more(archive: Path, there: set[str], count: int, since: float) -> bool:
    """Tell whether so many shards have come since a time, or none is left to come."""
    return len(shards(archive) - there) >= count or is_gathered(archive, since)


@pytest.mark.slow
def test_killed_at_random_moments(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """Each kind is killed a few times, then another one, often with what the one before has left: ``--kills`` in all.

    What is under the archive's name is the one before or a whole new one, and no shard of a kind goes before that. With
    ``-n 0 -s`` it says how many of each kind there were.
    """
    kills, moments, archive = request.config.getoption("--kills"), random.Random(20), tmp_path / "a.nc"
    images = {}
    for number, study in enumerate((OLD, NEW, OTHER, SHORT, SWEPT)):
        run_study(study, tmp_path / f"{number}.nc")
        images[study.text] = (tmp_path / f"{number}.nc").read_bytes(), content_hash(tmp_path / f"{number}.nc")
    killed, gathering, replaced = Counter[str](), 0, 0
    while killed.total() < kills or gathering < kills // 10:
        kind = moments.choice(sorted(KINDS, key=lambda each: (killed[each], each))[:3])
        begun_from, study, options = KINDS[kind]
        archive.unlink(missing_ok=True)
        if begun_from is not None:
            archive.write_bytes(images[begun_from.text][0])
        if moments.random() < 0.5:  # else it goes on with what the one before has left
            rmtree(parts_of(archive), ignore_errors=True)
        before, others = archive.read_bytes() if archive.exists() else None, shards(archive)
        words = ("run", written(study.text, tmp_path), "-o", archive, "--drop", *options)
        for _ in range(moments.randrange(1, 6)):
            there, began = shards(archive), time.time()
            with slowly(*words, pause=0.1) as process:
                if moments.random() < 0.25:
                    wait_until(partial(is_gathered, archive, began), process)
                    time.sleep(moments.uniform(0, 0.03))
                else:
                    wait_until(partial(has_more, archive, there, moments.randrange(1, 3), began), process)
                    time.sleep(moments.uniform(0, 0.3))
                alive = process.poll() is None
                killed[kind] += alive
                gathering += alive and is_gathered(archive, began)
                process.kill()
                process.wait(PATIENCE)
            if archive.exists() and archive.read_bytes() != before:
                replaced += 1
                break
            assert there - others <= shards(archive)
        if archive.exists() and archive.read_bytes() != before:
            assert content_hash(archive) == provenance(archive)["content_hash"] == images[study.text][1]
        else:
            assert archive.exists() == (before is not None)
    print(f"{killed.total()} kills: {dict(killed)}, {gathering} while gathering; {replaced} archives were replaced")
    run_study(study, archive, drop=True)
    assert content_hash(archive) == images[study.text][1]
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
    with slowly("run", text, "-o", archive, "--threads", "1", pause=0.3) as process:
        assert wait_until(lambda: len(shards(archive)) == 2, process)
        time.sleep(0.1)
        process.send_signal(number)
        _, output = process.communicate(timeout=PATIENCE)
    assert process.returncode == status
    stored = len(shards(archive))
    assert 2 <= stored < 6
    assert f"stopped; {50 * stored} of 300 cases are stored beside {archive}" in output
    assert "the same command goes on from there" in output
    assert "Traceback" not in output
    assert not archive.exists()
    assert run_study(NEW, archive).resumed == 50 * stored
    assert sorted(e.name for e in tmp_path.iterdir()) == ["a.nc", "study.yaml"]
    run_study(NEW, tmp_path / "whole.nc")
    assert content_hash(archive) == content_hash(tmp_path / "whole.nc")


PATIENCE = 120.0
"""Seconds after which a test has failed."""

SLOWLY = """
from workflow.cli._stop import heed_signals
heed_signals()
import sys, time
import workflow.solve._tasks as cutting
import workflow.run._task as running
from workflow.cli import main
pause, ahead = (float(sys.argv.pop(1)) for _ in range(2))
now, write = time.time_ns, running.write_shard
time.time_ns = lambda: now() + int(ahead * 1e9)
cutting.LONGEST, cutting.unit = 1e-9, lambda grid, *_: grid.inner_shape[-1]
running.write_shard = lambda *words: (time.sleep(pause), write(*words))[1]
if __name__ == "__main__":
    main()
"""
"""The command line with a clock that is ahead, and a task for each row, none of which ends at once."""

Process = subprocess.Popen[str]


def slowly(*words: str | Path, pause: float, ahead: float = 0.0, **more: Any) -> AbstractContextManager[Process]:
    return started("-c", SLOWLY, str(pause), str(ahead), *words, **more)


def wait_until(what: Callable[[], bool], process: Process) -> bool:
    """Wait for something to be so while a process runs; tell whether it came to be."""
    until = time.monotonic() + PATIENCE
    while not what():
        if process.poll() is not None:
            return False
        if time.monotonic() > until:
            raise TimeoutError
        time.sleep(5e-4)
    return True


def shards(archive: Path) -> set[str]:
    return {shard.name for shard in parts_of(archive).glob("*.shard")}


def is_gathered(archive: Path, since: float) -> bool:
    """Tell whether an archive has begun to be put together since a time; a run that was killed leaves what it had."""
    try:
        return (parts_of(archive) / f"{archive.name}.tmp").stat().st_mtime >= since
    except FileNotFoundError:
        return False


def heeds(pid: int) -> bool:
    """Tell whether a process has come so far that it catches SIGTERM; Python itself, as it starts, does not."""
    with suppress(OSError):
        caught = re.search(r"^SigCgt:\s*(\w+)", Path(f"/proc/{pid}/status").read_text(), re.MULTILINE)
        return caught is not None and bool(int(caught[1], 16) >> (signal.SIGTERM - 1) & 1)
    return False


@pytest.mark.parametrize("after", [0, 0.03, 0.1])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_while_libraries_are_imported(number: signal.Signals, after: float, tmp_path: Path) -> None:
    """Its process group is signalled some seconds after it heeds any signal."""
    study = written(NEW.text, tmp_path)
    with started("-m", "workflow", "run", study, "-o", tmp_path / "a.nc") as process:
        until(lambda: process.poll() is not None or heeds(process.pid))
        time.sleep(after)
        os.killpg(process.pid, number)
        out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (128 + number, ""), err
    assert err.startswith("stopped")
    assert err.count("\n") == 1  # no traceback


STUDY = quick({"h": [1e-4, 5e-5], "e": [0.0, 0.5, 0.9], "alpha": [*ALPHA[:19], 1e9]}, study="often")
PARTS = ("axes.e=[0, 0.5]", "axes.h=1e-4")
"""Settings that leave cases of the study out: runs with one of them are extended by the others."""

COMMANDS = ("run", "run", "run", "part", "retry", "recompute", "workers", "plan", "show", "verify")
ENDED = {0, 1, 2, -signal.SIGKILL, -signal.SIGTERM, 128 + signal.SIGINT, 128 + signal.SIGTERM}


def words_of(kind: str, study: Path, archive: Path, draw: random.Random) -> list[str | Path]:
    """Return a command on an archive."""
    if kind in ("show", "verify"):
        return [kind, archive]
    options = {
        "part": ["-s", draw.choice(PARTS)],
        "retry": ["--retry"],
        "recompute": ["--recompute"],
        "workers": ["--workers", "2"],
    }
    return ["plan" if kind == "plan" else "run", study, "-o", archive, *options.get(kind, [])]


@pytest.mark.slow
def test_random_sequences_lose_nothing(tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """As many as ``--sequences`` says, from the seed ``--first`` on; with ``-n 0 -s`` it says what there was."""
    first, number = (request.config.getoption(name) for name in ("--first", "--sequences"))
    run_study(STUDY, tmp_path / "whole.nc")
    expected, study, commands, signals = content_hash(tmp_path / "whole.nc"), written(STUDY.text, tmp_path), 0, 0
    for seed in range(first, first + number):
        draw, archive, stored = random.Random(seed), tmp_path / f"{seed}.nc", 0
        for _ in range(draw.randrange(3, 8)):
            kind, ahead, limits = draw.choice(COMMANDS), draw.choice([0.0, 0.0, -1e6, 1e6]), dict[str, Any]()
            if draw.random() < 0.2:
                most = draw.choice([0, 1000, 30_000])
                limits["preexec_fn"] = partial(resource.setrlimit, resource.RLIMIT_FSIZE, (most, most))
            words, sent, whole = words_of(kind, study, archive, draw), 0, archive.exists()
            with slowly(*words, pause=0.1, ahead=ahead, **limits) as process:
                try:
                    _, said = process.communicate(timeout=draw.choice([PATIENCE, draw.uniform(1.0, 4.0)]))
                except TimeoutExpired:
                    sent = draw.choice([signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
                    process.send_signal(sent)
                    _, said = process.communicate(timeout=PATIENCE)
            commands, signals = commands + 1, signals + bool(sent)
            where = f"seed {seed}: {kind} {limits} ended with {process.returncode}: {said}"
            assert process.returncode in ENDED, where
            assert "Traceback" not in said, where
            assert archive.exists() or not whole, where
            now = holdings(STUDY, archive).stored
            assert now >= stored or kind in ("recompute", "retry"), where
            stored = now
        run_study(STUDY, archive, drop=True)
        assert content_hash(archive) == expected
        assert all(check.holds for check in verify(archive, 3))
        assert not parts_of(archive).exists()
        archive.unlink()
        assert {path.name for path in tmp_path.iterdir()} == {"study.yaml", "whole.nc"}
    print(f"{number} sequences of {commands} commands with {signals} signals")
