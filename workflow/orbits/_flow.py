"""The exact motion of one case over whole periods, and its derivative with respect to the initial state.

Between events X = [y, y', τ], in the modes with all contacts open, obeys X' = A_S X + b(t), S the set that is closed.
Where a contact c with mass strikes, the contacts I take impulses p = W_II⁻¹ (1 + e) u_I, u = w y' - d', of those that
stay closed p = W_II⁻¹ u_I; deviations are multiplied by the saltation matrix

    S = J + (f⁺ - J f⁻ - J_t) w_cᵀ/u_c,   J = 1 + X_p ∂p/∂y',   J_t = -X_p ∂p/∂u d'',

X_p the jump of X by impulses, f∓ the rates before and after. A release is continuous, and so are all events of
compliant contacts: S = 1. Of contacts that strike at the same instant and do not act on each other it is the product.
"""

from __future__ import annotations

from fractions import Fraction
from functools import cached_property
from math import lcm

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.linalg import expm, matrix_balance

from workflow.kernels.algebra import block_diagonal, connected_parts
from workflow.models import Array, Cases, Structure
from workflow.schemes.event_driven import (
    Budget,
    ExactOperator,
    Trajectory,
    make_operator,
    one_case,
    propagators,
    trajectory,
)

MOST_LOAD_PERIODS = 64
"""Largest number of load periods in the common period of all sinusoids."""

_SAME_INSTANT = 1e-9
"""Time between impacts, over the period, up to which they are at the same instant: an orbit is known to 1e-10."""

_ROUNDING = 1e-12
"""Sum over modes, over that of its terms, up to which it is 0: the rounding of modes that a symmetry makes equal."""

_MOST_SPANS = 16
"""Spans over which a set's motion is kept, for states beside one of the same case."""

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


def analysed(structure: Structure) -> ExactOperator:
    """Return the operator of a structure, for all its cases."""
    return make_operator(structure, _BUDGET)


