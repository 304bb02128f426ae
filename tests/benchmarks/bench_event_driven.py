"""Time and error of ``event_driven`` on the heavy chain: ``python tests/benchmarks/bench_event_driven.py``.

Errors are relative L2 distances, the largest of displacement, temperature and impulse:

- from the same scheme with every internal threshold ten times tighter;
- from an independent solution, DOP853 in physical coordinates with events (its own tolerance is
  1e-12), as far as it can tell impacts apart: up to the first accumulation.

The time is the median of some runs of a batch, over its cases; the compilation is that of a first
call with nothing compiled, in a process of its own, in processor seconds.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1] / "schemes"))
sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from bench_limits import Line, least
from plain_events import Reference

from scenes import cases, heavy_chain, relative, sampling
from workflow.reduction import reduce_structure
from workflow.schemes import event_driven

NAMES = ("displacement", "temperature", "impulse")


def measure(e: float, count: int, runs: int, distinct: bool = False) -> tuple[float, float, float]:
    """Return milliseconds per case, error and impacts; ``distinct``: each case has an α of its own, 50 first."""
    structure, over = heavy_chain(), sampling(0.3, 1e-3)
    alpha = np.linspace(50.0, 49.0, count) if distinct else 50.0
    batch = cases(structure, count, e=e, alpha=alpha, gap=5e-5, amplitude=100.0, frequency=20.0)
    operator = event_driven.init(structure, 1.0, event_driven.Options())
    results = event_driven.compute(operator, batch, over)
    times = []
    for _ in range(runs):
        begun = time.perf_counter()
        event_driven.compute(operator, batch, over)
        times.append(1e3 * (time.perf_counter() - begun) / count)
    tight = operator.thresholds
    tight = tight._replace(**{name: value / 10 for name, value in tight._asdict().items() if name != "force"})
    exact = event_driven.compute(replace(operator, thresholds=tight), batch.take(slice(0, 1)), over)
    error = max(relative(results.histories[name][:1], exact.histories[name]) for name in NAMES)
    return median(times), error, float(results.metrics["impacts"][0])


def compared(count: int, runs: int) -> list[Line]:
    """What α of their own make of a batch's time, full and reduced: both take turns."""
    full, lines = heavy_chain(), []
    reduction, over = reduce_structure(full, 3, 12), sampling(0.3, 1e-3)
    for name, structure in (("20 + 20 modes", full), ("3 + 12 modes", reduction.structure)):
        operator, works = event_driven.init(structure, 1.0, event_driven.Options()), []
        for alpha in (50.0, np.linspace(50.0, 49.0, count)):
            batch = cases(full, count, e=0.5, alpha=alpha, gap=5e-5, amplitude=100.0, frequency=20.0)
            loaded = batch if structure is full else reduction.project(batch)
            works.append(partial(event_driven.compute, operator, loaded, over))
        one, own = least(runs, *works)
        what = f"`event_driven`, {name}, each case another alpha over one alpha"
        lines.append((what, "<= 1.3", f"{1e3 * own / count:.2f} ms", f"{own / one:.2f}"))
    return lines


def independent(e: float) -> tuple[float, float, int]:
    """Return the error against the independent solution, how far that came, s, and its impacts."""
    structure, over = heavy_chain(), sampling(0.02, 1e-5)
    case = cases(structure, e=e, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)
    results = event_driven.compute(event_driven.init(structure, 1.0, event_driven.Options()), case, over)
    other = Reference(structure, case).solve(over.times)
    reached = over.times < other.reached - 1e-9
    error = max(relative(results.histories[name][0, reached], getattr(other, name)[reached]) for name in NAMES)
    return error, other.reached, other.impacts


def compilation() -> float:
    """Return the processor seconds of a first call in a process that finds nothing compiled."""
    here = Path(__file__).parent
    call = (
        f"import sys, time; sys.path[:0] = [{str(here.parents[1])!r}, {str(here)!r}]\n"
        "import bench_event_driven as bench; begun = time.process_time(); bench.measure(0.5, 1, 1)\n"
        "print(time.process_time() - begun)"
    )
    with tempfile.TemporaryDirectory() as empty:
        environment = {**os.environ, "NUMBA_CACHE_DIR": empty}
        completed = subprocess.run(
            [sys.executable, "-c", call], capture_output=True, text=True, check=True, env=environment
        )
    return float(completed.stdout)


def main(count: int = 100, runs: int = 7) -> None:
    """Print a line for each restitution coefficient."""
    for e in (0.0, 0.5, 0.9):
        milliseconds, error, impacts = measure(e, count, runs)
        print(f"e = {e:g}: {milliseconds:.2f} ms per case, error {error:.1e}, {impacts:.0f} impacts")
        assert np.isfinite(milliseconds)
    for line in compared(count, runs):
        print(*line, sep="; ")


def beside() -> None:
    """Print errors against the independent solution, and what compilation takes."""
    for e in (0.0, 0.5, 0.9):
        error, reached, seen = independent(e)
        print(f"e = {e:g}: error {error:.1e} against DOP853 up to t = {1e3 * reached:.2f} ms, {seen} impacts")
    print(f"first call with nothing compiled: {compilation():.1f} s of processor time")


if __name__ == "__main__":
    main()
    beside()
