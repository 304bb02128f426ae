"""Time and error of ``event_driven`` on the heavy chain: ``python tests/benchmarks/bench_event_driven.py``.

The error is the relative L2 distance (largest of displacement, temperature, impulse) from the same
scheme with every internal threshold ten times tighter; the time is the median of some runs of a
batch, over its cases.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from scenes import cases, heavy_chain, relative, sampling
from workflow.schemes import event_driven

NAMES = ("displacement", "temperature", "impulse")


def measure(e: float, count: int, runs: int) -> tuple[float, float, float]:
    """Return milliseconds per case, error and impacts."""
    structure, over = heavy_chain(), sampling(0.3, 1e-3)
    batch = cases(structure, count, e=e, alpha=50.0, gap=5e-5, amplitude=100.0, frequency=20.0)
    operator = event_driven.init(structure, 1.0, event_driven.Options())
    found = event_driven.compute(operator, batch, over)
    taken = []
    for _ in range(runs):
        begun = time.perf_counter()
        event_driven.compute(operator, batch, over)
        taken.append(1e3 * (time.perf_counter() - begun) / count)
    tight = operator.thresholds
    tight = tight._replace(**{name: value / 10 for name, value in tight._asdict().items() if name != "force"})
    exact = event_driven.compute(replace(operator, thresholds=tight), batch.take(slice(0, 1)), over)
    error = max(relative(found.histories[name][:1], exact.histories[name]) for name in NAMES)
    return median(taken), error, float(found.metrics["impacts"][0])


def main(count: int = 100, runs: int = 7) -> None:
    """Print a line for each restitution coefficient."""
    for e in (0.0, 0.5, 0.9):
        milliseconds, error, impacts = measure(e, count, runs)
        print(f"e = {e:g}: {milliseconds:.2f} ms per case, error {error:.1e}, {impacts:.0f} impacts")
        assert np.isfinite(milliseconds)


if __name__ == "__main__":
    main()
