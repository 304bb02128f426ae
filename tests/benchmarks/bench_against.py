"""The table of two versions side by side: ``python tests/benchmarks/bench_against.py REVISION [ROUNDS] [--quick]``.

Each version measures itself by its own scripts, in turn, so that the machine's other work and its clock change both
alike. A row that both have has the median of the ratios of neighbouring runs.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from statistics import median

ROOT = Path(__file__).parents[2]
MOST = 1.05
"""What a row may cost over what it did before."""

_NUMBER = re.compile(r"(\d[\d.e+-]*) (ns|us|ms|s)$")
_VARYING = re.compile(r", (load|error against itself) [\d.e+-]+")
_UNITS = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}

Rows = dict[str, float]
"""What each row of a table costs, s."""


def measured(tree: Path, options: Sequence[str]) -> Rows:
    """Run the table of a checked out tree with its own package."""
    command = [sys.executable, str(tree / "tests" / "benchmarks" / "bench_table.py"), *options]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, (tree, tree / "tests")))}
    return rows(subprocess.run(command, env=environment, cwd=tree, capture_output=True, text=True, check=True).stdout)


def rows(table: str) -> Rows:
    """Return the rows of a table that are times."""
    costs: Rows = {}
    for line in table.splitlines():
        cells = [cell.strip() for cell in line.split("|")]
        time = _NUMBER.match(cells[3]) if len(cells) == 6 else None
        if time:
            costs[_VARYING.sub("", cells[1])] = float(time[1]) * _UNITS[time[2]]
    return costs


def compared(before: Sequence[Rows], now: Sequence[Rows]) -> list[str]:
    """Return a line for each row that all runs have: its name, its times, the median of its ratios."""
    lines = ["| what | before | now | now over before |", "|---|---|---|---|"]
    for what in now[0]:
        if all(what in run for run in [*before, *now]):
            earlier, later = ([run[what] for run in runs] for runs in (before, now))
            ratio = median(b / a for a, b in zip(earlier, later, strict=True))
            mark = " **over**" if ratio > MOST else ""
            lines.append(f"| {what} | {median(earlier):.3g} s | {median(later):.3g} s | {ratio:.2f}{mark} |")
    return lines


def main(revision: str, rounds: int, options: Sequence[str]) -> None:
    before, now = [], []
    with tempfile.TemporaryDirectory() as directory:
        tree = Path(directory) / "tree"
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "--quiet", "--detach", tree, revision], check=True)
        try:
            for _ in range(rounds):
                before.append(measured(tree, options))
                now.append(measured(ROOT, options))
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", tree], check=True)
    print("\n".join(compared(before, now)))


if __name__ == "__main__":
    words = [word for word in sys.argv[1:] if not word.startswith("--")]
    if not words:
        sys.exit(__doc__)
    main(words[0], int(words[1]) if len(words) > 1 else 3, [word for word in sys.argv[1:] if word.startswith("--")])
