"""A structure with its tip held: the static answer to a unit tip, and the modes of the interior; modes of the whole."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI, least_squares
from workflow.models._chain import Chain
from workflow.models._long_chain import mechanical_path, thermal_path
from workflow.models._modes import Modes, mechanical_modes, singular_modes, thermal_modes
from workflow.models._path import Path
from workflow.models._sparse import Sparse, TooManyCoordinatesError
from workflow.models._sparse_pair import SparsePair
from workflow.models._structure import Structure

_STRUCTURES = 4
"""Structures whose modes are kept: a study reduces one of them by many bases and counts, then the next one."""

MOST_ONE_BY_ONE = 100
"""Modes of a long chain that are computed one by one: each costs a pass or two along it, and room for its shape."""


def mechanical_constraint(structure: Structure) -> tuple[Array, Array]:
    """Return ψ, the static displacement by a unit displacement of the tip, and its elongation of the springs.

    Shapes ``(mechanical,)`` and ``(spring,)``. Parts that are not linked to the tip stay at zero (minimum norm).
    Where ψ moves the structure as a rigid body the elongation is exactly zero: rank decides, not rounding.
    """
    if isinstance(structure, Sparse):
        return structure.mechanical.constraint, structure.mechanical.forces_of_constraint
    if isinstance(structure, Chain):
        return mechanical_path(structure).unit_tip()
    return _least_squares(structure.springs, structure.elongation)


def thermal_constraint(structure: Structure) -> tuple[Array, Array]:
    """Return the steady temperatures by a unit temperature of the tip, and their differences across the conductors.

    As :func:`mechanical_constraint`; the differences are exactly zero where no heat leaves the tip's part.
    """
    if isinstance(structure, Sparse):
        return structure.thermal.constraint, structure.thermal.forces_of_constraint
    if isinstance(structure, Chain):
        warmth, differences = thermal_path(structure).unit_tip()
        return warmth, np.concatenate([differences, warmth])
    return _least_squares(structure.conductors, structure.difference)


def _least_squares(weights: Array, deformation: Array) -> tuple[Array, Array]:
    """Return the vector u of least deformation energy with u_n = 1, of minimum norm, and its deformation."""
    weighted = np.sqrt(weights)[:, None] * deformation
    shape = np.append(least_squares(weighted[:, :-1], -weighted[:, -1]), 1.0)
    deformed = deformation @ shape
    rounding = max(weighted.shape) * np.finfo(float).eps  # numpy.linalg.matrix_rank's own rule
    if np.linalg.norm(np.sqrt(weights) * deformed) <= rounding * np.linalg.norm(weighted):
        deformed = np.zeros_like(deformed)
    return shape, deformed


def held_modes(structure: Structure, count: int | None = None) -> Modes:
    """Return the lowest modes with the tip held (all if not said), shapes ``(coordinate, mode)``, the tip's row 0."""
    if isinstance(structure, Sparse):
        squares, shapes = structure.mechanical.held_modes(_few(structure.mechanical, count))
        return Modes(np.sqrt(squares), shapes)
    if isinstance(structure, Chain) and count is not None and _one_by_one(structure, count):
        interior, inertia = mechanical_path(structure).without_tip(), structure.masses[:-1]
        modes = interior.modes(inertia, 0, count - 1) if count else Modes(np.zeros(0), np.zeros((inertia.size, 0)))
    else:
        modes = _all_held(structure)
    shapes = modes.shapes[:, :count]
    return Modes(modes.values[:count], np.vstack([shapes, np.zeros(shapes.shape[1])]))


def held_thermal_modes(structure: Structure, count: int | None = None) -> Modes:
    """Return the slowest thermal modes with the tip at 0 (all if not said), ``(coordinate, mode)``; values in 1/s."""
    if isinstance(structure, Sparse):
        return Modes(*structure.thermal.held_modes(_few(structure.thermal, count)))
    if isinstance(structure, Chain) and count is not None and _one_by_one(structure, count):
        interior, capacities = thermal_path(structure).without_tip(), structure.heat_capacities[:-1]
        modes = (
            interior.modes(capacities, 0, count - 1) if count else Modes(np.zeros(0), np.zeros((capacities.size, 0)))
        )
    else:
        modes = _all_held_thermal(structure)
    shapes = modes.shapes[:, :count]
    return Modes(modes.values[:count] ** 2, np.vstack([shapes, np.zeros(shapes.shape[1])]))


