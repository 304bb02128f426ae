"""The performance table: ``python tests/benchmarks/bench_table.py``; ``--write`` keeps it in TABLE.md.

Some of its lines go into the README, too.

Every line of the other scripts that says what something costs, beside what it should: measured in one
run, on a machine that should have nothing else to do (its load is printed).
"""

from __future__ import annotations

import os
import platform
import sys
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path

import bench_event_driven
import bench_limits
import bench_workflow
from bench_limits import Line, Size
from bench_rivals import RIVALS
from threadpoolctl import threadpool_limits

from scenes import heavy_chain, sampling
from workflow import schemes
from workflow.reduction import reduce_structure
from workflow.run import available_threads

README = Path(__file__).parents[2] / "README.md"
TABLE = Path(__file__).with_name("TABLE.md")
HEADLINES = (
    "full, 20 + 20 modes, over its multiply-adds at peak",
    "reduced over full",
    "Siconos, the same step without heat",
    "`event_driven`, e = 0.5, each case another alpha",
    "run of 10000 cases with metrics over its kernels",
    "workflow run studies/blade.yaml, nothing compiled",
)
"""Lines that the README shows."""

BEGIN, END = "<!-- performance -->\n", "<!-- end of performance -->\n"


def rivals(size: Size) -> list[Line]:
    """The other stepping schemes over ``moreau``, full and reduced."""
    full, h = heavy_chain(), 5e-6
    reduction, batch = reduce_structure(full, 3, 12), bench_limits.rub(full, size.cases)
    over = replace(sampling(size.steps * h, size.steps * h / 10), balances=False)
    lines = []
    for name, structure, loaded in (
        ("full", full, batch),
        ("3 + 12 modes", reduction.structure, reduction.project(batch)),
    ):
        works = []
        for method, options in RIVALS.values():
            scheme = schemes.load(method)
            operator = scheme.init(structure, h, scheme.Options(**options))
            works.append(partial(scheme.compute, operator, loaded, over))
        own, *others = bench_limits.least(size.runs, *works)
        for label, seconds in zip(list(RIVALS)[1:], others, strict=True):
            target = "" if "implicit" in label else "<= 1.3"
            each = f"{1e9 * seconds / size.cases / size.steps:.2f} ns"
            lines.append((f"`{label}` over `moreau`, {name}", target, each, f"{seconds / own:.2f}"))
    return lines


def exact(count: int, runs: int) -> list[Line]:
    """``event_driven`` per case."""
    lines = []
    for e in (0.0, 0.5, 0.9):
        milliseconds, error, impacts = bench_event_driven.measure(e, count, runs)
        what = f"`event_driven`, e = {e:g}, {impacts:.0f} impacts, one alpha, error against itself {error:.0e}"
        lines.append((what, "<= 1 ms", f"{milliseconds:.2f} ms", f"{milliseconds:.2f}"))
        milliseconds, _, _ = bench_event_driven.measure(e, count, runs, distinct=True)
        what = f"`event_driven`, e = {e:g}, each case another alpha"
        lines.append((what, "", f"{milliseconds:.2f} ms", f"{milliseconds:.2f}"))
    return lines


def whole_run(cases: int, runs: int) -> Line:
    """A run of ``workflow`` in a warm process over its kernels on as many threads."""
    wall, kernels = bench_workflow.whole_run(cases, runs)
    what = f"run of {cases} cases with metrics over its kernels, {available_threads()} threads"
    return what, "<= 1.15", f"{wall:.2f} s", f"{wall / kernels:.2f}"


