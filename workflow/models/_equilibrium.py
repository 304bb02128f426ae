"""Static equilibrium of a structure under its constant loads: ``initial: static``."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workflow.kernels import Array
from workflow.models._cases import Cases, distinct_rows
from workflow.models._pair import UNBALANCED
from workflow.models._sliding import static_share
from workflow.models._structure import Structure


class NoEquilibriumError(ValueError):
    """A structure has no equilibrium under its constant loads."""


def static_equilibrium(
    structure: Structure, load: Array, heating: Array, gap: float, friction: float = 0.0
) -> tuple[Array, Array]:
    """Return displacement and temperature at rest under constant loads, casing included.

    K2 θ = q and K1 x + K12 θ = f - λ (e_n - µ t) with 0 <= gap - x_n ⊥ λ >= 0. At rest contact makes no heat.
    A pressed tip has x = gap ψ + K1⁻¹ (f + µ λ t - K12 θ), inverted with the tip held, and λ (1 - µ ψᵀt) = ψᵀ (f -
    K12 θ) - σ gap.

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
        The loads accelerate a free body, or heat that cannot leave warms the structure for ever.
    """
    pair, thermal = structure.mechanical, structure.thermal
    if thermal.moves(heating):
        raise NoEquilibriumError("the heat load cannot leave the structure, its temperature has no equilibrium")
    temperature = thermal.solve(heating)
    force = load + structure.thermal_forces(temperature)
    if not pair.moves(force):
        free = pair.solve(force)
        if free[-1] <= gap:
            return free, temperature
    moved, pressing = pair.constraint * force, pair.tip_stiffness * gap
    reaction, yields = float(moved.sum()) - pressing, 1.0
    if structure.tangent is not None:
        yields = 1 - friction * static_share(structure)
        force = force + friction * max(reaction, 0.0) / yields * structure.tangent if yields > 0 else force
    if reaction < -UNBALANCED * (np.abs(moved).sum() + abs(pressing)) or yields <= 0 or pair.moves(force, held=True):
        raise NoEquilibriumError("the constant loads move the structure for ever, it has no equilibrium")
    return gap * pair.constraint + pair.solve(force, held=True), temperature


def at_rest(structure: Structure, cases: Cases) -> Cases:
    """Return cases that start in equilibrium under their constant loads; a pressed tip has the velocity ḋ(0).

    ``structure`` is the one that is run, full or reduced, so that none of its modes is excited.

    Raises
    ------
    NoEquilibriumError
        A case has no equilibrium under its constant loads.
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
