"""Vectors of a basis, orthonormal in the inertia and 0 at the tip, and what the Galerkin projection on them yields.

For friction a basis gets one more vector of each contact. A contact force acts along n - µt, the gap is measured along
n. By its constraint modes a basis contains the static responses to forces along n; the response to t with the contacts
held, K_ii⁻¹ t_i, is added, orthonormal to the others in M. With both S = nᵀK1⁻¹(n - µt) is exact for every µ. Friction
drives pairs of modes into flutter, also of those high ones that a basis does not resolve and the structure does not
have: with several contacts t does not act on those (:func:`with_friction_on_resolved_modes`). Where contacts have no
mass those modes have none either, and there is no such flutter.

A basis that leaves contacts without mass has the unit matrix as mass, and the residual ΔF w_i: the static displacement
per force on a contact that its vectors lack. From it follow R = w ΔF wᵀ, R^t, r and ρ of
:class:`~workflow.models.Contacts`, and what constant loads add to the place of a contact (``Cases.offset``).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from workflow.models import (
    Array,
    Cases,
    Contacts,
    ContactsLast,
    DensePair,
    EndState,
    Matrices,
    Pair,
    Sensors,
    Structure,
    distinct_rows,
    project,
    static_growth,
)
from workflow.models._from_matrices import structure_of_forms
from workflow.models._pair import symmetric
from workflow.models._structure import Transforms

Inertia = Callable[[Array], Array]
"""Product of an inertia and vectors."""

DEPENDENT = 1e-8
"""Norm of the new part of a vector, over the vector's, up to which it is linearly dependent: half of the digits, so
that the new part has the other half before it is orthogonalised again."""


def fixed_interface_modes(structure: Structure, count: int) -> Array:
    """Return the lowest mechanical modes with the tip held, ``(node, mode)``."""
    return structure.mechanical.modes(count, held=True).shapes


def relative_thermal_modes(structure: Structure, count: int) -> Array:
    """Return the slowest thermal modes of the whole structure relative to its constraint mode, ``(node, mode)``.

    Their span with the constraint mode contains the modes themselves, tip included. For heat this is more accurate than
    fixed-interface modes, every second of which heat at the tip excites without effect on the tip. A mode that is the
    constraint mode is skipped.

    Raises
    ------
    ValueError
        Fewer modes are independent of the tip.
    """
    pair = structure.thermal
    shapes = pair.modes(count + pair.boundary).shapes  # some may be constraint modes
    return relative(shapes, pair.constraint, pair.inertia_of, count)


def relative(shapes: Array, constraint: Array, inertia: Inertia, count: int) -> Array:
    """Return ``count`` vectors relative to the constraint mode, orthonormal in the inertia, ``(node, vector)``.

    Parameters
    ----------
    shapes
        Vectors in their order, ``(node, vector)``; those that depend on the tip's and earlier ones are skipped.
    constraint
        Constraint modes, ``(node, boundary)``.
    inertia
        Product of the inertia and vectors.

    Raises
    ------
    ValueError
        Fewer are independent of the tip and of each other.
    """
    span, held = Orthonormal(shapes.shape[0], count, inertia), constraint.shape[1]
    for shape in shapes.T:
        new = shape - constraint @ shape[-held:]
        new[-held:] = 0.0
        span.add(new, np.sqrt(np.dot(shape, inertia(shape))))
    return span.all()


class Orthonormal:
    """Gram–Schmidt orthonormalisation in an inertia, up to a number of vectors.

    Parameters
    ----------
    size
        Entries of a vector.
    count
        Number of vectors.
    inertia
        Product of the inertia and vectors.
    """

    def __init__(self, size: int, count: int, inertia: Inertia) -> None:
        self._vectors = np.zeros((size, count))
        self._count = 0
        self._inertia = inertia

    @property
    def is_full(self) -> bool:
        """Whether the number of vectors is reached."""
        return self._count == self._vectors.shape[1]

    @property
    def vectors(self) -> Array:
        """Those added so far, ``(entry, vector)``."""
        return self._vectors[:, : self._count]

    def add(self, vector: Array, length: float | None = None) -> Array | None:
        """Add the new part of a vector and return it normalised, ``None`` where the vector is dependent.

        The new part is compared with ``length``, by default that of the vector.
        """
        if self.is_full:
            return None
        vectors, count = self._vectors, self._count
        size = np.sqrt(np.dot(vector, self._inertia(vector))) if length is None else length
        if size == 0:
            return None
        new = self.apart(vector)
        rest = np.sqrt(np.dot(new, self._inertia(new)))
        if not rest > DEPENDENT * size:
            return None
        vectors[:, count] = new / rest
        self._count += 1
        return np.asarray(vectors[:, count])

    def apart(self, vector: Array) -> Array:
        """Return the part of a vector that is orthogonal to those added so far."""
        vectors = self.vectors
        for _ in range(2):  # the second pass removes the rounding of the first
            vector = vector - vectors @ (vectors.T @ self._inertia(vector))
        return vector

    def add_each(self, vectors: Array) -> None:
        """Add vectors ``(entry, vector)`` in their order until the number is reached."""
        for vector in vectors.T:
            self.add(vector)

    def all(self) -> Array:
        """Return the vectors, ``(entry, vector)``.

        Raises
        ------
        ValueError
            There are too few.
        """
        if not self.is_full:
            raise ValueError(f"only {self._count} of {self._vectors.shape[1]} vectors are independent of the tip")
        return self._vectors


_ORTHONORMAL = 1e-6
"""Accepted deviation of interiorᵀ · inertia · interior from 1, which is the error of projected initial states."""


@dataclass(frozen=True, eq=False)
class Reduction(Transforms):
    """A reduced structure and its bases for the expansion to the nodes.

    Attributes
    ----------
    structure
        The reduced structure; its coordinates are interior vectors, then the contacts that have mass.
    displacement_basis, temperature_basis
        ``(node, mechanical)`` and ``(node, thermal)``; the row of a tip with mass is (0, …, 0, 1).
    displacement_projection, temperature_projection
        The tip itself, the interior inertia-orthogonally to its vectors.
    carried
        Static displacement per temperature, m/K, ``(node, thermal)``: x = displacement_basis · x_r + carried · θ_r,
        v = displacement_basis · v_r. It is 0 at the tip and M-orthogonal to the interior vectors. ``None`` for none.
    residual
        ΔF w_i, m/N, ``(node, contact)``, of contacts that the basis leaves without mass; else ``None``.
    """

    structure: Structure
    carried: Array | None = None
    residual: Array | None = None

    def project(self, cases: Cases) -> Cases:
        """Return the cases of the full structure in reduced coordinates."""
        beside = 0.0 if self.residual is None else project(self.residual.T, cases.steady)
        return self.transformed(replace(cases, offset=cases.offset + beside))

    def sensors(self, full: Sensors, structure: Structure) -> Sensors:
        """Return the sensors of the full structure; they follow contacts that the basis leaves without mass.

        What the modes lack of x is of ΔF w_i what w_i finds there: a force elsewhere moves no sensor by itself.
        """
        x, theta = full.displacement @ self.displacement_basis, full.temperature @ self.temperature_basis
        if self.carried is not None:
            theta = theta + full.displacement @ self.carried
        if self.residual is None or structure.contacts.is_massless:
            return Sensors(x, theta, full.shares)
        follows = self.residual @ np.linalg.pinv(structure.contacts.normal @ self.residual)
        shares = full.displacement @ follows
        return Sensors(x - shares @ self.structure.contacts.normal, theta, shares)

    def expanded(self, state: EndState) -> EndState:
        """Return states of the reduced structure on the nodes, without what the residual flexibility yields."""
        given = self.given(state)
        carried = 0.0 if self.carried is None else project(self.carried, state.temperature)
        return given._replace(displacement=given.displacement + carried)

    def given_in(self, coordinates: ContactsLast) -> Reduction:
        """Return the reduction of the structure whose contacts these coordinates put last."""
        x, theta = coordinates.displacements, coordinates.temperatures
        return replace(
            self,
            displacement_basis=x.basis @ self.displacement_basis,
            temperature_basis=theta.basis @ self.temperature_basis,
            displacement_projection=self.displacement_projection @ x.projection,
            temperature_projection=self.temperature_projection @ theta.projection,
            carried=None if self.carried is None else x.basis @ self.carried,
            residual=None if self.residual is None else x.basis @ self.residual,
        )


class ReducedModel(NamedTuple):
    """The structure on which cases are run, and its reduction; ``None`` where it is unreduced."""

    structure: Structure
    reduction: Reduction | None

    def project(self, cases: Cases) -> Cases:
        """Return cases given on the full structure in the coordinates of this one."""
        return cases if self.reduction is None else self.reduction.project(cases)

    def expanded(self, state: EndState) -> EndState:
        """Return states of this structure in the coordinates of the full one."""
        return state if self.reduction is None else self.reduction.expanded(state)


@dataclass(frozen=True, eq=False)
class Vectors:
    """Basis of the displacements, or of the temperatures."""

    shapes: Array
    """Interior vectors, 0 at the contacts, then the contacts' own, 1 at one of them each, ``(node, coordinate)``; of
    contacts without mass vectors of any kind, on which M is the unit matrix."""
    deformation: Array
    """Elongation of each spring, or temperature difference across each conductor, per coordinate, shape ``(spring,
    coordinate)``."""
    projection: Array
    """Transform of states to coordinates, shape ``(coordinate, node)``."""
    residual: Array | None = None
    """ΔF w_i of contacts without mass, m/N, ``(node, contact)``; else ``None``."""


def mechanical_vectors(structure: Structure, interior: Array) -> Vectors:
    """Return interior displacements, orthonormal in M and 0 at the contacts, followed by the constraint modes."""
    return _with_constraint(structure.mechanical, interior)


def thermal_vectors(structure: Structure, interior: Array) -> Vectors:
    """Return interior temperatures, orthonormal in C2 and 0 at the contacts, followed by the constraint modes."""
    return _with_constraint(structure.thermal, interior)


def _with_constraint(pair: Pair, interior: Array) -> Vectors:
    """Return interior vectors and constraint modes; states are projected to the contacts, the rest to the interior."""
    gram, held = interior.T @ pair.inertia_of(interior), pair.boundary
    if np.any(interior[-held:]) or not np.allclose(gram, np.eye(gram.shape[0]), rtol=0.0, atol=_ORTHONORMAL):
        raise ValueError("vectors of a basis are 0 at the tip and orthonormal in the inertia")
    projection = np.vstack([pair.inertia_of(interior).T, np.zeros((held, pair.size))])
    projection[-held:, -held:] = np.eye(held)
    projection[:-held, -held:] = -(projection[:-held, :-held] @ pair.constraint[:-held])
    deformation = np.column_stack([pair.deformation_of(interior), pair.deformed])
    return Vectors(np.column_stack([interior, pair.constraint]), deformation, projection)


def unreduced(pair: Pair) -> Vectors:
    """Return a unit vector for every coordinate."""
    every = np.eye(pair.size)
    return Vectors(every, pair.deformation_of(every), every)


def galerkin(structure: Structure, mechanical: Vectors, thermal: Vectors, carried: Array | None = None) -> Reduction:
    """Project a structure on its bases: Xᵀ M X, D X, expansion Θ, Θᵀ C2 Θ, D Θ; Xᵀ K1 X where it is sparse.

    Static displacements Γ per temperature, ``(node, thermal)``, relieve the springs: expansion Θ - D Γ.
    """
    x, theta, residual = mechanical.shapes, thermal.shapes, mechanical.residual
    mass = np.eye(x.shape[1]) if residual is not None else x.T @ structure.mechanical.inertia_of(x)
    capacity, expansion = theta.T @ structure.thermal.inertia_of(theta), structure.expansions(theta)
    if carried is not None:
        expansion = expansion - structure.mechanical.deformation_of(carried)
    if structure.is_sparse:
        forms = mass, x.T @ mechanical.deformation, -x.T @ expansion, capacity, theta.T @ thermal.deformation
        reduced = structure_of_forms(*forms)
    else:
        reduced = Matrices(
            DensePair(mass, structure.mechanical.weights, mechanical.deformation),
            DensePair(capacity, structure.thermal.weights, thermal.deformation),
            expansion,
            structure.uniform_rise,
        )
    contacts = structure.contacts if residual is None else _without_mass(structure, residual)
    load = structure.load if residual is None else structure.load_direction
    reduced = replace(
        reduced,
        uniform_rise=thermal.projection @ structure.uniform_rise,
        damping=structure.damping,
        load=None if load is None else x.T @ load,
        damper=None if structure.damper is None else x.T @ np.asarray(structure.damper @ x),
        contacts=replace(contacts, growth=static_growth(structure)).transformed(x, theta),
    )
    return Reduction(x, mechanical.projection, theta, thermal.projection, reduced, carried, residual)


def _without_mass(structure: Structure, residual: Array) -> Contacts:
    """Return the contacts of a structure with ΔF w_i, ``(node, contact)``, added to their residual."""
    pair, own = structure.mechanical, structure.contacts
    by_heat = pair.work(residual, pair.deformation_of(residual), structure.expansion)
    return replace(
        own,
        residual=symmetric(own.normal @ residual) + (0.0 if own.residual is None else own.residual),
        residual_tangent=own.residual_tangent + residual.T @ own.tangent.T,
        residual_coupling=own.residual_coupling - by_heat,
        residual_load=own.residual_load + residual.T @ structure.load_direction,
    )


def with_friction(structure: Structure, mechanical: Vectors) -> Vectors:
    """Return a basis with the static responses to forces along the tangents added, if they are not contained."""
    pair, tangents = structure.mechanical, structure.contacts.tangent
    interior, acting = mechanical.shapes[:, : -pair.boundary], tangents[tangents.any(axis=1)]
    most = min(interior.shape[1] + len(acting), pair.size - pair.boundary)
    span = Orthonormal(pair.size, most, pair.inertia_of)
    span.add_each(interior)
    added = [span.add(pair.solve(tangent, held=True)) for tangent in acting]
    return mechanical if all(new is None for new in added) else mechanical_vectors(structure, span.vectors)


_RESOLVED = 0.005
"""Doubt about the frequency of a mode, 1 - Ω/ω, up to which a basis resolves it. Of 1 352 bases of random structures 45
flutter that should not with no limit, 13, 7 and 16 with 1, 0.5 and 0.2 %; with 0.1 % motions of a rod err by 1.6 times
as much, with 0.5 % by 0.98 times."""


def with_friction_on_resolved_modes(structure: Structure, reduction: Reduction) -> Reduction:
    """Return a reduction whose tangents act on modes that the basis does not resolve only as normals do.

    φ = Φ φ_r of a mode of the reduced structure has Rayleigh's quotient ω² = φᵀ K1 φ/φᵀ M φ. Grammel's, Ω² = φᵀ M φ/
    (φᵀ M K1⁻¹ M φ), is not above it; both are its frequency where φ is a mode of the structure. The tangents' parts in
    the other modes become those of Σ_j c_ij n_j with the same static answers of all contacts, so that S stays exact.
    """
    small, contacts = reduction.structure.mechanical, reduction.structure.contacts
    modes = small.modes()
    forces = structure.mechanical.inertia_of(reduction.displacement_basis @ modes.shapes).T
    squares = modes.values * (forces * structure.mechanical.static_solutions(forces)).sum(axis=1)  # ω²/Ω²
    lost = squares > 1 / (1 - _RESOLVED) ** 2
    shapes, frequency = modes.shapes[:, lost], np.sqrt(modes.values[lost])
    normal, tangent = ((rows @ shapes / frequency).T for rows in (contacts.normal, contacts.tangent))
    apart = tangent - normal @ np.linalg.lstsq(normal, tangent)[0]
    tangents = contacts.tangent - (small.inertia_of(shapes) @ (frequency * apart.T).T).T
    return replace(reduction, structure=replace(reduction.structure, contacts=replace(contacts, tangent=tangents)))


def projection_residual(structure: Structure, reduction: Reduction, cases: Cases) -> Array:
    """Return the projection residual of cases in the bases of a reduction, 1, shape ``(case,)``.

    It is the largest of these relative norms, 0 where the state is 0:

        initial displacement   |x - Φ x_r - Γ θ_r| / |x|    in strain energy, |x|² = xᵀ K1 x
        initial velocity       |v - Φ v_r| / |v|    in kinetic energy, |v|² = vᵀ M v
        initial temperature    |θ - Θ θ_r| / |θ|    |θ|² = θᵀ C2 θ
        constant loads f̄ + F0 e_n                    static displacement, reduced against full, in strain energy
        heating q                                    steady temperature, reduced against full, |θ|² = θᵀ K2 θ

    Parameters
    ----------
    structure
        The full structure.
    reduction
        Its reduction, with bases Φ (displacement) and Θ (temperature), and Γ (``carried``).
    cases
        The cases in the coordinates of the full structure.
    """
    first, which = distinct_rows(
        *(cases.displacement, cases.velocity, cases.temperature, cases.steady, cases.mean[:, None], cases.heating)
    )
    cases = cases.take(first)
    small = reduction.project(cases)
    loads = cases.steady + cases.mean[:, None] * structure.load_direction
    static: Array | float = 0.0
    if reduction.residual is not None:  # ΔF f of what ΔF w_i span
        within = reduction.residual @ np.linalg.pinv(structure.contacts.normal @ reduction.residual)
        static = project(within, project(reduction.residual.T, loads))
    carried = 0.0 if reduction.carried is None else project(reduction.carried, small.temperature)
    x, theta, reduced = reduction.displacement_basis, reduction.temperature_basis, reduction.structure
    pair, thermal = structure.mechanical, structure.thermal
    answers = pair.static_solutions(loads), reduced.mechanical.static_solutions(project(x.T, loads))
    warmth = thermal.static_solutions(cases.heating), reduced.thermal.static_solutions(small.heating)
    lost = [
        _lost(cases.displacement, small.displacement, x, pair.energies, carried),
        _lost(*answers, x, pair.energies, static),
        _lost(cases.velocity, small.velocity, x, _in_inertia(pair)),
        _lost(cases.temperature, small.temperature, theta, _in_inertia(thermal)),
        _lost(*warmth, theta, thermal.energies),
    ]
    return np.asarray(np.max(lost, axis=0)[which])


_Squares = Callable[[Array], Array]
"""Terms of the squared norm of a state."""


def _lost(full: Array, reduced: Array, basis: Array, squares: _Squares, beside: Array | float = 0.0) -> Array:
    """Return the norm of ``full - basis · reduced - beside`` over that of ``full`` for each case."""
    shares = np.zeros(full.shape[0])
    missing = full - project(basis, reduced) - beside
    for case in np.flatnonzero(full.any(axis=1)):
        size = math.fsum(squares(full[case]))
        shares[case] = math.sqrt(math.fsum(squares(missing[case])) / size) if size > 0 else 0.0
    return shares


def _in_inertia(pair: Pair) -> _Squares:
    return lambda u: u * pair.inertia_of(u)
