"""What the workflow costs beside its kernels: ``python tests/benchmarks/bench_workflow.py``.

Durable overhead per case (wall time less the kernels' own, results on the disk) with threads and with
local dask workers, side by side with xyzpy where it is installed; runs with nothing to do; opening and
slicing; a value added to an axis; memory; what a whole run of the heavy chain takes beside its kernels;
``plan``; and what a user waits for at the command line, the first run with nothing compiled included, also in
processor time over that of the imports alone and of a loop of NumPy.
"""

from __future__ import annotations

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from io import StringIO
from pathlib import Path
from statistics import median

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from workflow import open_archive, run_study
from workflow.grid import arrange, plan
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
axes: {{h: 5e-3, alpha: {alpha}, e: {{lin: [0, 0.9, {columns}]}}}}
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
status = Path("/proc/self/status").read_text()
print(int(status.split("VmHWM:")[1].split()[0]) / 1024)
"""


ROOT = Path(__file__).parents[2]
BLADE = ROOT / "studies" / "blade.yaml"


def trivial(cases: int, kind: dict[str, str], rows: slice = slice(-1)) -> str:
    """Return the trivial study of some thousand cases; there is one more value of alpha to take ``rows`` from."""
    columns = min(1000, cases // 2)
    alpha = [k / 100 for k in range(cases // columns + 1)]
    return TRIVIAL.format(alpha=alpha[rows], columns=columns, **kind)


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
        return float(data["processor_time"].sum())


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


def extension(cases: int, kind: dict[str, str]) -> tuple[float, float, float]:
    """Return seconds of adding a value to an axis, of running its cases alone, and of copying the archive durably."""
    new, whole = (parsed(trivial(cases, kind, rows)) for rows in (slice(-1, None), slice(None)))
    with scratch() as directory:
        run_study(parsed(trivial(cases, kind)), directory / "a.nc")
        begun = time.perf_counter()
        shutil.copyfile(directory / "a.nc", directory / "copy.nc")
        with open(directory / "copy.nc", "rb") as file:
            os.fsync(file.fileno())
        copied = time.perf_counter()
        run_study(new, directory / "new.nc")
        alone = time.perf_counter()
        run_study(whole, directory / "a.nc")
        return time.perf_counter() - alone, alone - copied, copied - begun


def command(*words: str | Path, runs: int = 1, **environment: str) -> float:
    """Return the median seconds of ``workflow`` as a process of its own."""
    here = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    here["PYTHONPATH"] = os.pathsep.join([str(ROOT), here.get("PYTHONPATH", "")])
    seconds = []
    for _ in range(runs):
        begun = time.perf_counter()
        subprocess.run(
            [sys.executable, "-m", "workflow", *map(str, words)],
            check=True,
            capture_output=True,
            env={**here, **environment},
        )
        seconds.append(time.perf_counter() - begun)
    return median(seconds)


def commands(runs: int) -> Iterator[tuple[str, float]]:
    """Yield what a user types and waits for, and the seconds it takes."""
    with scratch() as directory:
        archive, kernels = directory / "a.nc", {"NUMBA_CACHE_DIR": str(directory / "kernels")}
        command("plan", BLADE)  # files in memory, bytecode written
        yield "workflow --help", command("--help", runs=runs)
        yield "workflow plan studies/blade.yaml", command("plan", BLADE, runs=runs)
        yield "workflow run studies/blade.yaml, nothing compiled", command("run", BLADE, "-o", archive, **kernels)
        again = []
        for _ in range(runs):
            archive.unlink()
            again.append(command("run", BLADE, "-o", archive, **kernels))
        yield "workflow run studies/blade.yaml, later", median(again)
        yield (
            "workflow run studies/blade.yaml, nothing to do",
            command("run", BLADE, "-o", archive, runs=runs, **kernels),
        )


def processor_seconds(words: Sequence[str | Path], **environment: str) -> float:
    """Return the processor seconds of a process and of all that it starts: they depend little on other load."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    here = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")]), **environment}
    subprocess.run([sys.executable, *map(str, words)], check=True, capture_output=True, env=here)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def numpy_loop(steps: int = 100_000) -> float:
    """Return the processor seconds of so many products of a 60 × 60 matrix with a vector, in a loop of Python's."""
    matrix, state = np.eye(60), np.ones(60)
    begun = time.process_time()
    for _ in range(steps):
        state = matrix @ state
    return time.process_time() - begun


def first_runs() -> Iterator[tuple[str, float, float, float]]:
    """Yield a run's name, its processor seconds, and these over those of the imports and of :func:`numpy_loop`."""
    imports, loop = processor_seconds(["-c", "import numba, xarray, scipy"]), numpy_loop()
    with scratch() as directory:
        archive = directory / "a.nc"
        for what in ("nothing compiled", "later"):
            run = ["-m", "workflow", "run", BLADE, "-o", archive]
            seconds = processor_seconds(run, NUMBA_CACHE_DIR=str(directory / "kernels"))
            archive.unlink()
            yield f"workflow run studies/blade.yaml, {what}, processor time", seconds, seconds / imports, seconds / loop


