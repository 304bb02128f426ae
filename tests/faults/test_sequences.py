"""Random sequences of commands that are stopped, run out of room or meet another clock: nothing is lost or fails."""

import random
import resource
import signal
from functools import partial
from pathlib import Path
from subprocess import TimeoutExpired
from typing import Any

import pytest

from quick import quick
from studies import written
from terminal import PATIENCE, started
from workflow.archive import content_hash, parts_of
from workflow.run import holdings, run_study, verify

ALPHA = [*map(float, range(19)), 1e9]
STUDY = quick({"h": [1e-4, 5e-5], "e": [0.0, 0.5, 0.9], "alpha": ALPHA}, study="often")
PARTS = ("axes.e=[0, 0.5]", "axes.h=1e-4")
"""Settings that leave cases of the study out: runs with one of them are extended by the others."""

SLOWLY = """
from workflow.cli._stop import heed_signals
heed_signals()
import sys, time
import workflow.solve._tasks as cutting
import workflow.run._task as running
from workflow.cli import main
now, ahead, write = time.time_ns, int(float(sys.argv.pop(1)) * 1e9), running.write_shard
time.time_ns = lambda: now() + ahead
cutting.LONGEST, cutting.unit = 1e-9, lambda grid, *_: grid.inner_shape[-1]
running.write_shard = lambda *words: (time.sleep(0.1), write(*words))[1]
if __name__ == "__main__":
    main()
"""
"""The command line with a clock that is ahead, and a task for each row, none of which ends at once."""

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
            with started("-c", SLOWLY, str(ahead), *words, **limits) as process:
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
