"""Craig–Bampton reduction in first-order form: full structure in, structure of the same type out.

Source: Thorin, Guérin, Legrand (extended abstract); Nachtergaele, Rixen, Steenhoek (2010).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workflow.models import Array, Cases, Structure
from workflow.models._modes import singular_modes


@dataclass(frozen=True, eq=False)
class Reduction:
    """A reduced structure and the bases that lead back to the nodes.

    Attributes
    ----------
    structure
        The reduced structure; its coordinates are interior modes, then the tip.
    displacement_basis, temperature_basis
        x = displacement_basis · x_r (and v likewise), θ = temperature_basis · θ_r, shapes
        ``(node, mechanical)`` and ``(node, thermal)``; the tip's row is (0, …, 0, 1).
    displacement_projection, temperature_projection
        Initial states to reduced ones: the tip as it is, the interior inertia-orthogonally onto
        its modes, shapes ``(mechanical, node)`` and ``(thermal, node)``.
    """

    structure: Structure
    displacement_basis: Array
    temperature_basis: Array
    displacement_projection: Array
    temperature_projection: Array

    def project(self, cases: Cases) -> Cases:
        """Return the cases of the full structure in reduced coordinates."""
        return replace(
            cases,
            steady=cases.steady @ self.displacement_basis,
            heating=cases.heating @ self.temperature_basis,
            displacement=cases.displacement @ self.displacement_projection.T,
            velocity=cases.velocity @ self.displacement_projection.T,
            temperature=cases.temperature @ self.temperature_projection.T,
        )


def _tip_kept_basis(inertia: Array, deformation: Array, kept: int) -> tuple[Array, Array]:
    """Return the basis [fixed-interface modes, constraint mode] and its projection.

    ``deformation`` is S of a stiffness SᵀS. The constraint mode is the static answer of the
    interior to a unit tip; parts that are not linked to the tip get zero (minimum norm).
    """
    size = inertia.shape[0]
    interior = slice(0, size - 1)
    modes = singular_modes(inertia[interior, interior], deformation[:, interior]).shapes[:, :kept]
    static, *_ = np.linalg.lstsq(deformation[:, interior], -deformation[:, -1], rcond=None)
    basis = np.zeros((size, kept + 1))
    basis[interior, :kept] = modes
    basis[interior, kept] = static
    basis[-1, kept] = 1.0
    projection = np.zeros((kept + 1, size))
    onto_modes = modes.T @ inertia[interior, interior]
    projection[:kept, interior] = onto_modes
    projection[:kept, -1] = -onto_modes @ static
    projection[kept, -1] = 1.0
    return basis, projection


def reduce_structure(structure: Structure, mechanical_modes: int, thermal_modes: int) -> Reduction:
    """Replace the interior by fixed-interface modes, keep the tip (x_n, v_n, θ_n) as it is.

    Parameters
    ----------
    structure
        The full structure, or a reduced one.
    mechanical_modes, thermal_modes
        Interior modes kept, lowest first, at most ``size - 1`` each; with all of them nothing is
        lost.

    Raises
    ------
    ValueError
        More modes are asked for than the interior has, or fewer than none.
    """
    for kept, size in ((mechanical_modes, structure.mechanical_size), (thermal_modes, structure.thermal_size)):
        if not 0 <= kept <= size - 1:
            raise ValueError(f"{kept} interior modes of a structure that has {size - 1}")
    mechanical, to_mechanical = _tip_kept_basis(
        structure.mass, np.sqrt(structure.springs)[:, None] * structure.elongation, mechanical_modes
    )
    thermal, to_thermal = _tip_kept_basis(
        structure.heat_capacity, np.sqrt(structure.conductors)[:, None] * structure.difference, thermal_modes
    )
    reduced = replace(
        structure,
        mass=mechanical.T @ structure.mass @ mechanical,
        elongation=structure.elongation @ mechanical,
        expansion=structure.expansion @ thermal,
        heat_capacity=thermal.T @ structure.heat_capacity @ thermal,
        difference=structure.difference @ thermal,
    )
    return Reduction(reduced, mechanical, thermal, to_mechanical, to_thermal)
