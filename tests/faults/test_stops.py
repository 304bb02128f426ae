"""Ctrl-C and SIGTERM at any moment: the right exit status, one line, no traceback, nothing lost."""

import os
import re
import signal
import time
from contextlib import suppress
from pathlib import Path

import pytest

from studies import HEAVY_SCENE, written
from terminal import PATIENCE, started, until

STUDY = (
    "study: stopped\n"
    + HEAVY_SCENE.replace("nodes: 20", "nodes: 4").replace("0.3", "0.1")
    + "axes: {h: [1e-5, 2e-5], e: {lin: [0, 1, 21]}, alpha: {lin: [0, 1, 41]}}\noutput: {interval: 1 ms}\n"
)


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
    study = written(STUDY, tmp_path)
    with started("-m", "workflow", "run", study, "-o", tmp_path / "a.nc") as process:
        until(lambda: process.poll() is not None or heeds(process.pid))
        time.sleep(after)
        os.killpg(process.pid, number)
        out, err = process.communicate(timeout=PATIENCE)
    assert (process.returncode, out) == (128 + number, ""), err
    assert err.startswith("stopped")
    assert err.count("\n") == 1  # no traceback
