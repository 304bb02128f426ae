"""How a run uses the cores: ``python tests/benchmarks/bench_scaling.py [--threads 1,2,4,...] [--cases N] [--runs N]``.

**Python inside tasks** is the processor time of the threads that compute tasks and references, each from a task's first
line to its last, less what the same threads spend in compiled kernels, whose entry from Python
(``workflow.kernels.compiled.Deferred``) is wrapped here. Waits, as on the disk, take no processor time. NumPy, LAPACK,
zlib and the system's work for a shard count as Python, and so do the two clocks of each call, 0.5 us.

**Speed-up**: wall seconds of one thread over those of N, of whole runs and of their tasks (from the first task's
beginning to the last one's end), over the speed-up of a loop of multiply-adds in registers, which holds no lock, on as
many threads. Runs and loops take turns; medians.
"""

import argparse
import os
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import multiply_add_peak
from bench_table import markdown
from bench_workflow import HEAVY_AXES, METRICS, ROOT, kernel_seconds, over_kernels, trivial
from timing import Line, scratch, taken

from studies import HEAVY_SCENE, parsed
from workflow import run_study
from workflow.kernels.compiled import Deferred
from workflow.run import _threads
from workflow.schemes._exact import contact_batch
from workflow.solve import _operators
from workflow.study import Study, read_study

TASK_FUNCTIONS = ("store_task", "compute_block")
"""What threads run of ``workflow.run._threads``."""


