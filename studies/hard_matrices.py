"""Badly conditioned matrices of a structure whose answer is known: a chain of four lumps, written as files.

    python studies/hard_matrices.py        writes the directories studies/hard/scaled_units and studies/hard/near_rigid

`scaled_units`: each spring in halves, with a node without mass between, and every displacement in a unit of its own, as
metres stand beside microradians: stiffnesses span 12 decades, and nothing is lost.

`near_rigid`: each mass in two halves joined by links of 1e12 times the springs' stiffness, over a node without mass. An
entry that holds both, 8e18 + 4e6, is rounded to 1024: what the springs are is left to three or four digits.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse

NODES, MASS, SPRING, SPACING, EXPANSION = 4, 2.5e-3, 4.0e6, 2.5e-3, 8.6e-6
HEAT_CAPACITY, CONDUCTANCE, CONVECTION = 1.3, 0.6, 0.02
"""Of the chain, SI; its root is clamped and cold."""

LINK = 1e12 * SPRING
UNITS = np.array([1.0, 1e3, 1e-3, 1e2, 1e-2, 1e3, 1e-3, 1.0])
"""Displacements of `scaled_units` are so many metres each."""


def heat() -> dict[str, np.ndarray]:
    """Return C2 and K2 of the chain, and the temperature that takes the heat."""
    steps = np.eye(NODES) - np.eye(NODES, k=-1)
    conductance = CONDUCTANCE * steps.T @ steps + CONVECTION * np.eye(NODES)
    return {
        "heat_capacity": HEAT_CAPACITY * np.eye(NODES),
        "conductance": conductance,
        "thermal_contact": np.eye(NODES)[:, -1:],
    }


def springs(joints: list[tuple[int, int, float, int]], size: int) -> dict[str, np.ndarray]:
    """Return K1 and K12 of springs (from, to, stiffness, and the spring of the chain whose part it is, from 1; or 0).

    A coordinate -1 is the root. A part of a spring expands by its share of the spring's length.
    """
    stiffness, coupling = np.zeros((size, size)), np.zeros((size, NODES))
    for first, second, stiff, spring in joints:
        ends = [(second, 1.0)] + [(first, -1.0)] * (first >= 0)
        for i, a in ends:
            for j, b in ends:
                stiffness[i, j] += a * b * stiff
            for node in (spring - 2, spring - 1):
                if spring and node >= 0:
                    coupling[i, node] -= a * stiff * EXPANSION * SPACING * (SPRING / stiff) / 2
    return {"stiffness": stiffness, "coupling": coupling}


def scaled_units() -> dict[str, np.ndarray]:
    """Return the matrices of the chain with springs in halves, in units of every displacement's own."""
    joints = []
    for node in range(NODES):
        joints += [(2 * node - 1, 2 * node, 2 * SPRING, node + 1), (2 * node, 2 * node + 1, 2 * SPRING, node + 1)]
    found = {"mass": np.diag([0.0, MASS] * NODES), **springs(joints, 2 * NODES)}
    unit = UNITS[:, None]
    found = {name: matrix * unit * (UNITS if name != "coupling" else 1.0) for name, matrix in found.items()}
    return {**found, **heat(), "contact": unit * np.eye(2 * NODES)[:, -1:]}


def near_rigid() -> dict[str, np.ndarray]:
    """Return the matrices of the chain with masses in halves that links join."""
    joints = []
    for node in range(NODES):
        first, middle, second = 3 * node, 3 * node + 1, 3 * node + 2
        joints += [(first - 1, first, SPRING, node + 1), (first, middle, 2 * LINK, 0), (middle, second, 2 * LINK, 0)]
    mass = np.diag([MASS / 2, 0.0, MASS / 2] * NODES)
    return {"mass": mass, **springs(joints, 3 * NODES), **heat(), "contact": np.eye(3 * NODES)[:, -1:]}


FILES = {"scaled_units": scaled_units, "near_rigid": near_rigid}


def main(place: Path) -> None:
    """Write a directory of Matrix Market files for each."""
    for name, made in FILES.items():
        (place / name).mkdir(exist_ok=True)
        for entry, matrix in made().items():
            scipy.io.mmwrite(place / name / f"{entry}.mtx", scipy.sparse.coo_array(matrix), precision=17)


if __name__ == "__main__":
    main(Path(__file__).parent / "hard")
