"""What the workflow costs beside its kernels: ``python tests/benchmarks/bench_workflow.py``.

Durable overhead per case (wall time less the kernels' own, results on the disk) with threads and with
local dask workers, side by side with xyzpy where it is installed; runs with nothing to do; opening and
slicing; memory; what a whole run of the heavy chain takes beside its kernels; ``plan``.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1]))

from workflow import open_archive, run_study
from workflow.grid import arrange, plan, units_of
from workflow.run import available_threads
from workflow.study import Study, parse_study

TRIVIAL = """
study: trivial
scene:
  chain: {{nodes: 1, mass: 2.5e-3, stiffness: 4.0e4, damping: {{mass: 10, stiffness: 2.0e-7}}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.3, conductance: 0.6, convection: 0.02}}
  casing: {{gap: 50 um}}
  load: {{amplitude: 10, frequency: 20 Hz}}
  duration: 0.1 s
axes: {{h: 5e-3, alpha: {{lin: [0, 10, {rows}]}}, e: {{lin: [0, 0.9, {columns}]}}}}
output: {{interval: {interval}, histories: {histories}, balances: false}}
"""
"""One node, twenty steps."""

HEAVY = """
study: heavy
scene:
  chain: {{nodes: 20, mass: 2.5e-3, stiffness: 2.0e7, damping: {{mass: 10, stiffness: 2.0e-7}}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.315, conductance: 0.605, convection: 0.02}}
  casing: {{gap: 5.0e-5}}
  load: {{amplitude: 100, frequency: 20}}
  duration: 0.3
axes: {{h: 1e-5, alpha: {{lin: [0, 50, {rows}]}}, e: {{lin: [0, 0.9, {columns}]}}}}
output: {{interval: 0.3, histories: [], balances: false}}
"""

METRICS = {"histories": "[]", "interval": "0.1 s"}
HISTORIES = {"histories": "[displacement, temperature, contact_force]", "interval": "0.5 ms"}

MEASURED = """
import sys
from pathlib import Path
from workflow import read_study, run_study
run_study(read_study(Path(sys.argv[1])), Path(sys.argv[2]))
told = Path("/proc/self/status").read_text()
print(int(told.split("VmHWM:")[1].split()[0]) / 1024)
"""


def trivial(cases: int, kind: dict[str, str]) -> str:
    """Return the trivial study of some thousand cases."""
    columns = min(1000, cases // 2)
    return TRIVIAL.format(rows=cases // columns, columns=columns, **kind)


def parsed(text: str) -> Study:
    """Return a study of this module."""
    return parse_study(text, "bench")


@contextmanager
def scratch() -> Iterator[Path]:
    """Give a directory for an archive."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)


def kernel_seconds(archive: Path) -> float:
    """Return the kernels' own time on one core, all cases together."""
    with open_archive(archive) as data:
        return float(data["wall_time"].sum())


def overhead(cases: int, **where: int) -> float:
    """Return seconds of wall time per case beyond the kernels' own."""
    with scratch() as directory:
        begun = time.perf_counter()
        run_study(parsed(trivial(cases, METRICS)), directory / "a.nc", **where)
        wall = time.perf_counter() - begun
        return (wall - kernel_seconds(directory / "a.nc") / next(iter(where.values()))) / cases


def nothing_to_do(cases: int, runs: int) -> tuple[float, float]:
    """Return seconds of a run with nothing to do, and of opening the archive and slicing a case."""
    study = parsed(trivial(cases, METRICS))
    with scratch() as directory:
        archive = directory / "a.nc"
        run_study(study, archive)
        again, sliced = [], []
        for _ in range(runs):
            begun = time.perf_counter()
            run_study(study, archive)
            again.append(time.perf_counter() - begun)
            begun = time.perf_counter()
            with open_archive(archive) as data:
                data.isel(alpha=1, e=1)["contact_impulse"].item()
            sliced.append(time.perf_counter() - begun)
    return median(again), median(sliced)


def memory(cases: int, kind: dict[str, str]) -> float:
    """Return the largest resident memory of a run in a process of its own, MiB."""
    with scratch() as directory:
        (directory / "a.yaml").write_text(trivial(cases, kind))
        words = [sys.executable, "-c", MEASURED, str(directory / "a.yaml"), str(directory / "a.nc")]
        return float(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def whole_run(cases: int) -> tuple[float, float]:
    """Return wall time of a run of the heavy chain and the kernels' own on as many threads, seconds."""
    columns = min(100, cases // 2)
    study = parsed(HEAVY.format(rows=cases // columns, columns=columns))
    with scratch() as directory:
        run_study(parsed(HEAVY.format(rows=2, columns=2)), directory / "warm.nc")
        begun = time.perf_counter()
        run_study(study, directory / "a.nc")
        return time.perf_counter() - begun, kernel_seconds(directory / "a.nc") / available_threads()


def plan_seconds(cases: int) -> float:
    """Return the seconds of planning a study."""
    study = parsed(trivial(cases, METRICS))
    begun = time.perf_counter()
    grid = arrange(study)
    plan(grid, units_of(grid))
    return time.perf_counter() - begun


def xyzpy_overhead(cases: int) -> float | None:
    """Return the seconds per case that xyzpy takes to store as many numbers of a function that costs nothing."""
    try:
        import xyzpy
    except ImportError:
        return None
    names = [f"metric{k}" for k in range(16)]
    numbers = tuple(float(k) for k in range(16))
    columns = min(1000, cases // 2)
    with scratch() as directory:
        runner = xyzpy.Runner(lambda alpha, e: numbers, var_names=names)
        harvester = xyzpy.Harvester(runner, data_name=str(directory / "a.h5"))
        combos = {"alpha": [k / 10 for k in range(cases // columns)], "e": [k / 1000 for k in range(columns)]}
        begun = time.perf_counter()
        harvester.harvest_combos(combos, verbosity=0)
        return (time.perf_counter() - begun) / cases


def main(
    sizes: tuple[int, int] = (10_000, 100_000),
    planned: int = 1_000_000,
    heavy: int = 10_000,
    runs: int = 5,
    processes: bool = True,
) -> None:
    """Print the table; without ``processes`` only what needs no other processes."""
    small, large = sizes
    with scratch() as directory:  # kernels compiled, libraries loaded
        run_study(parsed(trivial(4, METRICS)), directory / "a.nc")
    threads = available_threads()
    print(f"overhead per case, {threads} threads: {1e6 * overhead(large, threads=threads):.3g} us")
    if processes:
        print(f"overhead per case, {threads} workers and their start: {1e6 * overhead(large, workers=threads):.3g} us")
    other = xyzpy_overhead(small)
    print("overhead per case, xyzpy: " + ("not installed" if other is None else f"{1e6 * other:.3g} us"))
    for cases in sizes:
        again, sliced = nothing_to_do(cases, runs)
        print(f"nothing to do, {cases} cases: {1e3 * again:.3g} ms")
        print(f"open and slice, {cases} cases: {1e3 * sliced:.3g} ms")
    for name, kind in (("metrics", METRICS), ("3 histories of 201 samples", HISTORIES)):
        for cases in sizes if processes else ():
            print(f"largest memory, {cases} cases, {name}: {memory(cases, kind):.0f} MiB")
    print(f"plan, {planned} cases: {plan_seconds(planned):.3g} s")
    wall, kernels = whole_run(heavy)
    ratio = f"{wall / kernels:.3f} x the kernels' own {kernels:.3g} s"
    print(f"whole run, {heavy} cases of the heavy chain: {wall:.3g} s, {ratio}")


if __name__ == "__main__":
    main()
