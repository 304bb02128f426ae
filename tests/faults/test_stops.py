"""Ctrl-C and SIGTERM at any moment: the right exit status, one line, no traceback, nothing lost."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from studies import HEAVY_SCENE

STUDY = (
    "study: stopped\n"
    + HEAVY_SCENE.replace("nodes: 20", "nodes: 4").replace("0.3", "0.1")
    + "axes: {h: [1e-5, 2e-5], e: {lin: [0, 1, 21]}, alpha: {lin: [0, 1, 41]}}\noutput: {interval: 1 ms}\n"
)

LONGEST = 60.0
"""Seconds after which a run that was stopped counts as one that hangs."""


def command(*words: str | Path) -> list[str]:
    return [sys.executable, "-m", "workflow", *map(str, words)]


def stopped(words: list[str | Path], number: signal.Signals, after: float) -> tuple[str, str]:
    """Start a command, signal its process group some seconds after it heeds any; return how it ended and its words."""
    with subprocess.Popen(
        command(*words),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    ) as process:
        while process.poll() is None and not heeds(process.pid):
            time.sleep(1e-3)
        time.sleep(after)
        if process.poll() is None:
            os.killpg(process.pid, number)
        try:
            out, err = process.communicate(timeout=LONGEST)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            return "hangs", ""
    return judged(process.returncode, out, err, number), out + err


def heeds(pid: int) -> bool:
    """Tell whether a process has come so far that it catches SIGTERM; Python itself, as it starts, does not."""
    try:
        status = Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
    caught = next((line.split()[1] for line in status.splitlines() if line.startswith("SigCgt")), "0")
    return bool(int(caught, 16) >> (signal.SIGTERM - 1) & 1)


def judged(status: int, out: str, err: str, number: signal.Signals) -> str:
    """Return a word for how a run ended: it was stopped, it was done before, or what is wrong."""
    if "Traceback" in err or "Exception ignored" in err:
        return "traceback"
    if status == 128 + number and err.startswith("stopped") and err.count("\n") == 1:
        return "stopped"
    return "done" if status == 0 and not err and "cases" in out else f"status {status}: {err.strip()[-200:]}"


@pytest.mark.parametrize("after", [0, 0.03, 0.1])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopped_while_libraries_are_imported(number: signal.Signals, after: float, tmp_path: Path) -> None:
    study = tmp_path / "stopped.yaml"
    study.write_text(STUDY, encoding="utf-8")
    how, said = stopped(["run", study, "-o", tmp_path / "a.nc"], number, after)
    assert how == "stopped", said
