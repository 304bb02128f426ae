"""Two masses on springs with a contact at each."""

from dataclasses import replace
from typing import Any

import numpy as np

from scenes import cases_of_file, movable, of_entries
from workflow.models import Cases, Structure


def two_masses(**entries: Any) -> Structure:
    """Return two masses on springs, a contact at each, or with rows that a file is refused for."""
    rows = {
        field: entries.pop(name) for field, name in (("normal", "contact"), ("tangent", "tangent")) if name in entries
    }
    masses = {"mass": np.diag([1.0, 2.0]), "stiffness": np.diag([1e4, 1e4]), "contact": np.eye(2)}
    structure = of_entries({**masses, **entries})
    rows = {name: row @ structure.coordinates.displacement_basis for name, row in rows.items()}
    return replace(structure, contacts=replace(structure.contacts, **rows))


def pressed(structure: Structure, **more: Any) -> Cases:
    """Return a case that is pushed against both its contacts, in equilibrium."""
    return movable(cases_of_file(structure, steady=[30.0, 50.0], **{"gaps": [1e-3, 1e-3], **more}))
