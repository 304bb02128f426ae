"""Equilibrium of a structure at standstill under its constant loads: ``initial: static``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import least_squares
from workflow.models import _long_chain
from workflow.models._cases import Cases, distinct_rows
from workflow.models._chain import Chain
from workflow.models._structure import Structure

_UNBALANCED = 1e-9
"""Residual of an equilibrium, as a share of the load, above which there is none: far above the
rounding of a least-squares solution, far below a load on a free body."""


class NoEquilibriumError(ValueError):
    """The constant loads move the structure for ever."""


def _solve(matrix: Array, load: Array) -> Array | None:
    """Return the minimum-norm solution of a symmetric singular or regular system, or ``None``."""
    scale = float(np.abs(matrix).max(initial=0.0))
    if scale == 0.0:
        return np.zeros_like(load) if not np.any(load) else None
    solution = least_squares(matrix / scale, load / scale)
    unbalanced = np.abs(matrix @ solution - load).max(initial=0.0)
    return solution if unbalanced <= _UNBALANCED * np.abs(load).max(initial=0.0) else None


def static_equilibrium(
    structure: Structure, load: Array, heating: Array, gap: float, friction: float = 0.0
) -> tuple[Array, Array]:
    """Return displacement and temperature at rest under constant loads, casing included.

    K2 θ = q and K1 x + K12 θ = f - λ (e_n - µ t) with 0 <= gap - x_n ⊥ λ >= 0. Contact makes no heat:
    α does not act.

    Parameters
    ----------
    structure
        The full structure.
    load, heating
        Constant loads [N] and heat loads [W], ``(node,)``.
    gap
        Clearance d, m.
    friction
        Friction coefficient µ along the structure's tangent.

    Returns
    -------
    displacement, temperature
        m and K, ``(node,)``.

    Raises
    ------
    NoEquilibriumError
        The loads move a free body, or heat that cannot leave keeps warming the structure.
    """
    if isinstance(structure, Chain):
        displacement, temperature = _long_chain.static_equilibrium(structure, load, heating, gap)
    else:
        displacement, temperature = _by_matrices(structure, load, heating, gap, friction)
    if temperature is None:
        raise NoEquilibriumError("the heat load cannot leave the structure, its temperature has no equilibrium")
    if displacement is None:
        raise NoEquilibriumError("the constant loads move the structure for ever, it has no equilibrium")
    return displacement, temperature


def _by_matrices(
    structure: Structure, load: Array, heating: Array, gap: float, friction: float
) -> tuple[Array | None, Array | None]:
    """Return displacement and temperature at rest, each ``None`` where there is none."""
    temperature = _solve(structure.conductance_matrix, heating)
    if temperature is None:
        return None, None
    stiffness = structure.stiffness_matrix
    force = load - structure.coupling_matrix @ temperature
    free = _solve(stiffness, force)
    if free is not None and free[-1] <= gap:
        return free, temperature
    pressed = np.zeros_like(force)
    pressed[-1] = gap
    interior = _solve(stiffness[:-1, :-1], force[:-1] - stiffness[:-1, -1] * gap)
    if interior is not None:
        pressed[:-1] = interior
        reaction = force[-1] - stiffness[-1] @ pressed
        if reaction >= -_UNBALANCED * (abs(force[-1]) + np.abs(stiffness[-1]) @ np.abs(pressed)):
            return _dragged(structure, stiffness, pressed, reaction, friction), temperature
    return None, temperature


def _dragged(structure: Structure, stiffness: Array, pressed: Array, reaction: float, friction: float) -> Array | None:
    """Return a pressed structure that friction drags along as well, ``None`` where it has no stable place.

    With y the answer to the tangent of the interior, x_i = x_i0 + µ λ y, and λ (1 - µ (t_n - K_ni y)) is the reaction
    without friction.
    """
    if structure.tangent is None or friction == 0:
        return pressed
    moved = _solve(stiffness[:-1, :-1], structure.tangent[:-1])
    if moved is None:
        return None
    yielding = 1 - friction * (structure.tangent[-1] - stiffness[-1, :-1] @ moved)
    if yielding <= 0:
        return None
    return np.append(pressed[:-1] + friction * max(reaction, 0.0) / yielding * moved, pressed[-1])


def at_rest(structure: Structure, cases: Cases) -> Cases:
    """Return cases that start in equilibrium under their constant loads; a pressed tip has the velocity ḋ(0).

    ``structure`` is the one they are run on, so that none of its modes swings.

    Raises
    ------
    NoEquilibriumError
        The constant loads of a case move the structure for ever.
    """
    load = cases.steady.copy()
    load += cases.mean[:, None] * structure.load_direction
    casing = cases.casing_at(0.0)
    first, which = distinct_rows(load, cases.heating, casing[:, None], cases.friction[:, None])
    laws = list(zip(casing.tolist(), cases.friction.tolist(), strict=True))
    states = [static_equilibrium(structure, load[k], cases.heating[k], *laws[k]) for k in first]
    displacement = np.stack([x for x, _ in states])[which]
    temperature = np.stack([theta for _, theta in states])[which]
    velocity = np.zeros_like(displacement)
    velocity[:, -1] = np.where(displacement[:, -1] == casing, cases.casing_velocity_at(0.0), 0.0)
    return replace(cases, displacement=displacement, velocity=velocity, temperature=temperature)
