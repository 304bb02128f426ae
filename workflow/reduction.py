"""Craig–Bampton reduction in first-order form: full structure in, structure of the same type out.

Source: Thorin, Guérin, Legrand (extended abstract); Nachtergaele, Rixen, Steenhoek (2010).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workflow.models import Array, Cases, Chain, Matrices, Structure, mechanical_path, project, thermal_path
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
            steady=project(self.displacement_basis.T, cases.steady),
            heating=project(self.temperature_basis.T, cases.heating),
            displacement=project(self.displacement_projection, cases.displacement),
            velocity=project(self.displacement_projection, cases.velocity),
            temperature=project(self.temperature_projection, cases.temperature),
        )


_DEPENDENT = 1e-8
"""A mode whose part that vanishes at the tip is below this share of it adds no direction: half of
the digits, so that what is kept is known to the other half before it is made orthogonal again."""


_MOST_OF_A_LONG_CHAIN = 100
"""Modes of a chain that has no matrices: each costs a pass or two along it, and room for its shape."""


def _constraint_mode(deformation: Array) -> Array:
    """Return the static answer of the interior to a unit tip, ``deformation`` being S of SᵀS.

    Parts that are not linked to the tip get zero (minimum norm).
    """
    static, *_ = np.linalg.lstsq(deformation[:, :-1], -deformation[:, -1], rcond=None)
    return np.append(static, 1.0)


def _fixed_interface_modes(inertia: Array, deformation: Array, kept: int) -> Array:
    """Return the lowest modes of the interior with the tip held, shape ``(coordinate, kept)``."""
    modes = singular_modes(inertia[:-1, :-1], deformation[:, :-1]).shapes[:, :kept]
    return np.vstack([modes, np.zeros(kept)])


def _relative_modes(shapes: Array, weighted: Array, constraint: Array, kept: int) -> Array:
    """Return the slowest modes of the whole structure relative to its constraint mode.

    Their span with the constraint mode holds the modes themselves, tip included. For heat this
    is more accurate than fixed-interface modes: every second one of those feels the tip's
    heat but does not move the tip. A mode that is the constraint mode is passed over.

    ``weighted`` is the inertia, as a matrix or by its diagonal.
    """

    def inertia(vector: Array) -> Array:
        return np.asarray(weighted * vector if weighted.ndim == 1 else weighted @ vector)

    found = np.zeros((shapes.shape[0], kept))
    count = 0
    for mode in shapes.T:
        if count == kept:
            break
        size = np.sqrt(mode @ inertia(mode))
        new = mode - mode[-1] * constraint
        new[-1] = 0.0
        for _ in range(2):  # once more, so that rounding of the first pass goes too
            new = new - found[:, :count] @ (found[:, :count].T @ inertia(new))
        length = np.sqrt(new @ inertia(new))
        if length > _DEPENDENT * size:
            found[:, count] = new / length
            count += 1
    if count < kept:
        raise ValueError(f"only {count} of {kept} modes are independent of the tip")
    return found


def _projection(onto_modes: Array, constraint: Array) -> Array:
    """Return what takes states to [modes, tip]: the tip as it is, the interior onto the modes.

    ``onto_modes`` is modesᵀ · inertia.
    """
    onto_modes[:, -1] = -onto_modes[:, :-1] @ constraint[:-1]
    tip = np.zeros(constraint.size)
    tip[-1] = 1.0
    return np.vstack([onto_modes, tip])


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
    if isinstance(structure, Chain) and not structure.has_matrices:
        return _reduce_long_chain(structure, mechanical_modes, thermal_modes)
    strain = np.sqrt(structure.springs)[:, None] * structure.elongation
    flux = np.sqrt(structure.conductors)[:, None] * structure.difference
    shape, warmth = _constraint_mode(strain), _constraint_mode(flux)
    modes = _fixed_interface_modes(structure.mass, strain, mechanical_modes)
    heat_shapes = singular_modes(structure.heat_capacity, flux).shapes
    heat_modes = _relative_modes(heat_shapes, structure.heat_capacity, warmth, thermal_modes)
    mechanical = np.column_stack([modes, shape])
    thermal = np.column_stack([heat_modes, warmth])
    reduced = replace(
        structure.matrices(),
        mass=mechanical.T @ structure.mass @ mechanical,
        elongation=structure.elongation @ mechanical,
        expansion=structure.expansion @ thermal,
        heat_capacity=thermal.T @ structure.heat_capacity @ thermal,
        difference=structure.difference @ thermal,
        content=structure.content @ thermal,
    )
    return Reduction(
        structure=reduced,
        displacement_basis=mechanical,
        temperature_basis=thermal,
        displacement_projection=_projection(modes.T @ structure.mass, shape),
        temperature_projection=_projection(heat_modes.T @ structure.heat_capacity, warmth),
    )


def _reduce_long_chain(chain: Chain, mechanical_modes: int, thermal_modes: int) -> Reduction:
    """Reduce a chain that has no matrices, to as few modes as are found one by one.

    Raises
    ------
    ValueError
        More modes than are found so.
    """
    if max(mechanical_modes, thermal_modes) > _MOST_OF_A_LONG_CHAIN:
        raise ValueError(
            f"a chain of {chain.mechanical_size} nodes is kept full or reduced to at most {_MOST_OF_A_LONG_CHAIN} modes"
        )
    held, heat = mechanical_path(chain).without_tip(), thermal_path(chain)

    def towards_tip(interior: Array | None) -> Array:
        return np.append(np.zeros(0) if interior is None else interior, 1.0)

    pull, flow = np.zeros(held.size), np.zeros(held.size)
    pull[-1], flow[-1] = chain.springs[-1], chain.conduction[-1]
    shape, warmth = towards_tip(held.solve(pull)), towards_tip(heat.without_tip().solve(flow))
    modes = np.zeros((chain.mechanical_size, mechanical_modes))
    if mechanical_modes:
        modes[:-1] = held.modes(chain.masses[:-1], 0, mechanical_modes - 1).shapes
    heat_shapes = heat.modes(chain.heat_capacities, 0, thermal_modes).shapes  # one may be the constraint mode
    heat_modes = _relative_modes(heat_shapes, chain.heat_capacities, warmth, thermal_modes)
    mechanical, thermal = np.column_stack([modes, shape]), np.column_stack([heat_modes, warmth])
    below = np.vstack([np.zeros(thermal.shape[1]), thermal[:-1]])
    reduced = Matrices(
        mass=mechanical.T @ (chain.masses[:, None] * mechanical),
        springs=chain.springs,
        elongation=np.diff(mechanical, axis=0, prepend=0.0),
        expansion=chain.free_expansion[:, None] * ((thermal + below) / 2),
        heat_capacity=thermal.T @ (chain.heat_capacities[:, None] * thermal),
        conductors=chain.conductors,
        difference=np.concatenate([thermal - below, thermal]),
        content=chain.content @ thermal,
        grounded=chain.grounded,
        damping=chain.damping,
    )
    return Reduction(
        structure=reduced,
        displacement_basis=mechanical,
        temperature_basis=thermal,
        displacement_projection=_projection(modes.T * chain.masses, shape),
        temperature_projection=_projection(heat_modes.T * chain.heat_capacities, warmth),
    )
