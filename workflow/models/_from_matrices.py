"""A structure from its matrices M, K1, K12, C2, K2 and a contact x_n = wᵀx, in whatever coordinates they come.

What the equations are not in yet, they are brought to in two steps. Coordinates without mass follow the others,
x_z = -K_zz⁻¹ (K_za x_a + K12_z θ), and are eliminated, those without heat capacity alike. Then the last coordinate is
made the tip: with the largest |w_j|, y = (x without x_j, wᵀx) and

    x = E y,   M ← Eᵀ M E,   K1 ← Eᵀ K1 E,   K12 ← Eᵀ K12 E_θ,   C2 ← E_θᵀ C2 E_θ,   K2 ← E_θᵀ K2 E_θ,

so that the contact force is -λ e_n and its heat α λ e_n, as equations (1a) and (1b) have them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array, semidefinite
from workflow.kernels.solving import cholesky, solve_triangular
from workflow.models._dense import MOST_PORTABLE, product
from workflow.models._structure import Coordinates, Matrices, Rayleigh

_INDEFINITE = 1e3
"""Beyond so many times what is taken for rounding, a part of a matrix that should not be there is none."""

_UNBALANCED = 1e-8
"""Share of a thermal force that may act on a rigid body: half of the digits of a file that has them all."""


class UnusableMatricesError(ValueError):
    """Matrices that are no structure: ``problem`` and ``remedy`` in the words of a study."""

    def __init__(self, problem: str, remedy: str):
        super().__init__(f"{problem}: {remedy}")
        self.problem, self.remedy = problem, remedy


@dataclass(frozen=True, eq=False)
class GivenMatrices:
    """Matrices in SI and in coordinates of their own; all are symmetric but K12.

    Attributes
    ----------
    mass, stiffness
        M [kg] and K1 [N/m], ``(displacement, displacement)``.
    coupling
        K12 [N/K], ``(displacement, temperature)``.
    heat_capacity, conductance
        C2 [J/K] and K2 [W/K], ``(temperature, temperature)``.
    contact
        w with x_n = wᵀx, ``(displacement,)``; the casing is at x_n = d.
    thermal_contact
        Shares of the contact heat that the temperatures take, ``(temperature,)``, 1 in sum; θ_n is the mean so weighed.
    steady, heating
        Constant loads [N] and heat loads [W], ``(displacement,)`` and ``(temperature,)``.
    damping
        Of the modes, or by Rayleigh's coefficients.
    """

    mass: Array
    stiffness: Array
    coupling: Array
    heat_capacity: Array
    conductance: Array
    contact: Array
    thermal_contact: Array
    steady: Array
    heating: Array
    damping: Rayleigh = field(default_factory=Rayleigh)


class _Part(NamedTuple):
    """A symmetric positive semi-definite matrix as deformationᵀ · deformation, ``(rank, coordinate)``."""

    deformation: Array
    order: NDArray[np.int64]


def structure_from_matrices(given: GivenMatrices) -> Matrices:
    """Return the structure that matrices describe; its ``coordinates`` lead from theirs and back.

    Raises
    ------
    UnusableMatricesError
        They are no structure.
    """
    basis, taken = _kept(given.mass, given.stiffness, given.contact, "mass", "stiffness")
    heat_basis, heat_taken = _kept(
        given.heat_capacity, given.conductance, given.thermal_contact, "heat_capacity", "conductance"
    )
    coordinates = Coordinates(basis, taken, heat_basis, heat_taken, given.steady, given.heating)
    mass, capacity = _congruent(given.mass, basis), _congruent(given.heat_capacity, heat_basis)
    for matrix, name in ((mass, "mass"), (capacity, "heat_capacity")):
        _check_definite(matrix, name)
    springs = _factored(_congruent(given.stiffness, basis), "stiffness")
    conductors = _factored(_congruent(given.conductance, heat_basis), "conductance")
    coupling = product(product(basis.T, given.coupling), heat_basis)
    uniform = np.ones(heat_basis.shape[1])
    return Matrices(
        mass=mass,
        springs=np.ones(springs.deformation.shape[0]),
        elongation=springs.deformation,
        expansion=_expansion(springs, coupling),
        heat_capacity=capacity,
        conductors=np.ones(conductors.deformation.shape[0]),
        difference=conductors.deformation,
        content=product(capacity, uniform),
        grounded=product(conductors.deformation, uniform),
        damping=given.damping,
        coordinates=coordinates,
    )


def _kept(inertia: Array, stiffness: Array, contact: Array, *names: str) -> tuple[Array, Array]:
    """Return what leads from the coordinates that are kept, the tip last, to those given, and what leads there.

    Shapes ``(given, kept)`` and ``(kept, given)``.
    """
    size = inertia.shape[0]
    carries = np.any(inertia != 0, axis=1)
    kept, loose = np.flatnonzero(carries), np.flatnonzero(~carries)
    if np.any(contact[loose] != 0):
        where = int(loose[np.flatnonzero(contact[loose])[0]])
        raise UnusableMatricesError(
            f"the contact acts on degree of freedom {where}, which has no {names[0].replace('_', ' ')}",
            "choose one that has",
        )
    basis = np.zeros((size, kept.size))
    tip = int(np.argmax(np.abs(contact[kept])))
    own = contact[kept]
    columns = np.delete(np.arange(kept.size), tip)
    basis[kept[columns], np.arange(kept.size - 1)] = 1.0
    basis[kept[tip], :-1] = -own[columns] / own[tip]
    basis[kept[tip], -1] = 1.0 / own[tip]
    taken = np.zeros((kept.size, size))
    taken[np.arange(kept.size - 1), kept[columns]] = 1.0
    taken[-1] = contact
    if loose.size:
        held = _following(stiffness, loose, kept, names[1])
        basis[loose] = product(held, basis[kept])
    return basis, taken


def _following(stiffness: Array, loose: NDArray[np.intp], kept: NDArray[np.intp], name: str) -> Array:
    """Return -K_zz⁻¹ K_za, by which coordinates without inertia follow the others."""
    own = stiffness[np.ix_(loose, loose)]
    try:
        root = cholesky(own)
    except np.linalg.LinAlgError:
        raise UnusableMatricesError(
            f"{loose.size} degrees of freedom have no inertia, and {name} does not hold them",
            "leave out what is neither held nor has inertia",
        ) from None
    halfway = solve_triangular(root, stiffness[np.ix_(loose, kept)])
    return -solve_triangular(root, halfway, transposed=True)


def _congruent(matrix: Array, basis: Array) -> Array:
    """Return basisᵀ · matrix · basis, symmetric to the bit."""
    found = product(basis.T, product(matrix, basis))
    return np.asarray((found + found.T) / 2)


def _check_definite(matrix: Array, name: str) -> None:
    try:
        cholesky(matrix)
    except np.linalg.LinAlgError:
        raise UnusableMatricesError(
            f"{name} is not positive definite", f"{name} must be, but for rows and columns of zeros"
        ) from None


def _factored(matrix: Array, name: str) -> _Part:
    """Return the deformation of a stiffness, its rank decided on the matrix scaled to a diagonal of ones.

    Raises
    ------
    UnusableMatricesError
        The matrix is indefinite.
    """
    size = matrix.shape[0]
    diagonal = np.diag(matrix)
    scale = np.sqrt(np.where(diagonal > 0, diagonal, 1.0))
    least = 10 * size * np.finfo(float).eps  # rounding of assembled entries, as a rule of numpy.linalg.matrix_rank's
    found = _pivoted(matrix / scale / scale[:, None], least)
    if not found.rest <= _INDEFINITE * least:
        raise UnusableMatricesError(
            f"{name} is not positive semi-definite", "check signs and that it was assembled in full"
        )
    deformation = np.zeros_like(found.upper)
    deformation[:, found.order] = found.upper
    return _Part(deformation * scale, found.order)


def _pivoted(matrix: Array, least: float) -> semidefinite.Factor:
    """Return the pivoted factor, above :data:`MOST_PORTABLE` coordinates by LAPACK."""
    if matrix.shape[0] <= MOST_PORTABLE:
        return semidefinite.pivoted_factor(matrix, least)
    from scipy.linalg.lapack import dpstrf  # imported here: reading a study needs none of it

    whole, order, rank, _ = dpstrf(matrix, tol=least)
    upper = np.triu(whole)[:rank]
    order = np.asarray(order, dtype=np.int64) - 1
    rest = matrix[np.ix_(order[rank:], order[rank:])] - upper[:, rank:].T @ upper[:, rank:]
    return semidefinite.Factor(upper, order, float(np.abs(rest).max(initial=0.0)))


def _expansion(springs: _Part, coupling: Array) -> Array:
    """Return the free expansion with K12 = -deformationᵀ · expansion, ``(rank, temperature)``.

    Raises
    ------
    UnusableMatricesError
        A rise of temperature would push a rigid body: no thermal expansion does.
    """
    rank = springs.deformation.shape[0]
    in_order = springs.deformation[:, springs.order]
    forces = -coupling[springs.order]
    expansion = solve_triangular(in_order[:, :rank].T, forces[:rank])
    beyond = np.abs(forces[rank:] - product(in_order[:, rank:].T, expansion)).max(initial=0.0)
    if beyond > _UNBALANCED * np.abs(forces).max(initial=0.0):
        raise UnusableMatricesError(
            "coupling pushes what nothing holds: stiffness moves freely where it acts",
            "thermal forces of a free body must balance; check sign and order of coupling",
        )
    return expansion
