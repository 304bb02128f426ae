"""The θ-method of ARCHITECTURE with plain matrices, by two laws of contact: what modal kernels must reproduce."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import plain_casing

from workflow.models import Cases, Structure

Law = Callable[[int, float, float, float, float], float]
"""From the step, x_n, v_n, v_n without contact and W to its impulse."""


@dataclass(frozen=True)
class Trajectory:
    """States at the step ends 0 … steps, and the impulse of each step."""

    displacement: np.ndarray
    velocity: np.ndarray
    temperature: np.ndarray
    impulse: np.ndarray

    def energy(self, structure: Structure) -> np.ndarray:
        """E = ½ vᵀMv + ½ xᵀK1x at every step end."""
        kinetic = np.einsum("ti,ij,tj->t", self.velocity, structure.mass, self.velocity)
        elastic = np.einsum("ti,ij,tj->t", self.displacement, structure.stiffness_matrix, self.displacement)
        return (kinetic + elastic) / 2


def march(structure: Structure, batch: Cases, h: float, theta: float, steps: int) -> Trajectory:
    """Step the first case of a batch, with Newton's law at velocity level."""
    e = batch.e[0]

    def law(k: int, x: float, v: float, free: float, kick: float) -> float:
        before, ahead = (plain_casing.velocity(batch, step * h, h, theta) for step in (k, k + 1))
        u = v - before
        return max(0.0, (free - ahead + e * u) / kick) if x + h / 2 * u >= plain_casing.place(batch, k * h) else 0.0

    return _march(structure, batch, h, theta, steps, law)


def march_on_spring(
    structure: Structure, batch: Cases, h: float, steps: int, stiffness: float, damping: float, theta: float
) -> Trajectory:
    """Step the first case of a batch on a spring and a damper, whose force acts at both ends of a step."""
    held = 0.0

    def law(k: int, x: float, v: float, free: float, kick: float) -> float:
        nonlocal held
        begun, per = h * (1 - theta) * held, h * theta * kick
        free, x_per = free - begun * kick, h * theta * per  # a force takes from the velocity and place at the end
        depth = x + h * (theta * free + (1 - theta) * v) - plain_casing.place(batch, (k + 1) * h)
        parting = free - plain_casing.velocity(batch, (k + 1) * h, h, theta)
        wanted, held = stiffness * depth + damping * parting, 0.0
        if depth > 0 and wanted > 0:
            held = wanted / (1 + stiffness * x_per + damping * per)
            if depth - held * x_per < 0:  # neither branch: the tip stays on the casing
                held = depth / x_per
        return begun + h * theta * held

    return _march(structure, batch, h, theta, steps, law)


def _march(structure: Structure, batch: Cases, h: float, theta: float, steps: int, law: Law) -> Trajectory:
    M, C1, K1 = structure.mass, structure.damping_matrix, structure.stiffness_matrix
    K12, C2, K2 = structure.coupling_matrix, structure.heat_capacity, structure.conductance_matrix
    alpha = batch.alpha[0]
    heat_tip = np.zeros(structure.thermal_size)
    heat_tip[-1] = 1.0

    def force(t: float) -> np.ndarray:
        return plain_casing.load(batch, t) * structure.load_direction + batch.steady[0]

    W_hat = M + h * theta * C1 + h**2 * theta**2 * K1
    T_hat = C2 + h * theta * K2
    warm = np.linalg.solve(T_hat, heat_tip)
    kick = np.linalg.solve(W_hat, plain_casing.direction(structure, batch) + alpha * h * theta * K12 @ warm)
    x, v, T = batch.displacement[0], batch.velocity[0], batch.temperature[0]
    path = [(x, v, T)]
    impulses = np.zeros(steps)
    for k in range(steps):
        T_new = np.linalg.solve(T_hat, C2 @ T - h * (1 - theta) * K2 @ T + h * batch.heating[0])
        load = theta * force((k + 1) * h) + (1 - theta) * force(k * h)
        right = M @ v - h * (1 - theta) * C1 @ v - h * K1 @ (x + h * theta * (1 - theta) * v)
        right += h * load - h * K12 @ (theta * T_new + (1 - theta) * T)
        v_new = np.linalg.solve(W_hat, right)
        p = impulses[k] = law(k, x[-1], v[-1], v_new[-1], kick[-1])
        v_new = v_new - p * kick
        T_new = T_new + alpha * p * warm
        x, v, T = x + h * (theta * v_new + (1 - theta) * v), v_new, T_new
        path.append((x, v, T))
    return Trajectory(*(np.array(states) for states in zip(*path, strict=True)), impulses)
