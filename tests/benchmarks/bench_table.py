"""The performance table: ``python tests/benchmarks/bench_table.py``; ``--write`` keeps it in TABLE.md.

Some of its lines go into the README, too.

Every line of the other scripts that says what something costs, beside what it should: measured in one
run, on a machine that should have nothing else to do (its load is printed).
"""

from __future__ import annotations

import os
import platform
import sys
import time
from dataclasses import replace
from datetime import date
from functools import partial
from pathlib import Path

import bench_event_driven
import bench_first_run
import bench_limits
import bench_scaling
import bench_workflow
from bench_limits import Line, Size
from bench_rivals import RIVALS
from bench_scaling import Curve, Extent
from threadpoolctl import threadpool_limits

from scenes import heavy_chain, sampling
from workflow import run_study, schemes
from workflow.reduction import reduce_structure
from workflow.run import available_threads

README = Path(__file__).parents[2] / "README.md"
TABLE = Path(__file__).with_name("TABLE.md")
HEADLINES = {
    "workflow run studies/blade.yaml, nothing compiled |": "`workflow run studies/blade.yaml`, 540 cases, first time",
    "workflow run studies/blade.yaml, later |": "the same, later",
    "included: `moreau`": "a case of 20 nodes over 0.3 s in a study of many, one thread: `moreau`, h = 1e-5 s",
    "included: `event_driven`": "… `event_driven`, exact",
    "included: NumPy": "… a loop of NumPy, h = 1e-5 s",
    "included: SciPy": "… SciPy's DOP853 with events",
}
"""What a row of the table holds that the README shows, and its words there."""

BEGIN, END = "<!-- performance -->\n", "<!-- end of performance -->\n"


def rivals(size: Size) -> list[Line]:
    """The other stepping schemes over ``moreau``, full and reduced."""
    full, h = heavy_chain(), 5e-6
    reduction, batch = reduce_structure(full, 3, 12), bench_limits.rub(full, size.cases)
    over = sampling(size.steps * h, size.steps * h / 10)
    lines = []
    for name, structure, loaded in (
        ("full", full, batch),
        ("3 + 12 modes", reduction.structure, reduction.project(batch)),
    ):
        works = []
        for method, options in RIVALS.values():
            scheme = schemes.load(method)
            operator = scheme.init(structure, h, scheme.Options(**options))
            works += [partial(scheme.compute, operator, loaded, replace(over, balances=b)) for b in (False, True)]
        seconds = [1e9 * s / size.cases / size.steps for s in bench_limits.least(size.runs, *works)]
        for label, plain, audited in zip(RIVALS, seconds[::2], seconds[1::2], strict=True):
            if label != "moreau":
                target = "" if "implicit" in label else "<= 1.3"
                lines.append(
                    (f"`{label}` over `moreau`, {name}", target, f"{plain:.2f} ns", f"{plain / seconds[0]:.2f}")
                )
            what = f"`{label}` with balances over without, {name}"
            lines.append((what, "<= 1.5", f"{audited:.2f} ns", f"{audited / plain:.2f}"))
    return lines


def exact(count: int, runs: int) -> list[Line]:
    """``event_driven`` per case."""
    lines = []
    for e in (0.0, 0.5, 0.9):
        milliseconds, error, impacts = bench_event_driven.measure(e, count, runs)
        what = f"`event_driven`, e = {e:g}, {impacts:.0f} impacts, one alpha, error against itself {error:.0e}"
        lines.append((what, "<= 1 ms", f"{milliseconds:.2f} ms", f"{milliseconds:.2f}"))
        distinct, _, _ = bench_event_driven.measure(e, count, runs, distinct=True)
        what = f"`event_driven`, e = {e:g}, each case another alpha, over one alpha"
        lines.append((what, "<= 1.3", f"{distinct:.2f} ms", f"{distinct / milliseconds:.2f}"))
    return lines + bench_event_driven.compared(count, runs)


