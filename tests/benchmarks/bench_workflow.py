"""What the workflow costs beside its kernels, and what a user waits for: lines of ``bench_table``.

Durable overhead per case (wall time less the kernels' own, results on the disk) with threads and with local dask
workers; runs with nothing to do; opening and slicing; a value added to an axis; whole runs over their kernels;
commands, in wall time and in processor time over that of the imports alone; memory.
"""

import os
import resource
import shutil
import subprocess
import sys
import time
from contextlib import chdir
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

import bench_limits
import xarray as xr
from timing import Line, Size, least, scratch, taken, within

from studies import BLADE_SCENE, HEAVY_SCENE, parsed
from workflow import open_archive, run_study
from workflow.cases import arrange
from workflow.plan import plan
from workflow.run import available_threads
from workflow.study import Study, read_study

TRIVIAL = """
study: trivial
scene:
  chain: {{nodes: 1, mass: 2.5e-3, stiffness: 4.0e4, damping: {{mass: 10, stiffness: 2.0e-7}}, spacing: 2.5e-3,
          expansion: 8.6e-6, heat_capacity: 1.3, conductance: 0.6, convection: 0.02}}
  casing: {{gap: 50 um}}
  load: {{amplitude: 10, frequency: 20 Hz}}
  duration: 0.1 s
axes: {{h: 5e-3, alpha: {alpha}, e: {e}}}
output: {{interval: {interval}, histories: {histories}, balances: false}}
"""
"""One node, twenty steps."""

HEAVY_AXES = """
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

LARGE = """
import sys
sys.path.insert(0, "studies")
import finite_element_blade as blade, workflow
whole, turning = (blade.matrices((4, 8, 1), **{kind: True}) for kind in ("chord", "spin"))
del whole["places"]
workflow.write_matrices(sys.argv[1], **whole, **{name: turning[name] for name in ("stiffness_speed2", "load_speed2")})
"""
"""A blade of 1 296 displacements and 432 temperatures that turns, with five contacts along the chord of its tip."""

SPEEDS = """
study: large
scene:
  matrices: {{file: large.npz, damping: {{ratio: 0.003}}}}
  casing: {{gap: 60 um, harmonics: [{{order: 6, amplitude: 15 um}}]}}
  friction: {{coefficient: 0.15, sliding_speed: 200, heat_share: 0.0005}}
  initial: static
  duration: 3 ms
axes: {{scheme: event_driven, e: 0, reduction: krylov, scene.speed: {{lin: [1000 rpm, 9000 rpm, {speeds}]}}}}
zip: {{model: {{mechanical_modes: [100], thermal_modes: [30]}}}}
output: {{interval: 0.05 ms, histories: [displacement]}}
"""

CASING = {"flexibility": 1e-7, "harmonics": [{"order": 2, "amplitude": "12 um"}]}
COATED = parsed(
    f"study: coated{BLADE_SCENE}  speed: 20000 rpm\n"
    "axes: {scheme: event_driven, alpha: 10, mechanical_modes: 3, thermal_modes: 12}\n"
    "output: {interval: 10 ms, histories: [], balances: false}\n"
).with_(
    {
        "scene.casing": {"gap": "10 um", "coating": {"yield_force": "2 N", "hardening": 1e5, "sectors": 360}, **CASING},
        "scene.load": {"mean": 25, "amplitude": 10, "frequency": "810 Hz"},
        "scene.duration": "3 s",
    }
)
"""The blade of ``blade.yaml`` cuts a coating over a thousand revolutions."""

ROOT = Path(__file__).parents[2]
BLADE = Path(__file__).with_name("blade.yaml")


def trivial(cases: int, kind: dict[str, str], rows: slice = slice(-1)) -> str:
    """Return the trivial study of some thousand cases; there is one more value of alpha to take ``rows`` from."""
    columns = min(1000, cases // 2)
    alpha = [k / 100 for k in range(cases // columns + 1)]
    e = [0.9 * k / columns for k in range(columns)]
    return TRIVIAL.format(alpha=alpha[rows], e=e, **kind)


def heavy(cases: int) -> Study:
    """Return so many cases of the heavy chain."""
    columns = min(100, max(2, cases // 10))
    return parsed(f"study: heavy\n{HEAVY_SCENE}{HEAVY_AXES.format(rows=max(2, cases // columns), columns=columns)}")


def kernel_seconds(archive: Path) -> float:
    """Return the kernels' own time on one core, all cases together."""
    with open_archive(archive) as data:
        return float(data["processor_time"].sum())


