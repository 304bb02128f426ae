"""Matrices of a structure as they are given, in its own coordinates or in others."""

from dataclasses import replace
from typing import Any

import numpy as np

from workflow.models import Array, GivenMatrices, Structure


def given(structure: Structure, **other: Any) -> GivenMatrices:
    """The matrices of a chain, its tip the contact."""
    tip = np.zeros(structure.mechanical_size)
    tip[-1] = 1.0
    matrices = GivenMatrices(
        mass=structure.mass,
        stiffness=structure.stiffness_matrix,
        coupling=structure.coupling_matrix,
        heat_capacity=structure.heat_capacity,
        conductance=structure.conductance_matrix,
        contact=tip,
        thermal_contact=tip,
        steady=np.zeros(tip.size),
        heating=np.zeros(tip.size),
        damping=structure.damping,
    )
    return replace(matrices, **other)


def turned(matrices: GivenMatrices, x: Array, theta: Array) -> GivenMatrices:
    """The same structure in other coordinates, x_old = x · x_new and θ_old = theta · θ_new."""
    return GivenMatrices(
        mass=x.T @ matrices.mass @ x,
        stiffness=x.T @ matrices.stiffness @ x,
        coupling=x.T @ matrices.coupling @ theta,
        heat_capacity=theta.T @ matrices.heat_capacity @ theta,
        conductance=theta.T @ matrices.conductance @ theta,
        contact=x.T @ matrices.contact,
        thermal_contact=theta.T @ matrices.thermal_contact,
        steady=x.T @ matrices.steady,
        heating=theta.T @ matrices.heating,
        damping=matrices.damping,
    )
