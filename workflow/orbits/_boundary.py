"""Boundaries over two parameters: curves of folds, doublings, tori and grazings of periodic rubs.

An orbit at u = (w, times) fulfils F(u, q₁, q₂) = 0, and a multiplier is ρ where b is 0 in the bordered system

    [∂F/∂u + (1 - ρ) E   l] [φ]   [0]
    [        rᵀ          0] [b] = [1],     ρ = 1 fold, -1 doubling, exp(iθ) torus, E = 1 for w alone;

at a grazing the approach speed of an impact of the word is 0. Both are smooth where approach speeds are 0 or negative:
whether an orbit is a motion is asked of one exact period at each point.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, newton

from workflow.kernels.algebra import eigenvalues
from workflow.models import Array, Cases, Structure, one_thread
from workflow.orbits._branch import (
    FOLD,
    GRAZING,
    NONE,
    PERIOD_DOUBLING,
    TORUS,
    Followed,
    Place,
    order_of_events,
    spread,
)
from workflow.orbits._curve import Curve, Residual, section_beside, turned
from workflow.orbits._orbit import has_converged
from workflow.orbits._shooting import shoot

Pair = Callable[[float, float], tuple[Structure, Cases]]
"""Structure and one case at values of the branched parameter and of another number."""

ENDS = ("none", "range", "grazing", "resonance", "corner", "not_followed")
"""Names of the values of ``boundary_end``: why a curve ends, at the end that is no range where there is one."""

_RANGE, _GRAZES, _RESONANCE, _CORNER, _NOT_FOLLOWED = range(1, 6)

MOST_CURVES = 8
"""Number of curves that are stored."""

_DIFFERENCE = 1e-7
"""Step of finite differences, which only the path of Newton's method depends on."""

_MOST, _MOST_STEPS = 20, 500
"""Largest numbers of Newton steps with one matrix, and of steps along a curve."""

_FIRST, _LARGEST, _LEAST, _TURN = 1e-2, 0.05, 1e-7, 0.03
"""First step, the largest of both numbers, the least one, and the largest turn in one, 1 less its cosine."""

_REAL = 1e-4
"""Sine of the angle of a torus beside ±1: the steps before become less than the least where they are 1e-5."""

_SAME = 1e-6
"""Distance of q₁ of two bifurcations, of one kind at one end of q₂, that are the same."""

_TURNS = 1e-6
"""Slope of the other number along a boundary below which the boundary turns there."""


@dataclass(frozen=True, eq=False)
class Boundaries:
    """Curves, first those of ``from`` along its branch; rows behind the last have kind and end ``none`` and NaN."""

    kind: NDArray[np.int8]
    """Index in ``BIFURCATIONS``, ``(curve,)``."""
    branched: Array
    """Values of the branched parameter at equal arclength, ``(curve, point)``."""
    other_parameter: Array
    """… and of the other one."""
    angle: Array
    """Angle of the multiplier of the condition, rad; NaN of a grazing, ``(curve, point)``."""
    other: Array
    """Largest modulus of all other multipliers, ``(curve, point)``."""
    end: NDArray[np.int8]
    """Index in :data:`ENDS`, ``(curve,)``."""


class Number(NamedTuple):
    """A number of a scene: cases at values of the branched parameter and of it, its value and a change of it."""

    problem: Pair
    value: float
    change: float


class _Solved(NamedTuple):
    """An orbit at U = (w, times, [θ], q₁, q₂), and the values of all conditions of a boundary."""

    U: Array
    residual: Residual
    values: Array


class _Spot(NamedTuple):
    """An orbit on a boundary."""

    U: Array
    residual: Residual
    slopes: Array
    """Derivatives of all conditions, ``(unknown - 1, unknown)``."""
    grazing: int | None
    """Event that grazes."""
    borders: tuple[Array, Array] | None
    """l and r of its slopes."""
    tangent: Array
    row: Array
    arclength: float = 0.0


