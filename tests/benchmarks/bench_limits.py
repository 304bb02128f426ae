"""``moreau`` against the processor and against what people use: ``python tests/benchmarks/bench_limits.py``.

Prints what was asked for, what was measured and their ratio. Everything is the heavy chain (20 nodes,
heated, θ = 1) unless a line says otherwise. Times are the processor's own (two threads: the clock's),
the least of some runs counts, and lines that are compared take turns, so that ratios survive a machine
that others use too.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import multiply_add_peak
import numpy as np
from scipy.integrate import solve_ivp
from threadpoolctl import threadpool_limits

from scenes import cases, heavy_chain, same_bits, sampling
from workflow.models import Cases, Chain, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Results, moreau

DEBIAN = "/usr/bin/python3"
RUB = {"gap": 5e-5, "amplitude": 100.0, "frequency": 20.0}


@dataclass(frozen=True)
class Size:
    """How much is run: cases of a batch, steps of a case, runs of which the least time counts."""

    cases: int = 512
    steps: int = 30_000
    runs: int = 5
    nodes: tuple[int, ...] = (1_000,)
    node_steps: int = 20_000_000
    rival_steps: int = 3_000


TINY = Size(cases=9, steps=40, runs=1, nodes=(200,), node_steps=6_000, rival_steps=20)


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
            begun = clock()
            work()
            seconds[k] = min(seconds[k], clock() - begun)
    return seconds


def multiply_adds(structure: Structure) -> int:
    """Return those of a heated step: 6 for a mechanical mode and 4 for a thermal one.

    A mechanical mode takes in an impulse and, in both states, heat, and turns; a thermal mode takes in
    heat, decays and shows in velocity and temperature of the tip; the last is a mere addition here, as
    modes are scaled, which is not counted as less. The tip's own work is left out.
    """
    return 6 * structure.mechanical_size + 4 * structure.thermal_size


def run(structure: Structure, batch: Cases, h: float, steps: int, samples: int = 10, **options: bool) -> Results:
    """Step a batch with ``moreau``; what a study does once for many batches is done once."""
    over = replace(sampling(steps * h, steps * h / samples), **options)
    return moreau.compute(_operator(structure, h), batch, over)


@cache
def _operator(structure: Structure, h: float) -> moreau.Operator:
    return moreau.init(structure, h, moreau.Options())


def rub(structure: Chain, count: int, alpha: float = 50.0) -> Cases:
    """Return cases that differ in α."""
    return cases(structure, count, alpha=np.linspace(alpha / count, alpha, count), **RUB)


Line = tuple[str, str, str, str]


def batched(size: Size) -> tuple[list[Line], float]:
    """Batches on one core: against the processor's peak, reduced, cold, alone, with balances."""
    full, h = heavy_chain(), 1e-5
    reduction = reduce_structure(full, 3, 12)
    batch = rub(full, size.cases)
    reduced, alone, cold = reduction.project(batch), batch.take(slice(0, 1)), rub(full, size.cases, 0.0)
    mechanical = heavy_chain(expansion=0.0, conductance=0.0, convection=0.0)
    turns = max(1, 10 * size.steps)
    seconds = least(
        size.runs,
        lambda: multiply_add_peak.turn(turns),
        lambda: run(full, batch, h, size.steps),
        lambda: run(reduction.structure, reduced, h, size.steps),
        lambda: run(full, cold, h, size.steps),
        lambda: run(mechanical, cold, h, size.steps),
        lambda: run(full, alone, h, 30 * size.steps),
        lambda: run(full, batch, h, size.steps, balances=True),
        lambda: run(reduction.structure, reduced, h, size.steps, balances=True),
    )
    per_step = 1e9 / (size.cases * size.steps)
    each = seconds[0] * 1e9 / (turns * multiply_add_peak.multiply_adds_of_a_turn())
    whole, few, unheated, bare, single, audited, few_audited = (s * per_step for s in seconds[1:])
    single *= size.cases / 30
    least_full, least_few = each * multiply_adds(full), each * multiply_adds(reduction.structure)
    return [
        ("multiply-add at the processor's peak, full registers", "", f"{each:.4f} ns", ""),
        ("full, 20 + 20 modes, over its multiply-adds at peak", "", f"{whole:.2f} ns", f"{whole / least_full:.2f}"),
        ("reduced, 3 + 12 modes, over its multiply-adds at peak", "", f"{few:.2f} ns", f"{few / least_few:.2f}"),
        ("reduced over full", "<= 0.45", f"{few:.2f} ns", f"{few / whole:.2f}"),
        ("one case alone, full", "<= 350 ns", f"{single:.0f} ns", f"{single / 350:.2f}"),
        ("no heat over a mechanical model", "1", f"{unheated:.2f} ns", f"{unheated / bare:.2f}"),
        ("full, with balances over without", "<= 1.5", f"{audited:.2f} ns", f"{audited / whole:.2f}"),
        ("reduced, with balances over without", "<= 1.5", f"{few_audited:.2f} ns", f"{few_audited / few:.2f}"),
    ], whole


