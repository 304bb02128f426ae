"""Points of random boundaries, found again by branches through their orbits in either number alone."""

from copy import copy
from itertools import product
from typing import Any

import numpy as np
import pytest
from test_boundary import Pair, of_two

from scenes import cases, chain
from workflow.models import Rayleigh, one_thread
from workflow.orbits import ENDS, Options, follow
from workflow.orbits._boundary import NONE, _Boundary, _is_end, _Spot, _starts
from workflow.orbits._branch import _followed, _reversed

TURN = 2 * np.pi
SEEDS = (
    1, 2, 5, 6, 8, 11, 12, 14, 16, 18, 19, 23, 24, 25, 26, 27, 28, 30, 33, 36, 38, 39, 47, 49, 51, 53, 55, 56, 57, 58,
)  # fmt: skip
"""Problems with bifurcations, but those with series of bounces, whose curves take minutes."""

NEAR, PARALLEL = 0.005, 0.05
"""Half the range of a branch, over that of the boundary; slope of a boundary below which no branch crosses it."""


def random_problem(seed: int) -> tuple[Pair, tuple[float, float], tuple[float, float]]:
    """One contact of a chain of one to three masses, half of them with heat, over its gap and another number."""
    rng = np.random.default_rng(seed)
    nodes, heats = int(rng.integers(1, 4)), rng.random() < 0.5
    lumps = {"spacing": 0.1, "expansion": 0.02, "heat_capacity": 0.3, "conductance": 0.4, "convection": 0.3}
    damping = Rayleigh(rng.uniform(0.03, 0.2), rng.uniform(0, 0.02))
    structure = chain(nodes=nodes, mass=1 / nodes, stiffness=nodes, damping=damping, **(lumps if heats else {}))
    e, omega, gap = rng.uniform(0.2, 0.9), rng.uniform(0.5, 2.5), rng.uniform(-0.2, 1.2)
    alpha = rng.uniform(0, 3) if heats else 0.0
    load = {"amplitude": 1.0, "frequency": omega / TURN, "mean": rng.uniform(0, 0.3)}
    scene = cases(structure, e=e, gap=gap, alpha=alpha, **load)
    if rng.random() < 0.4:
        name, ends = "e", (e, min(0.95, e + 0.25))
    elif heats and rng.random() < 0.5:
        name, ends = "alpha", (alpha, alpha + 2)
    else:
        name, ends = "frequency", (omega / TURN, 1.25 * omega / TURN)
    return of_two(structure, scene, "gaps", name), (gap, gap + 0.8), ends


def random_boundaries(seed: int) -> list[tuple[_Boundary, list[_Spot], tuple[Any, Any]]]:
    """The first three curves of a problem, five points of each, and the ranges of its numbers."""
    problem, span, ends = random_problem(seed)
    found, last = [], list[tuple[int, Any]]()
    for q2, other in enumerate(ends):
        followed = follow(lambda gap, other=other: problem(gap, other), *span, Options(periods=2, samples=4))  # type: ignore[misc]
        for place in _starts(followed):
            again = any(_is_end(place.flag, place.point.q, q2, *each) for each in last)
            if place.flag > NONE and len(found) < 3 and not again:
                with one_thread():
                    boundary = _Boundary(followed.curve, problem, *ends, place, q2)
                    trail, end = boundary.follow()
                    assert ENDS[end] in ("range", "grazing")
                    found.append((boundary, boundary.spread(trail, 11)[1:10:2], (span, ends)))
                    last.append((place.flag, trail[-1].U))
    return found


def miss(boundary: _Boundary, spot: _Spot, which: int, ranges: tuple[Any, Any]) -> float:
    """How far from a point of a boundary the nearest of its kind is on a branch beside it, in one number alone."""
    both = [low + q * (high - low) for q, (low, high) in zip(spot.U[-2:], ranges, strict=True)]
    curve, near, least = copy(boundary.curve), NEAR * (ranges[which][1] - ranges[which][0]), np.inf
    curve.problem = lambda value: boundary.problem(*(value if k == which else both[k] for k in (0, 1)))
    curve.start, curve.stop = both[which] - near, both[which] + near
    u = np.append(spot.U[: boundary.w.size + boundary.events], 0.5)
    residual = curve.residual_at(u, spot.residual.frame)
    assert residual is not None
    slope = curve._slopes(residual)[0]
    along = np.linalg.svd(np.column_stack([residual.matrix, slope]))[2][-1]
    point = curve._point(residual, along)
    assert point is not None
    for length, side in product(0.02 * 4.0 ** -np.arange(5), (-1, 1)):
        beside = curve.step(point, side * length)
        if beside is not None and beside.is_motion and least > 1e-8:
            trace = _followed(curve, beside if side < 0 else _reversed(beside))
            found = [abs(place.point.q - 0.5) * 2 * near for place in trace if place.flag == boundary.kind]
            least = min([least, *found])
    return least


@pytest.mark.slow
@pytest.mark.parametrize("seed", SEEDS)
def test_points_of_random_boundaries_are_found_again_in_either_number(seed: int) -> None:
    found = random_boundaries(seed)
    assert found
    for boundary, spots, ranges in found:
        for spot in spots:
            for which in (0, 1):
                if abs(spot.tangent[-1 - which]) > PARALLEL * np.linalg.norm(spot.tangent[-2:]):
                    with one_thread():
                        assert miss(boundary, spot, which, ranges) < 1e-8
