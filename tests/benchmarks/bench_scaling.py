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
from functools import partial
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

sys.path.insert(0, str(Path(__file__).parents[1]))

import multiply_add_peak
from bench_table import markdown
from bench_workflow import METRICS, ROOT, atlas, heavy, over_kernels, overhead, trivial
from timing import Line, scratch, taken, within

from studies import parsed
from workflow import run_study
from workflow.kernels.compiled import Deferred
from workflow.run import _threads
from workflow.schemes._exact import batch, set_tables
from workflow.solve import _operators
from workflow.study import Study, read_study

REFERENCE = {"mechanical_modes": 5}
TASK_FUNCTIONS = ("store_task", "compute_block")
"""What threads run of ``workflow.run._threads``."""


def exact(cases: int, **more: Any) -> Study:
    """Return ``studies/atlas.yaml`` with so many cases; 10 loads and 20 e."""
    gaps = max(2, cases // 4000)
    return atlas(loads=10, e=20, gaps=gaps, alphas=max(2, cases // (200 * gaps)), **more)


def stepped(cases: int) -> Study:
    """Return so many cases of 2 000 steps of a chain of 20 nodes, 3 + 12 modes."""
    modes = {"axes.mechanical_modes": 3, "axes.thermal_modes": 12}
    return heavy(cases).with_({**modes, "scene.duration": 0.02, "output.interval": 0.02})


def chord() -> Study:
    """Return the 200 exact cases of ``studies/chord.yaml``: five contacts, sets for each µ and α."""
    return read_study(ROOT / "studies" / "chord.yaml")


class Call(NamedTuple):
    """Wall times at which a call begins and ends, and its processor seconds."""

    begun: float
    ended: float
    seconds: float


@contextmanager
def clocked(owner: Any, *names: str) -> Iterator[list[Call]]:
    """Collect the calls of functions of a module or class, in all threads."""
    calls, functions = list[Call](), {name: getattr(owner, name) for name in names}

    def measured(function: Callable[..., Any], *words: Any, **named: Any) -> Any:
        begun, seconds = time.perf_counter(), time.thread_time()
        result = function(*words, **named)
        calls.append(Call(begun, time.perf_counter(), time.thread_time() - seconds))
        return result

    def watched(function: Callable[..., Any]) -> Callable[..., Any]:
        return lambda *words, **named: measured(function, *words, **named)  # a function, so that it binds as a method

    for name, function in functions.items():
        setattr(owner, name, watched(function))
    try:
        yield calls
    finally:
        for name, function in functions.items():
            setattr(owner, name, function)


def total(calls: list[Call]) -> float:
    return sum(call.seconds for call in calls)


def run(study: Study, clock: Callable[[], float] = time.perf_counter, **where: int) -> float:
    """Return seconds of a run, of wall time by default."""
    with scratch() as directory:
        return taken(partial(run_study, study, directory / "a.nc", **where), clock)


def python_inside(cases: int, threads: int, runs: int) -> Iterator[Line]:
    """Yield Python inside tasks, us for each case."""
    for what, study, asked in (
        (f"{cases} exact cases", exact(cases), 3),
        (f"{cases} cases of 2 000 steps", stepped(cases), 2),
        (f"{cases} exact cases with a reference", exact(cases, reference=REFERENCE), 6),
    ):
        each = []
        for _ in range(runs):
            with clocked(_threads, *TASK_FUNCTIONS) as tasks, clocked(Deferred, "__call__") as kernels:
                run(study, threads=threads)
            each.append(1e6 * (total(tasks) - total(kernels)) / cases)
        yield within(f"Python inside tasks, {what}, {threads} threads", asked, median(each), "us")


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
    with clocked(_threads, *TASK_FUNCTIONS) as calls:
        return run(study, threads=threads), max(call.ended for call in calls) - min(call.begun for call in calls)


def _of_loops(pool: ThreadPoolExecutor, threads: int, parts: int) -> float:
    """Return wall seconds of so many loops of about a second together."""
    turns = [200_000_000 // parts] * parts
    return taken(lambda: list((pool.map if threads > 1 else map)(multiply_add_peak.turn, turns)))


def over_march(runs: int) -> Line:
    """Return the chord's grid less the making of its sets, over its march with all sets known; processor seconds."""
    study, pairs = chord(), []
    for _ in range(runs):
        _operators._operator.cache_clear()
        with clocked(set_tables.SetTable, "add") as sets:
            whole = run(study, time.process_time, threads=1) - total(sets)
        with clocked(batch, "run_cases") as march:
            run(study, threads=1)
        pairs.append((whole / total(march), whole))
    ratio, whole = sorted(pairs)[runs // 2]
    what = "run of 200 exact cases of five contacts without making their sets, over its march, 1 thread"
    return what, "<= 1.2", f"{whole:.1f} s", f"{ratio:.2f}"


def durable(cases: int, threads: int, runs: int) -> Line:
    """Return what a case costs beyond its kernel, us, twenty steps of one node each."""
    each = median(1e6 * overhead(cases, threads=threads) for _ in range(runs))
    return within(f"a durable case, of {cases}, {threads} threads", 5, each, "us")


def workers(cases: int, threads: int) -> Line:
    """Return a run on worker processes over one on as many threads."""
    study = exact(cases)
    on_threads, on_workers = run(study, threads=threads), run(study, workers=threads)
    what = f"{cases} exact cases on {threads} workers over {threads} threads, {on_threads:.1f} s"
    return what, "<= 1.1", f"{on_workers:.1f} s", f"{on_workers / on_threads:.2f}"


def lines(threads: list[int], cases: int, runs: int) -> Iterator[Line]:
    """Yield all lines, after what they need has been compiled."""
    most = max(threads)
    for study in (exact(4000), exact(4000, reference=REFERENCE), stepped(200), parsed(trivial(100, METRICS)), chord()):
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
