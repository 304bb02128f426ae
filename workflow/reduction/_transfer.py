"""Counts of vectors of a basis that meet a tolerance of the tip's transfer functions where a case excites them.

    displacement by forces   e_nᵀ (K1 + s C1 + s² M)⁻¹ f,     temperature by heat   e_nᵀ (K2 + s C2)⁻¹ q

of the full structure and of the reduced one are compared on s = (i + 1/5) ω, ω log-spaced up to π by the shortest time
that steps or samples resolve; heat from 1/duration on, forces from the frequency of the load on. Loads and contacts
come and go in steps, whose spectrum falls as 1/ω: squares of the differences are weighted by 1/ω². The real part of s
widens resonances to the distance of the frequencies. Forces are compared at s = 2π i f of the load too, and so are
both structures' α_c. What counts are right is decided by trials in time, which begin with these.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from workflow.kernels.algebra import Complex
from workflow.models import Array, Structure, critical_alpha
from workflow.reduction._reduction import Reduction

Reduce = Callable[[int, int], Reduction]
"""From counts of mechanical and thermal vectors to the reduction with so many."""

_FREQUENCIES, _WIDTH = 24, 0.2
"""Frequencies that are compared, and the share of each that is the real part of s: some five a decade, and their
distance to each other in half."""


@dataclass(frozen=True, eq=False)
class Excitation:
    """What moves and heats the tip of a case.

    Attributes
    ----------
    duration, shortest
        Duration of the case and the shortest time that its steps or samples resolve, s.
    frequency
        Of the load, Hz; 0 where it has none.
    forces, heats
        Loads that come and go, N or W in any scale, ``(coordinate, load)``.
    """

    duration: float
    shortest: float
    frequency: float
    forces: Array
    heats: Array


def least_counts(
    full: Structure, reduce: Reduce, excitation: Excitation, tolerance: float, most: tuple[int, int]
) -> tuple[int, int]:
    """Return the fewest mechanical and thermal vectors whose transfer functions and α_c are within a tolerance.

    Parameters
    ----------
    full
        The structure as it is.
    reduce
        Its reductions; it is called with at most ``most`` vectors of each kind.
    excitation
        What a case excites.
    tolerance
        Largest relative difference, 1.
    most
        Largest counts; returned where fewer do not do.
    """
    displacements = displacement_answer(full, excitation, excitation.forces)
    temperatures = temperature_answer(full, excitation, excitation.heats)

    def misses_displacement(count: int) -> bool:
        reduced = reduce(count, 0)
        forces = reduced.displacement_basis.T @ excitation.forces
        return _difference(displacement_answer(reduced.structure, excitation, forces), displacements) > tolerance

    def misses_temperature(count: int) -> bool:
        reduced = reduce(0, count)
        heats = reduced.temperature_basis.T @ excitation.heats
        return _difference(temperature_answer(reduced.structure, excitation, heats), temperatures) > tolerance

    mechanical, thermal = _fewest(misses_displacement, most[0]), _fewest(misses_temperature, most[1])
    critical = critical_alpha(full)
    while (mechanical, thermal) != most and _coupling_error(
        reduce(mechanical, thermal).structure, critical
    ) > tolerance:
        mechanical, thermal = min(mechanical + 1, most[0]), min(thermal + 1, most[1])
    return mechanical, thermal


def displacement_answer(structure: Structure, excitation: Excitation, forces: Array) -> Complex:
    """Return the tip's weighted displacement by each force at each frequency, ``(frequency, force)``."""
    stiffness, damping, mass = structure.stiffness_matrix, structure.damping_matrix, structure.mass
    load = 2 * np.pi * excitation.frequency
    points = _points(max(load, 1 / excitation.duration), np.pi / excitation.shortest)
    if load > 0:
        points.append((complex(0.0, load), 1.0))
    dynamic = ((stiffness + s * damping + s * s * mass, weight) for s, weight in points)
    return np.array([weight * np.linalg.solve(matrix, forces)[-1] for matrix, weight in dynamic])


def temperature_answer(structure: Structure, excitation: Excitation, heats: Array) -> Complex:
    """Return the tip's weighted temperature by each heat load at each frequency, ``(frequency, heat)``."""
    conductance, capacity = structure.conductance_matrix, structure.heat_capacity
    points = _points(1 / excitation.duration, np.pi / excitation.shortest)
    return np.array([weight * np.linalg.solve(conductance + s * capacity, heats)[-1] for s, weight in points])


def _points(first: float, last: float) -> list[tuple[complex, float]]:
    """Return values of s, 1/s, over a decade at least, each with the weight of its answer, 1/√ω of the first.

    Steps have the spectrum 1/ω, and ω dω/ω² is what a log-spaced frequency stands for in an integral of squares.
    """
    omega = np.geomspace(first, max(last, 10 * first), _FREQUENCIES)
    return [(complex(_WIDTH * w, w), float(np.sqrt(first / w))) for w in omega]


def _difference(answers: Complex, exact: Complex) -> float:
    """Return the largest relative difference of the answers to a load."""
    size = np.linalg.norm(exact, axis=0)
    apart = np.linalg.norm(answers - exact, axis=0)
    return float(np.max(np.divide(apart, size, out=np.zeros_like(apart), where=size > 0), initial=0.0))


def _coupling_error(structure: Structure, critical: float) -> float:
    """Return the relative error of α_c; 0 where the full structure has none, or 0."""
    if not 0 < critical < np.inf:
        return 0.0
    return abs(critical_alpha(structure) / critical - 1)


def _fewest(misses: Callable[[int], bool], most: int) -> int:
    """Return the smallest count that does not miss by bisection, ``most`` where all others do."""
    low, high = 0, most
    while low < high:
        middle = (low + high) // 2
        if misses(middle):
            low = middle + 1
        else:
            high = middle
    return high
