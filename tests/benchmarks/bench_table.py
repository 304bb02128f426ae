"""The performance table: ``python tests/benchmarks/bench_table.py``; ``--write`` keeps it in TABLE.md.

``--quick`` measures shorter runs. What something costs stands beside what it should: measured in one run, on a
machine that should have nothing else to do (its load is printed).
"""

import os
import platform
import sys
from datetime import date
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import bench_limits
import bench_workflow
from threadpoolctl import threadpool_limits
from timing import QUICK, Line, Size, keep

TABLE = Path(__file__).with_name("TABLE.md"), "performance"


def table(size: Size, processes: bool = True) -> str:
    """Return the table; without ``processes`` only what needs no other processes.

    Threads of BLAS, which go on for a while when they are done, are left out.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        lines = bench_limits.lines(size) + bench_workflow.lines(size)
        command = "python tests/benchmarks/bench_table.py" + " --quick" * ("--quick" in sys.argv)
        return markdown(lines + (bench_workflow.command_lines(size) if processes else []), command)


def markdown(lines: list[Line], command: str) -> str:
    """Return the table with date, machine and the command that measured it."""
    machine = (
        f"{processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python {platform.python_version()}"
    )
    rows = [f"*{date.today()}, {machine}; `{command}`*\n"]
    rows += ["| what | asked for | measured | ratio |", "|---|---|---|---|"]
    rows += [
        f"| {what} | {target.replace('<=', '≤').replace('>=', '≥')} | {measured} | {ratio} |"
        for what, target, measured, ratio in lines
    ]
    return "\n".join(rows) + "\n"


def processor() -> str:
    file = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in file.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()


if __name__ == "__main__":
    measured = table(QUICK if "--quick" in sys.argv else Size())
    print(measured, end="")
    if "--write" in sys.argv:
        keep(*TABLE, measured)
