"""What a structure answers by itself: natural frequencies and thermal rates, and growth by constant heat."""

from __future__ import annotations

import numpy as np
import scipy

from workflow.kernels import Array
from workflow.models._structure import Structure


def frequencies(structure: Structure) -> Array:
    """Return ω of the modes, rad/s, ascending; of a chain without matrices the lowest and the highest.

    Of sparse matrices the lowest and about the highest. The last one is infinite where the tip has no mass.
    """
    return np.sqrt(structure.mechanical.spectrum())


def rates(structure: Structure) -> Array:
    """Return μ of the thermal modes, 1/s, ascending; of long chains and sparse matrices as :func:`frequencies`."""
    return structure.thermal.spectrum()


def growth_at_once(structure: Structure) -> float:
    """Return the quasi-static tip growth by temperatures without heat capacity that heat loads raise at once, m."""
    given = structure.coordinates
    if given is None or not given.expansive.any():
        return 0.0
    return float(structure.mechanical.answer(given.displacement_basis.T @ given.expansive)[-1])


def rounding_of_flexibility(structure: Structure) -> float:
    """Return about by which share the roundings of the entries of K1 change S = e_nᵀ K1⁻¹ e_n, 1.

    With u = K1⁻¹ e_n a change of the entries changes S by -uᵀ δK1 u; half a unit in the last place of each, added as
    independent ones: ε/2 √(Σ (u_i K_ij u_j)²)/S. It is large where an entry is far larger than what it must hold of S.
    """
    answer = structure.mechanical.answer(structure.mechanical.unit_tip)
    entries = scipy.sparse.coo_array(structure.mechanical.stiffness)
    row, column = entries.coords
    energies = answer[row] * entries.data * answer[column]
    return float(np.finfo(float).eps / 2 * np.linalg.norm(energies) / abs(answer[-1]))