def held_displacements(structure: Structure) -> Callable[[Array], Array]:
    """Return what gives the static displacement ``(mechanical,)``, m, by forces, N, with the tip held.

    Forces on a part that nothing holds are left out.
    """
    if isinstance(structure, Sparse):
        return structure.mechanical.answer_held
    if isinstance(structure, Chain):
        interior = mechanical_path(structure).without_tip()
        return lambda force: _solved(interior, force)
    modes = held_modes(structure)
    stiffness = modes.values**2
    return lambda force: modes.shapes @ _divided(modes.shapes.T @ force, stiffness)


def held_temperatures(structure: Structure) -> Callable[[Array, float], Array]:
    """Return what gives (K2 + s C2)⁻¹ q with the tip at 0, K, ``(thermal,)``, by heat q, W, and s > 0, 1/s."""
    if isinstance(structure, Sparse):
        return structure.thermal.answers_held_shifted()
    if isinstance(structure, Chain):
        interior, capacities = thermal_path(structure).without_tip(), structure.heat_capacities[:-1]
        return lambda heat, shift: _solved(Path(interior.ground + shift * capacities, interior.joint), heat)
    modes = held_thermal_modes(structure)
    return lambda heat, shift: modes.shapes @ ((modes.shapes.T @ heat) / (modes.values + shift))


def _solved(interior: Path, load: Array) -> Array:
    """Return the answer of the nodes before the tip, 0 at the tip, and 0 everywhere if nothing holds what is driven."""
    answer = interior.solve(load[:-1])
    return np.zeros(load.size) if answer is None else np.append(answer, 0.0)


def _divided(forces: Array, stiffness: Array) -> Array:
    return np.divide(forces, stiffness, out=np.zeros_like(forces), where=stiffness > 0)


def lowest_modes(structure: Structure, count: int) -> Modes:
    """Return the lowest mechanical modes of the whole structure, the tip free, shapes ``(coordinate, mode)``."""
    if isinstance(structure, Sparse):
        squares, shapes = structure.mechanical.modes(count)
        return Modes(np.sqrt(squares), shapes)
    if isinstance(structure, Chain) and _one_by_one(structure, count):
        return mechanical_path(structure).modes(structure.masses, 0, count - 1)
    modes = _all(structure)
    return Modes(modes.values[:count], modes.shapes[:, :count])


def slowest_modes(structure: Structure, count: int | None = None) -> Modes:
    """Return the slowest thermal modes of the whole structure (all if not said), shapes ``(coordinate, mode)``."""
    if isinstance(structure, Sparse):
        return Modes(*structure.thermal.modes(_few(structure.thermal, count)))
    if isinstance(structure, Chain) and count is not None and _one_by_one(structure, count):
        modes = thermal_path(structure).modes(structure.heat_capacities, 0, count - 1)
        return Modes(modes.values**2, modes.shapes)
    modes = every_thermal_mode(structure)
    return Modes(modes.values[:count], modes.shapes[:, :count])


@lru_cache(maxsize=_STRUCTURES)
def _all(structure: Structure) -> Modes:
    return mechanical_modes(structure)


@lru_cache(maxsize=_STRUCTURES)
def every_thermal_mode(structure: Structure) -> Modes:
    """Return all thermal modes of the whole structure, computed once for a few structures."""
    return thermal_modes(structure)


@lru_cache(maxsize=_STRUCTURES)
def _all_held(structure: Structure) -> Modes:
    strain = np.sqrt(structure.springs)[:, None] * structure.elongation
    return singular_modes(structure.mass[:-1, :-1], strain[:, :-1])


@lru_cache(maxsize=_STRUCTURES)
def _all_held_thermal(structure: Structure) -> Modes:
    flow = np.sqrt(structure.conductors)[:, None] * structure.difference
    return singular_modes(structure.heat_capacity[:-1, :-1], flow[:, :-1])


def _few(pair: SparsePair, count: int | None) -> int:
    """Return how many modes are requested.

    Raises
    ------
    TooManyCoordinatesError
        All are.
    """
    if count is None:
        raise TooManyCoordinatesError(pair.size)
    return count


def _one_by_one(chain: Chain, count: int) -> bool:
    """Tell whether so few modes of so long a chain are requested that each is computed by passes along it."""
    return count <= MOST_ONE_BY_ONE + 1 and chain.mechanical_size > MOST_BY_JACOBI
