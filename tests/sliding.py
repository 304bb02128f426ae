"""Structures with a direction in which the casing slides."""

import numpy as np

from scenes import of_entries
from workflow.models import Matrices, Rayleigh

NORMAL, TANGENT = 1, 0
"""Degrees of freedom of :func:`slider`."""


def slider(cross: float = -30.0, inertia: float = 0.0, damping: Rayleigh | None = None) -> Matrices:
    """A mass on a tangential and a normal spring of 100 N/m that lean on each other by ``cross`` N/m."""
    mass, stiffness = np.array([[1.0, inertia], [inertia, 1.0]]), np.array([[100.0, cross], [cross, 100.0]])
    return of_entries({"mass": mass, "stiffness": stiffness, "contact": 1, "tangent": 0}, damping)


def random_structure(rng: np.random.Generator, size: int, heats: int = 3) -> Matrices:
    """A structure without any symmetry between its degrees of freedom, with heat that moves it."""

    def definite(count: int, scale: float) -> np.ndarray:
        root = rng.normal(size=(count, count))
        return scale * (root @ root.T / count + np.eye(count))

    entries = {
        "mass": definite(size, 0.05),
        "stiffness": definite(size, 2e3),
        "tangent": rng.normal(size=size),
        "coupling": rng.normal(size=(size, heats)),
        "heat_capacity": definite(heats, 1.0),
        "conductance": definite(heats, 3.0),
        "contact": size - 1,
        "thermal_contact": heats - 1,
    }
    return of_entries(entries, Rayleigh(0.5, 1e-4))