class Flow:
    """The flow of one case: its motion as a first-order system."""

    def __init__(self, operator: ExactOperator, cases: Cases, *, heated: bool = False):
        """Prepare a case, with thermal states where heat acts or ``heated`` is set.

        Under constant loads the period is that of the slowest mode with all contacts open, 1 s without any.
        """
        self.structure, self.operator, self.cases = operator.structure, operator, cases
        frequency, self.friction = self.operator.basis.frequency, float(cases.friction[0])
        self.period, self.alpha, self.e = common_period(cases), float(cases.alpha[0]), float(cases.e[0])
        self.is_constant = self.period == np.inf
        if self.is_constant:
            vibrating = frequency[frequency > 0]
            self.period = 2 * np.pi / float(vibrating.min()) if vibrating.size else 1.0
        duration = self.period if np.isfinite(self.period) else 1.0  # loads without a common period have no map
        self.one = one_case(self.operator, cases, duration, heated=heated)
        self.load, self.modes, self.contacts = self.one.own, frequency.size, self.one.contacts
        self.heats = self.one.basis.rate.size
        self.is_heated, self.start = self.heats > 0, self.load.modal
        self.all_open = np.zeros(self.contacts, dtype=np.bool_)
        basis, none = self.one.basis, np.zeros((self.contacts, self.modes))
        self.struck = np.hstack([none, self.friction * basis.tangent - basis.normal, self.alpha * basis.heat])
        """Jump of X by an impulse at each contact, ``(contact, N)``."""

        self._motions: dict[tuple[bool, ...], SetMotion] = {}

    @cached_property
    def turn(self) -> Array:
        """The rate of the sources, w' = turn w, of w = [1, cos ψ, sin ψ, …] for all sinusoids."""
        cos = np.arange(1, 1 + 2 * len(self.load.waves), 2)
        turn = np.zeros((1 + 2 * cos.size, 1 + 2 * cos.size))
        turn[cos, cos + 1], turn[cos + 1, cos] = -self.load.waves[:, 0], self.load.waves[:, 0]
        return turn

    @cached_property
    def inputs(self) -> Array:
        """Inputs [g, q, F, d, d', d''] per source, ``(input, source)``."""
        inputs, m = np.zeros((self.load.constant.size, len(self.turn))), self.contacts
        inputs[:, 0], inputs[-3 * m - 1, 2::2] = self.load.constant, self.load.waves[:, 2]
        inputs[-3 * m : -2 * m, 1::2], inputs[-3 * m : -2 * m, 2::2] = self.load.casing.T.swapaxes(0, 1)
        inputs[-2 * m : -m] = inputs[-3 * m : -2 * m] @ self.turn
        inputs[-m:] = inputs[-2 * m : -m] @ self.turn
        return inputs

    def sources(self, t: float) -> Array:
        """Return w at a time, ψ = ω t + φ."""
        angle = self.load.waves[:, 0] * t + self.load.waves[:, 1]
        return np.concatenate([[1.0], np.column_stack([np.cos(angle), np.sin(angle)]).ravel()])

    def motion_in(self, closed: ArrayLike) -> SetMotion:
        """Return the linear motion of a set of closed contacts."""
        key = tuple(np.asarray(closed).tolist())
        if key not in self._motions:
            self._motions[key] = SetMotion(self, np.array(key))
        return self._motions[key]

    @cached_property
    def coupled(self) -> NDArray[np.bool_]:
        """Whether an impulse at one of two contacts jumps velocity or acceleration of the other, or of both."""
        basis, others = self.one.basis, self.struck[:, self.modes : 2 * self.modes]
        C = basis.damping_matrix
        damped = basis.normal * basis.damping if C is None else basis.normal @ C
        pairs = (basis.normal, others), (damped, others), (basis.normal @ basis.coupling, self.alpha * basis.heat)
        acts = [np.abs(a @ b.T) > _ROUNDING * (np.abs(a) @ np.abs(b).T) for a, b in pairs]
        return np.asarray(np.logical_or.reduce([*acts, *(one.T for one in acts)]))

    def parts(self, X: Array) -> tuple[Array, Array, Array]:
        """Return displacements, velocities and temperatures of the structure's coordinates, ``(…, coordinate)``."""
        basis, n = self.one.basis, self.modes
        return X[..., :n] @ basis.shapes.T, X[..., n : 2 * n] @ basis.shapes.T, X[..., 2 * n :] @ basis.heat_shapes.T

    def size(self, X: Array, scale: Array) -> float:
        """Return the norm of a deviation: its largest x, v or θ, each over its scale; inf where it is not finite."""
        size = max(float(np.abs(x).max(initial=0.0)) / most for x, most in zip(self.parts(X), scale, strict=True))
        return size if np.isfinite(X).all() else np.inf

    def growth_by_heat(self, X: Array) -> Array:
        """Return the quasi-static growth of a state at each contact, m, ``(contact,)``."""
        basis = self.one.basis
        return np.asarray(basis.contacts.growth_at_once + basis.growth @ X[2 * self.modes :])

    def warmth(self, X: Array) -> Array:
        """Return the temperature of each contact, K, ``(contact,)``."""
        return np.asarray(self.one.basis.heat @ X[2 * self.modes :])

    def balanced(self, X: Array, force: Array) -> Array:
        """Return a state with temperatures in balance with mean contact forces λ_i [N], μ τ = χᵀq + α Σ χ_i λ_i.

        An adiabatic thermal mode is left unchanged.
        """
        basis, n = self.one.basis, self.modes
        sources = self.load.constant[n : n + self.heats] + self.alpha * force @ basis.heat
        kept = X.copy()
        np.divide(sources, basis.rate, out=kept[2 * n :], where=basis.rate > 0)
        return kept

    @property
    def reach(self) -> float:
        """The length accounted for by clearance, loads, heating and the initial temperatures, m."""
        basis, load, heating = self.one.basis, self.load, slice(self.modes, self.modes + self.heats)
        with np.errstate(divide="ignore", invalid="ignore"):  # of a free root, or heat that cannot leave
            flexibility = np.nansum((basis.normal / basis.frequency) ** 2, axis=1).max()
            growth = np.abs(basis.growth * load.constant[heating] / basis.rate)
        flexibility += basis.contacts.compliance(self.friction).max()
        forces = abs(load.constant[heating.stop]) + np.abs(load.waves[:, 2]).sum()
        warm = np.nansum(growth, axis=1).max() + np.abs(self.growth_by_heat(self.start)).max()
        return float(load.reach + flexibility * forces + warm)

    def march(self, X: Array, closed: NDArray[np.bool_], begin: float, span: float, samples: int = 1) -> Trajectory:
        """Return the exact motion from X at ``begin`` [s] over ``span`` [s], as :func:`trajectory` does."""
        return trajectory(self.one, X, closed, begin, span, samples=samples)

    def derivative(self, motion: Trajectory) -> Array:
        """Return the derivative of a motion's final state with respect to its initial state, ``(N, N)``.

        Where contacts strike at once that act on each other, it is that of motions in which they still do.
        """
        factors = self._propagators(motion)
        D = factors[0]
        for event, factor in enumerate(factors[1:]):
            D = factor @ (self._after_impacts(motion, event, D) if motion.impulses[event].any() else D)
        return np.asarray(D)

    def _propagators(self, motion: Trajectory) -> Array:
        """Return the propagator of each stretch, ``(event + 1, N, N)``."""
        spans, (every, which) = np.diff(motion.ends), np.unique(motion.sets, axis=0, return_inverse=True)
        factors = np.empty((spans.size, self.start.size, self.start.size))
        for k, closed in enumerate(every):
            of_set = which.ravel() == k
            factors[of_set] = propagators(self.one.set_of(closed), spans[of_set])
        return factors

    def _after_impacts(self, motion: Trajectory, event: int, D: Array) -> Array:
        """Return S D of an event with impacts; those that do not act on each other are passed one after another."""
        n, normal, approach, t = self.modes, self.one.basis.normal, motion.approaches[event], motion.times[event]
        before, after, strikes = *motion.sets[event : event + 2], self._strikes(motion)[event]
        X, closed, D, t = motion.states[event], after.copy(), D.copy(), motion.begin + t
        bend = self.inputs[-self.contacts :] @ self.sources(t)
        takes = (motion.impulses[event] > 0) | after
        for part in self._linked(takes | before):
            striking, taking = part[strikes[part]], part[takes[part]]
            if striking.size:
                bounced = np.diag(np.where(after[taking], 1.0, 1.0 + self.e))
                law = self.struck[taking].T @ np.linalg.solve(self.delassus[np.ix_(taking, taking)], bounced)
                late = self._rates(X, t, closed)
                X, closed[part] = X - law @ np.where(strikes, approach, 0.0)[taking], before[part]
                rates = self._rates(X, t, closed)
                late -= rates + law @ (normal[taking] @ rates[n : 2 * n] - bend[taking])
                earlier = (normal[striking] / approach[striking, None]).mean(axis=0) @ D[:n]
                D += law @ (normal[taking] @ D[n : 2 * n]) + np.outer(late, earlier)
        return D

    def corner(self, motion: Trajectory) -> NDArray[np.intp]:
        """Return contacts that strike at the same instant and act on each other, where DP has a jump; none else."""
        strikes, involved = self._strikes(motion), (motion.impulses > 0) | motion.sets[:-1] | motion.sets[1:]
        for event in np.flatnonzero(strikes.any(axis=1)) if self.contacts > 1 else ():
            near = np.abs(motion.times - motion.times[event]) <= _SAME_INSTANT * motion.span
            for part in self._linked(involved[near].any(axis=0)):
                striking = part[strikes[near][:, part].any(axis=0)]
                if striking.size > 1:
                    return np.asarray(striking)
        return np.zeros(0, dtype=np.intp)

    def _strikes(self, motion: Trajectory) -> NDArray[np.bool_]:
        """Return which contacts end a flight by an impact, ``(event, contact)``."""
        return np.asarray((motion.impulses > 0) & (motion.approaches > 0) & ~motion.sets[:-1])

    def _linked(self, some: NDArray[np.bool_]) -> list[NDArray[np.intp]]:
        """Return some contacts in parts that do not act on each other."""
        which = np.flatnonzero(some)
        return [which[part] for part in connected_parts(self.coupled[np.ix_(which, which)])]

    @cached_property
    def delassus(self) -> Array:
        """W, ``(contact, contact)``, 1/kg."""
        basis = self.one.basis
        return np.asarray(basis.normal @ (basis.normal - self.friction * basis.tangent).T)

    def _rates(self, X: Array, t: float, closed: NDArray[np.bool_]) -> Array:
        """Return X' of a state with contacts with mass closed, ``(N,)``."""
        own, w, S = self.motion_in(self.all_open), self.sources(t), np.flatnonzero(closed)
        rates = own.A @ X + own.B @ w
        excess = self.one.basis.normal[S] @ rates[self.modes : 2 * self.modes] - (self.inputs[-self.contacts :] @ w)[S]
        return np.asarray(rates + np.linalg.solve(self.delassus[np.ix_(S, S)], excess) @ self.struck[S])

    def place_of(self, contact: int, t: Array) -> Array:
        """Return the place of the casing at a contact, m, ``(time,)``."""
        row = self.inputs[contact - 3 * self.contacts]
        return np.array([row @ self.sources(each) for each in t.tolist()])


