"""Time and memory to reduce structures of many degrees of freedom, by every basis.

    python tests/benchmarks/bench_sparse.py --elements 10 260 1

A line of 1e5 displacements and 1e5 temperatures, and the finite element blade, so of 98 280 displacements and 32 760
temperatures. Each in a process of its own, BLAS on one thread; times are of the processor.
"""

from __future__ import annotations

import argparse
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
COUNTS = 24, 24


def write_line(place: Path, nodes: int) -> None:
    """Write the uniform blade of ``models/blade`` as sparse matrices."""
    from scipy.sparse import csr_array, diags_array

    def line(joint: float, ground: float = 0.0) -> csr_array:
        own = np.full(nodes, 2 * joint + ground)
        own[-1] = joint + ground / 2
        beside = np.full(nodes - 1, -joint)
        return csr_array(diags_array([own, beside, beside], offsets=[0, 1, -1]))

    def lumps(each: float) -> csr_array:
        return csr_array(diags_array(np.append(np.full(nodes - 1, each), each / 2)))

    cell, spring = 0.04 / nodes, 1e6 * nodes
    mass, half = 4430 * 0.03 * 1e-3 * cell, spring * 9e-6 * cell / 2
    tip = np.append(np.zeros(nodes - 1), -half)
    entries = {
        "mass": lumps(mass),
        "stiffness": line(spring),
        "coupling": csr_array(
            diags_array([tip, np.full(nodes - 1, half), np.full(nodes - 1, -half)], offsets=[0, 1, -1])
        ),
        "heat_capacity": lumps(560 * mass),
        "conductance": line(7.0 * 0.03 * 1e-3 / cell, 400 * 0.062 * cell),
    }
    parts = ("data", "indices", "indptr", "shape")
    arrays = {f"{name}.{part}": getattr(matrix, part) for name, matrix in entries.items() for part in parts}
    np.savez(place, contact=nodes - 1, thermal_contact=nodes - 1, **arrays)


def reduce_once(place: Path, basis: str) -> None:
    """Read, factorise and reduce one structure, and print what it took."""
    from threadpoolctl import threadpool_limits

    from workflow import models
    from workflow.declare import File
    from workflow.reduction import reduce_structure

    model, begun = models.load("matrices"), time.process_time()
    with threadpool_limits(limits=1, user_api="blas"):
        structure = model.assemble(model.Parameters(File("", place.name, str(place))))
        read = time.process_time()
        reduced = reduce_structure(structure, *COUNTS, basis, 0.1).structure
        done = time.process_time()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    sizes = f"{structure.mechanical_size:>7} + {structure.thermal_size:<7}"
    spent = f"{read - begun:6.1f} s {done - read:6.1f} s {peak:6.2f} GB"
    print(f"{sizes} {basis:<15} {spent}   f1 {models.frequencies(reduced)[0] / (2 * np.pi):.6g} Hz", flush=True)


def main() -> None:
    """Print a table, or one row of it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--nodes", type=int, default=100_000)
    parser.add_argument("--elements", type=int, nargs=3, default=(8, 40, 1))
    parser.add_argument("--one", nargs=2, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.one:
        reduce_once(Path(arguments.one[0]), arguments.one[1])
        return
    from workflow.reduction import names

    print("coordinates        basis           read, factor  reduce  peak")
    with tempfile.TemporaryDirectory() as directory:
        line, blade = Path(directory) / "line.npz", Path(directory) / "blade.npz"
        write_line(line, arguments.nodes)
        elements = ["--elements", *map(str, arguments.elements)]
        subprocess.run([sys.executable, ROOT / "studies" / "finite_element_blade.py", blade, *elements], check=True)
        for place in (line, blade):
            for basis in names():
                subprocess.run([sys.executable, __file__, "--one", str(place), basis], check=True)


if __name__ == "__main__":
    main()