def workflow_lines(sizes: tuple[int, int], runs: int, processes: bool) -> list[Line]:
    """What a case costs beside its kernels, beside xyzpy, and what a grid costs that is there already."""
    threads, large = available_threads(), sizes[-1]

    def per_case(what: str, seconds: float | None, asked: float | None = None) -> Line:
        if seconds is None:
            return what, "", "not installed", ""
        told, target = f"{1e6 * seconds:.1f} us", f"<= {asked:g} us" if asked else ""
        return what, target, told, f"{1e6 * seconds / asked:.2f}" if asked else ""

    lines = [
        per_case(f"overhead per case, durable, {threads} threads", bench_workflow.overhead(large, threads=threads), 30)
    ]
    if processes:
        seconds = bench_workflow.overhead(large, workers=threads)
        lines.append(per_case(f"overhead per case, durable, {threads} local dask workers", seconds, 120))
    lines.append(per_case("xyzpy per case, kept in memory to the end", bench_workflow.xyzpy_overhead(large)))
    lines.append(per_case("xyzpy per case, batches of 1000 on the disk", bench_workflow.xyzpy_overhead(large, 1000)))
    for cases, most in zip(sizes, (25, 500), strict=True):
        again, sliced = bench_workflow.nothing_to_do(cases, runs)
        for what, seconds, asked in (("nothing to do", again, most), ("open and slice a case", sliced, 25)):
            ratio = f"{1e3 * seconds / asked:.2f}"
            lines.append((f"{what}, {cases} cases", f"<= {asked} ms", f"{1e3 * seconds:.1f} ms", ratio))
    for cases in sizes:
        added, alone, copied = bench_workflow.extension(cases, bench_workflow.METRICS)
        what = f"a value added to {cases} cases over its cases alone and a raw copy"
        lines.append((what, "", f"{added:.2f} s", f"{added / (alone + copied):.1f}"))
    return lines


def commands(runs: int) -> list[Line]:
    """What a user waits for at the command line."""
    targets = {"--help": 0.5, "plan": 1.2, "nothing compiled": 12.0, "later": 3.0}
    lines = []
    for what, seconds in bench_workflow.commands(runs):
        target = next((most for words, most in targets.items() if words in what), None)
        asked, ratio = (f"<= {target:g} s", f"{seconds / target:.2f}") if target else ("", "")
        lines.append(
            (f"`{what}`" if what.startswith("workflow") and "," not in what else what, asked, f"{seconds:.2f} s", ratio)
        )
    return lines


def table(size: Size, exact_cases: int, run_cases: int, grids: tuple[int, int], processes: bool) -> list[Line]:
    """Return all lines; without ``processes`` only what needs no other processes."""
    lines = bench_limits.lines(size)
    lines += rivals(size) + exact(exact_cases, size.runs)
    lines.append(whole_run(run_cases, size.runs))
    lines += workflow_lines(grids, size.runs, processes)
    return lines + (commands(size.runs) if processes else [])


def markdown(lines: list[Line]) -> str:
    """Return the table with date and machine."""
    machine = (
        f"{processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python {platform.python_version()}"
    )
    rows = [f"*{date.today()}, {machine}; `python tests/benchmarks/bench_table.py`*\n"]
    rows += ["| what | asked for | measured | ratio |", "|---|---|---|---|"]
    rows += [
        f"| {what} | {asked.replace('<=', '≤').replace('>=', '≥')} | {told} | {ratio} |"
        for what, asked, told, ratio in lines
    ]
    return "\n".join(rows) + "\n"


def processor() -> str:
    """Return the processor's name."""
    told = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in told.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()


def main(
    size: Size | None = None,
    exact_cases: int = 100,
    run_cases: int = 10_000,
    grids: tuple[int, int] = (10_000, 100_000),
    processes: bool = True,
) -> str:
    """Print the table and return it; threads of BLAS, which go on for a while when they are done, are left out."""
    with threadpool_limits(limits=1, user_api="blas"):
        told = markdown(table(size or Size(), exact_cases, run_cases, grids, processes))
    print(told, end="")
    return told


def write(told: str) -> None:
    """Keep the table, and put the headlines into the README."""
    before, _, after = _parts(TABLE.read_text())
    TABLE.write_text(before + BEGIN + told + END + after)
    before, _, after = _parts(README.read_text())
    README.write_text(before + BEGIN + headlines(told) + END + after)


def _parts(text: str) -> tuple[str, str, str]:
    """Return what stands before, within and after the marks of a table."""
    before, rest = text.split(BEGIN)
    within, after = rest.split(END)
    return before, within, after


def headlines(told: str) -> str:
    """Return the table with the lines that the README shows."""
    lines = told.splitlines(keepends=True)
    return "".join([*lines[:4], *(line for line in lines[4:] if line.startswith(tuple(f"| {h}" for h in HEADLINES)))])


if __name__ == "__main__":
    found = main()
    if "--write" in sys.argv:
        write(found)