class _Boundary:
    """The orbits of one word at which a condition holds, over fractions of the ranges of two numbers."""

    def __init__(self, curve: Curve, problem: Pair, low: float, high: float, place: Place, q2: float):
        self.curve, self.problem, self.low, self.high = copy(curve), problem, low, high
        point, self.kind, self.grazing = place.point, place.flag, None
        self.frame, self.w = point.frame, point.w
        self.angles = np.zeros(0)
        if self.kind == TORUS:
            multipliers = point.orbit.multipliers
            beside = np.where(multipliers.imag > 0, np.abs(np.abs(multipliers) - 1), np.inf)
            self.angles = np.angle(multipliers[[np.argmin(beside)]])
        if self.kind == GRAZING:
            self.grazing = int(np.argmin(np.abs(point.residual.approach)))
        self.start = np.concatenate([self.w, point.times, self.angles, [point.q, q2]])
        self.events = point.times.size
        self.borders: tuple[Array, Array] | None = None
        self.order, self.other = order_of_events(point.orbit), np.nan

    def set_other(self, q2: float) -> None:
        """Set the other number of the curve's problem."""
        other = self.low + q2 * (self.high - self.low)
        if other != self.other:
            self.other, self.curve.problem = other, lambda value: self.problem(value, other)

    def residual(self, U: Array) -> Residual | None:
        """Return the residual of the orbit; ``None`` where there is none."""
        self.set_other(U[-1])
        return self.curve.residual_at(np.append(U[: self.w.size + self.events], U[-2]), self.frame)

    def condition(self, residual: Residual, U: Array) -> Array:
        """Return b, of a torus its real part and its imaginary part over sin θ."""
        if self.grazing is not None:
            assert self.curve.scale is not None
            return np.array([residual.approach[self.grazing] / self.curve.scale[1]])
        rho = {FOLD: 1.0, PERIOD_DOUBLING: -1.0}.get(self.kind) or np.exp(1j * U[-3])
        matrix = residual.matrix + (1 - rho) * np.diag(np.arange(len(residual.matrix)) < self.w.size)
        if self.borders is None:
            left, _, right = np.linalg.svd(matrix)
            self.borders = _real(left[:, -1]), _real(right[-1].conj())
        size = len(matrix)
        whole = np.zeros((size + 1, size + 1), dtype=matrix.dtype)
        whole[:size, :size], whole[:size, size], whole[size, :size] = matrix, *self.borders
        b = np.linalg.solve(whole, np.eye(size + 1)[size])[size]
        return np.array([b.real, b.imag / np.sin(U[-3])]) if self.kind == TORUS else np.array([b])

    def values(self, U: Array, known: Residual | None = None) -> _Solved | None:
        """Return the values of all conditions, of a residual that is ``known``; ``None`` where there is no orbit."""
        residual = known or self.residual(U)
        if residual is None:
            return None
        return _Solved(U, residual, np.concatenate([residual.values, self.condition(residual, U)]))

    def slopes(self, found: _Solved) -> Array | None:
        """Return the derivatives of all conditions by differences, of q₁ and q₂ to the inside of their ranges."""
        U, columns = found.U, []
        for k in range(U.size):
            inside = np.copysign(_DIFFERENCE, 0.5 - U[k]) if k >= U.size - 2 else _DIFFERENCE
            beside = self.values(U + inside * (np.arange(U.size) == k))
            if beside is None:
                return None
            columns.append((beside.values - found.values) / inside)
        return np.array(columns).T

    def solve(self, guess: Array, row: Array, slopes: Array | None = None) -> _Solved | None:
        """Return the orbit in the plane through a guess across a row.

        Newton steps have one matrix, of the guess where none is given.
        """
        U, last = guess.copy(), np.inf
        for _ in range(_MOST):
            found = self.values(U)
            if found is None:
                return None
            size = max(float(np.abs(found.values).max()), abs(float(row @ (U - guess))))
            if has_converged(size, last):
                return found
            if not size < 10 * last:
                return None
            slopes = self.slopes(found) if slopes is None else slopes
            if slopes is None:
                return None
            try:
                U = U - np.linalg.solve(np.vstack([slopes, row]), np.append(found.values, row @ (U - guess)))
            except np.linalg.LinAlgError:
                return None
            last = min(size, last)
            if not np.abs((U - guess)[-2:]).max() < 1:
                return None
        return None

    def spot(self, found: _Solved | None, along: Array, arclength: float = 0.0) -> _Spot | None:
        """Return an orbit with the tangent of the boundary in the direction of a row, and new borders."""
        if found is None:
            return None
        U, residual, self.borders = found.U, found.residual, None
        bordered = self.values(U, residual)
        slopes = None if bordered is None else self.slopes(bordered)
        if slopes is None:
            return None
        try:
            tangent = np.linalg.solve(np.vstack([slopes, along]), np.append(np.zeros(U.size - 1), 1.0))
        except np.linalg.LinAlgError:
            return None
        row, n = tangent.copy(), residual.flow.modes
        row[n : 2 * n] = row[self.w.size : -2] = 0.0
        length = np.sqrt(row @ tangent)
        own = slopes, self.grazing, self.borders
        return _Spot(U, residual, *own, tangent / length, row / length, arclength)

    def step(self, here: _Spot, length: float) -> _Solved | None:
        """Return the orbit at a length along the tangent, in the plane across it."""
        return self.beside(here, here.U + length * here.tangent, here.row)

    def beside(self, here: _Spot, guess: Array, row: Array) -> _Solved | None:
        """Return the orbit in the plane through a guess across a row."""
        self.frame, self.grazing, self.borders = here.residual.frame, here.grazing, here.borders
        return self.solve(guess, row, here.slopes)

    def follow(self) -> tuple[list[_Spot], int]:
        """Return the boundary from its start to its end, and why it ends there."""
        inward = 1.0 if self.start[-1] < 0.5 else -1.0
        across = np.eye(self.start.size)[-1]
        first = self.solve(self.start, across)
        here = self.spot(first, inward * across)
        if first is None or here is None or not self.is_motion(first):
            return [], _NOT_FOLLOWED
        trail, step = [here], _FIRST
        while len(trail) < _MOST_STEPS and step > _LEAST:
            guess, row = here.U + step * here.tangent, here.row
            late = [k for k in (-2, -1) if not 0.0 <= guess[k] <= 1.0]
            if late:
                shares = [(float(guess[k] > 0.5) - here.U[k]) / here.tangent[k] for k in late]
                bound = late[int(np.argmin(shares))]
                guess, row = here.U + min(shares) * here.tangent, np.eye(guess.size)[bound]
                guess[bound] = round(guess[bound])
            found = self.beside(here, guess, row)
            if found is None or found.U[-2:].min() < -_SAME or found.U[-2:].max() > 1 + _SAME:
                step /= 2
                continue
            length = float(here.row @ (found.U - here.U))
            if not self.is_motion(found):
                last, end = self.ending(here, found, length)
                return trail + ([last] if last else []), end
            ahead = self.spot(found, here.row, here.arclength + length)
            if ahead is None or not 1 - float(here.row @ ahead.tangent) < _TURN:
                step /= 2
                continue
            trail.append(ahead)
            if late:
                return trail, _RANGE
            here, step = self.rephased(ahead), min(1.5 * step, _LARGEST / float(np.linalg.norm(ahead.tangent[-2:])))
            trail[-1] = here
        is_real = self.kind == TORUS and abs(np.sin(here.U[-3])) < _REAL  # where θ and -θ meet slopes are singular
        return trail, _RESONANCE if is_real else _NOT_FOLLOWED

    def rephased(self, spot: _Spot) -> _Spot:
        """Return an orbit with its section moved to the middle of its longest stretch, if an event is near."""
        at, frame = self.w.size + self.events, spot.residual.frame
        times = spot.U[self.w.size : at]
        later = section_beside(times)
        if frame.word is None or later is None:
            return spot
        i, ahead = int(np.sum(times <= later)), np.zeros(spot.U.size)
        ahead[-2:] = spot.tangent[-2:]
        self.set_other(spot.U[-1])
        moved = self.curve.carried(frame, np.append(spot.U[:at], spot.U[-2]), i, later)
        self.frame = turned(frame, i, later, frame.was_closed)
        self.grazing = None if spot.grazing is None else (spot.grazing - i) % self.events
        return self.spot(self.values(np.concatenate([moved[:-1], spot.U[at:]])), ahead, spot.arclength) or spot

    def is_motion(self, found: _Solved) -> bool:
        """Tell whether the exact motion over kT is the orbit, and a complex multiplier is one."""
        if self.kind == TORUS and not 0 < found.U[-3] < np.pi:
            return False
        orbit, shot = found.residual.orbit, found.residual.shot
        if shot is not None:
            return shot.is_motion(orbit.motion, self.grazing)
        return orbit.flow.structure.contacts.is_compliant or order_of_events(orbit) == self.order

    def ending(self, here: _Spot, beyond: _Solved, length: float) -> tuple[_Spot | None, int]:
        """Return the last orbit before one that is no motion, and why the boundary ends there."""
        measure: Callable[[_Solved], float]
        shot, known = beyond.residual.shot, dict[float, _Solved]()
        if self.kind == TORUS and not 0 < beyond.U[-3] < np.pi:
            end, measure = _RESONANCE, lambda each: min(each.U[-3], np.pi - each.U[-3])
        elif shot is None:
            return None, _NOT_FOLLOWED
        elif np.any(meet := (np.diff(shot.times) <= 0) & (np.diff(shot.word.contact) != 0)):
            times = slice(self.w.size, self.w.size + self.events)
            end, measure = _CORNER, lambda each: float(np.diff(each.U[times])[meet].min())
        elif shot.slowest(self.grazing) <= 0:
            end, measure = _GRAZES, lambda each: each.residual.shot.slowest(self.grazing)  # type: ignore[union-attr]
        else:
            new = shot.new_impact(beyond.residual.orbit.motion)
            if new is None:
                return None, _NOT_FOLLOWED
            stretch, contact, time = new

            def least_gap(each: _Solved) -> float:
                """Return the gap where its rate is 0, near the time of the impact beyond."""
                own = each.residual.shot
                assert own is not None
                at = float(newton(lambda share: own.flight(share, stretch, contact)[1], time, tol=1e-12))
                return own.flight(at, stretch, contact)[0]

            end, measure = _GRAZES, least_gap

        def value(s: float) -> float:
            found = self.step(here, s)
            if found is not None:
                known[s] = found
            return np.nan if found is None else float(measure(found))

        try:
            at = float(brentq(value, 0.0, length, xtol=1e-13, rtol=1e-14))
        except (ValueError, RuntimeError):
            return None, _NOT_FOLLOWED
        return self.spot(known.get(at) or self.step(here, at), here.row, here.arclength + at), end

    def spread(self, trail: list[_Spot], count: int) -> list[_Spot]:
        """Return orbits at equal arclength of both numbers, the first and the last of the trail among them.

        It is that of chords between the orbits that were followed and, in the end, those that are found.
        """
        found = trail[1:-1]
        for _ in range(2):
            known = sorted([trail[0], *found, trail[-1]], key=lambda spot: spot.arclength)
            chords = [float(np.linalg.norm(b.U[-2:] - a.U[-2:])) for a, b in pairwise(known)]
            along, found = np.cumsum([0.0, *chords]), []
            lengths = np.linspace(0.0, along[-1], count)[1:-1]
            for arclength in np.interp(lengths, along, [spot.arclength for spot in known]).tolist():
                near = min(trail, key=lambda spot: abs(spot.arclength - arclength))
                between = self.step(near, arclength - near.arclength)
                if between is not None and self.is_motion(between):
                    found.append(near._replace(U=between.U, residual=between.residual, arclength=arclength))
        return [trail[0], *found, trail[-1]]

    def multipliers(self, spot: _Spot) -> tuple[float, float]:
        """Return the angle of the multiplier of the condition and the largest modulus of the others."""
        shot = spot.residual.shot
        if spot.grazing is not None and shot is not None:
            word, times = shot.word.without(spot.grazing), np.delete(shot.times, spot.grazing)
            shot = shoot(shot.flow, word, shot.states[0], shot.begin, shot.span, times)
            return np.nan, float(np.abs(eigenvalues(shot.derivative)).max(initial=0.0))
        values = eigenvalues(spot.residual.orbit.D)
        angle = {FOLD: 0.0, PERIOD_DOUBLING: np.pi}.get(self.kind, float(spot.U[-3]) if self.kind == TORUS else 0.0)
        for own in {angle, -angle} if self.kind == TORUS else {angle}:
            values = np.delete(values, np.argmin(np.abs(values - np.exp(1j * own))))
        return angle, float(np.abs(values).max(initial=0.0))


