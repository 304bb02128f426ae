"""Central differences with plain matrices, by three laws of contact: what modal kernels must reproduce."""

from collections.abc import Callable

import numpy as np
import plain_casing
from plain_theta import Trajectory

from workflow.models import Cases, Structure

Law = Callable[[int, float, float, float, float], float]
"""From the step, x_n before, now and after it without contact, and what a unit force takes from that, to the force."""


def carpenter(
    structure: Structure, batch: Cases, h: float, steps: int, *, lagged: bool = False, implicit: bool = False
) -> Trajectory:
    """Step the first case of a batch; the tip ends no step beyond its casing."""
    return paoli_schatzman(structure, batch, h, steps, e=0.0, lagged=lagged, implicit=implicit)


def paoli_schatzman(
    structure: Structure,
    batch: Cases,
    h: float,
    steps: int,
    *,
    e: float,
    lagged: bool = False,
    implicit: bool = False,
) -> Trajectory:
    """Step the first case of a batch; from an impact the tip is e times as far from its casing as two steps before."""

    def law(k: int, before: float, now: float, free: float, give: float) -> float:
        behind, ahead = (plain_casing.place(batch, (k + i) * h) for i in (-1, 1))
        return max(0.0, (free - ahead + e * (before - behind)) / give)

    return _march(structure, batch, h, steps, law, lagged, implicit)


def spring(structure: Structure, batch: Cases, h: float, steps: int, stiffness: float, damping: float) -> Trajectory:
    """Step the first case of a batch; the damper takes the central velocity, which the force itself changes."""

    def law(k: int, before: float, now: float, free: float, give: float) -> float:
        behind, gap, ahead = (plain_casing.place(batch, (k + i) * h) for i in (-1, 0, 1))
        force = stiffness * (now - gap) + damping * ((free - before) - (ahead - behind)) / (2 * h)
        return max(0.0, force / (1 + damping * give / (2 * h))) if now > gap else 0.0

    return _march(structure, batch, h, steps, law, lagged=False, implicit=False)


def _march(
    structure: Structure, batch: Cases, h: float, steps: int, law: Law, lagged: bool, implicit: bool
) -> Trajectory:
    """Return the states; ``impulse`` holds p_0 … p_steps, velocities are central.

    A temperature is told with half the heat of its p_k.
    """
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    ahead = M / h**2 if lagged else M / h**2 + C1 / (2 * h)
    give = np.linalg.solve(ahead, plain_casing.direction(structure, batch))
    enters = np.linalg.solve(C2 + h * K2 if implicit else C2, np.eye(structure.thermal_size)[-1])

    def force(t: float) -> np.ndarray:
        return plain_casing.load(batch, t) * structure.load_direction + batch.steady[0]

    x, v, T = batch.displacement[0], batch.velocity[0], batch.temperature[0]
    a = np.linalg.solve(M, force(0.0) - C1 @ v - K1 @ x - K12 @ T)
    x_before = x - h * v + h**2 / 2 * a
    path, impulses = [], []
    for k in range(steps + 1):
        right = force(k * h) - K1 @ x - K12 @ T + M @ (2 * x - x_before) / h**2
        right = right - C1 @ (x - x_before) / h if lagged else right + C1 @ x_before / (2 * h)
        x_free = np.linalg.solve(ahead, right)
        force_n = law(k, x_before[-1], x[-1], x_free[-1], give[-1])
        x_after = x_free - force_n * give
        heat = batch.alpha[0] * h * force_n * enters
        path.append((x, (x_after - x_before) / (2 * h) if k else v, T + heat / 2 if k else T))
        impulses.append(h * force_n)
        if implicit:
            T = np.linalg.solve(C2 + h * K2, C2 @ T + h * batch.heating[0]) + heat
        else:
            T = T + h * np.linalg.solve(C2, batch.heating[0] - K2 @ T) + heat
        x_before, x = x, x_after
    return Trajectory(*(np.array(states) for states in zip(*path, strict=True)), np.array(impulses))
