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
from workflow.schemes.event_driven import (
    LEAVES,
    TOUCHES,
    Budget,
    ClosedSet,
    Linear,
    Trajectory,
    make_operator,
    one_case,
    propagators,
    trajectory,
)

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
        if not structure.contacts.is_one_with_mass:
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
            vibrating = basis.frequency[basis.frequency > 0]
            self.period = 2 * np.pi / float(vibrating.min()) if vibrating.size else 1.0
        self.one = one_case(self.operator, cases, self.period, heated=heated)
        self.load, self.modes, self.heats = self.one.own, basis.frequency.size, self.one.basis.rate.size
        self.is_heated, n, self.start = self.heats > 0, self.modes, self.load.modal
        self.tip = np.zeros((2, self.start.size))
        self.tip[0, :n] = self.tip[1, n : 2 * n] = basis.normal[0]
        heat = self.alpha * self.one.basis.heat[0]
        self.impulse_jump = np.concatenate([np.zeros(n), friction * basis.tangent[0] - basis.normal[0], heat])

    def set_of(self, held: bool) -> ClosedSet:
        """Return the set of the held or the free tip."""
        return self.one.set_of(held)

    @cached_property
    def free(self) -> Linear:
        """The tip free."""
        return self.one.linear(False)

    @cached_property
    def held(self) -> Linear:
        """The tip held."""
        return self.one.linear(True)

    def parts(self, X: Array) -> tuple[Array, Array, Array]:
        """Return displacements, velocities and temperatures of the structure's coordinates, ``(…, coordinate)``."""
        basis, n = self.one.basis, self.modes
        return X[..., :n] @ basis.shapes.T, X[..., n : 2 * n] @ basis.shapes.T, X[..., 2 * n :] @ basis.heat_shapes.T

    def size(self, X: Array, scale: Array) -> float:
        """Return the norm of a deviation: its largest x, v or θ, each over its scale; inf where it is not finite."""
        size = max(float(np.abs(x).max(initial=0.0)) / most for x, most in zip(self.parts(X), scale, strict=True))
        return size if np.isfinite(X).all() else np.inf

    def growth_by_heat(self, X: Array) -> float:
        """Return the quasi-static tip growth of a state, m."""
        basis = self.one.basis
        return float((basis.contacts.growth_at_once + basis.growth @ X[2 * self.modes :])[0])

    def balanced(self, X: Array, force: float) -> Array:
        """Return a state with temperatures in balance with a mean contact force λ [N], μ τ = χᵀq + α χ_n λ.

        An adiabatic thermal mode is left unchanged.
        """
        basis, n = self.one.basis, self.modes
        sources = self.load.constant[n : n + self.heats] + self.alpha * basis.heat[0] * force
        kept = X.copy()
        np.divide(sources, basis.rate, out=kept[2 * n :], where=basis.rate > 0)
        return kept

    @property
    def reach(self) -> float:
        """The length accounted for by clearance, loads, heating and the initial temperatures, m."""
        basis, load, heating = self.one.basis, self.load, slice(self.modes, self.modes + self.heats)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a free root, or heat that cannot leave
            flexibility = np.nansum((basis.normal[0] / basis.frequency) ** 2)
            warm = np.nansum(np.abs(basis.growth[0] * load.constant[heating] / basis.rate))
        forces = abs(load.constant[heating.stop]) + np.abs(load.waves[:, 2]).sum()
        return float(load.reach + flexibility * forces + warm + abs(self.growth_by_heat(self.start)))

    def march(self, X: Array, contact: bool, begin: float, span: float, kept: int = 64, samples: int = 1) -> Trajectory:
        """Return the exact motion from X at ``begin`` [s] over ``span`` [s], as :func:`trajectory` does."""
        return trajectory(self.one, X, contact, begin, span, kept, samples)

    def derivative(self, motion: Trajectory) -> Array:
        """Return the derivative of a motion's final state with respect to its initial state, ``(N, N)``."""
        ends, held = motion.stretches
        spans = np.diff(ends)
        factors = np.empty((spans.size, self.start.size, self.start.size))
        for is_held in (False, True):
            factors[held == is_held] = propagators(self.set_of(is_held), spans[held == is_held])
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
        own, waves, loads = self.free.system, self.load.waves, self.modes + self.heats
        force = np.sin(waves[:, 0] * t[:, None] + waves[:, 1]) @ waves[:, 2]
        rates = X @ own.A.T + own.B @ self.load.constant + force[:, None] * own.B[:, loads]
        excess = np.where(held, rates @ self.tip[1] - self._casing(t)[1], 0.0)
        return np.asarray(rates - excess[:, None] * self.impulse_jump / (self.tip[1] @ self.impulse_jump))

    def _casing(self, t: Array) -> tuple[Array, Array]:
        """Return velocity and acceleration of the casing at some times."""
        (omega, phase, _, _), (cos, sin) = self.load.waves.T, self.load.casing[..., 0].T
        c, s = (turned(omega * t[:, None] + phase) for turned in (np.cos, np.sin))
        return (c * sin - s * cos) @ omega, -(c * cos + s * sin) @ omega**2