def exact(cases: int, reference: bool = False) -> Study:
    """Return ``studies/atlas.yaml`` with so many cases, 20 e and 20 alpha; its gaps are halved with a reference."""
    text = (ROOT / "studies" / "atlas.yaml").read_text()
    gaps = max(2, cases // 4000)
    for values, others in (
        ("[3.125, 12.875, 40]", "[3.125, 12.875, 10]"),
        ("{lin: [0, 0.9, 10]}", "{lin: [0, 0.9, 20]}"),
        ("[1 um, 10.8 um, 50]", f"[1 um, 10.8 um, {gaps}]"),
        ("[0, 5.5125, 50]", f"[0, 5.5125, {max(2, cases // (200 * gaps))}]"),
    ):
        assert values in text, values
        text = text.replace(values, others)
    return parsed(text + ("reference: {mechanical_modes: 5}\n" if reference else ""))


def stepped(cases: int) -> Study:
    """Return so many cases of 2 000 steps of a chain of 20 nodes, 3 + 12 modes."""
    text = f"study: heavy\n{HEAVY_SCENE}{HEAVY_AXES.format(rows=max(2, cases // 100), columns=100)}"
    return parsed(
        text.replace("h: 1e-5", "h: 1e-5, mechanical_modes: 3, thermal_modes: 12")
        .replace("duration: 0.3", "duration: 0.02")
        .replace("interval: 0.3", "interval: 0.02")
    )


def chord() -> Study:
    """Return the 200 exact cases of ``studies/chord.yaml``: five contacts, sets for each µ and α."""
    return read_study(ROOT / "studies" / "chord.yaml")


@dataclass
class Spent:
    """Processor seconds of all threads in tasks, and in kernels within them; when tasks began and ended."""

    tasks: float = 0.0
    kernels: float = 0.0
    times: list[float] = field(default_factory=list)


@contextmanager
def watched(kernels: bool = True) -> Iterator[Spent]:
    """Measure what tasks spend; where their kernels are not asked for only when tasks begin and end."""
    spent, call = Spent(), Deferred.__call__

    def wrapped(work: Callable[..., Any]) -> Callable[..., Any]:
        def measured(*words: Any) -> Any:
            spent.times.append(time.perf_counter())
            begun = time.thread_time()
            result = work(*words)
            spent.tasks += time.thread_time() - begun
            spent.times.append(time.perf_counter())
            return result

        return measured

    def kernel(deferred: Deferred, *words: Any) -> Any:
        begun = time.thread_time()
        result = call(deferred, *words)
        spent.kernels += time.thread_time() - begun
        return result

    before = {name: getattr(_threads, name) for name in TASK_FUNCTIONS}
    for name, work in before.items():
        setattr(_threads, name, wrapped(work))
    if kernels:
        Deferred.__call__ = kernel  # type: ignore[method-assign]
    try:
        yield spent
    finally:
        Deferred.__call__ = call  # type: ignore[method-assign]
        for name, work in before.items():
            setattr(_threads, name, work)


def run(study: Study, clock: Callable[[], float] = time.perf_counter, **where: int) -> float:
    """Return seconds of a run, of wall time by default."""
    with scratch() as directory:
        return taken(partial(run_study, study, directory / "a.nc", **where), clock)


def python_inside(cases: int, threads: int, runs: int) -> Iterator[Line]:
    """Yield Python inside tasks, us for each case."""
    for what, study, asked in (
        (f"{cases} exact cases", exact(cases), 3),
        (f"{cases} cases of 2 000 steps", stepped(cases), 2),
        (f"{cases} exact cases with a reference", exact(cases, reference=True), 6),
    ):
        each = []
        for _ in range(runs):
            with watched() as spent:
                run(study, threads=threads)
            each.append(1e6 * (spent.tasks - spent.kernels) / cases)
        name = f"Python inside tasks, {what}, {threads} threads"
        yield name, f"<= {asked} us", f"{median(each):.1f} us", f"{median(each) / asked:.2f}"


def speed_ups(study: Study, what: str, threads: list[int], runs: int) -> Iterator[Line]:
    """Yield the speed-up of each number of threads over one, and over that of a loop without a lock."""
    for count in threads[1:]:
        ratios: list[list[float]] = []
        with ThreadPoolExecutor(count) as pool:
            for _ in range(runs):
                seconds = [(*_of_tasks(study, n), _of_loops(pool, n, count)) for n in (1, count)]
                ratios.append([one / many for one, many in zip(*seconds, strict=True)])
        whole, tasks, loop = (median(column) for column in zip(*ratios, strict=True))
        for name, ratio in (("tasks", tasks), ("the whole run", whole)):
            line = f"{what}: {count} threads over one, {name}, over {loop:.2f} of a loop without a lock"
            yield line, ">= 0.95" if count == 2 else "", f"{ratio:.2f}", f"{ratio / loop:.2f}"


def _of_tasks(study: Study, threads: int) -> tuple[float, float]:
    """Return wall seconds of a run and of its tasks."""
    with watched(kernels=False) as spent:
        return run(study, threads=threads), max(spent.times) - min(spent.times)


def _of_loops(pool: ThreadPoolExecutor, threads: int, parts: int) -> float:
    """Return wall seconds of so many loops of about a second together."""
    turns = [200_000_000 // parts] * parts
    return taken(lambda: list((pool.map if threads > 1 else map)(multiply_add_peak.turn, turns)))


def over_march(runs: int) -> Line:
    """Return the chord's grid less the making of its sets, over its march with all sets known; processor seconds."""
    study, pairs = chord(), []
    for _ in range(runs):
        _operators._operator.cache_clear()
        with clocked(contact_batch.SetTable, "add") as sets:
            whole = run(study, time.process_time, threads=1) - sum(sets)
        with clocked(contact_batch, "run_contacts") as march:
            run(study, threads=1)
        pairs.append((whole / sum(march), whole))
    ratio, whole = sorted(pairs)[runs // 2]
    what = "run of 200 exact cases of five contacts without making their sets, over its march, 1 thread"
    return what, "<= 1.2", f"{whole:.1f} s", f"{ratio:.2f}"


@contextmanager
def clocked(owner: Any, name: str) -> Iterator[list[float]]:
    """Collect the processor seconds of each call of a function of a module or class."""
    function, seconds = getattr(owner, name), list[float]()

    def measured(*words: Any) -> Any:
        begun = time.thread_time()
        result = function(*words)
        seconds.append(time.thread_time() - begun)
        return result

    setattr(owner, name, measured)
    try:
        yield seconds
    finally:
        setattr(owner, name, function)


def durable(cases: int, threads: int, runs: int) -> Line:
    """Return what a case costs beyond its kernel, us, twenty steps of one node each."""
    study, each = parsed(trivial(cases, METRICS)), []
    for _ in range(runs):
        with scratch() as directory:
            wall = taken(partial(run_study, study, directory / "a.nc", threads=threads))
            each.append(1e6 * (wall - kernel_seconds(directory / "a.nc") / threads) / cases)
    what = f"a durable case, of {cases}, {threads} threads"
    return what, "<= 5 us", f"{median(each):.1f} us", f"{median(each) / 5:.2f}"


def workers(cases: int, threads: int) -> Line:
    """Return a run on worker processes over one on as many threads."""
    study = exact(cases)
    on_threads, on_workers = run(study, threads=threads), run(study, workers=threads)
    what = f"{cases} exact cases on {threads} workers over {threads} threads, {on_threads:.1f} s"
    return what, "<= 1.1", f"{on_workers:.1f} s", f"{on_workers / on_threads:.2f}"


def lines(threads: list[int], cases: int, runs: int) -> Iterator[Line]:
    """Yield all lines, after what they need has been compiled."""
    most = max(threads)
    for study in (exact(4000), exact(4000, reference=True), stepped(200), parsed(trivial(100, METRICS)), chord()):
        run(study, threads=most)
    yield from python_inside(cases, most, runs)
    yield from speed_ups(exact(cases), f"{cases} exact cases", threads, runs)
    yield from speed_ups(stepped(cases), f"{cases} cases of 2 000 steps", threads, runs)
    yield from speed_ups(chord(), "200 exact cases of five contacts", threads, runs)
    yield over_march(runs)
    for count, times in ((cases // 4, runs), (5 * cases, 1)):
        yield over_kernels(f"run of {count} exact cases", exact(count), exact(400), times)
    yield durable(cases, most, runs)
    yield durable(10 * cases, most, 1)
    yield workers(5 * cases, most)


if __name__ == "__main__":
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--threads", default=f"1,{os.cpu_count()}")
    words.add_argument("--cases", type=int, default=40_000)
    words.add_argument("--runs", type=int, default=3)
    given = words.parse_args()
    table = list(lines([int(count) for count in given.threads.split(",")], given.cases, given.runs))
    print(markdown(table, " ".join(["python tests/benchmarks/bench_scaling.py", *sys.argv[1:]])), end="")