def stored(size: Size) -> list[Line]:
    """Histories every 10th and 100th step over two samples."""
    full, h = heavy_chain(), 1e-5
    batch = rub(full, min(size.cases, 128))
    few, tenth, hundredth = least(
        size.runs,
        lambda: run(full, batch, h, size.steps, samples=1),
        lambda: run(full, batch, h, size.steps, samples=size.steps // 10),
        lambda: run(full, batch, h, size.steps, samples=max(1, size.steps // 100)),
    )
    return [
        ("histories every 10th step over none", "<= 1.25", f"{tenth:.3f} s", f"{tenth / few:.2f}"),
        ("histories every 100th step over none", "<= 1.25", f"{hundredth:.3f} s", f"{hundredth / few:.2f}"),
    ]


def threads(size: Size) -> list[Line]:
    """Two threads over one."""
    full, h = heavy_chain(), 1e-5
    batch = rub(full, size.cases)
    halves = [batch.take(slice(0, size.cases // 2)), batch.take(slice(size.cases // 2, size.cases))]

    def work(half: Cases) -> Results:
        return run(full, half, h, size.steps)

    with ThreadPoolExecutor(2) as pool:
        both = list(pool.map(work, halves))
        same = all(same_bits(a, b) for a, b in zip(both, map(work, halves), strict=True))
        turns = [max(1, 5 * size.steps)] * 2
        one, two, alone, beside = least(
            size.runs,
            lambda: list(map(work, halves)),
            lambda: list(pool.map(work, halves)),
            lambda: list(map(multiply_add_peak.turn, turns)),
            lambda: list(pool.map(multiply_add_peak.turn, turns)),
            clock=time.perf_counter,
        )
    busy = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    return [
        (f"two threads over one, {busy}", ">= 1.8", "same bits" if same else "OTHER BITS", f"{one / two:.2f}"),
        ("two threads over one, multiply-adds in registers alone", "", "", f"{alone / beside:.2f}"),
    ]


def long_chains(size: Size) -> list[Line]:
    """Nanoseconds per case, node and step: the difference of a long and a short run, set-up left out."""
    lines = []
    for nodes in size.nodes:
        chain = heavy_chain(nodes=nodes)
        steps = max(2, size.node_steps // nodes)
        for count, target in ((1, 25.0), (8, 10.0)):
            batch = rub(chain, count)
            short, long = least(
                size.runs,
                lambda batch=batch, chain=chain, steps=steps: run(chain, batch, 1e-6, steps // 2),
                lambda batch=batch, chain=chain, steps=steps: run(chain, batch, 1e-6, steps),
            )
            taken = 1e9 * (long - short) / (count * nodes * (steps - steps // 2))
            what = f"{nodes} nodes, {count} case{'s' * (count > 1)}, per case, node and step"
            lines.append((what, f"<= {target:g} ns", f"{taken:.1f} ns", f"{taken / target:.2f}"))
    return lines


def _siconos(steps: int) -> float | None:
    """Return processor seconds per step of Siconos, ``None`` where it is not installed or fails."""
    script = Path(__file__).with_name("siconos_chain.py")
    if not Path(DEBIAN).exists():
        return None
    environment = {"PATH": "/usr/bin:/bin", "OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    try:
        words = subprocess.run(
            [DEBIAN, str(script), str(steps), "1e-5"], capture_output=True, text=True, check=True, env=environment
        ).stdout.split()
        return float(words[0]) if words else None
    except (OSError, subprocess.SubprocessError, ValueError):  # installed, and fails when it is used
        return None


def _numpy(steps: int) -> float:
    """Return seconds per step of the θ-method as one matrix per step, on x, v and temperatures."""
    chain, h = heavy_chain(), 1e-5
    n = chain.mechanical_size
    stiffness, damping = chain.stiffness_matrix, chain.damping_matrix
    implicit = np.linalg.inv(chain.mass + h * damping + h**2 * stiffness)
    cooling = np.linalg.solve(chain.heat_capacity + h * chain.conductance_matrix, chain.heat_capacity)
    A = np.zeros((3 * n, 3 * n))
    A[2 * n :, 2 * n :] = cooling
    A[n : 2 * n] = implicit @ np.hstack([-h * stiffness, chain.mass, -h * chain.coupling_matrix @ cooling])
    A[:n] = h * A[n : 2 * n]
    A[:n, :n] += np.eye(n)
    push = np.concatenate([h * implicit[:, -1], implicit[:, -1], np.zeros(n)])
    kick = push.copy()
    kick[-1] -= 50.0 / chain.heat_capacity[-1, -1]
    tip, speed, e, gap = n - 1, 2 * n - 1, 0.5, 5e-5
    z, step = np.zeros(3 * n), 0
    begun = time.process_time()
    while step < steps:
        step += 1
        before, place = z[speed], z[tip]
        z = A @ z + h * 100.0 * np.sin(2 * np.pi * 20.0 * step * h) * push
        if place + h / 2 * before >= gap:
            z = z - max(0.0, (z[speed] + e * before) / kick[speed]) * kick
    return (time.process_time() - begun) / steps


def _solve_ivp(most: int) -> tuple[float, float]:
    """Return seconds per simulated second of SciPy's integrator with events, and the seconds simulated.

    e = 0.9; it ends after ``most`` impacts, as their number grows without bound before the tip rests.
    """
    chain = heavy_chain()
    n = chain.mechanical_size
    inverse = 1 / np.diag(chain.mass)
    stiffness, damping = chain.stiffness_matrix, chain.damping_matrix
    coupling, cooling = chain.coupling_matrix, chain.conductance_matrix / np.diag(chain.heat_capacity)[:, None]

    def rate(t: float, z: np.ndarray) -> np.ndarray:
        x, v, warmth = z[:n], z[n : 2 * n], z[2 * n :]
        force = -stiffness @ x - damping @ v - coupling @ warmth
        force[-1] += 100.0 * np.sin(2 * np.pi * 20.0 * t)
        return np.concatenate([v, inverse * force, -cooling @ warmth])

    def closes(t: float, z: np.ndarray) -> float:
        return float(5e-5 - z[n - 1])

    closes.terminal, closes.direction = True, -1.0  # type: ignore[attr-defined]
    t, z, impacts = 0.0, np.zeros(3 * n), 0
    begun = time.process_time()
    while t < 5e-3 and impacts < most:
        solution = solve_ivp(rate, (t, 5e-3), z, method="DOP853", rtol=1e-8, atol=1e-12, events=closes)
        t, z = float(solution.t[-1]), solution.y[:, -1].copy()
        if solution.status == 1:
            impacts += 1
            impulse = 1.9 * z[2 * n - 1] * chain.mass[-1, -1]
            z[2 * n - 1] *= -0.9
            z[n - 1] = 5e-5
            z[-1] += 50.0 * impulse / chain.heat_capacity[-1, -1]
    return (time.process_time() - begun) / t, t


def rivals(size: Size, whole: float) -> list[Line]:
    """What people would use instead, for one step or for a simulated second."""
    lines = []
    siconos, plain = _siconos(size.rival_steps), _numpy(10 * size.rival_steps)
    if siconos is None:
        lines.append(("Siconos, the same step without heat", ">= 1000", "skipped: not installed or fails", ""))
    else:
        ratio = f"{1e9 * siconos / whole:.0f}"
        lines.append(("Siconos, the same step without heat", ">= 1000", f"{1e6 * siconos:.1f} us", ratio))
    lines.append(("NumPy, a matrix per step", ">= 300", f"{1e6 * plain:.1f} us", f"{1e9 * plain / whole:.0f}"))
    integrated, simulated = _solve_ivp(20 if size.rival_steps > 1000 else 1)
    what = f"SciPy DOP853 with events, {simulated:.2g} s, per simulated second"
    ours = whole * 1e-9 / 1e-5
    lines.append((what, "", f"{integrated:.2f} s", f"{integrated / ours:.0f}"))
    return lines


def lines(size: Size) -> list[Line]:
    """Return all lines."""
    first, whole = batched(size)
    return first + rivals(size, whole) + stored(size) + threads(size) + long_chains(size)


def main(size: Size | None = None) -> None:
    """Print the table; threads of BLAS, which go on for a while when they are done, are left out."""
    with threadpool_limits(limits=1, user_api="blas"):
        table = lines(size or Size())
    width = max(len(line[0]) for line in table)
    print(f"{'what':{width}}  {'asked for':>24}  {'measured':>13}  {'ratio':>7}")
    for what, target, measured, ratio in table:
        print(f"{what:{width}}  {target:>24}  {measured:>13}  {ratio:>7}")


if __name__ == "__main__":
    main()
