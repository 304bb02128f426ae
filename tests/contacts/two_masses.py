"""Two masses on springs with a contact at each."""

from typing import Any

import numpy as np
from several import of_entries

from workflow.models import Cases, Rayleigh, Structure


def two_masses(**entries: Any) -> Structure:
    """Return two masses on springs, a contact at each."""
    return of_entries(
        {"mass": np.diag([1.0, 2.0]), "stiffness": np.diag([1e4, 1e4]), "contact": np.eye(2), **entries}, Rayleigh()
    )


def pressed(structure: Structure, **more: Any) -> Cases:
    """Return a case that is pushed against both its contacts, in equilibrium."""
    size, zero = structure.contacts.count, np.zeros(1)
    given: dict[str, Any] = dict.fromkeys(("e", "alpha", "gap", "mean"), zero)
    states = {name: np.zeros((1, 2)) for name in ("displacement", "velocity")} | {
        name: np.zeros((1, structure.thermal_size)) for name in ("heating", "temperature")
    }
    given |= {"steady": np.array([[30.0, 50.0]]), "gaps": np.full((1, size), 1e-3), "turns": np.zeros((1, size, 1))}
    return structure.coordinates.transformed(Cases(**{**given, **states, **more}))
