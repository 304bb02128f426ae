"""README's first command on the reference machine: ``python tests/benchmarks/bench_first_run.py [ROUNDS]``.

A version that was measured on that machine and this one run their own ``studies/blade.yaml`` in turn, each with nothing
compiled and once more; the ratio of both here, times what that version's README says, stands for this one there.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from statistics import median

from bench_against import ROOT, checked_out

REVISION = "4e13f83"
"""The last one whose table was measured on the machine for which 12 s and 3 s are asked."""

_ROW = re.compile(r"\| workflow run studies/blade\.yaml, (nothing compiled|later) \| ≤ ([\d.]+) s \| ([\d.]+) s \|")


def rows(readme: str) -> dict[str, tuple[float, float]]:
    """Return what a README asks and says of the two runs, s, by what it calls them."""
    return {name: (float(asked), float(said)) for name, asked, said in _ROW.findall(readme)}


def measured(tree: Path) -> dict[str, float]:
    """Run the command of a checked out tree twice; return its seconds with nothing compiled and later."""
    with tempfile.TemporaryDirectory() as directory:
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
        environment |= {"PYTHONPATH": str(tree), "NUMBA_CACHE_DIR": f"{directory}/kernels"}
        seconds = []
        for archive in ("first.nc", "later.nc"):
            command = [sys.executable, "-m", "workflow", "run", str(tree / "studies" / "blade.yaml"), "-o", archive]
            begun = time.perf_counter()
            subprocess.run(command, cwd=directory, env=environment, check=True, capture_output=True)
            seconds.append(time.perf_counter() - begun)
        return dict(zip(("nothing compiled", "later"), seconds, strict=True))


def ratios(before: Sequence[dict[str, float]], now: Sequence[dict[str, float]]) -> dict[str, float]:
    """Return the medians of the ratios of runs that were made in turn, by what they are called."""
    return {name: median(b[name] / a[name] for a, b in zip(before, now, strict=True)) for name in before[0]}


def on_reference_machine(rounds: int) -> dict[str, tuple[float, float]] | None:
    """Return what is asked of the two runs on the reference machine and what they take there, s, by name.

    ``None`` where the history does not hold the revision.
    """
    known = subprocess.run(["git", "-C", str(ROOT), "cat-file", "-e", REVISION], check=False, capture_output=True)
    if known.returncode != 0:
        return None
    before, now = [], []
    with checked_out(REVISION) as tree:
        said = rows((tree / "README.md").read_text(encoding="utf-8"))
        for checkout in (tree, ROOT):
            subprocess.run([sys.executable, "-m", "compileall", "-q", str(checkout / "workflow")], check=True)
        for _ in range(rounds):
            before.append(measured(tree))
            now.append(measured(ROOT))
    return {name: (said[name][0], ratio * said[name][1]) for name, ratio in ratios(before, now).items()}


def lines(rounds: int) -> list[tuple[str, str, str, str]]:
    """Return a line of the table for each of the two runs."""
    there = on_reference_machine(rounds)
    what = "workflow run studies/blade.yaml, on the reference machine, {}".format
    if there is None:
        return [(what(name), "", "skipped: not in the history", "") for name in ("nothing compiled", "later")]
    return [
        (what(name), f"<= {asked:g} s", f"{seconds:.2f} s", f"{seconds / asked:.2f}")
        for name, (asked, seconds) in there.items()
    ]


def main(rounds: int = 3) -> None:
    """Print the lines."""
    for what, asked, seconds, ratio in lines(rounds):
        print(f"{what:70} {asked:8} {seconds:10} {ratio}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
