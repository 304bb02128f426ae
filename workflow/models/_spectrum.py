"""Natural frequencies and thermal rates of a structure: all of them, or the ends of a long list."""

from __future__ import annotations

import numpy as np

from workflow.kernels import Array
from workflow.kernels.algebra import MOST_BY_JACOBI
from workflow.models._chain import Chain
from workflow.models._long_chain import frequency_range, rate_range
from workflow.models._modes import mechanical_modes
from workflow.models._sparse import Sparse
from workflow.models._sparse_pair import SparsePair
from workflow.models._structure import Structure
from workflow.models._tip_held import every_thermal_mode


def frequencies(structure: Structure) -> Array:
    """Return ω of the modes, rad/s, ascending; of a chain without matrices the lowest and the highest.

    Of sparse matrices the lowest and about the highest. The last one is infinite where the tip has no mass.
    """
    if isinstance(structure, Chain) and not structure.has_matrices:
        return frequency_range(structure)
    if isinstance(structure, Sparse):
        return np.sqrt(_ends(structure.mechanical))
    modes = mechanical_modes(structure)
    return np.where(modes.inertia > 0, modes.values, np.inf)


def rates(structure: Structure) -> Array:
    """Return μ of the thermal modes, 1/s, ascending; of long chains and sparse matrices as :func:`frequencies`."""
    if isinstance(structure, Chain) and not structure.has_matrices:
        return rate_range(structure)
    if isinstance(structure, Sparse):
        return _ends(structure.thermal)
    return every_thermal_mode(structure).values


def fastest_rate(structure: Structure) -> float:
    """Return the largest μ, 1/s; of a chain above 300 nodes by passes along it, without the others."""
    if isinstance(structure, Chain) and structure.thermal_size > MOST_BY_JACOBI:
        return float(rate_range(structure)[-1])
    return float(rates(structure)[-1])


def _ends(pair: SparsePair) -> Array:
    """Return the lowest and about the largest eigenvalue of a pair."""
    lowest = float(pair.modes(1)[0][0])
    return np.array([lowest, max(pair.largest(), lowest)])
