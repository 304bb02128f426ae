"""Branches of steady rubs along one parameter, through folds, with their bifurcations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from workflow.models import Array
from workflow.orbits._curve import Curve, Point, Problem
from workflow.orbits._orbit import NOT_FOUND, Orbit, scale_of
from workflow.orbits._rubs import tabulated
from workflow.orbits._settle import Options, Settled, settle
from workflow.schemes._exact.record import TOUCH

BIFURCATIONS = ("none", "fold", "period_doubling", "torus", "grazing")
"""Names of the values of ``bifurcation``."""

_NONE, _FOLD, _PERIOD_DOUBLING, _TORUS, _GRAZING = range(5)

_STARTS = (0.0, 1.0, 0.5, 0.25, 0.75)
"""Fractions of the range at which a periodic rub is searched for."""

Along = Callable[[float], Point | None]
"""Point of a branch at an arclength."""

_FIRST, _LARGEST, _LEAST = 1e-2, 0.25, 1e-7
"""First, largest and least step along the curve, on which range and motion have length 1."""

_FAR = 4.0
"""Norm of w at which an unstable branch ends: its temperatures may grow without bound."""

_TURN = 0.9
"""Least cosine between tangents of successive points."""

_MOST_STEPS = 500

_ROOT, _ZERO, _GRAZED = 1e-12, 1e-6, 1e-7
"""Accuracy in arclength of roots of a test function, which is 0 up to ``_ZERO``, and of grazing by bisection."""


def branch(
    problem: Problem, start: float, stop: float, points: int, options: Options
) -> tuple[dict[str, Array], str]:
    """Return the branch of steady rubs through the first one found at start, at stop or between, and a message.

    Variables are those of :func:`~workflow.orbits.steady_rubs`, ``(points,)`` and ``(points, samples)``, in order of
    arclength, and ``value`` of the parameter and ``bifurcation`` (int8, index in :data:`BIFURCATIONS`), ``(points,)``.
    A flagged point lies at its bifurcation. After the last point numbers are NaN, ``steady_state`` is ``not_found`` and
    ``bifurcation`` ``none``. Where no point is found that holds for all, and the message, which begins with
    ``steady:``, states why.
    """
    curve = Curve(problem, start, stop)
    first = _first(curve, options)
    found, flags = _flagged(curve, first, points) if first is not None else ([], np.zeros(0, dtype=np.int8))
    beyond, rubs = points - len(found), [Settled(point.orbit.state, "", point.orbit) for point in found]
    values = tabulated(rubs + beyond * [Settled(NOT_FOUND)], options.samples)
    values["value"] = np.pad([curve.value(point.q) for point in found], (0, beyond), constant_values=np.nan)
    values["bifurcation"] = np.pad(flags, (0, beyond))
    return values, "" if found else f"steady: no periodic rub was found at {start:g}, at {stop:g} or between"


def _flagged(curve: Curve, first: Point, count: int) -> tuple[list[Point], NDArray[np.int8]]:
    """Return at most ``count`` points of the branch through one, in order of arclength, and their bifurcations."""
    behind, back = _followed(curve, _reversed(first))
    ahead, end = _followed(curve, first)
    trace = [*map(_reversed, reversed(behind)), *ahead[1:]]

    def at(arclength: float) -> Point | None:
        """Return the point at an arclength."""
        near = min(trace, key=lambda point: abs(point.arclength - arclength))
        return near if near.arclength == arclength else curve.step(near, arclength - near.arclength)

    arclengths = np.linspace(trace[0].arclength, trace[-1].arclength, count)
    found = [point for arclength in arclengths if (point := at(arclength)) is not None]
    flags = np.zeros(len(found), dtype=np.int8)
    _locate(at, found, flags)
    order = np.argsort([point.arclength for point in found], kind="stable")
    found, flags = [found[i] for i in order], flags[order]
    flags[0], flags[-1] = flags[0] or back, flags[-1] or end
    return found, flags


def _reversed(point: Point) -> Point:
    """Return a point with the opposite direction of the curve."""
    return replace(point, tangent=-point.tangent, row=-point.row, arclength=-point.arclength)


def _first(curve: Curve, options: Options) -> Point | None:
    """Return the first periodic rub found; the curve is scaled by it and a distant one."""
    found: list[tuple[float, Orbit]] = []
    starts = list(_STARTS)
    while starts and len(found) < 2:
        q = starts.pop(0)
        orbit = settle(curve.flow(q), options).orbit
        if orbit is not None:
            found.append((q, orbit))
            starts = [q + (round(1 - q) - q) / 2**k for k in range(8)] if len(found) == 1 else []
    if not found:
        return None
    scale = np.max([scale_of(orbit.flow, [orbit.motion]) for _, orbit in found], axis=0)
    first = curve.begin(found[0][1], scale, found[0][0])
    return first and curve.rephased(first)


def _followed(curve: Curve, first: Point) -> tuple[list[Point], int]:
    """Return the points from one to the end of the range or of the branch, and the flag of that end.

    A branch has no end where the map is smooth: it ends where the order of events changes.
    """
    points, step = [first], _FIRST
    while len(points) < _MOST_STEPS and (points[-1].orbit.growth < 0 or np.linalg.norm(points[-1].w) < _FAR):
        here = points[-1]
        if here.q in (0.0, 1.0) and (here.tangent[-1] > 0) == (here.q == 1.0):
            return points, _NONE
        if (
            len(points) > 10
            and np.linalg.norm(here.u - first.u) < 0.5 * here.arclength / len(points)
            and here.phase == first.phase
        ):
            return points, _NONE  # a closed branch
        found, ahead = curve.step(here, step), here.q + step * here.tangent[-1]
        if not 0.0 <= ahead <= 1.0:
            bound = 0.0 if ahead < 0 else 1.0
            found = curve.step(here, bound, np.append(np.zeros(here.w.size), 1.0))
            if found is not None:
                found = replace(found, q=bound, arclength=here.arclength + abs(float(here.row @ (found.u - here.u))))
        if found is None or abs(here.row @ found.tangent - 1) > 1 - _TURN:
            step /= 2
            if step < _LEAST:
                return points, _GRAZING
            continue
        points.append(curve.rephased(found))
        step = min(1.5 * step, _LARGEST)
    return points, _NONE


def _locate(at: Along, found: list[Point], flags: NDArray[np.int8]) -> None:
    """Locate each bifurcation, and replace the nearer of its neighbours by the flagged point."""
    for i, (a, b) in enumerate(pairwise(list(found))):
        for flag, test in _TESTS.items():
            point = _root(at, a, b, test)
            if point is not None:
                _insert(found, flags, point, i, flag)
        for grazing in _order_changes(at, a, b) if _order(a) != _order(b) else ():
            _insert(found, flags, grazing, i, _GRAZING)


def _insert(found: list[Point], flags: NDArray[np.int8], point: Point, i: int, flag: int) -> None:
    """Replace found[i] or found[i + 1] by a located point, preferably one that is no end and has no flag."""
    k = min((i, i + 1), key=lambda k: (k in (0, len(found) - 1), flags[k], abs(found[k].arclength - point.arclength)))
    found[k], flags[k] = point, flag


def _doubling(point: Point) -> float:
    """Return a test function that changes its sign where a real multiplier passes -1."""
    real = point.orbit.multipliers
    return float(np.prod(1 + real[real.imag == 0].real))


def _torus_test(point: Point) -> float:
    """Return the largest modulus of the complex multipliers less 1; -inf without any."""
    values = point.orbit.multipliers
    return float(np.abs(values[values.imag > 0]).max(initial=-np.inf)) - 1


_TESTS: dict[int, Callable[[Point], float]] = {
    _FOLD: lambda point: float(point.tangent[-1]),
    _PERIOD_DOUBLING: _doubling,
    _TORUS: _torus_test,
}


def _root(at: Along, a: Point, b: Point, test: Callable[[Point], float]) -> Point | None:
    """Return the point between two where a test is 0; ``None`` where its sign does not change, or changes by a jump."""
    if not (test(a) * test(b) < 0 and np.isfinite(test(a) * test(b))):
        return None
    found = [a, b]

    def value(arclength: float) -> float:
        point = at(arclength)
        found.extend([point] if point is not None else [])
        return np.nan if point is None else test(point)

    try:
        brentq(value, a.arclength, b.arclength, xtol=_ROOT, rtol=1e-14)
    except ValueError:  # a point between was not found
        return None
    nearest = min(found, key=lambda point: abs(test(point)))
    return nearest if abs(test(nearest)) < _ZERO else None


def _order(point: Point) -> tuple[int, int, bool]:
    """Return the numbers of an orbit's contacts and, without any, impacts, and whether it is one permanent contact.

    Impacts are not counted besides contacts, as chattering has infinitely many.
    """
    motion = point.orbit.motion
    touches = int(np.sum(motion.kinds == TOUCH))
    return touches, 0 if touches else motion.kinds.size, motion.was_held and not motion.times.size


def _order_changes(at: Along, a: Point, b: Point) -> list[Point]:
    """Return the last point with the order of events of a, and the last one before that of b."""
    low, last, found = a.arclength, a, list[Point]()
    is_before: list[Callable[[Point], bool]] = [lambda p: _order(p) == _order(a), lambda p: _order(p) != _order(b)]
    for before in is_before:
        high, beyond = b.arclength, b
        while high - low > _GRAZED:
            middle = 0.5 * (low + high)
            point = at(middle)
            if point is not None and before(point):
                low, last = middle, point
            else:
                high, beyond = middle, point or beyond
        found.append(last)
        if _order(beyond) == _order(b):
            break
    return found