def memory(cases: int, kind: dict[str, str]) -> float:
    """Return the largest resident memory of a run in a process of its own, MiB."""
    with scratch() as directory:
        (directory / "a.yaml").write_text(trivial(cases, kind))
        words = [sys.executable, "-c", MEASURED, str(directory / "a.yaml"), str(directory / "a.nc")]
        return float(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def whole_run(cases: int, runs: int) -> tuple[float, float]:
    """Return wall time of a run of the heavy chain and the kernels' own on as many threads, seconds.

    It is the run whose ratio of both is the median.
    """
    columns = min(100, cases // 2)
    study = parsed(HEAVY.format(rows=cases // columns, columns=columns))
    runs_seconds = []
    with scratch() as directory:
        run_study(parsed(HEAVY.format(rows=2, columns=2)), directory / "warm.nc")
        for run in range(runs):
            archive = directory / f"{run}.nc"
            begun = time.perf_counter()
            run_study(study, archive)
            runs_seconds.append((time.perf_counter() - begun, kernel_seconds(archive) / available_threads()))
    return sorted(runs_seconds, key=lambda pair: pair[0] / pair[1])[runs // 2]


def atlas_run(alphas: int) -> tuple[int, float, float]:
    """Return the cases of ``studies/atlas.yaml`` with fewer loads and α, its wall time and that of its kernels, s.

    The kernels' is their own on as many threads.
    """
    text = (ROOT / "studies" / "atlas.yaml").read_text()
    for values, fewer in (("[3.125, 12.875, 40]", "[3.125, 12.875, 4]"), ("[0, 5.5125, 50]", f"[0, 5.5125, {alphas}]")):
        assert values in text, values
        text = text.replace(values, fewer)
    with scratch() as directory:
        few_gaps = text.replace("10.8 um, 50]", "10.8 um, 2]")
        run_study(parsed(few_gaps), directory / "warm.nc")
        archive, begun = directory / "a.nc", time.perf_counter()
        counts = run_study(parsed(text), archive).counts
        seconds = time.perf_counter() - begun
        return sum(counts.values()), seconds, kernel_seconds(archive) / available_threads()


def plan_seconds(cases: int) -> float:
    """Return the seconds of planning a study."""
    study = parsed(trivial(cases, METRICS))
    begun = time.perf_counter()
    grid = arrange(study)
    plan(grid)
    return time.perf_counter() - begun


def xyzpy_overhead(cases: int, batch: int | None = None) -> float | None:
    """Return the seconds per case that xyzpy takes to store as many numbers of a function that costs nothing.

    With ``batch`` its batches of so many cases are on the disk before they are put together, as our
    tasks are, though not flushed; without, nothing is until the end.
    """
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
        if batch is None:
            harvester.harvest_combos(combos, verbosity=0)
        else:
            crop = harvester.Crop(name="bench", parent_dir=str(directory), batchsize=batch)
            crop.sow_combos(combos, verbosity=0)
            crop.grow_missing(verbosity=0)
            with redirect_stderr(StringIO()):  # its bar
                crop.reap()
        return (time.perf_counter() - begun) / cases


def main(
    sizes: tuple[int, int] = (10_000, 100_000),
    planned: int = 1_000_000,
    heavy: int = 10_000,
    runs: int = 5,
    processes: bool = True,
) -> None:
    """Print the table; without ``processes`` only what needs no other processes."""
    large = sizes[-1]
    with scratch() as directory:  # kernels compiled, libraries loaded
        run_study(parsed(trivial(4, METRICS)), directory / "a.nc")
    threads = available_threads()
    print(f"overhead per case, {threads} threads: {1e6 * overhead(large, threads=threads):.3g} us")
    if processes:
        print(f"overhead per case, {threads} workers and their start: {1e6 * overhead(large, workers=threads):.3g} us")
    for how, batch in (("kept in memory to the end", None), ("batches of 1000 on the disk", 1000)):
        other = xyzpy_overhead(large, batch)
        print(f"overhead per case, xyzpy, {how}: " + ("not installed" if other is None else f"{1e6 * other:.3g} us"))
    for cases in sizes:
        again, sliced = nothing_to_do(cases, runs)
        print(f"nothing to do, {cases} cases: {1e3 * again:.3g} ms")
        print(f"open and slice, {cases} cases: {1e3 * sliced:.3g} ms")
    for cases in sizes:
        added, alone, copied = extension(cases, METRICS)
        parts = f"{added / (alone + copied):.3g} x the new cases alone {alone:.3g} s and a copy {copied:.3g} s"
        print(f"extension of {cases} cases by {min(1000, cases // 2)}: {added:.3g} s, {parts}")
    for name, kind in (("metrics", METRICS), ("3 histories of 201 samples", HISTORIES)):
        for cases in sizes if processes else ():
            print(f"largest memory, {cases} cases, {name}: {memory(cases, kind):.0f} MiB")
    print(f"plan, {planned} cases: {plan_seconds(planned):.3g} s")
    wall, kernels = whole_run(heavy, runs)
    ratio = f"{wall / kernels:.3f} x the kernels' own {kernels:.3g} s"
    print(f"whole run, {heavy} cases of the heavy chain: {wall:.3g} s, {ratio}")
    for words, seconds in commands(runs) if processes else ():
        print(f"{words}: {seconds:.3g} s")
    for what, seconds, imports, loop in first_runs() if processes else ():
        print(f"{what}: {seconds:.3g} s, {imports:.3g} x `import numba, xarray, scipy`, {loop:.3g} x 100 000 products")


if __name__ == "__main__":
    main()
