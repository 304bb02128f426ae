"""Nanoseconds per case and step of ``moreau`` on the heavy chain: ``python tests/benchmarks/bench_moreau.py``.

Heated, θ = 1, without and with balances; full (20 + 20 modes) and reduced (3 + 12), in batches of several
sizes. Medians of some runs, set-up of the batch included.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from statistics import median

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from scenes import cases, heavy_chain, sampling
from workflow.reduction import reduce_structure
from workflow.schemes import moreau


def main(counts: tuple[int, ...] = (1, 4, 8, 32, 1000), steps: int = 30_000, runs: int = 5) -> None:
    """Print a line for each batch size."""
    full = heavy_chain()
    reduction = reduce_structure(full, 3, 12)
    h = 1e-5
    for count in counts:
        batch = cases(full, count, alpha=np.linspace(1, 50, count), gap=5e-5, amplitude=100.0, frequency=20.0)
        columns = []
        reduced = reduction.project(batch)
        for name, structure, loaded, balances in (
            ("full", full, batch, False),
            ("3 + 12", reduction.structure, reduced, False),
            ("full with balances", full, batch, True),
            ("3 + 12 with balances", reduction.structure, reduced, True),
        ):
            over = replace(sampling(steps * h, steps * h / 10), balances=balances)
            operator = moreau.init(structure, h, moreau.Options())
            moreau.compute(operator, loaded, replace(sampling(10 * h, 5 * h), balances=balances))
            taken = []
            for _ in range(runs):
                begun = time.perf_counter()
                moreau.compute(operator, loaded, over)
                taken.append(time.perf_counter() - begun)
            columns.append(f"{name} {1e9 * median(taken) / count / steps:.1f}")
        print(f"{count} cases, ns per case and step: " + ", ".join(columns))


if __name__ == "__main__":
    main()
