"""Structures with a direction in which the casing slides."""

from typing import Any

import numpy as np

from workflow.models import GivenMatrices, Matrices, Rayleigh, structure_from_matrices

NORMAL, TANGENT = 1, 0
"""Degrees of freedom of :func:`slider`."""


def structure(mass: Any, stiffness: Any, tangent: Any, damping: Rayleigh | None = None, **more: Any) -> Matrices:
    """A structure by its matrices, its last degree of freedom the contact; cold and rigid to heat where not said."""
    mass, stiffness = np.atleast_2d(mass).astype(float), np.atleast_2d(stiffness).astype(float)
    size = mass.shape[0]
    heats = np.atleast_2d(more.get("heat_capacity", [[1.0]])).shape[0]
    entries: dict[str, Any] = {
        "coupling": np.zeros((size, heats)),
        "heat_capacity": np.eye(heats),
        "conductance": np.eye(heats),
        **more,
    }
    return structure_from_matrices(
        GivenMatrices(
            mass=mass,
            stiffness=stiffness,
            contact=np.eye(size)[-1],
            thermal_contact=np.eye(heats)[-1],
            steady=np.zeros(size),
            heating=np.zeros(heats),
            damping=damping or Rayleigh(),
            tangent=None if tangent is None else np.asarray(tangent, dtype=float),
            **entries,
        )
    )


def slider(cross: float = -30.0, inertia: float = 0.0, damping: Rayleigh | None = None) -> Matrices:
    """A mass on a tangential and a normal spring of 100 N/m that lean on each other by ``cross`` N/m."""
    mass = [[1.0, inertia], [inertia, 1.0]]
    return structure(mass, [[100.0, cross], [cross, 100.0]], [1.0, 0.0], damping)


def random_structure(rng: np.random.Generator, size: int, heats: int = 3) -> Matrices:
    """A structure without any symmetry between its degrees of freedom, with heat that moves it."""

    def definite(count: int, scale: float) -> np.ndarray:
        root = rng.normal(size=(count, count))
        return scale * (root @ root.T / count + np.eye(count))

    return structure(
        definite(size, 0.05),
        definite(size, 2e3),
        rng.normal(size=size),
        Rayleigh(0.5, 1e-4),
        coupling=rng.normal(size=(size, heats)),
        heat_capacity=definite(heats, 1.0),
        conductance=definite(heats, 3.0),
    )
