"""The exact motion of one case over whole periods, and its derivative by the state at the start.

Between events a state X = [x, v, θ] moves by X' = A X + b(t), with A of the free tip or of the tip held on the casing,
x_n = d(t), where the contact force is

    λ = e_nᵀ M⁻¹ (f - C1 v - K1 x - K12 θ - M e_n d'')/W,   W = e_nᵀ M⁻¹ n,   n = e_n - µ t.

At an event where the gap g = d(t) - x_n falls to zero perturbations are multiplied by the saltation matrix

    S = J_X + (f⁺ - J_X f⁻ - J_t) ∇gᵀ/(∇g · f⁻ + g_t),

J Newton's law with the heat of its impulse, f∓ the rates before and after. A release is continuous: S = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

from workflow.models import Array, Cases, Structure
from workflow.schemes._exact.advance import Events, States, advance
from workflow.schemes._exact.batch import Operator
from workflow.schemes._exact.record import IMPACT, TOUCH


@dataclass(frozen=True, eq=False)
class Flow:
    """One case as a first-order system, ``(N, N)`` and ``(N,)``."""

    operator: Operator
    cases: Cases
    """One case."""
    mechanical: int
    """Number of displacements; X = [x, v, θ], without θ where no heat acts."""
    free: Array
    """A with the tip free."""
    held: Array
    """A with the tip held."""
    steady: Array
    """Constant part of b of a free tip."""
    push: Array
    """b per tip load."""
    kick: Array
    """Change of X per contact impulse: [0, -M⁻¹ n, α C2⁻¹ e_n]."""

    @property
    def tip(self) -> tuple[int, int]:
        """Rows of x_n and v_n."""
        return self.mechanical - 1, 2 * self.mechanical - 1

    def rates(self, X: Array, t: float, contact: bool) -> Array:
        """Return X' of a free or a held tip."""
        rates = self.free @ X + self.steady + self.push * self.cases.load_at(t)[0]
        if contact:
            v = self.tip[1]
            rates = rates - self.kick * (rates[v] - self.casing(t)[2]) / self.kick[v]
        return np.asarray(rates)

    def casing(self, t: float) -> tuple[float, float, float]:
        """Return place, velocity and acceleration of the casing."""
        harmonics, cases = self.cases.casing_harmonics, self.cases
        turn = harmonics.angular * t + harmonics.phase
        acceleration = -np.sum(harmonics.amplitude * harmonics.angular**2 * np.sin(turn))
        return float(cases.casing_at(t)[0]), float(cases.casing_velocity_at(t)[0]), float(acceleration)


def flow_of(structure: Structure, operator: Operator, cases: Cases) -> Flow:
    """Return the first-order system of one case."""
    n, mu = structure.mechanical_size, float(cases.friction[0])
    m = structure.thermal_size if cases.heated[0] else 0
    size, x, v, heat = 2 * n + m, slice(0, n), slice(n, 2 * n), slice(2 * n, 2 * n + m)
    free, steady, push, kick = np.zeros((size, size)), np.zeros(size), np.zeros(size), np.zeros(size)
    free[x, v] = np.eye(n)
    forces = np.hstack([structure.stiffness_matrix, structure.damping_matrix, structure.coupling_matrix[:, :m]])
    free[v] = -np.linalg.solve(structure.mass, forces)
    tip = np.eye(n)[-1]
    along = tip if structure.tangent is None else tip - mu * structure.tangent
    steady[v] = np.linalg.solve(structure.mass, cases.steady[0])
    push[v] = np.linalg.solve(structure.mass, structure.load_direction)
    kick[v] = -np.linalg.solve(structure.mass, along)
    if m:
        free[heat, heat] = -np.linalg.solve(structure.heat_capacity, structure.conductance_matrix)
        steady[heat] = np.linalg.solve(structure.heat_capacity, cases.heating[0])
        kick[heat] = float(cases.alpha[0]) * np.linalg.solve(structure.heat_capacity, np.eye(m)[-1])
    held = free - np.outer(kick, free[2 * n - 1]) / kick[2 * n - 1]
    return Flow(operator, cases, n, free, held, steady, push, kick)


def vector_of(flow: Flow, states: States, i: int = 0) -> Array:
    """Return X of a state."""
    whole = np.concatenate([states.displacement[i], states.velocity[i], states.temperature[i]])
    return whole[: flow.free.shape[0]]


def states_of(flow: Flow, X: Array, contact: bool) -> States:
    """Return the state of X; a tip in contact is put on the casing at the start of a period."""
    n, temperature = flow.mechanical, np.zeros_like(flow.cases.temperature)
    x, v = X[None, :n].copy(), X[None, n : 2 * n].copy()
    temperature[0, : X.size - 2 * n] = X[2 * n :]
    if contact:
        x[0, -1], v[0, -1] = flow.casing(0.0)[:2]
    return States(x, v, temperature, np.array([contact]))


def after(flow: Flow, X: Array, contact: bool, span: float) -> tuple[Array, bool, Events]:
    """Return state, contact and events after ``span`` from the start of a period."""
    states, events = advance(flow.operator, flow.cases, states_of(flow, X, contact), 0.0, span)
    return vector_of(flow, states), bool(states.contact[0]), events


def derivative(flow: Flow, contact: bool, events: Events, span: float) -> Array:
    """Return the derivative of :func:`after` by X, along the events met: propagators and saltation matrices."""
    D, at, held = np.eye(flow.free.shape[0]), 0.0, contact
    if contact:
        D[list(flow.tip), list(flow.tip)] = 0.0  # the place and velocity of a held tip are the casing's
    for i, (t, kind) in enumerate(zip(events.time, events.kind, strict=True)):
        D = expm((flow.held if held else flow.free) * (t - at)) @ D
        if kind in (IMPACT, TOUCH):
            D = saltation(flow, vector_of(flow, events.after, i), events.impulse[i], t, kind == TOUCH) @ D
        at, held = t, bool(kind == TOUCH)
    return np.asarray(expm((flow.held if held else flow.free) * (span - at)) @ D)


def saltation(flow: Flow, X: Array, impulse: float, t: float, stays: bool) -> Array:
    """Return S of an event after which the state is X."""
    (x, v), (_, speed, acceleration) = flow.tip, flow.casing(t)
    before = X - flow.kick * impulse
    e = 0.0 if stays else float(flow.cases.e[0])
    law = np.eye(X.size)
    jump = -(1 + e) * flow.kick / flow.kick[v]  # J = X + jump (v_n - d')
    law[:, v] += jump
    approach = speed - before[v]
    if approach == 0.0:
        return law
    late = flow.rates(X, t, stays) - law @ flow.rates(before, t, False) + jump * acceleration
    law[:, x] -= late / approach
    return law
