"""How benchmarks take times, how much they run, and the lines they make."""

import re
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Line = tuple[str, str, str, str]
"""What is measured, what is asked for, what was measured, the ratio."""


@dataclass(frozen=True)
class Size:
    """How much is run; of some runs the least or the median time counts."""

    cases: int = 512
    steps: int = 30_000
    runs: int = 5
    rival_steps: int = 3_000
    exact_cases: int = 100
    nodes: tuple[int, ...] = (5, 10, 20, 40, 80, 160, 320)
    modes: tuple[int, ...] = (2, 5, 10, 20, 40, 80)
    long_nodes: int = 1_000
    node_steps: int = 4_000_000
    run_cases: int = 10_000
    grids: tuple[int, int] = (10_000, 100_000)


QUICK = Size(
    steps=3_000, runs=3, rival_steps=300, exact_cases=30, node_steps=1_000_000, run_cases=1_000, grids=(1_000, 10_000)
)  # fmt: skip
TINY = Size(
    cases=9, steps=40, runs=1, rival_steps=20, exact_cases=1, nodes=(5, 10), modes=(2, 5), long_nodes=200,
    node_steps=6_000, run_cases=4, grids=(8, 20),
)  # fmt: skip


def least(runs: int, *works: Callable[[], object], clock: Callable[[], float] = time.process_time) -> list[float]:
    """Return the least processor seconds of each work; they take turns, after each was done once.

    Arrays of a few KiB lie elsewhere in each turn: where they lie decides about some percent.
    """
    for work in works:
        work()
    seconds, between, rng = [float("inf")] * len(works), [], np.random.default_rng(0)
    for _ in range(runs):
        for k, work in enumerate(works):
            between.append(np.empty(rng.integers(64, 4096)))
            seconds[k] = min(seconds[k], taken(work, clock))
    return seconds


def taken(work: Callable[[], object], clock: Callable[[], float] = time.perf_counter) -> float:
    begun = clock()
    work()
    return clock() - begun


def within(what: str, most: float, value: float, unit: str, digits: int = 1) -> Line:
    """Return the line of a value that should be so small at most."""
    return what, f"<= {most:g} {unit}", f"{value:.{digits}f} {unit}", f"{value / most:.2f}"


def keep(document: Path, name: str, table: str) -> None:
    """Write a table between its marks in a document."""
    before, _, after = parts(document, name)
    document.write_text(f"{before}<!-- {name} -->\n{table}<!-- end of {name} -->\n{after}", encoding="utf-8")


def parts(document: Path, name: str) -> list[str]:
    """Return what stands before, within and after the marks of a table."""
    return re.split(rf"<!-- (?:end of )?{name} -->\n", document.read_text(encoding="utf-8"))


def slope(numbers: tuple[int, ...], seconds: list[float]) -> float:
    """Return the slope of log seconds over log number: 1 is a straight line through 0."""
    return float(np.polyfit(np.log(numbers), np.log(seconds), 1)[0])


@contextmanager
def scratch() -> Iterator[Path]:
    """Give a directory for an archive."""
    with tempfile.TemporaryDirectory() as name:
        yield Path(name)
