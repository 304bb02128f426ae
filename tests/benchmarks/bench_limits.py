"""Kernels against the processor: lines of ``bench_table``; and what people use instead.

Everything is the heavy chain (20 nodes, heated, θ = 1) unless a line says otherwise. Times are the processor's own, and
lines that are compared take turns, so that ratios survive a machine that others use too.
"""

import time
from dataclasses import replace
from functools import cache, partial
from typing import Any

import multiply_add_peak
import numpy as np
from scipy.integrate import solve_ivp
from timing import Line, Size, least, slope, within

from scenes import cases, heavy_chain, sampling
from workflow import schemes
from workflow.models import Cases, Contacts, Structure
from workflow.reduction import reduce_structure
from workflow.schemes import Results

H = 1e-5
RIVALS = ("moreau", "carpenter", "penalty", "penalty implicit")


def multiply_adds(structure: Structure) -> int:
    """Return those of a heated step: 6 for a mechanical mode and 4 for a thermal one.

    A mechanical mode takes in an impulse and, in both states, heat, and turns; a thermal mode takes in
    heat, decays and shows in velocity and temperature of the tip; the last is a mere addition here, as
    modes are scaled, which is not counted as less. The tip's own work is left out.
    """
    return 6 * structure.mechanical_size + 4 * structure.thermal_size


@cache
def _operator(structure: Structure, h: float, label: str) -> Any:
    method, _, integration = label.partition(" ")
    scheme = schemes.load(method)
    return scheme, scheme.init(structure, h, scheme.Options(**({"integration": integration} if integration else {})))


def run(
    structure: Structure,
    batch: Cases,
    h: float,
    steps: int,
    samples: int = 10,
    label: str = "moreau",
    balances: bool = False,
) -> Results:
    """Step a batch; what a study does once for many batches is done once."""
    scheme, operator = _operator(structure, h, label)
    return scheme.compute(operator, batch, sampling(steps * h, steps * h / samples, balances))


def rub(structure: Structure, count: int, **values: Any) -> Cases:
    """Return cases that differ in α where it is not given."""
    alpha, gap = np.linspace(50.0 / count, 50.0, count), {} if "gaps" in values else {"gap": 5e-5}
    return cases(structure, count, **{"alpha": alpha, "amplitude": 100.0, "frequency": 20.0, **gap, **values})


def batched(size: Size) -> list[Line]:
    """Batches on one core: against the processor's peak, reduced, cold, alone."""
    full = heavy_chain()
    reduction = reduce_structure(full, 3, 12)
    batch, cold = rub(full, size.cases), rub(full, size.cases, alpha=0.0)
    mechanical = heavy_chain(expansion=0.0, conductance=0.0, convection=0.0)
    turns = max(1, 10 * size.steps)
    peak, *seconds = least(
        size.runs,
        lambda: multiply_add_peak.turn(turns),
        lambda: run(full, batch, H, size.steps),
        lambda: run(reduction.structure, reduction.project(batch), H, size.steps),
        lambda: run(full, cold, H, size.steps),
        lambda: run(mechanical, cold, H, size.steps),
        lambda: run(full, batch.take(slice(0, 1)), H, 30 * size.steps),
    )
    each = peak * 1e9 / (turns * multiply_add_peak.multiply_adds_of_a_turn())
    whole, few, unheated, bare, single = (1e9 * s / (size.cases * size.steps) for s in seconds)
    single *= size.cases / 30
    least_full, least_few = each * multiply_adds(full), each * multiply_adds(reduction.structure)
    return [
        ("multiply-add at the processor's peak, full registers", "", f"{each:.4f} ns", ""),
        (
            "full, 20 + 20 modes, over its multiply-adds at peak",
            "<= 1.3",
            f"{whole:.2f} ns",
            f"{whole / least_full:.2f}",
        ),
        ("reduced, 3 + 12 modes, over its multiply-adds at peak", "<= 1.4", f"{few:.2f} ns", f"{few / least_few:.2f}"),
        ("reduced over full", "<= 0.45", f"{few:.2f} ns", f"{few / whole:.2f}"),
        within("one case alone, full", 350, single, "ns", 0),
        ("no heat over a mechanical model", "1", f"{unheated:.2f} ns", f"{unheated / bare:.2f}"),
    ]


def several(size: Size) -> list[Line]:
    """Contacts at the last nodes of the chain as matrices, metrics alone, over one."""
    full, works = heavy_chain(), []
    for count in (1, 2, 5, 16):
        rows = np.eye(20)[-count:]
        own = Contacts(tuple(map(str, range(count))), rows, 0 * rows, rows, np.zeros(count))
        structure = replace(full.matrices(), contacts=own) if count > 1 else full
        gaps = {"gaps": [list(5e-5 * np.linspace(1, 20, 20)[-count:] / 20)]} if count > 1 else {}
        works.append(partial(run, structure, rub(full, size.cases, e=0.5, **gaps), H, size.steps, 1))
    one, *more = (1e9 * s / (size.cases * size.steps) for s in least(size.runs, *works))
    return [
        (f"{count} contacts over one, full", f"<= {limit}", f"{each:.1f} ns", f"{each / one:.1f}")
        for count, limit, each in zip((2, 5, 16), (5, 8, 16), more, strict=True)
    ]


