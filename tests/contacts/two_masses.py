"""Two masses on springs with a contact at each."""

from typing import Any

import numpy as np
from several import of_entries

from scenes import cases_of_file
from workflow.models import Cases, Rayleigh, Structure


def two_masses(**entries: Any) -> Structure:
    """Return two masses on springs, a contact at each."""
    return of_entries(
        {"mass": np.diag([1.0, 2.0]), "stiffness": np.diag([1e4, 1e4]), "contact": np.eye(2), **entries}, Rayleigh()
    )


def pressed(structure: Structure, **more: Any) -> Cases:
    """Return a case that is pushed against both its contacts, in equilibrium."""
    return cases_of_file(structure, steady=[30.0, 50.0], **{"gaps": [1e-3, 1e-3], **more})
