"""A reduced structure with the bases that lead back to the nodes, and how a basis makes one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from workflow.models import Array, Cases, Matrices, Structure, project, static_tip_growth
from workflow.models._from_matrices import Forms, structure_of_forms
from workflow.models._sparse import Sparse


@dataclass(frozen=True, eq=False)
class Reduction:
    """A reduced structure and the bases that lead back to the nodes.

    Attributes
    ----------
    structure
        The reduced structure; its coordinates are interior vectors, then the tip.
    displacement_basis, temperature_basis
        x = displacement_basis · x_r (and v likewise), θ = temperature_basis · θ_r, shapes
        ``(node, mechanical)`` and ``(node, thermal)``; the tip's row is (0, …, 0, 1).
    displacement_projection, temperature_projection
        Initial states to reduced ones: the tip as it is, the interior inertia-orthogonally onto
        its vectors, shapes ``(mechanical, node)`` and ``(thermal, node)``.
    carried
        Displacement that temperatures carry with them, m/K, ``(node, thermal)``: x = displacement_basis · x_r +
        carried · θ_r, v = displacement_basis · v_r. It is 0 at the tip and M-orthogonal to the interior vectors.
        ``None`` for none.
    """

    structure: Structure
    displacement_basis: Array
    temperature_basis: Array
    displacement_projection: Array
    temperature_projection: Array
    carried: Array | None = None

    def project(self, cases: Cases) -> Cases:
        """Return the cases of the full structure in reduced coordinates."""
        return replace(
            cases,
            steady=project(self.displacement_basis.T, cases.steady),
            heating=project(self.temperature_basis.T, cases.heating),
            displacement=project(self.displacement_projection, cases.displacement),
            velocity=project(self.displacement_projection, cases.velocity),
            temperature=project(self.temperature_projection, cases.temperature),
        )


@dataclass(frozen=True, eq=False)
class Vectors:
    """Basis of the displacements, or of the temperatures.

    Attributes
    ----------
    shapes
        Interior vectors, 0 at the tip, then the tip's own vector, 1 at the tip, shape ``(node, coordinate)``.
    deformation
        Elongation of each spring, or temperature difference across each conductor, per coordinate,
        shape ``(spring, coordinate)``.
    projection
        From states to coordinates, shape ``(coordinate, node)``.
    has_massless_tip
        Whether the tip's own vector has no inertia and the interior ones, in which all of it is, have the unit matrix.
    """

    shapes: Array
    deformation: Array
    projection: Array
    has_massless_tip: bool = False


def mechanical_vectors(structure: Structure, interior: Array) -> Vectors:
    """Return the constraint mode behind interior displacements, which are orthonormal in M and 0 at the tip."""
    constraint, elongation = structure.mechanical.constraint, structure.mechanical.deformed
    deformation = np.column_stack([structure.elongations(interior), elongation])
    projection = _projection(structure.inertia_forces(interior).T, constraint)
    return Vectors(np.column_stack([interior, constraint]), deformation, projection)


def massless_vectors(structure: Structure, interior: Array, tip: Array, strain: Array, modes: Array) -> Vectors:
    """Return interior displacements and the tip's vector, which is given no inertia.

    Parameters
    ----------
    structure
        The full structure.
    interior
        0 at the tip, ``(node, vector)``.
    tip
        1 at the tip and orthogonal to ``modes`` in M, ``(node,)``; ``strain`` is its elongation of the springs.
    modes
        Orthonormal in M, ``(node, vector)``: the interior vectors up to multiples of the tip's. They hold all inertia.
    """
    deformation = np.column_stack([structure.elongations(interior), strain])
    projection = _projection(structure.inertia_forces(modes).T, tip)
    return Vectors(np.column_stack([interior, tip]), deformation, projection, has_massless_tip=True)


def thermal_vectors(structure: Structure, interior: Array) -> Vectors:
    """Return the constraint mode behind interior temperatures, which are orthonormal in C2 and 0 at the tip."""
    constraint, difference = structure.thermal.constraint, structure.thermal.deformed
    deformation = np.column_stack([structure.differences(interior), difference])
    projection = _projection(structure.heat_contents(interior).T, constraint)
    return Vectors(np.column_stack([interior, constraint]), deformation, projection)


def _projection(onto_interior: Array, constraint: Array) -> Array:
    """Return what takes states to [interior, tip]: the tip as it is, the rest onto the interior vectors.

    ``onto_interior`` is interiorᵀ · inertia.
    """
    tip = np.zeros(constraint.size)
    tip[-1] = 1.0
    rows = np.vstack([onto_interior, tip])
    rows[:-1, -1] = -onto_interior[:, :-1] @ constraint[:-1]
    return rows


def _mass(structure: Structure, mechanical: Vectors) -> Array:
    """Return Xᵀ M X, or the unit matrix on the interior vectors where the tip has no mass."""
    if mechanical.has_massless_tip:
        mass = np.eye(mechanical.shapes.shape[1])
        mass[-1, -1] = 0.0
        return mass
    return mechanical.shapes.T @ structure.inertia_forces(mechanical.shapes)


def _along(structure: Structure, shapes: Array) -> Array | None:
    """Return Xᵀt of the direction of friction, ``None`` where there is none."""
    return None if structure.tangent is None else shapes.T @ structure.tangent


def quadratic_forms(structure: Sparse, mechanical: Vectors, thermal: Vectors, carried: Array | None) -> Matrices:
    """Return Xᵀ M X, Xᵀ K1 X, Xᵀ (K12 Θ + K1 Γ), Θᵀ C2 Θ and Θᵀ K2 Θ as a structure."""
    x, theta = mechanical.shapes, thermal.shapes
    forces = -structure.thermal_forces(theta)
    if carried is not None:
        forces = forces + structure.elongations(carried)
    forms = Forms(
        mass=_mass(structure, mechanical),
        stiffness=x.T @ mechanical.deformation,
        coupling=x.T @ forces,
        heat_capacity=theta.T @ structure.heat_contents(theta),
        conductance=theta.T @ thermal.deformation,
        even_rise=thermal.projection @ structure.even_rise,
        tip_growth=static_tip_growth(structure) @ theta,
        tangent=_along(structure, x),
    )
    return replace(
        structure_of_forms(forms, structure.damping),
        load=None if structure.load is None else x.T @ structure.load,
        damper=None if structure.damper is None else x.T @ np.asarray(structure.damper @ x),
    )


def unreduced(deformations: Callable[[Array], Array], size: int) -> Vectors:
    """Return a unit vector for every coordinate."""
    every = np.eye(size)
    return Vectors(every, deformations(every), every)


def galerkin(structure: Structure, mechanical: Vectors, thermal: Vectors, carried: Array | None = None) -> Reduction:
    """Return the structure projected on its bases: Φᵀ M Φ, elongation Φ, expansion Θ, Θᵀ C2 Θ, difference Θ.

    Displacements Γ that temperatures carry, ``(node, thermal)``, relieve the springs: expansion Θ - elongation Γ.
    """
    if isinstance(structure, Sparse):
        return Reduction(
            quadratic_forms(structure, mechanical, thermal, carried),
            mechanical.shapes,
            thermal.shapes,
            mechanical.projection,
            thermal.projection,
            carried,
        )
    x, theta = mechanical.shapes, thermal.shapes
    expansion = structure.expansions(theta)
    reduced = Matrices(
        mass=_mass(structure, mechanical),
        springs=structure.springs,
        elongation=mechanical.deformation,
        expansion=expansion if carried is None else expansion - structure.elongations(carried),
        heat_capacity=theta.T @ structure.heat_contents(theta),
        conductors=structure.conductors,
        difference=thermal.deformation,
        even_rise=thermal.projection @ structure.even_rise,
        damping=structure.damping,
        load=None if structure.load is None else x.T @ structure.load,
        damper=None if structure.damper is None else x.T @ (structure.damper @ x),
        tangent=_along(structure, x),
        tip_growth=static_tip_growth(structure) @ theta,
    )
    return Reduction(reduced, x, theta, mechanical.projection, thermal.projection, carried)
