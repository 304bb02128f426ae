"""Matrices of a structure as they are given, in its own coordinates or in others."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from workflow.models import Array, GivenMatrices, Structure


def given(structure: Structure, kind: Callable[[Any], Any] = np.asarray, **other: Any) -> GivenMatrices:
    """The matrices of a chain, its tip the contact, as arrays of a kind."""
    tip = np.eye(structure.mechanical_size)[-1]
    names = ("mass", "stiffness_matrix", "coupling_matrix", "heat_capacity", "conductance_matrix")
    matrices = (kind(getattr(structure, name)) for name in names)
    return replace(GivenMatrices(*matrices, tip, tip, 0 * tip, 0 * tip, structure.damping), **other)


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
