"""Nanoseconds per case and step of every stepping scheme: ``python tests/benchmarks/bench_rivals.py``.

On the heavy chain, heated, full (20 + 20 modes) and reduced (3 + 12), without and with balances. The
schemes take turns and the least processor time of some runs counts, so that ratios to ``moreau`` survive
a noisy machine.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np

from scenes import cases, heavy_chain, sampling
from workflow import schemes
from workflow.reduction import reduce_structure

RIVALS: dict[str, tuple[str, dict[str, Any]]] = {
    "moreau": ("moreau", {}),
    "carpenter": ("carpenter", {}),
    "penalty": ("penalty", {}),
    "penalty implicit": ("penalty", {"integration": "implicit"}),
}


def main(counts: tuple[int, ...] = (8, 256), steps: int = 20_000, runs: int = 5) -> None:
    """Print a line for each structure and batch size."""
    full = heavy_chain()
    reduction = reduce_structure(full, 3, 12)
    h = 5e-6
    for count in counts:
        batch = cases(full, count, alpha=np.linspace(1, 50, count), gap=5e-5, amplitude=100.0, frequency=20.0)
        for balances in (False, True):
            over = replace(sampling(steps * h, steps * h / 10), balances=balances)
            for name, structure, loaded in (
                ("full", full, batch),
                ("3 + 12", reduction.structure, reduction.project(batch)),
            ):
                least = dict.fromkeys(RIVALS, float("inf"))
                for _ in range(runs):
                    for label, (method, options) in RIVALS.items():
                        scheme = schemes.load(method)
                        operator = scheme.init(structure, h, scheme.Options(**options))
                        begun = time.process_time()
                        scheme.compute(operator, loaded, over)
                        least[label] = min(least[label], time.process_time() - begun)
                columns = [
                    f"{label} {1e9 * seconds / count / steps:.1f} (x {seconds / least['moreau']:.2f})"
                    for label, seconds in least.items()
                ]
                suffix = " with balances" if balances else ""
                print(f"{count} cases, {name}{suffix}, ns per case and step: " + ", ".join(columns))


if __name__ == "__main__":
    main()
