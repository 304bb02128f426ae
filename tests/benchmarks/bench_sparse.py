"""Time and memory to reduce structures of many degrees of freedom, by every basis or by those named.

    python tests/benchmarks/bench_sparse.py --elements 10 260 1
    python tests/benchmarks/bench_sparse.py --only block --bases krylov

The finite element blade, so of 98 280 displacements and 32 760 temperatures, and a bulky block of the same material of
104 544 displacements and 34 848 temperatures. Each in a process of its own, BLAS on one thread; times are of the
processor. Where the extra ``sparse`` is installed CHOLMOD factorises, else SuperLU does.
"""

from __future__ import annotations

import argparse
import resource
import sys
import tempfile
import time
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from workflow.models import _factors

STUDIES = Path(__file__).parents[2] / "studies"
sys.path.insert(0, str(STUDIES))

COUNTS = 24, 24


def write_block(place: Path, nodes: int) -> None:
    """Write an elastic cube, 50 mm, one face clamped and cold, touched at a corner of the other; not compressed."""
    import finite_element_blade as material
    from skfem import Basis, ElementHex1, ElementVector, FacetBasis, MeshHex

    body = MeshHex.init_tensor(*3 * [np.linspace(0, 0.05, nodes)])
    moving, warm = Basis(body, ElementVector(ElementHex1())), Basis(body, ElementHex1())
    free, rises = (np.flatnonzero(basis.doflocs[2] > 1e-9) for basis in (moving, warm))
    entries = material.mechanical_matrices(moving, warm) | material.thermal_matrices(warm, FacetBasis(body, warm.elem))
    rows = {"heat_capacity": rises, "conductance": rises}
    columns = {**rows, "coupling": rises}
    kept = {name: matrix[rows.get(name, free)][:, columns.get(name, free)] for name, matrix in entries.items()}
    material.write_npz(kept | {"contact": free.size - 1, "thermal_contact": rises.size - 1}, place, np.savez)


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
        sizes = structure.mechanical_size, structure.thermal_size
        counts = (min(count, size - 1) for count, size in zip(COUNTS, sizes, strict=True))
        reduced = reduce_structure(structure, *counts, basis, 0.1).structure
        done = time.process_time()
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    spent = f"{read - begun:6.1f} s {done - read:6.1f} s {peak:6.2f} GB"
    print(
        f"{sizes[0]:>7} + {sizes[1]:<7} {basis:<15} {spent}   f1 {models.frequencies(reduced)[0] / (2 * np.pi):.6g} Hz",
        flush=True,
    )


def write_blade(place: Path, elements: tuple[int, int, int]) -> None:
    import finite_element_blade

    finite_element_blade.write_npz(finite_element_blade.matrices(elements), place)


WRITE = {"blade": write_blade, "block": write_block}


def parsed() -> argparse.Namespace:
    from workflow.reduction import names

    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--only", nargs="+", choices=WRITE, default=WRITE)
    parser.add_argument("--bases", nargs="+", choices=names(), default=names())
    parser.add_argument("--elements", dest="blade", type=int, nargs=3, default=(8, 40, 1))
    parser.add_argument("--block", type=int, default=33, metavar="NODES", help="along an edge")
    return parser.parse_args()


def _alone(work: Callable[..., None], *words: object) -> None:
    """Run a function in a process of its own, which begins without the memory of this one."""
    process = get_context("spawn").Process(target=work, args=words)
    process.start()
    process.join()
    if process.exitcode:
        raise SystemExit(process.exitcode)


def main() -> None:
    """Print a table, or one row of it."""
    arguments = parsed()
    by_cholmod = _factors.has_cholmod()
    print(f"by {'CHOLMOD' if by_cholmod else 'SuperLU'} above {_factors.MOST_BY_SUPERLU} coordinates")
    print("coordinates        basis           read, factor  reduce  peak")
    with tempfile.TemporaryDirectory() as directory:
        for name in arguments.only:
            place = Path(directory) / f"{name}.npz"
            _alone(WRITE[name], place, getattr(arguments, name))
            for basis in arguments.bases:
                _alone(reduce_once, place, basis)


if __name__ == "__main__":
    main()
