"""Branches of steady rubs along one parameter, through folds, with their bifurcations."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq

from workflow.models import Array, one_thread
from workflow.orbits._curve import Curve, Point, Problem
from workflow.orbits._orbit import NOT_FOUND, UNSTABLE, Orbit, scale_of
from workflow.orbits._settle import Options, Settled, settle, tabulated

BIFURCATIONS = ("none", "fold", "period_doubling", "torus", "grazing", "branch_point")
"""Names of the values of ``bifurcation``."""

NONE, FOLD, PERIOD_DOUBLING, TORUS, GRAZING, BRANCH_POINT = range(6)

_STARTS = (0.0, 1.0, 0.5, 0.25, 0.75)
"""Fractions of the range at which a periodic rub is searched for."""

_FIRST, _LARGEST, _LEAST = 1e-2, 0.25, 1e-9
"""First, largest and least step along the curve, on which range and motion have length 1."""

_NEAREST = 1e-6
"""Distance from the doubling of half its period at which a branch ends that does not go on from there."""

_FAR = 4.0
"""Norm of the temperatures of w at which an unstable branch ends: they may grow without bound."""

_CURVE, _BEND = 0.1, 1e-3
"""Largest bend of a step, and of one to other events: a late impact of many bends less, others are approached."""

_MOST_STEPS = 500

_ROOT, _ZERO, _APART = 1e-12, 1e-6, 1e-3
"""Accuracy in arclength of roots of a test, which is 0 up to ``_ZERO`` of its values; distance of two grazings."""


_MULTIPLIER, _NEAR = {PERIOD_DOUBLING: -1.0, BRANCH_POINT: 1.0}, 1e-2
"""The multiplier that an orbit has where a test is 0, and how near: roots have it to 1e-4."""


class Place(NamedTuple):
    """A point of a branch and its bifurcation."""

    point: Point
    flag: int = NONE

    @property
    def arclength(self) -> float:
        """Arclength of the point."""
        return self.point.arclength


@dataclass(frozen=True, eq=False)
class Followed:
    """A branch as it was followed: its curve and points in order of arclength, none where no rub was found."""

    curve: Curve
    trace: list[Place]


def follow(problem: Problem, start: float, stop: float, options: Options, *, heated: bool = False) -> Followed:
    """Follow the branch of steady rubs through the first one found at start, at stop or between.

    It has thermal states where heat acts within its range, or ``heated`` is set: where it acts at another number.
    """
    curve = Curve(problem, start, stop, heated)
    with one_thread():  # matrices are small
        first = _first(curve, options)
        if first is None:
            return Followed(curve, [])
        behind = [Place(_reversed(point), flag) for point, flag in _followed(curve, _reversed(first))]
        return Followed(curve, [*reversed(behind), *_followed(curve, first)[1:]])


def tabulate(followed: Followed, points: int, options: Options) -> tuple[dict[str, Array], str]:
    """Return a branch at equal distances, and a message.

    Variables are those of :func:`~workflow.orbits.steady_rubs`, ``(points,)`` and ``(points, samples)``, in order of
    arclength, and ``value`` of the parameter and ``bifurcation`` (int8, index in :data:`BIFURCATIONS`), ``(points,)``.
    A flagged point lies at its bifurcation. After the last point numbers are NaN, ``steady_state`` is ``not_found`` and
    ``bifurcation`` ``none``. Where no point is found that holds for all, and the message, which begins with
    ``steady:``, states why.
    """
    curve = followed.curve
    found, lost = spread(followed, points)
    beyond, rubs = points - len(found), [Settled(point.orbit.state, "", point.orbit) for point, _ in found]
    values = tabulated(rubs + beyond * [Settled(NOT_FOUND)], options.samples, curve.problem(curve.start)[0])
    values["value"] = np.pad([curve.value(point.q) for point, _ in found], (0, beyond), constant_values=np.nan)
    values["bifurcation"] = np.pad(np.array([flag for _, flag in found], dtype=np.int8), (0, beyond))
    critical = np.isin(values["bifurcation"], (FOLD, PERIOD_DOUBLING, TORUS, BRANCH_POINT))  # multipliers of modulus 1
    values["steady_state"][critical], values["settling_time"][critical] = UNSTABLE, np.nan
    if not found:
        ends = f"at {curve.start:g}, at {curve.stop:g} or between"
        return values, f"steady: no periodic rub was found {ends}"
    near, marked = ", ".join(f"{curve.value(q):.6g}" for q in lost), sum(place.flag != NONE for place in followed.trace)
    messages = [f"{len(lost)} of {points} points were not found, near {near}"] * bool(lost)
    if 2 * marked > points:
        messages.append(
            f"{marked} bifurcations leave few of the {points} points to the arms between them; ask for more"
        )
    return values, "; ".join(f"steady: {each}" for each in messages)


def branch(problem: Problem, start: float, stop: float, points: int, options: Options) -> tuple[dict[str, Array], str]:
    """Return the branch that :func:`follow` finds, as :func:`tabulate` does."""
    return tabulate(follow(problem, start, stop, options), points, options)


def spread(followed: Followed, count: int) -> tuple[list[Place], list[float]]:
    """Return ``count`` points of a branch, in order of arclength, and q near those that are not found.

    They have equal distances, but the nearest to a bifurcation is put there, and one between two of them.
    """
    curve, trace = followed.curve, followed.trace
    if not trace:
        return [], []
    arclengths = np.linspace(trace[0].arclength, trace[-1].arclength, count)
    put, marks = {0: trace[0], count - 1: trace[-1]}, [place for place in trace[1:-1] if place.flag][: count - 2]

    def replace_nearest(place: Place) -> None:
        """Put a place where the nearest point is that may be moved."""
        free = set(range(count)) - set(put)
        put[min(free, key=lambda k: abs(float(arclengths[k]) - place.arclength))] = place

    for place in marks:
        replace_nearest(place)
    for low, high in pairwise(place.arclength for place in (trace[0], *marks, trace[-1])):
        if len(put) < count and not any(k not in put and low < s < high for k, s in enumerate(arclengths)):
            middle = _at(curve, trace, 0.5 * (low + high))
            if middle is not None:
                replace_nearest(Place(middle))
    found, lost = list(put.values()), list[float]()
    for k in set(range(count)) - set(put):
        point = _at(curve, trace, float(arclengths[k]))
        if point is None:
            lost.append(_nearest(trace, float(arclengths[k]))[0].q)
        else:
            found.append(Place(point))
    return sorted(found, key=lambda place: place.arclength), lost


def _nearest(trace: list[Place], arclength: float) -> list[Point]:
    """Return the nearest points to an arclength, of the order k that the branch has there."""
    points = [point for point, _ in trace if point.arclength * arclength >= 0]  # it was followed to both sides from 0
    before = max((p for p in points if abs(p.arclength) <= abs(arclength)), key=lambda p: abs(p.arclength))
    alike = [point for point in points if point.orbit.order == before.orbit.order]
    return sorted(alike, key=lambda point: abs(point.arclength - arclength))[:3]


def _at(curve: Curve, trace: list[Place], arclength: float) -> Point | None:
    """Return the point at an arclength."""
    steps = (curve.step(near, arclength - near.arclength) for near in _nearest(trace, arclength))
    with one_thread():
        found = next((point for point in steps if point is not None and point.is_motion), None)
    return found


def _reversed(point: Point, shift: float = 0.0) -> Point:
    """Return a point with the opposite direction of the curve, whose arclength is counted from ``shift``."""
    tangent, row, regular = -point.tangent, -point.row, -point.regular
    return replace(point, tangent=tangent, row=row, regular=regular, arclength=shift - point.arclength)


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


def _followed(curve: Curve, first: Point) -> list[Place]:
    """Return the points from one to the end of the range or of the branch, with the bifurcations between.

    At a grazing the branch goes on with an impact less or more, whichever way that leads. It ends where the order of
    other events changes and it turns back: a grazing, but of compliant contacts, which pass one without a mark.
    """
    trace, here, step, count = [Place(first)], first, _FIRST, 1
    heats, smooth = slice(2 * first.orbit.flow.modes, None), first.orbit.flow.structure.contacts.is_compliant
    while count < _MOST_STEPS and (here.orbit.growth < 0 or np.linalg.norm(here.w[heats]) < _FAR):
        if here.q in (0.0, 1.0) and (here.tangent[-1] > 0) == (here.q == 1.0):
            break
        same = count > 10 and here.frame.word == first.frame.word and here.frame.phase == first.frame.phase
        if same and np.linalg.norm(here.u - first.u) < 0.5 * here.arclength / count:
            break  # a closed branch
        if step < _LEAST:
            mapped = None if here.frame.word is None else curve.unworded(here)
            if mapped is None:
                return trace if smooth else [*trace[:-1], Place(here, GRAZING)]
            here, step = mapped, _FIRST
        found, ahead = curve.step(here, step), here.q + step * here.tangent[-1]
        if not 0.0 <= ahead <= 1.0:
            found = curve.at(here, 0.0 if ahead < 0 else 1.0)
        if found is None or _bend(here, found) > (_CURVE if _same_events(here, found) else _BEND):
            step /= 2
            continue
        if not found.is_motion:
            passed = _past_grazing(curve, here, found)
            if passed is None:
                step /= 2
                continue
            trace, here, step, count = [*trace, *passed[1:]], passed[-1].point, _FIRST, count + 1
            continue
        if here.orbit.order % 2 == 0 and _exchanges_halves(curve, here, found):
            found = _with_equal_halves(curve, here)
            if found is None and step > _NEAREST:
                step /= 2
                continue
            if found is None:
                return [*trace[:-1], Place(here, PERIOD_DOUBLING)]
        passed = _joined(curve, here, found)
        if passed is None:
            step /= 2
            continue
        here, step, count = curve.rephased(curve.worded(passed[-1].point)), min(1.5 * step, _LARGEST), count + 1
        trace = [*trace[:-1], trace[-1] if trace[-1].flag else passed[0], *passed[1:-1], Place(here)]
    return trace


def _past_grazing(curve: Curve, here: Point, beyond: Point) -> list[Place] | None:
    """Return the points from one to the grazing before one that is no motion, and the first beyond it."""
    found = curve.grazing(here, beyond)
    if found is None:
        return None
    arclength = here.arclength + float(here.row @ (found[0].u - here.u))
    last, ahead = (replace(each, arclength=arclength) for each in found)
    fewest = min(last.times.size, ahead.times.size)
    ends = [Place(point, GRAZING if point.times.size == fewest else NONE) for point in (last, ahead)]
    between = _roots(curve, here, last)
    return None if between is None else [Place(here), *between, *ends]


def _bend(a: Point, b: Point) -> float:
    """Return how far a chord is from the mean tangent of its ends, over its length, or by how much they turn."""
    mean = 0.5 * (b.arclength - a.arclength) * (a.tangent + b.tangent)
    return max(a.distance(b.u - mean) / a.distance(b.u), abs(float(a.row @ b.tangent) - 1))


def _exchanges_halves(curve: Curve, a: Point, b: Point) -> bool:
    """Tell whether the halves of a rub's period become each other, as beyond the doubling of half its period.

    Their difference d changes by -2 Δw there, at most twice that is taken; where an impact passes the middle of the
    period d jumps.
    """
    before, after = (curve.between_halves(point) for point in (a, b))
    return bool(before @ after < 0 and np.linalg.norm(after - before) < 4 * np.linalg.norm(b.w - a.w))


def _with_equal_halves(curve: Curve, here: Point) -> Point | None:
    """Return a rub of half the order beyond the doubling of its period that a rub comes to."""
    start = curve.halved(here)
    for step in _FIRST * 4.0 ** np.arange(-3, 3):
        found = None if start is None else curve.step(start, float(step))
        if start is not None and found is not None and _doubling(start) * _doubling(found) < 0:
            return found
    return None


def _joined(curve: Curve, a: Point, b: Point) -> list[Place] | None:
    """Return the points from one to the next with the bifurcations between; ``None`` where these are of two curves.

    Grazing is at the side that has fewer impacts, where the map is smooth. On the other a multiplier comes from
    infinity, so tests are made between points at growing distances.
    """
    if a.orbit.order != b.orbit.order or _same_events(a, b):
        between = _roots(curve, a if a.orbit.order == b.orbit.order else curve.halved(a) or b, b)
        return None if between is None else [Place(a), *between, Place(b)]
    first, length = a.orbit.motion.times.size <= b.orbit.motion.times.size, b.arclength - a.arclength
    low, high = (_until_events_change(curve, each, length) for each in (a, _reversed(b)))
    apart = low[-1].point.distance(high[-1].point.u)
    for end, smooth in ((low, first), (high, not first)):
        if smooth or apart > _APART:
            end[-1] = Place(end[-1].point, GRAZING)
    shift = low[-1].arclength + high[-1].arclength + apart
    return [*low, *(Place(_reversed(point, shift), flag) for point, flag in reversed(high))]


def _until_events_change(curve: Curve, a: Point, length: float) -> list[Place]:
    """Return points from one on as far as they have its order of events, with the bifurcations between.

    The first step is half of a length at which the order is another.
    """
    places, step = [Place(a)], 0.5 * length
    while step > _LEAST and places[-1].arclength - a.arclength < 4 * length:
        here = places[-1].point
        found = curve.step(here, step)
        alike = found is not None and order_of_events(found.orbit) == order_of_events(a.orbit)
        between = _roots(curve, here, found) if found is not None and alike else None
        if found is None or between is None:
            step /= 2
        else:
            places += [*between, Place(found)]
    return places


def _doubling(point: Point) -> float:
    """Return the test that is 0 where a multiplier is -1, det(1 + DPᵏ) by the conditions of the orbit."""
    matrix, N = point.residual.matrix.copy(), point.w.size
    matrix[:N, :N] += 2 * np.eye(N)
    return float(np.linalg.det(matrix))


def _torus_test(point: Point) -> float:
    """Return the largest modulus of the complex multipliers, 0 without any, less 1."""
    values = point.orbit.multipliers
    return float(np.abs(values[values.imag > 0]).max(initial=0.0)) - 1


_TESTS: dict[int, Callable[[Point], float]] = {
    FOLD: lambda point: float(point.tangent[-1]),
    PERIOD_DOUBLING: _doubling,
    TORUS: _torus_test,
    BRANCH_POINT: lambda point: point.regular,
}


def _roots(curve: Curve, a: Point, b: Point) -> list[Place] | None:
    """Return the bifurcations between two points with the same order of events; ``None`` where these are of two curves.

    Along one curve a test passes 0 where its sign changes. That of a torus may jump, as pairs of multipliers end; the
    conditions of bounces that accumulate are nearly dependent, without a multiplier 1 or -1 (:data:`_MULTIPLIER`).
    """
    found = []
    for flag, test in _TESTS.items():
        size = max(abs(test(a)), abs(test(b)))
        if test(a) * test(b) < 0:
            point = _root(curve, a, b, test)
            if point is not None and abs(test(point)) < _ZERO * max(1.0, size):
                at = _MULTIPLIER.get(flag)
                if at is None or np.abs(point.orbit.multipliers - at).min() < _NEAR:
                    found.append(Place(point, flag))
            elif flag != TORUS:
                return None
    return sorted(found, key=lambda place: place.arclength)


def _root(curve: Curve, a: Point, b: Point, test: Callable[[Point], float]) -> Point | None:
    """Return the point between two at which the sign of a test changes; ``None`` where one between is not found."""
    found = {point.arclength: point for point in (a, b)}

    def value(arclength: float) -> float:
        near = min(found.values(), key=lambda point: abs(point.arclength - arclength))
        point = found.get(arclength) or curve.step(near, arclength - near.arclength)
        found.update({} if point is None else {arclength: point})
        return np.nan if point is None else test(point)

    try:
        brentq(value, a.arclength, b.arclength, xtol=_ROOT, rtol=1e-14)
    except ValueError:
        return None
    return min(found.values(), key=lambda point: abs(test(point)))


def _same_events(a: Point, b: Point) -> bool:
    """Tell whether two neighbours have one sequence of events, or one whose changes the map does not show."""
    is_smooth = a.frame.word is not None or a.orbit.flow.structure.contacts.is_compliant
    return is_smooth or order_of_events(a.orbit) == order_of_events(b.orbit)


def order_of_events(orbit: Orbit) -> tuple[tuple[int, ...], tuple[int, ...], tuple[bool, ...]]:
    """Return how often each contact begins and, of those that never do, strikes, and which stay closed for good.

    Impacts are not counted besides contacts, as chattering has infinitely many.
    """
    motion = orbit.motion
    begins, impacts = motion.begins, np.sum(motion.impulses > 0, axis=0)
    stays = np.asarray(motion.sets.all(axis=0))
    return tuple(begins.tolist()), tuple(np.where(begins, 0, impacts).tolist()), tuple(stays.tolist())
