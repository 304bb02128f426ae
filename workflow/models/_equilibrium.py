"""Equilibrium of a structure at standstill under its constant loads: ``initial: static``."""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.models._pair import UNBALANCED
from workflow.models._sliding import static_share
from workflow.models._structure import Structure


class NoEquilibriumError(ValueError):
    """The constant loads move the structure for ever."""


def static_equilibrium(
    structure: Structure, load: Array, heating: Array, gap: float, friction: float = 0.0
) -> tuple[Array, Array]:
    """Return displacement and temperature at rest under constant loads, casing included.

    K2 θ = q and K1 x + K12 θ = f - λ (e_n - µ t) with 0 <= gap - x_n ⊥ λ >= 0. Contact makes no heat: α does not act.
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
        The loads move a free body, or heat that cannot leave keeps warming the structure.
    """
    pair, thermal = structure.mechanical, structure.thermal
    if thermal.moves(heating):
        raise NoEquilibriumError("the heat load cannot leave the structure, its temperature has no equilibrium")
    temperature = thermal.static_answers(heating[None])[0]
    force = load + structure.thermal_forces(temperature)
    if not pair.moves(force):
        free = pair.static_answers(force[None])[0]
        if free[-1] <= gap:
            return free, temperature
    moved, pressing = pair.constraint * force, pair.tip_stiffness * gap
    reaction, yields = float(moved.sum()) - pressing, 1.0
    if structure.tangent is not None:
        yields = 1 - friction * static_share(structure)
        force = force + friction * max(reaction, 0.0) / yields * structure.tangent if yields > 0 else force
    if reaction < -UNBALANCED * (np.abs(moved).sum() + abs(pressing)) or yields <= 0 or pair.moves(force, held=True):
        raise NoEquilibriumError("the constant loads move the structure for ever, it has no equilibrium")
    return gap * pair.constraint + pair.answer_held(force), temperature