def memory(cases: int, kind: dict[str, str]) -> float:
    """Return the largest resident memory of a run in a process of its own, MiB."""
    with scratch() as directory:
        (directory / "a.yaml").write_text(trivial(cases, kind))
        words = [sys.executable, "-c", MEASURED, str(directory / "a.yaml"), str(directory / "a.nc")]
        return float(subprocess.run(words, check=True, capture_output=True, text=True).stdout)


def equal_terms(size: Size) -> list[Line]:
    """Return what a user waits for, for each of distinct cases over 0.3 s, set-up and archive included, one thread.

    A loop in NumPy knows no batches: its cases take as long each. Few of its steps, and SciPy's first milliseconds, are
    measured and multiplied.
    """
    seconds, steps = {}, 30_000
    for scheme in ("moreau", "event_driven"):
        study = heavy(10 * size.exact_cases).with_({"axes.scheme": [scheme]})
        with scratch() as directory:
            run_study(study, directory / "warm.nc", threads=1)
            count = sum(run_study(study, directory / "a.nc", threads=1).counts.values())
            seconds[scheme] = taken(partial(run_study, study, directory / "b.nc", threads=1)) / count
    integrated, _ = bench_limits.dop853(20 if size.rival_steps > 1000 else 1)
    own = seconds["moreau"]
    what = f"a case of 0.3 s, {count} distinct ones, one thread, everything included"
    lines: list[Line] = [(f"{what}: `moreau`, h = 1e-5 s", "", f"{1e3 * own:.3g} ms", "1")]
    for label, other in (
        ("`event_driven`", seconds["event_driven"]),
        ("NumPy, h = 1e-5 s", bench_limits.numpy_loop(10 * size.rival_steps) * steps),
        ("SciPy DOP853 with events", 0.3 * integrated),
    ):
        measured = f"{other:.3g} s" if other >= 1 else f"{1e3 * other:.3g} ms"
        lines.append((f"{what}: {label}, over `moreau`", "", measured, f"{other / own:.3g}"))
    return lines