class SetMotion:
    """The linear motion of a set of closed contacts, Z' = A Z + B w, and its transforms from and to X."""

    def __init__(self, flow: Flow, closed: NDArray[np.bool_]):
        self.flow, system, m = flow, flow.one.system(closed), flow.contacts
        self.A, self.B = system.A, system.B @ flow.inputs
        self.signals, self.signal_inputs = system.signals, system.inputs @ flow.inputs
        self.leave = block_diagonal(system.null, system.null, np.eye(flow.heats))
        follows = [system.place.T @ flow.inputs[rows] for rows in (slice(-3 * m, -2 * m), slice(-2 * m, -m))]
        self.place = np.vstack([*follows, np.zeros((flow.heats, len(flow.turn)))])
        self._known: dict[float, tuple[Array, Array]] = {}

    @cached_property
    def _balanced(self) -> tuple[Array, Array]:
        """The matrix of [Z, w], balanced, and the scales of that."""
        turn = self.flow.turn
        whole = np.block([[self.A, self.B], [np.zeros((len(turn), len(self.A))), turn]])
        balanced, (scale, _) = matrix_balance(whole, permute=False, separate=True)
        return balanced, scale

    def over(self, span: float) -> tuple[Array, Array]:
        """Return Z after a time per Z before and per w before."""
        if span not in self._known:
            if len(self._known) == _MOST_SPANS:
                self._known.clear()
            (balanced, scale), size = self._balanced, len(self.A)
            moved = scale[:size, None] * expm(balanced * span)[:size] / scale
            self._known[span] = moved[:, :size], moved[:, size:]
        return self._known[span]

    def steady(self) -> tuple[Array, Array]:
        """Return X and the gaps or contact forces ``(contact,)`` of the steady response at t = 0.

        Raises
        ------
        numpy.linalg.LinAlgError
            There is none: a pole is that of a load.
        """
        Z, w = np.linalg.solve(-self.A, self.B[:, 0]), self.flow.sources(0.0)
        for (omega, phase, _, _), cos, sin in zip(self.flow.load.waves, self.B.T[1::2], self.B.T[2::2], strict=True):
            Z += np.linalg.solve(1j * omega * np.eye(Z.size) - self.A, (cos - 1j * sin) * np.exp(1j * phase)).real
        return self.leave @ Z + self.place @ w, self.signals @ Z + self.signal_inputs @ w
