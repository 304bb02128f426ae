"""A reduced structure, its bases for the expansion to the nodes, and the Galerkin projection that yields them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from workflow.models import Array, Cases, DensePair, Matrices, Pair, Sparse, Structure, project, static_tip_growth
from workflow.models._from_matrices import structure_of_forms

_ORTHONORMAL = 1e-6
"""Accepted deviation of interiorᵀ · inertia · interior from 1, which is the error of projected initial states."""


@dataclass(frozen=True, eq=False)
class Reduction:
    """A reduced structure and its bases for the expansion to the nodes.

    Attributes
    ----------
    structure
        The reduced structure; its coordinates are interior vectors, then the tip.
    displacement_basis, temperature_basis
        x = displacement_basis · x_r (and v likewise), θ = temperature_basis · θ_r, shapes
        ``(node, mechanical)`` and ``(node, thermal)``; the tip's row is (0, …, 0, 1).
    displacement_projection, temperature_projection
        Projection of initial states: the tip itself, the interior inertia-orthogonally to its vectors, shapes
        ``(mechanical, node)`` and ``(thermal, node)``.
    carried
        Static displacement per temperature, m/K, ``(node, thermal)``: x = displacement_basis · x_r + carried · θ_r,
        v = displacement_basis · v_r. It is 0 at the tip and M-orthogonal to the interior vectors. ``None`` for none.
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


class ReducedModel(NamedTuple):
    """The structure on which cases are run, and its reduction; ``None`` where it is unreduced."""

    structure: Structure
    reduction: Reduction | None

    def project(self, cases: Cases) -> Cases:
        """Return cases given on the full structure in the coordinates of this one."""
        return cases if self.reduction is None else self.reduction.project(cases)


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
        Transform of states to coordinates, shape ``(coordinate, node)``.
    has_massless_tip
        Whether the tip's own vector has no inertia, and the interior ones the unit matrix.
    """

    shapes: Array
    deformation: Array
    projection: Array
    has_massless_tip: bool = False


def mechanical_vectors(structure: Structure, interior: Array) -> Vectors:
    """Return interior displacements, orthonormal in M and 0 at the tip, followed by the constraint mode."""
    return _with_constraint(structure.mechanical, interior)


def thermal_vectors(structure: Structure, interior: Array) -> Vectors:
    """Return interior temperatures, orthonormal in C2 and 0 at the tip, followed by the constraint mode."""
    return _with_constraint(structure.thermal, interior)


def _with_constraint(pair: Pair, interior: Array) -> Vectors:
    gram = interior.T @ pair.inertia_of(interior)
    if np.any(interior[-1]) or not np.allclose(gram, np.eye(gram.shape[0]), rtol=0.0, atol=_ORTHONORMAL):
        raise ValueError("vectors of a basis are 0 at the tip and orthonormal in the inertia")
    return _with_tip(pair, interior, pair.constraint, pair.deformed, interior)


def massless_vectors(pair: Pair, interior: Array, tip: Array, strain: Array, modes: Array) -> Vectors:
    """Return interior displacements and the tip's vector without inertia.

    Parameters
    ----------
    pair
        K1 and M of the full structure.
    interior
        0 at the tip, ``(node, vector)``.
    tip
        1 at the tip and orthogonal to ``modes`` in M, ``(node,)``; ``strain`` is its elongation of the springs.
    modes
        Orthonormal in M, ``(node, vector)``: the interior vectors up to multiples of the tip's.
    """
    return replace(_with_tip(pair, interior, tip, strain, modes), has_massless_tip=True)


def _with_tip(pair: Pair, interior: Array, tip: Array, strain: Array, modes: Array) -> Vectors:
    """Return interior vectors and the tip's; states are projected to the tip itself, the rest of them to ``modes``."""
    projection = np.vstack([pair.inertia_of(modes).T, pair.unit_tip])
    projection[:-1, -1] = -projection[:-1, :-1] @ tip[:-1]
    deformation = np.column_stack([pair.deformation_of(interior), strain])
    return Vectors(np.column_stack([interior, tip]), deformation, projection)


def _mass(structure: Structure, mechanical: Vectors) -> Array:
    """Return Xᵀ M X, or the unit matrix on the interior vectors where the tip has no mass."""
    if mechanical.has_massless_tip:
        mass = np.eye(mechanical.shapes.shape[1])
        mass[-1, -1] = 0.0
        return mass
    return mechanical.shapes.T @ structure.mechanical.inertia_of(mechanical.shapes)


def unreduced(pair: Pair) -> Vectors:
    """Return a unit vector for every coordinate."""
    every = np.eye(pair.size)
    return Vectors(every, pair.deformation_of(every), every)


def galerkin(structure: Structure, mechanical: Vectors, thermal: Vectors, carried: Array | None = None) -> Reduction:
    """Project a structure on its bases: Xᵀ M X, D X, expansion Θ, Θᵀ C2 Θ, D Θ; Xᵀ K1 X where it is sparse.

    Static displacements Γ per temperature, ``(node, thermal)``, relieve the springs: expansion Θ - D Γ.
    """
    x, theta = mechanical.shapes, thermal.shapes
    mass, capacity = _mass(structure, mechanical), theta.T @ structure.thermal.inertia_of(theta)
    expansion = structure.expansions(theta)
    if carried is not None:
        expansion = expansion - structure.mechanical.deformation_of(carried)
    if isinstance(structure, Sparse):
        forms = mass, x.T @ mechanical.deformation, -x.T @ expansion, capacity, theta.T @ thermal.deformation
        reduced = structure_of_forms(*forms)
    else:
        reduced = Matrices(
            DensePair(mass, structure.mechanical.weights, mechanical.deformation),
            DensePair(capacity, structure.thermal.weights, thermal.deformation),
            expansion,
            structure.uniform_rise,
        )
    reduced = replace(
        reduced,
        uniform_rise=thermal.projection @ structure.uniform_rise,
        damping=structure.damping,
        tip_growth=static_tip_growth(structure) @ theta,
        load=None if structure.load is None else x.T @ structure.load,
        damper=None if structure.damper is None else x.T @ np.asarray(structure.damper @ x),
        tangent=None if structure.tangent is None else x.T @ structure.tangent,
    )
    return Reduction(reduced, x, theta, mechanical.projection, thermal.projection, carried)
