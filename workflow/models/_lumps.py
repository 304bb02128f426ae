"""Assembly of lumps on a line into a :class:`Structure`: equations (1a) and (1b) of DESIGN."""

from __future__ import annotations

import numpy as np

from workflow.declare import Values
from workflow.models._structure import Array, Rayleigh, Structure


def per_item(value: Values, count: int) -> Array:
    """Spread a scalar over ``count`` nodes or springs, or take one value per item as it is."""
    return np.broadcast_to(np.asarray(value, dtype=np.float64), (count,)).copy()


def assemble_chain(
    *,
    mass: Array,
    stiffness: Array,
    damping: Rayleigh,
    free_expansion: Array,
    heat_capacity: Array,
    conductance: Array,
    convection: Array,
) -> Structure:
    """Assemble n lumps in line, spring i joining nodes i-1 and i; node 0 is the clamped, cold root.

    Parameters
    ----------
    mass, heat_capacity, convection
        m_i [kg], c_i [J/K] and b_i [W/K] of the nodes 1 … n, shape (n,).
    stiffness, conductance
        k_i [N/m] and κ_i [W/K] of the springs 1 … n, shape (n,).
    free_expansion
        a ℓ_i, free thermal elongation of a spring per kelvin [m/K], shape (n,).
    damping
        Rayleigh coefficients.
    """
    n = mass.size
    joins = np.eye(n) - np.eye(n, k=-1)
    mean_temperature = (np.eye(n) + np.eye(n, k=-1)) / 2
    difference = np.concatenate([joins, np.eye(n)])
    return Structure(
        mass=np.diag(mass),
        springs=stiffness,
        elongation=joins,
        expansion=free_expansion[:, None] * mean_temperature,
        damping=damping,
        heat_capacity=np.diag(heat_capacity),
        conductors=np.concatenate([conductance, convection]),
        difference=difference,
        content=heat_capacity.copy(),
        grounded=difference.sum(axis=1),
    )
