"""Energy and heat of a scheme that steps plain states of a structure that modes do not separate.

With midpoint values x_m = (x + x')/2 of a step and F_θ the load as the step takes it, in the direction b, the sum over
the steps of

    - F_θ bᵀv_m h - f̄ᵀ v_m h + v_mᵀ C1 v_m h + v_mᵀ K12 θ_m h + p (e_n - µt)ᵀ v_m

and ΔE, E = ½ vᵀM v + ½ xᵀK1 x, over the largest E at a step end, is the energy residual; the change of the heat
content less αJ and heating plus the losses, over the heat turned over, is the heat residual.
"""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.models import Cases, Structure, directions, project

States = tuple[Array, Array, Array]
"""Displacement and velocity ``(case, mechanical)``, temperature ``(case, thermal)``."""


def _dot(left: Array, right: Array) -> Array:
    """Return Σ left · right of each case, added in the order of the coordinates, ``(case,)``."""
    total = np.zeros(left.shape[0])
    for column in range(left.shape[1]):
        total += left[:, column] * right[:, column]
    return total


class DenseBalance:
    """Sums of a batch, ``(case,)`` each."""

    def __init__(self, structure: Structure, cases: Cases, h: float) -> None:
        self._cases, self._h, self._step = cases, h, 0
        self._mass, self._stiffness = structure.mass, structure.stiffness_matrix
        self._damping, self._coupling = structure.damping_matrix, structure.coupling_matrix
        self._direction = structure.load_direction[None, :]
        self._contact = directions(structure, cases.friction)
        self._content, self._losses = structure.content[None, :], structure.loss_row[None, :]
        self._first = self._energy((cases.displacement, cases.velocity, cases.temperature))
        self._largest = self._first.copy()
        self._spent, self._lost, self._turned, self._heat = np.zeros((4, cases.count))

    def _energy(self, states: States) -> Array:
        """Return E = ½ vᵀM v + ½ xᵀK1 x, J."""
        x, v, _ = states
        return 0.5 * (_dot(v, project(self._mass, v)) + _dot(x, project(self._stiffness, x)))

    def add(self, before: States, after: States, impulse: Array, load: Array) -> None:
        """Add a step from its states at both ends, the impulse p and the load F_θ in it, N s and N, ``(case,)``."""
        h, cases = self._h, self._cases
        self._step += 1
        v, temperature = 0.5 * (before[1] + after[1]), 0.5 * (before[2] + after[2])
        force = project(self._damping, v) + project(self._coupling, temperature) - cases.steady
        driven = project(self._direction, v)[:, 0]
        self._spent += h * (_dot(v, force) - load * driven) + impulse * _dot(self._contact, v)
        loss = h * project(self._losses, temperature)[:, 0]
        self._lost += loss
        self._turned += np.abs(loss)
        self._heat += cases.alpha * impulse
        self._largest = np.maximum(self._largest, self._energy(after))

    def residuals(self, last: States) -> dict[str, Array]:
        """Return ``energy_residual`` and ``heat_residual``; 0 where there is no energy, or no heat turned over."""
        cases, ones = self._cases, np.ones_like(self._cases.heating)
        change = self._energy(last) - self._first + self._spent
        heating = self._step * self._h * _dot(cases.heating, ones)
        initial = self._content * cases.temperature
        gained = _dot(self._content * last[2] - initial, ones) - self._heat - heating + self._lost
        turned = self._heat + np.abs(heating) + self._turned + _dot(np.abs(initial), ones)
        return {"energy_residual": _ratio(change, self._largest), "heat_residual": _ratio(gained, turned)}


def _ratio(part: Array, whole: Array) -> Array:
    """Return part / whole, 0 where the whole is 0."""
    return np.where(whole == 0, 0.0, part / np.where(whole == 0, 1.0, whole))
