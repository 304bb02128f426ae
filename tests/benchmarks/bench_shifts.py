"""What shifts of ``krylov`` are worth where each vector is made from the one before.

    python tests/benchmarks/bench_shifts.py

Relative error of the tip's temperature of the reduced structure over the number of different shifts, against the full
one, or 20 + 40 vectors of a longer chain, under the same scheme and step: the blade of ``studies/scaling.yaml``, and
the finite element blade of ``studies/compressor_blade.yaml``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from scenes import relative
from workflow.grid import arrange
from workflow.grid._conditions import conditions
from workflow.grid._operators import structure_of
from workflow.models import Cases, Chain, Sparse, Structure
from workflow.reduction import krylov, reduce_structure
from workflow.schemes import Sampling, moreau
from workflow.study import read_study

STUDIES = Path(__file__).parents[2] / "studies"
SHIFTS = (2, 3, 4, 6, 8, 12, 24)
H = 1e-5
MANY = (20, 40)
"""Vectors that are within 2e-12 of a full chain of 2000 nodes."""


def scene(name: str, settings: dict[str, float]) -> tuple[Structure, Cases, Sampling]:
    """Return the structure of a study and the case with these settings."""
    each = {path: [value] for path, value in settings.items()}
    grid = arrange(read_study(STUDIES / name).with_({"axes": {"h": H}, "zip": {"only": each}}))
    cell = grid.settings(0)
    structure = structure_of(cell.scene.model, cell.scene.parameters)
    return structure, conditions(cell, structure, grid.inner_values(np.array([0])), 1), grid.sampling


def temperature(structure: Structure, case: Cases, sampling: Sampling) -> np.ndarray:
    """Return the tip's temperature by ``moreau``, ``(1, sample)``."""
    return moreau.compute(moreau.init(structure, H, moreau.Options()), case, sampling).histories["temperature"]


def errors(name: str, settings: dict[str, float], counts: tuple[int, int], shifts: tuple[int, ...]) -> Iterator[str]:
    """Yield the error with each number of shifts, of bases of so many vectors."""
    modes = dict(zip(("mechanical_modes", "thermal_modes"), counts, strict=True))
    structure, case, sampling = scene(name, settings | modes)
    if isinstance(structure, Chain) and not structure.has_matrices:
        many = reduce_structure(structure, *MANY, "krylov", sampling.duration)
        exact = temperature(many.structure, many.project(case), sampling)
    else:
        full = structure.matrices() if isinstance(structure, Sparse) else structure
        exact = temperature(full, case, sampling)
    for count in shifts:
        if counts[1] < count:
            return
        krylov.MOST_SHIFTS = count
        reduction = reduce_structure(structure, *counts, "krylov", sampling.duration)
        yield f"{relative(temperature(reduction.structure, reduction.project(case), sampling), exact):9.1e}"


def main(
    nodes: tuple[int, ...] = (10_000, 100_000), vectors: tuple[int, ...] = (6, 8), counts: tuple[int, ...] = SHIFTS
) -> None:
    """Print a row for each structure and number of thermal vectors."""
    most_shifts = krylov.MOST_SHIFTS
    print(f"{'shifts':<42}" + "".join(f"{count:9}" for count in counts))
    for count in nodes:
        columns = errors("scaling.yaml", {"scene.blade.nodes": count, "alpha": 30}, (4, 12), counts)
        print(f"{f'{count} nodes, 4 + 12 vectors':<42}" + "".join(columns), flush=True)
    rub = {"alpha": 2, "scene.casing.gap": 2e-5, "scene.load.amplitude": 20}
    for thermal in vectors:
        columns = errors("compressor_blade.yaml", rub, (18, thermal), counts)
        print(f"{f'finite element blade, 18 + {thermal} vectors':<42}" + "".join(columns), flush=True)
    krylov.MOST_SHIFTS = most_shifts


if __name__ == "__main__":
    main()
