"""A curve of periodic rubs u = (w, q), w the scaled state at a phase of the period and q the fraction of a range."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from workflow.kernels.algebra import block_diagonal
from workflow.models import Array, Cases, Structure
from workflow.orbits._flow import AnalysedStructure, Flow
from workflow.orbits._orbit import Orbit, has_converged, longest
from workflow.schemes.event_driven import Trajectory

Problem = Callable[[float], tuple[Structure, Cases]]
"""Structure and one case at a value of the parameter."""

_DIFFERENCE = 1e-10
"""Step of finite differences with respect to q."""

_MOST = 12
"""Largest number of Newton steps to a point, of eight trials each where they are halved."""

_NEAR_EVENT = 0.1
"""Distance of an event from the phase of w, over the longest flight or contact, below which another phase is chosen."""


@dataclass(frozen=True, eq=False)
class Point:
    """A periodic rub on the curve."""

    q: float
    w: Array
    phase: float
    """Phase of the Poincaré section of w, over T."""
    orbit: Orbit
    tangent: Array
    """Tangent of the curve of u, of length 1 …"""
    row: Array
    """… in the scalar product with this row, without velocities, which vibrations after an impact change quickly."""
    arclength: float = 0.0
    """Arclength."""

    @property
    def u(self) -> Array:
        """State and fraction of the range."""
        return np.append(self.w, self.q)

    def distance(self, u: Array) -> float:
        """Return the length of the chord to another u, without velocities."""
        away, n = u - self.u, self.orbit.flow.modes
        away[n : 2 * n] = 0.0
        return float(np.linalg.norm(away))


class Curve:
    """The periodic rubs of one order of a problem over a range."""

    def __init__(self, problem: Problem, start: float, stop: float):
        self.problem, self.start, self.stop = problem, start, stop
        self.scale: Array | None = None
        self.first: Structure | None = None
        self.shared: AnalysedStructure | None = None
        self.charts: tuple[Structure, Array, Array] | None = None
        self.heated = any(problem(self.value(q))[1].heated.any() for q in (0.0, 0.5, 1.0))

    def value(self, q: float) -> float:
        """Return the value of the parameter at q."""
        return self.start + q * (self.stop - self.start)

    def flow(self, q: float) -> Flow:
        """Return the case at q; cases of one structure share its operator."""
        structure, cases = self.problem(self.value(q))
        if self.shared is None or structure is not self.shared.structure:
            self.shared = AnalysedStructure(structure)
        return Flow(self.shared, cases, heated=self.heated)

    def begin(self, orbit: Orbit, scale: Array, q: float) -> Point | None:
        """Return an orbit as the first point of the curve, with a tangent towards larger q."""
        self.scale, self.first = scale, orbit.flow.structure
        w = self._charts(orbit.flow)[0] @ orbit.motion.start
        ahead = np.append(np.zeros(w.size), 1.0)
        return self._point(np.append(w, q), orbit.motion.begin / orbit.flow.period, orbit, ahead)

    def step(self, point: Point, length: float) -> Point | None:
        """Return the point at a length along the tangent, in the plane across it; ``None`` where none is found."""
        found = self._newton(point, point.u + length * point.tangent, point.row)
        return found and replace(found, arclength=point.arclength + length)

    def at(self, point: Point, q: float, *, keeps_events: bool = False) -> Point | None:
        """Return the point at a fraction of the range near one, on whose curve it has the same direction.

        Steps of Newton's method that change the number of events, with ``keeps_events``, are halved.
        """
        ahead = np.append(np.zeros(point.w.size), np.copysign(1.0, point.tangent[-1]))
        found = self._newton(point, np.append(point.w, q), ahead, keeps_events)
        return found and replace(found, arclength=point.arclength + point.distance(found.u))

    def _newton(self, point: Point, guess: Array, row: Array, keeps_events: bool = False) -> Point | None:
        """Return the point near a guess in the plane across a row, by Newton steps or parts of them."""
        u, whole, last, part, events = guess.copy(), 0.0 * guess, np.inf, 1.0, -1
        for _ in range(8 * _MOST if keeps_events else _MOST):
            orbit = self._at(u + part * whole, point)
            count = -1 if orbit is None else orbit.motion.times.size
            if keeps_events and count != events >= 0:
                part /= 2
                continue
            if orbit is None:
                return None
            u += part * whole
            events, size = count, max(orbit.residual, abs(float(row @ (u - guess))))
            if has_converged(size, last):
                return self._point(u, point.phase, orbit, row)
            slope, error = self._slope(u, point.phase, orbit), self._charts(orbit.flow)[0] @ orbit.motion.X - u[:-1]
            if slope is None:
                return None
            try:
                aim = u + np.linalg.solve(self._matrix(orbit, slope, row), np.append(-error, row @ (guess - u)))
            except np.linalg.LinAlgError:
                return None
            if not (np.abs((aim - guess)[point.row != 0]).max() < 1 and abs(aim[-1] - 0.5) < 0.5 + _DIFFERENCE):
                return None
            aim[-1] = min(max(aim[-1], 0.0), 1.0)
            whole, last, part = aim - u, size, 1.0
        return None

    def halved(self, point: Point) -> Point | None:
        """Return the rub of half the order in the middle of a rub whose halves are nearly alike."""
        orbit = replace(point.orbit, order=point.orbit.order // 2)
        return self.at(replace(point, orbit=orbit, w=point.w + 0.5 * self.between_halves(point)), point.q)

    def between_halves(self, point: Point) -> Array:
        """Return the change of w over a half of a rub's period."""
        motion, flow = point.orbit.motion, point.orbit.flow
        middle = flow.march(motion.start, motion.was_closed, motion.begin, 0.5 * motion.span)
        return np.asarray(self._charts(flow)[0] @ middle.X - point.w)

    def _at(self, u: Array, point: Point) -> Orbit | None:
        """Return the motion from u over kT with its residual, the largest change of w; ``None`` where it has none."""
        flow, motion, w = self._mapped(u, point.phase, point.orbit)
        residual = float(np.abs(w - u[:-1]).max())
        return Orbit(flow, point.orbit.order, motion, flow.derivative(motion), residual) if motion.repeats else None

    def _mapped(self, u: Array, phase: float, orbit: Orbit) -> tuple[Flow, Trajectory, Array]:
        """Return the case at u, its motion from there over the kT of an orbit near it, and w at its end."""
        flow = self.flow(u[-1])
        out, into = self._charts(flow)
        motion = flow.march(into @ u[:-1], orbit.motion.was_closed, phase * flow.period, orbit.order * flow.period)
        return flow, motion, out @ motion.X

    def _point(self, u: Array, phase: float, orbit: Orbit, along: Array, arclength: float = 0.0) -> Point | None:
        """Return an orbit as a point, with the tangent of the curve in the direction of the row ``along``."""
        slope, n = self._slope(u, phase, orbit), orbit.flow.modes
        if slope is None:
            return None
        tangent = np.linalg.solve(self._matrix(orbit, slope, along), np.append(np.zeros(slope.size), 1.0))
        row = tangent.copy()
        row[n : 2 * n] = 0.0
        length = np.sqrt(row @ tangent)
        return Point(float(u[-1]), u[:-1], phase, orbit, tangent / length, row / length, arclength)

    def _matrix(self, orbit: Orbit, slope: Array, row: Array) -> Array:
        """Return the Jacobian of the map's residual and the plane with respect to u."""
        out, into = self._charts(orbit.flow)
        return np.vstack([np.column_stack([out @ orbit.D @ into - np.eye(slope.size), slope]), row])

    def _slope(self, u: Array, phase: float, orbit: Orbit) -> Array | None:
        """Return the derivative of the map with respect to q by a finite difference inside the range.

        Where an impact begins the map has a root and multipliers grow: there it is smaller.
        """
        side = (_DIFFERENCE if u[-1] < 0.5 else -_DIFFERENCE) / max(1.0, 0.01 * float(np.abs(orbit.multipliers[0])))
        _, motion, w = self._mapped(np.append(u[:-1], u[-1] + side), phase, orbit)
        return (w - self._charts(orbit.flow)[0] @ orbit.motion.X) / side if motion.repeats else None

    def _charts(self, flow: Flow) -> tuple[Array, Array]:
        """Return w per X and X per w.

        Coordinates of a reduced structure have the signs of their coupling to the tip at the first point.
        """
        if self.charts is not None and self.charts[0] is flow.structure:
            return self.charts[1:]
        assert self.scale is not None
        assert self.first is not None
        basis, first, now = flow.operator.basis, self.first, flow.structure
        size, n = flow.start.size, flow.modes
        kinds = [(basis.shapes, basis.to_modes)] * 2
        kinds += [(basis.heat_shapes, basis.to_thermal)] * flow.is_heated
        inertia = [first.mass[-1] * now.mass[-1]] * 2 + [first.heat_capacity[-1] * now.heat_capacity[-1]]
        sides = np.where(np.concatenate(inertia)[:size] < 0, -1.0, 1.0)
        factor = sides / (np.repeat(self.scale, (n, n, size - 2 * n)) * np.sqrt(size))
        out, into = (block_diagonal(*matrices) for matrices in zip(*kinds, strict=True))
        self.charts = flow.structure, factor[:, None] * out, into / factor
        return self.charts[1:]

    def rephased(self, point: Point) -> Point:
        """Return a point with its section moved to the middle of the longest flight or contact, if an event is near."""
        orbit, flow, motion = point.orbit, point.orbit.flow, point.orbit.motion
        lengths = np.diff(np.append(motion.times, motion.times[:1] + motion.span))
        if not lengths.size or min(motion.times[0], motion.span - motion.times[-1]) > _NEAR_EVENT * lengths.max():
            return point
        away = _DIFFERENCE if (point.q < 0.5) == (point.tangent[-1] > 0) else -_DIFFERENCE
        later, ends = longest(motion) / flow.period, []
        for u in (point.u + away * point.tangent, point.u):
            flow = self.flow(u[-1])
            out, into = self._charts(flow)
            part = flow.march(into @ u[:-1], motion.was_closed, point.phase * flow.period, later * flow.period)
            ends.append(np.append(out @ part.X, u[-1]))
        phase, along = (point.phase + later) % 1.0, (ends[0] - ends[1]) / away
        motion = flow.march(part.X, part.closed, phase * flow.period, motion.span)
        if not motion.repeats:
            return point
        moved = replace(orbit, motion=motion, D=flow.derivative(motion))
        return self._point(ends[1], phase, moved, along, point.arclength) or point