def _real(vector: NDArray[np.complex128] | Array) -> Array:
    """Return the larger real part of a vector turned in its plane, of length 1."""
    turned = np.real(vector * np.exp(-0.5j * np.angle(np.sum(vector**2))))
    return np.asarray(turned / np.linalg.norm(turned))


def _starts(followed: Followed) -> list[Place]:
    """Return the bifurcations of a branch that are followed, in its order; grazings with the word of the impact."""
    trace, found = followed.trace, []
    for k, place in enumerate(trace):
        if place.flag == GRAZING:
            beside = [each for each in trace[max(0, k - 1) : k + 2] if each.point.arclength == place.arclength]
            more = max(beside, key=lambda each: each.point.times.size)
            found.append(Place(more.point, GRAZING) if more is not place else place._replace(flag=-GRAZING))
        elif place.flag in (FOLD, PERIOD_DOUBLING, TORUS):
            found.append(place)
    return found


def boundaries(
    problem: Pair, first: Followed, last: Followed, low: float, high: float, count: int
) -> tuple[Boundaries, str]:
    """Return the boundaries through the bifurcations of two branches, at the other parameter's ``low`` and ``high``.

    ``first`` and ``last`` are the branches there, followed over the same range, ``heated`` where heat acts in either.
    The message is '' or says what is not stored or not followed.
    """
    rows, reached = np.full((4, MOST_CURVES, count), np.nan), list[tuple[int, Array]]()
    kinds, ends = np.zeros((2, MOST_CURVES), dtype=np.int8)
    stored, left, said = 0, 0, list[str]()
    for curve, place, q2 in [(one.curve, place, q2) for q2, one in enumerate((first, last)) for place in _starts(one)]:
        if any(_is_end(place.flag, place.point.q, q2, *each) for each in reached):
            continue
        if stored == MOST_CURVES:
            left += 1
            continue
        kinds[stored], ends[stored], trail = abs(place.flag), _NOT_FOLLOWED, list[_Spot]()
        q = np.array([[place.point.q, q2]])
        if place.flag > NONE:
            with one_thread():  # matrices are small
                boundary = _Boundary(curve, problem, low, high, place, q2)
                trail, ends[stored] = boundary.follow()
                spots = boundary.spread(trail, count) if len(trail) > 1 else []
                rows[2:, stored, : len(spots)] = np.reshape([boundary.multipliers(spot) for spot in spots], (-1, 2)).T
            q = np.array([spot.U[-2:] for spot in spots]) if spots else q
            reached += [(place.flag, trail[-1].U)] if trail else []
        rows[:2, stored, : len(q)] = curve.start + q[:, 0] * (curve.stop - curve.start), low + q[:, 1] * (high - low)
        if ends[stored] == _NOT_FOLLOWED:
            begins = "the branch has no motion with its impact" if place.flag < NONE else "its start is no motion"
            why = "no motion is found beyond its last point" if trail else begins
            why = f"{_MOST_STEPS} steps do not reach its end" if len(trail) == _MOST_STEPS else why
            said.append(f"boundary {stored + 1} is not followed: {why}")
        stored += 1
    said += [f"{left} more boundaries are not stored"] * bool(left)
    return Boundaries(kinds, rows[0], rows[1], rows[2], rows[3], ends), "; ".join(said)