def over_kernels(what: str, study: Study, warm: Study, runs: int = 1) -> Line:
    """A run in a warm process over its kernels on as many threads: the run whose ratio of both is the median."""
    pairs = []
    with scratch() as directory:
        run_study(warm, directory / "warm.nc")
        for k in range(runs):
            wall = taken(partial(run_study, study, directory / f"{k}.nc"))
            pairs.append((wall / kernel_seconds(directory / f"{k}.nc") * available_threads(), wall))
    ratio, wall = sorted(pairs)[runs // 2]
    return f"{what} over its kernels, {available_threads()} threads", "<= 1.1", f"{wall:.2f} s", f"{ratio:.2f}"


def atlas(loads: int = 4, e: int = 10, gaps: int = 50, alphas: int = 50, **more: Any) -> Study:
    """Return ``studies/atlas.yaml`` with other numbers of values along its axes."""
    study, counts = (
        read_study(ROOT / "studies" / "atlas.yaml"),
        {"amplitude": loads, "e": e, "gap": gaps, "alpha": alphas},
    )
    axes = [axis for dimension in study.dimensions for axis in dimension.axes]
    lin = {f"axes.{a.path}": {"lin": [a.values[0], a.values[-1], counts[a.name]]} for a in axes}
    return study.with_(lin | more)


def overhead(cases: int, **where: int) -> float:
    """Return seconds of wall time per case beyond the kernels' own."""
    with scratch() as directory:
        wall = taken(partial(run_study, parsed(trivial(cases, METRICS)), directory / "a.nc", **where))
        return (wall - kernel_seconds(directory / "a.nc") / next(iter(where.values()))) / cases


def there_already(cases: int, most: int, runs: int) -> list[Line]:
    """A run with nothing to do, opening the archive, alone and to slice a case."""
    study = parsed(trivial(cases, METRICS))
    with scratch() as directory:
        archive = directory / "a.nc"

        def sliced() -> None:
            with open_archive(archive) as data:
                data.isel(alpha=1, e=1)["contact_impulse"].item()

        run_study(study, archive)
        works = {"nothing to do": (partial(run_study, study, archive), most), "open and slice a case": (sliced, 25)}
        lines = []
        for what, (work, asked) in works.items():
            seconds = 1e3 * median(taken(work) for _ in range(runs))
            lines.append(within(f"{what}, {cases} cases", asked, seconds, "ms"))
        ours, plain = least(runs, lambda: open_archive(archive).close(), lambda: xr.open_dataset(archive).close())
        what = f"open, {cases} cases, over `xarray.open_dataset`"
        return [*lines, (what, "<= 1.5", f"{1e3 * ours:.1f} ms", f"{ours / plain:.2f}")]


def extension(cases: int) -> Line:
    """A value added to an axis over running its cases alone and copying the archive durably."""
    new, whole = (parsed(trivial(cases, METRICS, rows)) for rows in (slice(-1, None), slice(None)))
    with scratch() as directory:
        run_study(parsed(trivial(cases, METRICS)), directory / "a.nc")
        begun = time.perf_counter()
        shutil.copyfile(directory / "a.nc", directory / "copy.nc")
        with open(directory / "copy.nc", "rb") as file:
            os.fsync(file.fileno())
        run_study(new, directory / "new.nc")
        apart = time.perf_counter() - begun
        added = taken(partial(run_study, whole, directory / "a.nc"))
    what = f"a value added to {cases} cases over its cases alone and a raw copy"
    return what, "", f"{added:.2f} s", f"{added / apart:.1f}"


def coated() -> Line:
    """A thousand revolutions against a coating, exactly: the case's own processor time."""
    with scratch() as directory:
        run_study(COATED, directory / "a.nc")
        seconds = 1e3 * kernel_seconds(directory / "a.nc")
    return "`event_driven`, 1 000 revolutions, coating of 360 sectors, 3 + 12 modes", "", f"{seconds:.0f} ms", ""


def out_of_reach(method: str, duration: str) -> Line:
    """A coating that is never touched over the elastic casing alone: the median ratio of runs in turns."""
    axes = {"axes.scheme": method, "axes.h": 1e-5, "axes.alpha": {"lin": [0, 1, 256]}, "output.interval": "0.1 s"}
    coat = COATED.with_(axes | {"scene.duration": duration, "scene.casing.gap": "5 mm"})
    alone = coat.with_({"scene.casing": {"gap": "5 mm", **CASING}})
    pairs = []
    with scratch() as directory:
        for k in range(8):
            for name, study in (("coat", coat), ("alone", alone)):
                run_study(study, directory / f"{name}{k}.nc", threads=1)
            pairs.append([kernel_seconds(directory / f"{name}{k}.nc") for name in ("coat", "alone")])
    ratio = median(both / alone for both, alone in pairs[1:])  # the first may compile
    what = f"`{method}`, a case that never touches its coating over `flexibility` alone"
    return what, "<= 1.05", f"{1e3 * min(pairs)[0] / 256:.3g} ms", f"{ratio:.2f}"


def lines(size: Size) -> list[Line]:
    """Return the lines that need no other process."""
    with scratch() as directory:  # kernels compiled, libraries loaded
        run_study(parsed(trivial(4, METRICS)), directory / "a.nc")
    threads = available_threads()
    each = 1e6 * overhead(size.grids[-1], threads=threads)
    table = [*equal_terms(size), coated(), out_of_reach("moreau", "0.3 s"), out_of_reach("event_driven", "3 s")]
    what = f"run of {size.run_cases} cases with metrics"
    table.append(over_kernels(what, heavy(size.run_cases), heavy(4), size.runs))
    alphas = max(2, size.run_cases // 200)
    what = f"`studies/atlas.yaml`, {4 * 10 * 50 * alphas} exact cases"
    table.append(over_kernels(what, atlas(alphas=alphas), atlas(alphas=alphas, gaps=2)))
    table.append(within(f"overhead per case, durable, {threads} threads", 8, each, "us"))
    for cases, most in zip(size.grids, (25, 500), strict=True):
        table += there_already(cases, most, size.runs)
    return table + [extension(cases) for cases in size.grids]


def called(*words: str | Path, **environment: str) -> tuple[float, float]:
    """Return wall and processor seconds of a process and of all that it starts."""
    here = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    here |= {"PYTHONPATH": os.pathsep.join([str(ROOT), here.get("PYTHONPATH", "")]), **environment}
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    wall = taken(lambda: subprocess.run([sys.executable, *map(str, words)], check=True, capture_output=True, env=here))
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return wall, after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def large_blade_lines() -> list[Line]:
    """Return processor times of a plan at three speeds, reduced for the first time and later, and of a diagram."""
    drawn = "import workflow; workflow.pin(); workflow.plots.campbell('large.yaml')"
    with scratch() as directory, chdir(ROOT):
        called("-c", LARGE, directory / "large.npz")
        os.chdir(directory)
        here, plan_it = {"NUMBA_CACHE_DIR": str(directory / "kernels")}, ("-m", "workflow", "plan", "large.yaml")
        Path("large.yaml").write_text(SPEEDS.format(speeds=3))
        called(*plan_it, **here)  # compiles
        for model in directory.rglob("*.model"):
            model.unlink()
        first, later = (called(*plan_it, **here)[1] for _ in range(2))
        Path("large.yaml").write_text(SPEEDS.format(speeds=17))
        diagram = called("-c", drawn, **here)[1]
    what = "a blade of 1296 + 432 coordinates and 5 contacts, processor time"
    return [
        within(f"{what}: plan at 3 speeds", 5, first, "s", 2),
        within(f"{what}: the same again", 2, later, "s", 2),
        within(f"{what}: Campbell diagram, 17 speeds", 8, diagram, "s", 2),
    ]


def command_lines(size: Size) -> list[Line]:
    """What a user types and waits for, alone and over the imports; workers; a million cases."""
    workers, large = available_threads(), size.grids[-1]
    each, runs = 1e6 * overhead(large, workers=workers), range(size.runs)
    what = f"overhead per case, durable, {workers} local dask workers"
    table = [within(what, 120, each, "us")]

    def waited(*words: str | Path, **here: str) -> float:
        return median(called("-m", "workflow", *words, **here)[0] for _ in runs)

    called("-m", "workflow", "plan", BLADE)  # files in memory, bytecode written
    table.append(within("`workflow --help`", 0.5, waited("--help"), "s", 2))
    table.append(within("`workflow plan tests/benchmarks/blade.yaml`", 1.2, waited("plan", BLADE), "s", 2))
    with scratch() as directory:
        archive, kernels = directory / "a.nc", {"NUMBA_CACHE_DIR": str(directory / "kernels")}
        run = ["-m", "workflow", "run", BLADE, "-o", archive]
        imports = median(called("-c", "import numba, xarray, scipy")[1] for _ in runs)
        for what, asked, times in (("nothing compiled", 12.0, range(1)), ("later", 3.0, runs)):
            taken_here = []
            for _ in times:
                taken_here.append(called(*run, **kernels))
                archive.unlink()
            wall, processor = (median(seconds) for seconds in zip(*taken_here, strict=True))
            name = f"workflow run tests/benchmarks/blade.yaml, {what}"
            table.append(within(name, asked, wall, "s", 2))
            name = f"{name}, processor time, over `import numba, xarray, scipy`"
            table.append((name, "", f"{processor:.2f} s", f"{processor / imports:.1f}"))
        called(*run, **kernels)
        what, idle = "workflow run tests/benchmarks/blade.yaml, nothing to do", waited(*run[2:], **kernels)
        table.append((what, "", f"{idle:.2f} s", ""))
    for name, kind in (("metrics", METRICS), ("3 histories of 201 samples", HISTORIES)):
        what = f"largest memory, {10 * large} cases, {name}"
        table.append(within(what, 500, memory(10 * large, kind), "MiB", 0))
    seconds = taken(lambda: plan(arrange(parsed(trivial(10 * large, METRICS)))))
    return [*table, (f"plan, {10 * large} cases", "", f"{seconds:.2f} s", ""), *large_blade_lines()]
