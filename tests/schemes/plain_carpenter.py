"""Carpenter's scheme with plain matrices: what the modal kernel must reproduce."""

from __future__ import annotations

import numpy as np
import plain_casing
from plain_moreau import Trajectory

from workflow.models import Cases, Structure


def march(
    structure: Structure, batch: Cases, h: float, steps: int, *, lagged: bool = False, implicit: bool = False
) -> Trajectory:
    """Step the first case of a batch; ``impulse`` holds p_0 … p_steps, velocities are central.

    A temperature is told with half the heat of its p_k.
    """
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    alpha = batch.alpha[0]
    heat_tip = np.eye(structure.thermal_size)[-1]
    ahead = M / h**2 if lagged else M / h**2 + C1 / (2 * h)

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
        give = np.linalg.solve(ahead, plain_casing.direction(structure, batch))
        force_n = max(0.0, (x_free[-1] - plain_casing.place(batch, (k + 1) * h)) / give[-1])
        x_after = x_free - force_n * give
        enters = np.linalg.solve(C2 + h * K2 if implicit else C2, heat_tip)
        heat = alpha * h * force_n * enters
        path.append((x, (x_after - x_before) / (2 * h) if k else v, T + heat / 2 if k else T))
        impulses.append(h * force_n)
        if implicit:
            T = np.linalg.solve(C2 + h * K2, C2 @ T + h * batch.heating[0]) + heat
        else:
            T = T + h * np.linalg.solve(C2, batch.heating[0] - K2 @ T) + heat
        x_before, x = x, x_after
    return Trajectory(*(np.array(states) for states in zip(*path, strict=True)), np.array(impulses))
