"""Contact by a spring and a damper with plain matrices: what the modal kernels must reproduce."""

from __future__ import annotations

import numpy as np
import plain_casing
from plain_moreau import Trajectory

from workflow.models import Cases, Structure


def explicit(structure: Structure, batch: Cases, h: float, steps: int, stiffness: float, damping: float) -> Trajectory:
    """Step the first case of a batch by central differences; ``impulse`` holds p_0 … p_steps.

    A temperature is told with half the heat of its p_k.
    """
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    alpha = batch.alpha[0]
    tip, heat_tip = np.eye(structure.mechanical_size)[-1], np.eye(structure.thermal_size)[-1]

    along = plain_casing.direction(structure, batch)
    x, v, T = batch.displacement[0], batch.velocity[0], batch.temperature[0]
    a = np.linalg.solve(M, _force(structure, batch, 0.0) - C1 @ v - K1 @ x - K12 @ T)
    x_before = x - h * v + h**2 / 2 * a
    path, impulses = [], []
    for k in range(steps + 1):
        left = M / h**2 + C1 / (2 * h)
        right = (
            _force(structure, batch, k * h) - K1 @ x - K12 @ T + M @ (2 * x - x_before) / h**2 + C1 @ x_before / (2 * h)
        )
        x_after = np.linalg.solve(left, right)
        force_n = 0.0
        behind, gap, ahead = (plain_casing.place(batch, (k + i) * h) for i in (-1, 0, 1))
        if x[-1] > gap:  # the damper takes the central velocity, which the force itself changes
            wall = damping / (2 * h) * np.outer(along, tip)
            pressed = right - stiffness * (x[-1] - gap) * along + wall @ (x_before + (ahead - behind) * tip)
            x_pressed = np.linalg.solve(left + wall, pressed)
            moved = (x_pressed[-1] - x_before[-1]) - (ahead - behind)
            force_n = stiffness * (x[-1] - gap) + damping * moved / (2 * h)
            force_n, x_after = (force_n, x_pressed) if force_n > 0 else (0.0, x_after)
        heat = alpha * h * force_n * np.linalg.solve(C2, heat_tip)
        path.append((x, (x_after - x_before) / (2 * h) if k else v, T + heat / 2 if k else T))
        impulses.append(h * force_n)
        T = T + heat + h * np.linalg.solve(C2, batch.heating[0] - K2 @ T)
        x_before, x = x, x_after
    return Trajectory(*(np.array(states) for states in zip(*path, strict=True)), np.array(impulses))


def implicit(
    structure: Structure, batch: Cases, h: float, steps: int, stiffness: float, damping: float, theta: float
) -> Trajectory:
    """Step the first case of a batch by the θ-method; ``impulse`` holds the steps' impulses."""
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    alpha = batch.alpha[0]
    heat_tip = np.eye(structure.thermal_size)[-1]
    W_hat, T_hat = M + h * theta * C1 + h**2 * theta**2 * K1, C2 + h * theta * K2
    warm = np.linalg.solve(T_hat, heat_tip)
    kick = np.linalg.solve(W_hat, plain_casing.direction(structure, batch) + alpha * h * theta * K12 @ warm)
    x, v, T, held = batch.displacement[0], batch.velocity[0], batch.temperature[0], 0.0
    path, impulses = [(x, v, T)], []
    for k in range(steps):
        T_new = np.linalg.solve(T_hat, C2 @ T - h * (1 - theta) * K2 @ T + h * batch.heating[0])
        load = theta * _force(structure, batch, (k + 1) * h) + (1 - theta) * _force(structure, batch, k * h)
        right = M @ v - h * (1 - theta) * C1 @ v - h * K1 @ (x + h * theta * (1 - theta) * v)
        right += h * load - h * K12 @ (theta * T_new + (1 - theta) * T)
        v_free = np.linalg.solve(W_hat, right)

        # λ' leads to (x', v') = (x_apart, v_apart) - λ' (x_per, v_per)
        begun, per = h * (1 - theta) * held, h * theta * kick
        v_apart = v_free - begun * kick
        x_apart, x_per = x + h * (theta * v_apart + (1 - theta) * v), h * theta * per
        depth, force = x_apart[-1] - plain_casing.place(batch, (k + 1) * h), 0.0
        parting = v_apart[-1] - plain_casing.velocity(batch, (k + 1) * h, h, theta)
        if depth > 0 and stiffness * depth + damping * parting > 0:
            law = np.array([[1.0, -stiffness, -damping], [x_per[-1], 1.0, 0.0], [per[-1], 0.0, 1.0]])
            force, left, _ = np.linalg.solve(law, [0.0, depth, parting])
            if left < 0:  # neither branch: the tip stays on the casing
                force = depth / x_per[-1]
        p = begun + h * theta * force
        x_new, v_new = x_apart - force * x_per, v_apart - force * per
        x, v, T, held = x_new, v_new, T_new + alpha * p * warm, force
        path.append((x, v, T))
        impulses.append(p)
    return Trajectory(*(np.array(states) for states in zip(*path, strict=True)), np.array(impulses))


def _force(structure: Structure, batch: Cases, t: float) -> np.ndarray:
    return np.asarray(plain_casing.load(batch, t) * structure.load_direction + batch.steady[0])
