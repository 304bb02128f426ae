"""The exact motion of one case over whole periods, and its derivative with respect to the initial state.

Between events X = [y, y', τ], in the modes of the free tip, obeys X' = A X + b(t), with A of the free tip or of the
tip held on the casing. At an event where the gap g = d(t) - x_n falls to zero deviations are multiplied by the
saltation matrix

    S = J_X + (f⁺ - J_X f⁻ - J_t) ∇gᵀ/(∇g · f⁻ + g_t),

J Newton's law with the heat of its impulse, f∓ the rates before and after. A release is continuous: S = 1.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from math import lcm

import numpy as np
from numpy.typing import NDArray

from workflow.models import Array, Cases, Structure
from workflow.schemes import RefusedStructureError
from workflow.schemes._exact.batch import make_operator
from workflow.schemes._exact.layout import Budget, Regime
from workflow.schemes._exact.record import LEAVES, TOUCHES
from workflow.schemes._exact.trajectory import Linear, Trajectory, linear, one_case, propagators, trajectory

MOST_LOAD_PERIODS = 64
"""Largest number of load periods in the common period of all sinusoids."""

_BUDGET = Budget(events=10**6, steps=10**8)
"""Limits of one march."""


def common_period(cases: Cases) -> float:
    """Return the least common period of all sinusoids of one case, s; inf without sinusoids, NaN if there is none."""
    given = cases.load_harmonics.joined(cases.casing_harmonics)[0]
    frequencies = np.unique(given.frequency[(given.amplitude != 0) & (given.frequency != 0)])
    if frequencies.size == 0:
        return np.inf
    base = float(cases.period_frequency[0]) or float(frequencies[0])
    ratios = [Fraction(f / base).limit_denominator(MOST_LOAD_PERIODS) for f in frequencies]
    if any(abs(float(ratio) * base / f - 1) > 1e-9 for ratio, f in zip(ratios, frequencies, strict=True)):
        return np.nan
    count = lcm(*(ratio.denominator for ratio in ratios))
    return count / base if count <= MOST_LOAD_PERIODS else np.nan


class AnalysedStructure:
    """A structure and its operator, with the tip free and held, for all its cases.

    Raises
    ------
    RefusedStructureError
        It has several contacts, or one without mass.
    """

    def __init__(self, structure: Structure):
        if not structure.contacts.is_tip:
            raise RefusedStructureError("steady rubs and branches are of one contact with mass; take another basis")
        self.structure, self.operator = structure, make_operator(structure, _BUDGET)


class Flow:
    """The flow of one case: its motion as a first-order system."""

    def __init__(self, structure: AnalysedStructure, cases: Cases, *, heated: bool = False):
        """Prepare a case, with thermal states where heat acts or ``heated`` is set.

        Under constant loads the period is that of the slowest mode of the free tip, 1 s without any.
        """
        self.structure, self.operator, self.cases = structure.structure, structure.operator, cases
        basis, friction = self.operator.basis, float(cases.friction[0])
        self.period, self.alpha, self.e = common_period(cases), float(cases.alpha[0]), float(cases.e[0])
        self.is_constant = self.period == np.inf
        if self.is_constant:
            vibrating = basis.free.frequency[basis.free.frequency > 0]
            self.period = 2 * np.pi / float(vibrating.min()) if vibrating.size else 1.0
        self.one = one_case(self.operator, cases, self.period, heated=heated)
        self.load, self.modes = self.one.own, basis.tip.size
        self.is_heated, n = bool(self.load.free), self.modes
        size = self.load.modal.size if self.is_heated else 2 * n
        self.start = self.load.modal[:size]
        self.tip = np.zeros((2, size))
        self.tip[0, :n] = self.tip[1, n : 2 * n] = basis.tip
        heat = self.alpha * basis.free.heat_tip[: size - 2 * n]
        self.impulse_jump = np.concatenate([np.zeros(n), friction * basis.tangent - basis.tip, heat])

    def regime(self, held: bool) -> Regime:
        """Return the regime of the held or the free tip."""
        return self.one.regime(held)

    @cached_property
    def free(self) -> Linear:
        """The tip free."""
        free = self.operator.basis.free
        return linear(free if self.is_heated else free.unheated, 0.0)

    @cached_property
    def held(self) -> Linear:
        """The tip held."""
        held = self.operator.basis.held
        return linear((held if self.is_heated else held.unheated).sliding(float(self.cases.friction[0])), self.alpha)

    def parts(self, X: Array) -> tuple[Array, Array, Array]:
        """Return displacements, velocities and temperatures of the structure's coordinates, ``(…, coordinate)``."""
        shapes, n = self.operator.basis.free, self.modes
        return (
            X[..., :n] @ shapes.shapes.T,
            X[..., n : 2 * n] @ shapes.shapes.T,
            (X[..., 2 * n :] @ shapes.heat_shapes[:, : X.shape[-1] - 2 * n].T),
        )

    def size(self, X: Array, scale: Array) -> float:
        """Return the norm of a deviation: its largest x, v or θ, each over its scale; inf where it is not finite."""
        size = max(float(np.abs(x).max(initial=0.0)) / most for x, most in zip(self.parts(X), scale, strict=True))
        return size if np.isfinite(X).all() else np.inf

    def growth_by_heat(self, X: Array) -> float:
        """Return the quasi-static tip growth of a state, m."""
        return float(self.operator.basis.closing[: X.size - 2 * self.modes] @ X[2 * self.modes :])

    def balanced(self, X: Array, force: float) -> Array:
        """Return a state with temperatures in balance with a mean contact force λ [N], μ τ = χᵀq + α χ_n λ.

        An adiabatic thermal mode is left unchanged.
        """
        free, size = self.operator.basis.free, X.size - 2 * self.modes
        sources = free.heat_shapes.T @ self.load.heating + self.alpha * free.heat_tip * force
        kept = X.copy()
        np.divide(sources[:size], free.rate[:size], out=kept[2 * self.modes :], where=free.rate[:size] > 0)
        return kept

    @property
    def reach(self) -> float:
        """The length accounted for by clearance, loads, heating and the initial temperatures, m."""
        basis, load = self.operator.basis, self.load
        with np.errstate(divide="ignore", invalid="ignore"):  # of a free root, or heat that cannot leave
            flexibility = np.nansum((basis.tip / basis.free.frequency) ** 2)
            warm = np.nansum(np.abs(basis.closing * (basis.free.heat_shapes.T @ load.heating) / basis.free.rate))
        forces, places = np.abs(load.waves[:, 2:4]).sum(axis=0)
        length = abs(load.gap) + places + flexibility * (abs(load.mean) + forces)
        return float(length + warm + abs(self.growth_by_heat(self.start)))

    def march(self, X: Array, contact: bool, begin: float, span: float, kept: int = 64, samples: int = 1) -> Trajectory:
        """Return the exact motion from X at ``begin`` [s] over ``span`` [s], as :func:`trajectory` does."""
        return trajectory(self.one, X, contact, begin, span, kept, samples)

    def derivative(self, motion: Trajectory) -> Array:
        """Return the derivative of a motion's final state with respect to its initial state, ``(N, N)``."""
        ends, held = motion.stretches
        spans = np.diff(ends)
        factors = np.empty((spans.size, self.start.size, self.start.size))
        for is_held in (False, True):
            factors[held == is_held] = propagators(self.regime(is_held), spans[held == is_held])
        D = factors[0]
        for saltation, factor in zip(self._saltations(motion), factors[1:], strict=True):
            D = factor @ saltation @ D
        return np.asarray(D)

    def _saltations(self, motion: Trajectory) -> Array:
        """Return S of each event, ``(event, N, N)``."""
        X, t, stays = motion.states, motion.begin + motion.times, motion.kinds == TOUCHES
        before = X - motion.impulses[:, None] * self.impulse_jump
        speed, acceleration = self._casing(t)
        jump = -(1 + np.where(stays, 0.0, self.e))[:, None] * self.impulse_jump / (self.tip[1] @ self.impulse_jump)
        law = np.eye(X.shape[1]) + jump[:, :, None] * self.tip[1]  # J = X + jump (v_n - d')
        before_rates = self._rates(before, t, np.zeros_like(stays))
        late = self._rates(X, t, stays) - np.einsum("eij,ej->ei", law, before_rates) + jump * acceleration[:, None]
        approach = speed - before @ self.tip[1]
        late[approach == 0] = 0.0
        S = law - (late / np.where(approach == 0, 1.0, approach)[:, None])[:, :, None] * self.tip[0]
        S[motion.kinds == LEAVES] = np.eye(X.shape[1])
        return np.asarray(S)

    def _rates(self, X: Array, t: Array, held: NDArray[np.bool_]) -> Array:
        """Return X' of states in flight or held, ``(state, N)``."""
        push, waves = self.free.B[:, -4], self.load.waves
        force = np.sin(waves[:, 0] * t[:, None] + waves[:, 1]) @ waves[:, 2]
        constant = np.concatenate([self.load.steady, self.load.heating, [self.load.mean]])
        rates = X @ self.free.A.T + self.free.B[:, :-3] @ constant + force[:, None] * push
        excess = np.where(held, rates @ self.tip[1] - self._casing(t)[1], 0.0)
        return np.asarray(rates - excess[:, None] * self.impulse_jump / (self.tip[1] @ self.impulse_jump))

    def _casing(self, t: Array) -> tuple[Array, Array]:
        """Return velocity and acceleration of the casing at some times."""
        omega, phase, _, amplitude = self.load.waves.T
        turn = omega * t[:, None] + phase
        return np.cos(turn) @ (omega * amplitude), -np.sin(turn) @ (omega**2 * amplitude)