def _is_end(flag: int, q1: float, q2: float, kind: int, U: Array) -> bool:
    """Tell whether a bifurcation is the end of a boundary of a kind."""
    return flag == kind and abs(q1 - U[-2]) < _SAME and abs(q2 - U[-1]) < _SAME


def bifurcation_shifts(followed: Followed, points: int, numbers: Sequence[Number]) -> Array:
    """Return by how much bifurcations move with each number, ``(point, number)``, points as of ``tabulate``.

    First order: ∂(value)/∂q times the change. Infinite where the boundary turns, NaN at points without a bifurcation
    or whose boundary is not found.
    """
    shifts, curve = np.full((points, len(numbers)), np.nan), followed.curve
    places, starts = spread(followed, points)[0], _starts(followed)
    for i, place in enumerate(places):
        start = next((each for each in starts if place.flag and each.point.arclength == place.arclength), None)
        for j, number in enumerate(numbers) if start is not None and start.flag > NONE else ():
            assert start is not None
            with one_thread():
                shifts[i, j] = number.change * _derivative(curve, number, start)
    return shifts


def _derivative(curve: Curve, number: Number, place: Place) -> float:
    """Return ∂(value of a bifurcation)/∂q by differences of fourth order; infinite where the boundary turns."""
    unit = 0.01 * max(abs(number.value), abs(number.change))
    boundary = _Boundary(curve, number.problem, number.value, number.value + unit, place, 0.0)
    *_, along, across = np.eye(boundary.start.size)
    here = boundary.spot(boundary.solve(boundary.start, across), along)
    if here is None:
        return np.nan
    if abs(here.tangent[-1]) < _TURNS * abs(here.tangent[-2]):
        return np.inf
    moved = []
    for h in (0.1, -0.1, 0.2, -0.2):
        guess = here.U + h / here.tangent[-1] * here.tangent
        found = boundary.beside(here, guess, across)
        if found is None:
            return np.nan
        moved.append(found.U[-2])
    slope = (8 * (moved[0] - moved[1]) - (moved[2] - moved[3])) / 1.2
    return float(slope * (curve.stop - curve.start) / unit)
