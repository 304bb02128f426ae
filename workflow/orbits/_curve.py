"""A curve of periodic rubs u = (w, times, q): w the scaled state at a phase of the period, q the fraction of a range.

Of contacts with mass the times of events are unknowns (:mod:`workflow.orbits._shooting`), in fractions of kT; where
bounces are too low, and of contacts without jumps, the events are those of the map over kT and u = (w, q).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels.algebra import block_diagonal
from workflow.models import Array, Cases, Structure
from workflow.orbits._flow import Flow, analysed
from workflow.orbits._orbit import Orbit, has_converged
from workflow.orbits._shooting import LEAVES, Shot, Word, shoot, tells_apart, word_of
from workflow.schemes.event_driven import ExactOperator, Trajectory

Problem = Callable[[float], tuple[Structure, Cases]]
"""Structure and one case at a value of the parameter."""

_DIFFERENCE, _SMOOTH = 1e-10, 1e-7
"""Step of finite differences with respect to q, of the map and of motions with given events."""

_MOST = 12
"""Largest number of Newton steps to a point."""

_NEAR_EVENT = 0.1
"""Distance of an event from the phase of w, over the longest flight or contact, below which another phase is chosen."""

_LEAST_GAP, _WIDEST_GAP = 1e-14, 1e-10
"""First and largest step from a grazing to where rounding leaves no impact."""


class Frame(NamedTuple):
    """What is the same for the points of a piece of the curve."""

    word: Word | None
    phase: float
    """Phase of the Poincaré section of w, over T."""
    order: int
    was_closed: NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Residual:
    """Residual of the conditions of an orbit at u, their derivatives per (w, times), and approach speeds."""

    u: Array
    """State, times of the events of the word after the phase of w, over kT, and fraction of the range."""
    frame: Frame
    flow: Flow
    values: Array
    matrix: Array
    approach: Array
    """Approach speeds at the events of the word, m/s."""
    approach_slope: Array
    shot: Shot | None = None
    mapped: tuple[Trajectory, Array] | None = None
    """Without a word: the exact motion over kT, and the derivative of its end."""

    @cached_property
    def orbit(self) -> Orbit:
        """The exact motion over kT, and the derivative of X(kT) per X(0)."""
        if self.mapped is None:
            assert self.shot is not None
            X, begin, span = self.shot.states[0], self.shot.begin, self.shot.span
            motion, D = self.flow.march(X, self.frame.was_closed, begin, span), self.shot.derivative
        else:
            motion, D = self.mapped
        error = np.abs(self.values[: self.flow.start.size]).max()
        return Orbit(self.flow, self.frame.order, motion, D, float(error))


@dataclass(frozen=True, eq=False)
class Point:
    """A periodic rub on the curve."""

    residual: Residual
    tangent: Array
    """Tangent of the curve of u, of length 1 …"""
    row: Array
    """… in the scalar product with this row, without velocities and times, which vibrations after an impact change."""
    regular: float
    """Determinant of the curve's conditions and the row: 0 where another curve crosses."""
    arclength: float = 0.0
    """Arclength."""

    @property
    def u(self) -> Array:
        """State, times and fraction of the range."""
        return self.residual.u

    @property
    def w(self) -> Array:
        """Scaled state."""
        return self.u[: self.residual.flow.start.size]

    @property
    def times(self) -> Array:
        """Times of the events of the word after the phase of w, over kT."""
        return self.u[self.w.size : -1]

    @property
    def q(self) -> float:
        """Fraction of the range."""
        return float(self.u[-1])

    @property
    def frame(self) -> Frame:
        """Its word and the section of w."""
        return self.residual.frame

    @property
    def orbit(self) -> Orbit:
        """The rub."""
        return self.residual.orbit

    @property
    def is_motion(self) -> bool:
        """Whether the exact motion has the events of the word, with approach speeds above 0."""
        shot = self.residual.shot
        return shot is None or shot.is_motion(self.orbit.motion)

    def distance(self, u: Array) -> float:
        """Return the length of the chord to another u, without velocities and times."""
        away, n = u - self.u, self.residual.flow.modes
        away[n : 2 * n] = away[self.w.size : -1] = 0.0
        return float(np.linalg.norm(away))


