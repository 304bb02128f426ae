"""What each basis is worth: ``python tests/benchmarks/bench_bases.py``; ``--write`` keeps the table in BASES.md.

The heavy chain in 20 and in 200 nodes of the same totals rubs for 0.1 s, stepped by ``moreau``. Errors are those of the
tip against the full model under the same scheme, so that no error of the scheme is in them.
"""

import sys
import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
from timing import keep, taken

sys.path.insert(0, str(Path(__file__).parents[1]))

from scenes import cases, finer_chain, relative, sampling
from workflow import reduction, schemes
from workflow.models import Cases, Structure, critical_alpha, frequencies
from workflow.reduction import reduce_structure
from workflow.schemes import HISTORIES, Results

H, ALPHA, DURATION = 1e-5, 0.5, 0.1
COUNTS = ((3, 12), (8, 6))
"""Mechanical and thermal vectors beside the tip's own."""


def rub(structure: Structure) -> Cases:
    """Return the heavy chain's scene."""
    return cases(structure, 1, alpha=ALPHA, gap=5e-5, amplitude=100.0, frequency=20.0)


def stepped(structure: Structure, batch: Cases, steps: int, balances: bool) -> tuple[Results, float]:
    """Return results and the least seconds of five runs."""
    scheme = schemes.load("moreau")
    operator = scheme.init(structure, H, scheme.Options())
    work = partial(scheme.compute, operator, batch, sampling(steps * H, steps * H / 100, balances))
    return work(), min(taken(work, time.thread_time) for _ in range(5))


def spectral_radius(structure: Structure, theta: float) -> float:
    """Return the largest factor of the mechanical free step."""
    scheme, omega = schemes.load("moreau"), frequencies(structure)
    damping = structure.damping.mass + structure.damping.stiffness * np.where(np.isinf(omega), 0.0, omega) ** 2
    assert scheme.amplification is not None
    return float(np.abs(scheme.amplification(omega, damping, H, scheme.Options(theta=theta))).max())


def rows(sizes: tuple[int, ...], steps: int, balances: bool) -> Iterator[str]:
    """Yield the table, a line for each chain, basis and count."""
    yield "| nodes | basis | vectors | displacement | temperature | impulse | α_c | ρ, θ = 1 | ρ, θ = ½ | cost |\n"
    yield "|---|---|---|---|---|---|---|---|---|---|\n"
    for nodes in sizes:
        whole = finer_chain(nodes)
        exact, full_seconds = stepped(whole, rub(whole), steps, balances)
        for mechanical, thermal in COUNTS:
            for name in reduction.names():
                small = reduce_structure(whole, mechanical, thermal, name, DURATION)
                run, seconds = stepped(small.structure, small.project(rub(whole)), steps, balances)
                errors = {of: relative(run.histories[of], exact.histories[of]) for of in HISTORIES}
                off = abs(critical_alpha(small.structure) / critical_alpha(whole) - 1)
                radii = [spectral_radius(small.structure, theta) for theta in (1.0, 0.5)]
                cells = [f"{errors[of]:.1e}" for of in ("displacement", "temperature", "impulse")]
                cells += [f"{off:.0e}", *(f"{radius:.5f}" for radius in radii), f"{seconds / full_seconds:.2f}"]
                yield f"| {nodes} | `{name}` | {mechanical} + {thermal} | {' | '.join(cells)} |\n"


def text(sizes: tuple[int, ...] = (20, 200), steps: int = round(DURATION / H), balances: bool = False) -> str:
    """Return the table and what it is of."""
    return "".join(rows(sizes, steps, balances)) + "\n"


if __name__ == "__main__":
    table = text()
    print(table)
    if "--write" in sys.argv:
        keep(Path(__file__).with_name("BASES.md"), "bases", table)
