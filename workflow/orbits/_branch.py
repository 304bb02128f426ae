"""Branches of steady rubs along one parameter."""

from __future__ import annotations

from collections.abc import Callable

from workflow.models import Array, Cases, Structure
from workflow.orbits._options import Options

BIFURCATIONS = ("none", "fold", "period_doubling", "torus", "grazing")
"""Flags of ``bifurcation``."""

Problem = Callable[[float], tuple[Structure, Cases]]
"""Structure and one case at a value of the parameter."""


def branch(
    problem: Problem, start: float, stop: float, points: int, duration: float, options: Options
) -> tuple[dict[str, Array], str]:
    """Return the branch of steady rubs through the first one found at start, at stop or between, and a message.

    Variables are those of :func:`~workflow.orbits.steady_rubs`, ``(points,)`` and ``(points, samples)``, in order of
    arclength, and ``value`` of the parameter and ``bifurcation`` (int8, index in :data:`BIFURCATIONS`), ``(points,)``.
    A point with a flag lies where the bifurcation is. Behind the last point numbers are NaN, ``steady_state`` is
    ``not_found`` and ``bifurcation`` ``none``. Without any point all is so, and the message, which begins with
    ``steady:``, says why.
    """
    raise NotImplementedError
