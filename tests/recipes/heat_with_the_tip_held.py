"""Fixed-interface modes for heat too: temperatures of the structure whose tip keeps its temperature."""

import numpy as np
from scipy.linalg import eigh

from workflow.models import Structure
from workflow.reduction import Vectors, fixed_interface_modes, mechanical_vectors, thermal_vectors


def mechanical(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the lowest ``count`` modes with the tip held and the constraint mode, as craig_bampton does."""
    return mechanical_vectors(structure, fixed_interface_modes(structure, count))


def thermal(structure: Structure, count: int, duration: float | None) -> Vectors:
    """Return the slowest ``count`` modes with the tip held, K2 χ = μ C2 χ inside, and the constraint mode."""
    inside = np.s_[:-1, :-1]
    _, shapes = eigh(structure.conductance_matrix[inside], structure.heat_capacity[inside])
    return thermal_vectors(structure, np.vstack([shapes[:, :count], np.zeros(count)]))