def stored(size: Size) -> list[Line]:
    """Histories every 10th and 100th step over two samples."""
    full = heavy_chain()
    batch = rub(full, min(size.cases, 128))
    counts = (1, size.steps // 10, max(1, size.steps // 100))
    few, *others = least(size.runs, *(partial(run, full, batch, H, size.steps, samples) for samples in counts))
    return [
        (f"histories every {every}th step over none", "<= 1.25", f"{seconds:.3f} s", f"{seconds / few:.2f}")
        for every, seconds in zip((10, 100), others, strict=True)
    ]


def _per_step(size: Size, structure: Structure, batch: Cases, steps: int) -> float:
    """Return the seconds of a step of a case, set-up left out: a long run less a short one."""
    works = (partial(run, structure, batch, 1e-6, count) for count in (steps, 3 * steps))
    short, long = least(size.runs, *works)
    return max(long - short, 1e-12) / (2 * steps * batch.e.size)


def scaling(size: Size) -> list[Line]:
    """A step over nodes of full chains and over modes of a reduced one, and of a long chain per node.

    What a step costs beside its modes makes the slope smaller on a straight line too.
    """
    lines: list[Line] = []
    for count, target in ((1, 25.0), (8, 10.0)):
        chain = heavy_chain(nodes=size.long_nodes)
        seconds = _per_step(size, chain, rub(chain, count), max(2, size.node_steps // size.long_nodes))
        each = 1e9 * seconds / size.long_nodes
        what = f"{size.long_nodes} nodes, {count} case{'s' * (count > 1)}, per case, node and step"
        lines.append(within(what, target, each, "ns"))
    long = heavy_chain(nodes=2 * size.modes[-1])
    chains = [(chain := heavy_chain(nodes=nodes), rub(chain, 64)) for nodes in size.nodes]
    reductions = [reduce_structure(long, modes, modes) for modes in size.modes]
    reduced = [(reduction.structure, reduction.project(rub(long, 64))) for reduction in reductions]
    for title, unit, numbers, pairs in (
        ("full in modes, a step", "nodes", size.nodes, chains),
        ("reduced, a step", "modes", size.modes, reduced),
    ):
        taken = [
            _per_step(size, *pair, max(2, size.node_steps // number))
            for number, pair in zip(numbers, pairs, strict=True)
        ]
        half = (len(numbers) - 1) // 2
        what = f"{title}: slope over {unit}, from {numbers[half]} to {numbers[-1]}"
        lines.append((what, "1", "", f"{slope(numbers[half:], taken[half:]):.2f}"))
        each = 1e9 * taken[-1] / numbers[-1]
        lines.append((f"{title}, {numbers[-1]} {unit}, for each", "", f"{each:.3g} ns", ""))
    return lines


def numpy_loop(steps: int) -> float:
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


def dop853(most: int) -> tuple[float, float]:
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


def stepping(size: Size) -> list[Line]:
    """The stepping schemes over ``moreau``, and with balances over without, full and reduced."""
    full, h = heavy_chain(), 5e-6
    reduction, batch = reduce_structure(full, 3, 12), rub(full, size.cases)
    lines = []
    for name, structure, loaded in (
        ("full", full, batch),
        ("3 + 12 modes", reduction.structure, reduction.project(batch)),
    ):
        works = [
            partial(run, structure, loaded, h, size.steps, label=label, balances=balances)
            for label in RIVALS
            for balances in (False, True)
        ]
        seconds = [1e9 * s / size.cases / size.steps for s in least(size.runs, *works)]
        for label, plain, audited in zip(RIVALS, seconds[::2], seconds[1::2], strict=True):
            if label != "moreau":
                what, asked = f"`{label}` over `moreau`, {name}", "" if "implicit" in label else "<= 1.3"
                lines.append((what, asked, f"{plain:.2f} ns", f"{plain / seconds[0]:.2f}"))
            what = f"`{label}` with balances over without, {name}"
            lines.append((what, "<= 1.5", f"{audited:.2f} ns", f"{audited / plain:.2f}"))
    return lines


def exact(size: Size) -> list[Line]:
    """``event_driven`` per case of 0.3 s, and what an α of each case's own makes of it, full and reduced."""
    full, lines, count = heavy_chain(), [], size.exact_cases
    for e in (0.0, 0.5, 0.9):
        batch = rub(full, count, e=e, alpha=50.0)
        impacts = run(full, batch, 1e-3, 300, 300, "event_driven").metrics["impacts"][0]
        (seconds,) = least(size.runs, partial(run, full, batch, 1e-3, 300, 300, "event_driven"))
        what = f"`event_driven`, e = {e:g}, {impacts:.0f} impacts, one alpha"
        lines.append(within(what, 1, 1e3 * seconds / count, "ms", 2))
    reduction = reduce_structure(full, 3, 12)
    for name, structure in (("20 + 20 modes", full), ("3 + 12 modes", reduction.structure)):
        works = []
        for alpha in (50.0, np.linspace(50.0, 49.0, count)):
            batch = rub(full, count, e=0.5, alpha=alpha)
            loaded = batch if structure is full else reduction.project(batch)
            works.append(partial(run, structure, loaded, 1e-3, 300, 300, "event_driven"))
        one, own = least(size.runs, *works)
        what = f"`event_driven`, {name}, each case another alpha over one alpha"
        lines.append((what, "<= 1.3", f"{1e3 * own / count:.2f} ms", f"{own / one:.2f}"))
    return lines


def lines(size: Size) -> list[Line]:
    return batched(size) + several(size) + stored(size) + scaling(size) + stepping(size) + exact(size)