class Curve:
    """The periodic rubs of one order of a problem over a range."""

    def __init__(self, problem: Problem, start: float, stop: float, heated: bool):
        self.problem, self.start, self.stop = problem, start, stop
        self.scale: Array | None = None
        self.first: Structure | None = None
        self.shared: ExactOperator | None = None
        self.known: tuple[tuple[Problem, float], Flow] | None = None
        self.charts: tuple[Structure, Array, Array] | None = None
        self.heated = heated or any(problem(self.value(q))[1].heated.any() for q in (0.0, 0.5, 1.0))

    def value(self, q: float) -> float:
        """Return the value of the parameter at q."""
        return self.start + q * (self.stop - self.start)

    def flow(self, q: float) -> Flow:
        """Return the case at q; cases of one structure share its operator."""
        at = self.problem, self.value(q)
        if self.known is None or self.known[0] != at:
            structure, cases = self.problem(at[1])
            if self.shared is None or structure is not self.shared.structure:
                self.shared = analysed(structure)
            self.known = at, Flow(self.shared, cases, heated=self.heated)
        return self.known[1]

    def begin(self, orbit: Orbit, scale: Array, q: float) -> Point | None:
        """Return an orbit as the first point of the curve, with a tangent towards larger q."""
        self.scale, self.first = scale, orbit.flow.structure
        guess = np.append(self._charts(orbit.flow)[0] @ orbit.motion.start, q)
        frame = Frame(None, orbit.motion.begin / orbit.flow.period, orbit.order, orbit.motion.was_closed)
        found = self._newton(frame, guess, np.eye(guess.size)[-1])
        return found and self.worded(found)

    def step(self, point: Point, length: float) -> Point | None:
        """Return the point at a length along the tangent, in the plane across it; ``None`` where none is found."""
        found = self._newton(point.frame, point.u + length * point.tangent, point.row)
        return found and replace(found, arclength=point.arclength + length)

    def at(self, point: Point, q: float) -> Point | None:
        """Return the point at a fraction of the range near one, on whose curve it has the same direction."""
        guess = np.append(point.u[:-1], q)
        found = self._newton(point.frame, guess, np.copysign(1.0, point.tangent[-1]) * np.eye(guess.size)[-1])
        return found and replace(found, arclength=point.arclength + float(point.row @ (found.u - point.u)))

    def worded(self, point: Point) -> Point:
        """Return a point of the map with the times of its events as unknowns, where these tell the events apart."""
        flow, motion = point.orbit.flow, point.orbit.motion
        if point.frame.word is not None or flow.structure.contacts.is_compliant or flow.is_constant:
            return point
        word = word_of(motion) if tells_apart(motion) else None
        if word is None:
            return point
        guess = np.concatenate([point.w, motion.times / motion.span, [point.q]])
        row = np.concatenate([point.row[:-1], np.zeros(motion.times.size), point.row[-1:]])
        found = self._newton(point.frame._replace(word=word), guess, row)
        return point if found is None or not found.is_motion else replace(found, arclength=point.arclength)

    def unworded(self, point: Point) -> Point | None:
        """Return a point as one of the map; ``None`` where its motion does not repeat."""
        residual = self._mapped(np.append(point.w, point.q), point.frame._replace(word=None))
        found = None if residual is None else self._point(residual, point.row[np.r_[: point.w.size, -1]])
        return found and replace(found, arclength=point.arclength)

    def grazing(self, here: Point, beyond: Point) -> tuple[Point, Point] | None:
        """Return the place between two points of a word at which an impact begins or ends, with both words.

        The first has the word of the points. The other, whose tangent points to where it is a motion, has an impact
        less or more. ``beyond`` is no motion. ``None`` where none is found.
        """
        word, before, after = here.frame.word, here.residual.approach, beyond.residual.approach
        assert word is not None
        late = [i for i, kind in enumerate(word.kind) if kind != LEAVES and after[i] <= 0 < before[i]]
        if late:
            shares = {i: before[i] / (before[i] - after[i]) for i in late}
            i = min(shares, key=lambda each: shares[each])
            more = self._newton(here.frame, here.u + shares[i] * (beyond.u - here.u), here.row, i)
            less = more and self._without(more, i)
            return (more, less) if more is not None and less is not None else None
        assert beyond.residual.shot is not None
        assert here.residual.shot is not None
        new = beyond.residual.shot.new_impact(beyond.orbit.motion)
        if new is None:
            return None
        i, contact, time = new
        deep, above = (shot.flight(time, i, contact)[0] for shot in (beyond.residual.shot, here.residual.shot))
        guess = here.u + above / (above - deep) * (beyond.u - here.u)
        at = here.w.size + i
        frame = here.frame._replace(word=word.with_impact(i, contact))
        more = self._newton(frame, np.insert(guess, at, time), np.insert(here.row, at, 0.0), i)
        less = more and self._without(more, i)
        if more is None or less is None:
            return None
        along = self._approach(more.residual, i)[1]
        ahead = self._point(more.residual, along / np.linalg.norm(along))
        back = self._point(less.residual, here.row)
        return None if ahead is None or back is None else (back, ahead)

    def _approach(self, residual: Residual, i: int) -> tuple[float, Array]:
        """Return the approach speed at event ``i``, over the motion's, and its derivatives per u."""
        assert self.scale is not None
        slopes = np.append(residual.approach_slope[i], self._slopes(residual)[1][i])
        return residual.approach[i] / self.scale[1], slopes / self.scale[1]

    def _without(self, point: Point, i: int) -> Point | None:
        """Return the point without the impact of a grazing, with a tangent along which its gap opens."""
        assert point.frame.word is not None
        at, frame = point.w.size + i, point.frame._replace(word=point.frame.word.without(i))
        opens = np.append(point.residual.matrix[at], self._slopes(point.residual)[0][at])
        guess, opens = np.delete(point.u, at), np.delete(opens, at)
        found = self._newton(frame, guess, np.eye(guess.size)[-1], along=opens / np.linalg.norm(opens))
        beside = _LEAST_GAP
        while found is not None and not found.is_motion and beside < _WIDEST_GAP:
            found, beside = self.step(found, beside), 4 * beside
        return found

    def _newton(
        self, frame: Frame, guess: Array, across: Array, grazing: int | None = None, along: Array | None = None
    ) -> Point | None:
        """Return the point in the plane through a guess across a row, or where the event ``grazing`` has no approach.

        Its tangent has the direction of the row, or of the one ``along``.
        """
        u, last, along = guess.copy(), np.inf, across if along is None else along
        for _ in range(_MOST):
            residual = self.residual_at(u, frame)
            if residual is None:
                return None
            value, row = float(across @ (u - guess)), across
            if grazing is not None:
                value, row = self._approach(residual, grazing)
            size = max(float(np.abs(residual.values).max()), abs(value))
            if has_converged(size, last):
                return self._point(residual, along)
            slope = self._slopes(residual)[0]
            matrix = np.vstack([np.column_stack([residual.matrix, slope]), row])
            try:
                aim = u - np.linalg.solve(matrix, np.append(residual.values, value))
            except np.linalg.LinAlgError:
                return None
            if not (np.abs((aim - guess)[along != 0]).max() < 1 and abs(aim[-1] - 0.5) < 0.5 + _DIFFERENCE):
                return None
            aim[-1] = min(max(aim[-1], 0.0), 1.0)
            u, last = aim, size
        return None

    def halved(self, point: Point) -> Point | None:
        """Return the rub of half the order in the middle of a rub whose halves are nearly alike."""
        whole = self.unworded(point)
        if whole is None:
            return None
        frame, w = whole.frame._replace(order=whole.frame.order // 2), point.w + 0.5 * self.between_halves(point)
        half = replace(whole.residual, u=np.append(w, point.q), frame=frame)
        return self.at(replace(whole, residual=half), point.q)

    def between_halves(self, point: Point) -> Array:
        """Return the change of w over a half of a rub's period."""
        motion, flow = point.orbit.motion, point.orbit.flow
        middle = flow.march(motion.start, motion.was_closed, motion.begin, 0.5 * motion.span)
        return np.asarray(self._charts(flow)[0] @ middle.X - point.w)

    def residual_at(self, u: Array, frame: Frame) -> Residual | None:
        """Return the residual at u; ``None`` where the motion does not repeat, or has no finite derivative."""
        return self._mapped(u, frame) if frame.word is None else self._shot(u, frame, frame.word)

    def _mapped(self, u: Array, frame: Frame) -> Residual | None:
        """Return the residual of the map."""
        flow = self.flow(u[-1])
        out, into = self._charts(flow)
        motion = flow.march(into @ u[:-1], frame.was_closed, frame.phase * flow.period, frame.order * flow.period)
        if not motion.repeats:
            return None
        D, none = flow.derivative(motion), np.zeros((0, u.size - 1))
        matrix = out @ D @ into - np.eye(u.size - 1)
        return Residual(u, frame, flow, out @ motion.X - u[:-1], matrix, none[:, 0], none, mapped=(motion, D))

    def _shot(self, u: Array, frame: Frame, word: Word) -> Residual | None:
        """Return the residual of the motion over given times of events, which stay near the period."""
        flow = self.flow(u[-1])
        out, into = self._charts(flow)
        N = len(out)
        if np.abs(u[N:-1] - 0.5).max(initial=0.0) > 1:
            return None
        begin, span = frame.phase * flow.period, frame.order * flow.period
        shot = shoot(flow, word, into @ u[:N], begin, span, u[N:-1])
        slopes = shot.X_slope, shot.signals_slope, shot.approach_slope
        if not all(np.isfinite(each).all() for each in slopes):
            return None
        by_w = [np.hstack([each[:, :N] @ into, each[:, N:]]) for each in slopes]
        size = np.linalg.norm(by_w[1], axis=1)
        matrix = np.vstack([out @ by_w[0], by_w[1] / size[:, None]])
        matrix[:N, :N] -= np.eye(N)
        values = np.concatenate([out @ shot.X - u[:N], shot.signals / size])
        return Residual(u, frame, flow, values, matrix, shot.approach, by_w[2], shot)

    def _slopes(self, residual: Residual) -> tuple[Array, Array]:
        """Return the derivatives of values and approach speeds with respect to q by a difference inside the range.

        Where an impact begins the map has a root and multipliers grow: there it is smaller. NaN where there is none.
        """
        u, side = residual.u, np.copysign(_SMOOTH, 0.5 - residual.u[-1])
        if residual.mapped is not None:
            largest = float(np.abs(np.linalg.eigvals(residual.mapped[1])).max(initial=0.0))
            side = np.copysign(_DIFFERENCE, 0.5 - u[-1]) / max(1.0, 0.01 * largest)
        beside = self.residual_at(np.append(u[:-1], u[-1] + side), residual.frame)
        if beside is None:
            return np.full(residual.values.size, np.nan), residual.approach
        return (beside.values - residual.values) / side, (beside.approach - residual.approach) / side

    def _point(self, residual: Residual, along: Array) -> Point | None:
        """Return an orbit as a point, with the tangent of the curve in the direction of the row ``along``."""
        N, n, slope = residual.flow.start.size, residual.flow.modes, self._slopes(residual)[0]
        if not np.isfinite(slope).all():
            return None
        matrix = np.vstack([np.column_stack([residual.matrix, slope]), along])
        tangent = np.linalg.solve(matrix, np.append(np.zeros(slope.size), 1.0))
        row = tangent.copy()
        row[n : 2 * n] = row[N:-1] = 0.0
        length = np.sqrt(row @ tangent)
        regular = float(np.linalg.det(np.vstack([matrix[:-1], row / length])))
        return Point(residual, tangent / length, row / length, regular)

    def _charts(self, flow: Flow) -> tuple[Array, Array]:
        """Return w per X and X per w.

        Coordinates of a reduced structure have the signs of their inertial coupling to the contacts at the first point.
        """
        if self.charts is not None and self.charts[0] is flow.structure:
            return self.charts[1:]
        assert self.scale is not None
        assert self.first is not None
        basis, first, now = flow.operator.basis, self.first, flow.structure
        size, n = flow.start.size, flow.modes
        kinds = [(basis.shapes, basis.to_modes)] * 2
        kinds += [(basis.heat_shapes, basis.to_thermal)] * flow.is_heated
        then, here = ((one.contacts.normal @ one.mass, one.contacts.heat @ one.heat_capacity) for one in (first, now))
        alike = [(a * b).sum(axis=0) for a, b in zip(then, here, strict=True)]
        sides = np.where(np.concatenate([alike[0], *alike])[:size] < 0, -1.0, 1.0)
        factor = sides / (np.repeat(self.scale, (n, n, size - 2 * n)) * np.sqrt(size))
        out, into = (block_diagonal(*matrices) for matrices in zip(*kinds, strict=True))
        self.charts = flow.structure, factor[:, None] * out, into / factor
        return self.charts[1:]

    def rephased(self, point: Point) -> Point:
        """Return a point with its section moved to the middle of the longest flight or contact, if an event is near."""
        motion, frame = point.orbit.motion, point.frame
        later = section_beside(motion.times / motion.span)
        if later is None:
            return point
        away = np.copysign(_SMOOTH if frame.word else _DIFFERENCE, (0.5 - point.q) * point.tangent[-1])
        i = int(np.sum(point.times <= later))
        ends = [self.carried(frame, u, i, later) for u in (point.u, point.u + away * point.tangent)]
        part = point.residual.flow.march(motion.start, frame.was_closed, motion.begin, later * motion.span)
        moved = turned(frame, i, later, part.closed)
        residual = self.residual_at(ends[0], moved)
        found = None if residual is None else self._point(residual, (ends[1] - ends[0]) / away)
        return point if found is None else replace(found, arclength=point.arclength)

    def carried(self, frame: Frame, u: Array, i: int, later: float) -> Array:
        """Return u at a section that is a fraction of kT later, between events ``i - 1`` and ``i``."""
        flow = self.flow(u[-1])
        (out, into), begin, span = self._charts(flow), frame.phase * flow.period, frame.order * flow.period
        X, times = into @ u[: len(into)], u[len(into) : -1]
        if frame.word is None:
            return np.append(out @ flow.march(X, frame.was_closed, begin, later * span).X, u[-1])
        X = shoot(flow, frame.word, X, begin, span, times).at(later, i)
        return np.concatenate([out @ X, times[i:] - later, times[:i] + 1 - later, u[-1:]])


def section_beside(times: Array) -> float | None:
    """Return the time of the middle of the longest stretch where an event is near the section; else ``None``."""
    ends = np.concatenate([[0.0], times, [1.0]])
    lengths = np.diff(ends)
    if not times.size or min(lengths[0], lengths[-1]) > _NEAR_EVENT * max(
        lengths[1:-1].max(initial=0.0), lengths[0] + lengths[-1]
    ):
        return None
    k = int(np.argmax(lengths))
    return float(0.5 * (ends[k] + ends[k + 1]))


def turned(frame: Frame, i: int, later: float, closed: NDArray[np.bool_]) -> Frame:
    """Return a frame whose section is a fraction of kT later, between events ``i - 1`` and ``i``."""
    word = frame.word and frame.word.turned(i)
    phase = (frame.phase + later * frame.order) % 1.0
    return Frame(word, phase, frame.order, np.array(word.closed[0]) if word else closed)