def _study_seconds(text: str, cases: int) -> float:
    """Return the wall time of a case in a whole run on one thread, from the text to the archive, s."""
    study = bench_workflow.parsed(text)
    with bench_workflow.scratch() as directory:
        run_study(study, directory / "warm.nc", threads=1)
        begun = time.perf_counter()
        run_study(study, directory / "a.nc", threads=1)
        return (time.perf_counter() - begun) / cases


def equal_terms(cases: int, rival_steps: int) -> list[Line]:
    """Return what a user waits for, for each of distinct cases over 0.3 s, set-up and archive included, one thread.

    Loops in Siconos and NumPy know no batches: their cases take as long each. Few of their steps, and SciPy's first
    milliseconds, are measured and multiplied.
    """
    steps, columns = 30_000, max(2, cases // 10)
    text = bench_workflow.HEAVY.format(rows=max(2, cases // columns), columns=columns)
    count = columns * max(2, cases // columns)
    own = _study_seconds(text, count)
    exact = _study_seconds(text.replace("axes: {h", "axes: {scheme: [event_driven], h"), count)
    siconos, plain = bench_limits._siconos(rival_steps), bench_limits._numpy(10 * rival_steps)
    integrated, _ = bench_limits._solve_ivp(20 if rival_steps > 1000 else 1)
    what = f"a case of 0.3 s, {count} distinct ones, one thread, everything included"
    lines: list[Line] = [(f"{what}: `moreau`, h = 1e-5 s", "", f"{1e3 * own:.3g} ms", "1")]
    others = [
        ("`event_driven`", exact),
        ("NumPy, h = 1e-5 s", plain * steps),
        ("Siconos, h = 1e-5 s, no heat", None if siconos is None else siconos * steps),
        ("SciPy DOP853 with events", 0.3 * integrated),
    ]
    for label, seconds in others:
        measured = "skipped: not installed or fails" if seconds is None else _time(seconds)
        lines.append(
            (f"{what}: {label}, over `moreau`", "", measured, "" if seconds is None else f"{seconds / own:.3g}")
        )
    return lines


def _time(seconds: float) -> str:
    return f"{seconds:.3g} s" if seconds >= 1 else f"{1e3 * seconds:.3g} ms"


def whole_run(cases: int, runs: int) -> Line:
    """A run of ``workflow`` in a warm process over its kernels on as many threads."""
    wall, kernels = bench_workflow.whole_run(cases, runs)
    what = f"run of {cases} cases with metrics over its kernels, {available_threads()} threads"
    return what, "<= 1.1", f"{wall:.2f} s", f"{wall / kernels:.2f}"


def atlas_run(alphas: int) -> Line:
    """A run of exact cases, each of another α, gap and load, over its kernels on as many threads."""
    cases, wall, kernels = bench_workflow.atlas_run(alphas)
    what = f"`studies/atlas.yaml`, {cases} exact cases over their kernels, {available_threads()} threads"
    return what, "<= 1.1", f"{wall:.2f} s", f"{wall / kernels:.2f}"


def workflow_lines(sizes: tuple[int, int], runs: int, processes: bool) -> list[Line]:
    """What a case costs beside its kernels, beside xyzpy, and what a grid costs that is there already."""
    threads, large = available_threads(), sizes[-1]

    def per_case(what: str, seconds: float | None, asked: float | None = None) -> Line:
        if seconds is None:
            return what, "", "not installed", ""
        measured, target = f"{1e6 * seconds:.1f} us", f"<= {asked:g} us" if asked else ""
        return what, target, measured, f"{1e6 * seconds / asked:.2f}" if asked else ""

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
    lines += bench_first_run.lines(2)
    for what, seconds, imports, loop in bench_workflow.first_runs():
        lines.append((f"{what}, over `import numba, xarray, scipy`", "", f"{seconds:.2f} s", f"{imports:.1f}"))
        lines.append((f"{what}, over 100000 products in a NumPy loop", "", f"{seconds:.2f} s", f"{loop:.0f}"))
    return lines


def table(size: Size, exact_cases: int, run_cases: int, grids: tuple[int, int], processes: bool) -> list[Line]:
    """Return all lines but those of curves; without ``processes`` only what needs no other processes."""
    lines = bench_limits.lines(size)
    lines += rivals(size) + exact(exact_cases, size.runs) + equal_terms(10 * exact_cases, size.rival_steps)
    lines += [whole_run(run_cases, size.runs), atlas_run(max(2, run_cases // 200))]
    lines += workflow_lines(grids, size.runs, processes)
    return lines + (commands(size.runs) if processes else [])


def markdown(lines: list[Line]) -> str:
    """Return the table with date and machine."""
    machine = (
        f"{processor()}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}, Python {platform.python_version()}"
    )
    command = "python tests/benchmarks/bench_table.py" + " --quick" * ("--quick" in sys.argv)
    rows = [f"*{date.today()}, {machine}; `{command}`*\n"]
    rows += ["| what | asked for | measured | ratio |", "|---|---|---|---|"]
    rows += [
        f"| {what} | {target.replace('<=', '≤').replace('>=', '≥')} | {measured} | {ratio} |"
        for what, target, measured, ratio in lines
    ]
    return "\n".join(rows) + "\n"


def processor() -> str:
    """Return the processor's name."""
    file = Path("/proc/cpuinfo")
    names = [line.split(":")[1].strip() for line in file.read_text().splitlines() if line.startswith("model name")]
    return names[0] if names else platform.machine()


def main(
    size: Size | None = None,
    exact_cases: int = 100,
    run_cases: int = 10_000,
    grids: tuple[int, int] = (10_000, 100_000),
    processes: bool = True,
    extent: Extent | None = None,
) -> tuple[str, list[Curve]]:
    """Print the table and return it with its curves.

    Threads of BLAS, which go on for a while when they are done, are left out.
    """
    with threadpool_limits(limits=1, user_api="blas"):
        lines = table(size or Size(), exact_cases, run_cases, grids, processes)
        scaling = bench_scaling.curves(extent or Extent())
        text = markdown(lines + bench_scaling.lines(scaling))
    print(text, end="")
    return text, scaling


def quickly() -> tuple[str, list[Curve]]:
    """Print the table of shorter runs, each measured once."""
    size = Size(steps=3_000, runs=3, node_steps=1_000_000, rival_steps=300)
    extent = Extent(cases=(1, 10, 1_000, 100_000), steps=1_000_000, runs=2)
    return main(size, 30, 1_000, (1_000, 10_000), extent=extent)


def write(text: str, scaling: list[Curve]) -> None:
    """Keep the table, draw its curves, and put the headlines into the README."""
    bench_scaling.draw(scaling)
    before, _, after = _parts(TABLE.read_text())
    TABLE.write_text(before + BEGIN + text + END + after)
    before, _, after = _parts(README.read_text())
    README.write_text(before + BEGIN + headlines(text) + END + after)


def _parts(text: str) -> tuple[str, str, str]:
    """Return what stands before, within and after the marks of a table."""
    before, rest = text.split(BEGIN)
    within, after = rest.split(END)
    return before, within, after


def headlines(text: str) -> str:
    """Return the README's table: what a few rows were measured to take."""
    about, _, *rows = text.splitlines()
    shown = ["| what | takes |", "|---|---|"]
    for held, words in HEADLINES.items():
        takes = next(row.split("|")[3] for row in rows if held in row)
        shown.append(f"| {words} |{takes}|")
    return "\n".join([about, "", *shown]) + "\n"


if __name__ == "__main__":
    results = quickly() if "--quick" in sys.argv else main()
    if "--write" in sys.argv:
        write(*results)
