"""A structure from its matrices M, K1, K12, C2, K2 and a contact x_n = wᵀx, in whatever coordinates they come.

What the equations are not in yet, they are brought to in two steps. Motions N without mass, M N = 0, follow the others
statically, z = -(NᵀK1 N)⁻¹ Nᵀ (K1 x + K12 θ), and are eliminated, those without heat capacity alike; what heat loads on
these make of them pushes the structure with the constant force -K12 N (NᵀK2 N)⁻¹ Nᵀq. Then the last
coordinate is made the tip: with the largest |w_j|, y = (x without x_j, wᵀx) and

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
"""A negative part of a matrix larger than so many times its rounding makes the matrix indefinite."""

_UNBALANCED = 1e-8
"""Share of a thermal force that may act on a rigid body: half of the digits of a file that has them all."""


COLD = 1e30
"""Heat capacity [J/K] of a structure that nobody describes temperatures of: it stays cold, whatever heat it takes."""


class UnusableMatricesError(ValueError):
    """Matrices that are no structure, or none that a basis can take: ``problem`` and ``remedy`` in a study's words."""

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
    load
        Direction along which the load acts, ``(displacement,)``; the contact's where ``None``.
    tangent
        Direction t in which the casing slides, ``(displacement,)``: the contact force acts along w - µt, or ``None``.
    even_rise
        Temperatures at an even rise of 1 K, ``(temperature,)``: 1 each where ``None``. Balances of heat weigh with it.
    damping, damper
        Of the modes, or by Rayleigh's coefficients; and C1 as a matrix [N s/m], ``(displacement, displacement)``.
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
    damper: Array | None = None
    load: Array | None = None
    tangent: Array | None = None
    even_rise: Array | None = None


class _Part(NamedTuple):
    """A symmetric positive semi-definite matrix as deformationᵀ · deformation, ``(rank, coordinate)``."""

    deformation: Array
    order: NDArray[np.int64]


def structure_from_matrices(matrices: GivenMatrices) -> Matrices:
    """Return the structure that dense matrices describe; its ``coordinates`` lead from theirs and back.

    Raises
    ------
    UnusableMatricesError
        They are no structure.
    """
    basis, projection = _contact_last(matrices.mass, matrices.stiffness, matrices.contact, "mass", "stiffness")
    heat_basis, heat_projection = _contact_last(
        matrices.heat_capacity, matrices.conductance, matrices.thermal_contact, "heat_capacity", "conductance"
    )
    steady = matrices.steady - product(matrices.coupling, _heated_at_once(matrices))
    coordinates = Coordinates(basis, projection, heat_basis, heat_projection, steady, matrices.heating)
    mass, capacity = _congruent(matrices.mass, basis), _congruent(matrices.heat_capacity, heat_basis)
    springs = _factored(_congruent(matrices.stiffness, basis), "stiffness")
    conductors = _factored(_congruent(matrices.conductance, heat_basis), "conductance")
    coupling = product(product(basis.T, matrices.coupling), heat_basis)
    even = np.ones(matrices.heat_capacity.shape[0]) if matrices.even_rise is None else matrices.even_rise
    uniform = product(heat_projection, even)
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
        damping=matrices.damping,
        damper=None if matrices.damper is None else _congruent(matrices.damper, basis),
        load=_elsewhere(matrices.load, basis),
        tangent=None if matrices.tangent is None else product(basis.T, matrices.tangent),
        coordinates=coordinates,
    )


def _heated_at_once(matrices: GivenMatrices) -> Array:
    """Return N (NᵀK2 N)⁻¹ Nᵀq, by which temperatures N without heat capacity follow the heat loads on them."""
    _, loose, null = _without_inertia(matrices.heat_capacity, "heat_capacity")
    if not loose.size:
        return np.zeros(matrices.heating.size)
    return product(null, _following(matrices.conductance, null, matrices.heating[:, None], "conductance"))[:, 0]


def _elsewhere(load: Array | None, basis: Array) -> Array | None:
    """Return the direction of a load in the structure's coordinates, ``None`` where it is that of the contact."""
    if load is None:
        return None
    direction = product(basis.T, load)
    tip = np.zeros(direction.size)
    tip[-1] = 1.0
    return None if np.abs(direction - tip).max() <= _UNBALANCED * np.abs(direction).max() else direction


class Forms(NamedTuple):
    """M, K1, K12, C2 and K2 of a structure whose tip is the last coordinate.

    ``content`` and ``losses`` are the heat content [J/K] and the heat flow out of the structure [W/K] per temperature,
    ``tip_growth`` the quasi-static displacement of the tip per temperature [m/K].
    """

    mass: Array
    stiffness: Array
    coupling: Array
    heat_capacity: Array
    conductance: Array
    content: Array
    losses: Array
    tip_growth: Array
    tangent: Array | None = None


def structure_of_forms(forms: Forms, damping: Rayleigh) -> Matrices:
    """Return the structure of matrices whose tip is the last coordinate, such as forms Xᵀ K1 X of a fuller one."""
    springs = _factored(_symmetric(forms.stiffness), "stiffness")
    conductors = _factored(_symmetric(forms.conductance), "conductance")
    return Matrices(
        mass=_symmetric(forms.mass),
        springs=np.ones(springs.deformation.shape[0]),
        elongation=springs.deformation,
        expansion=_expansion(springs, forms.coupling),
        heat_capacity=_symmetric(forms.heat_capacity),
        conductors=np.ones(conductors.deformation.shape[0]),
        difference=conductors.deformation,
        content=forms.content,
        grounded=_expansion(conductors, -forms.losses[:, None])[:, 0],
        damping=damping,
        tip_growth=forms.tip_growth,
        tangent=forms.tangent,
    )


def _contact_last(inertia: Array, stiffness: Array, contact: Array, *names: str) -> tuple[Array, Array]:
    """Return the basis E and the projection onto its coordinates: those with inertia, the contact last.

    Shapes ``(given, own)`` and ``(own, given)``; given = E own.
    """
    inertial, loose, null = _without_inertia(inertia, names[0])
    share = product(contact, null)
    if np.abs(share).max(initial=0.0) > _UNBALANCED * np.abs(contact).max():
        raise UnusableMatricesError(
            f"the contact moves without {names[0].replace('_', ' ')}: there is no impact law for it",
            "choose a degree of freedom that has some",
        )
    own = contact[inertial]
    tip = int(np.argmax(np.abs(own)))
    others = np.delete(np.arange(inertial.size), tip)
    into = np.zeros((inertia.shape[0], inertial.size))
    into[inertial[others], np.arange(inertial.size - 1)] = 1.0
    into[inertial[tip], :-1] = -own[others] / own[tip]
    into[inertial[tip], -1] = 1.0 / own[tip]
    projection = np.zeros((inertial.size, inertia.shape[0]))
    projection[np.arange(inertial.size - 1), inertial[others]] = 1.0
    projection[:-1, loose] = -null[inertial[others]]
    projection[-1] = contact
    if loose.size:
        into -= product(null, _following(stiffness, null, product(stiffness, into), names[1]))
    return into, projection


def _without_inertia(inertia: Array, name: str) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return the coordinates with inertia, the others, and the motions without inertia, ``(given, other)``.

    A motion without inertia has 1 in one of the others, 0 in the rest of them. Mostly it is nothing else, with a row of
    zeros in M; the incompatible modes of an element may share a mass, however, and then it is a difference of theirs.
    """
    factor, _ = _pivots(inertia, name)
    rank = factor.upper.shape[0]
    inertial, loose = np.sort(factor.order[:rank]), factor.order[rank:]
    null = np.zeros((inertia.shape[0], loose.size))
    null[factor.order[:rank]] = -_solved_upper(factor.upper[:, :rank], factor.upper[:, rank:])
    scale = _scale(inertia)
    null *= scale[loose] / scale[:, None]
    null[loose, np.arange(loose.size)] = 1.0
    return inertial, loose, null


def _solved_upper(upper: Array, right: Array) -> Array:
    """Return R⁻¹ b of an upper triangular R, for each column of b."""
    return solve_triangular(upper.T, right, transposed=True)


def _following(stiffness: Array, null: Array, forces: Array, name: str) -> Array:
    """Return (NᵀK N)⁻¹ Nᵀf, by which motions N without inertia follow forces f on them."""
    try:
        root = cholesky(product(product(null.T, stiffness), null))
    except np.linalg.LinAlgError:
        raise UnusableMatricesError(
            f"{null.shape[1]} degrees of freedom have no inertia, and {name} does not hold them",
            "leave out what is neither held nor has inertia",
        ) from None
    halfway = solve_triangular(root, product(null.T, forces))
    return solve_triangular(root, halfway, transposed=True)


def _congruent(matrix: Array, basis: Array) -> Array:
    """Return basisᵀ · matrix · basis, symmetric to the bit."""
    return _symmetric(product(basis.T, product(matrix, basis)))


def _symmetric(matrix: Array) -> Array:
    return np.asarray((matrix + matrix.T) / 2)


def _factored(matrix: Array, name: str) -> _Part:
    """Return the deformation of a stiffness, its rank decided on the matrix scaled to a diagonal of ones.

    Raises
    ------
    UnusableMatricesError
        The matrix is indefinite.
    """
    factor, scale = _pivots(matrix, name)
    deformation = np.zeros_like(factor.upper)
    deformation[:, factor.order] = factor.upper
    return _Part(deformation * scale, factor.order)


def _scale(matrix: Array) -> Array:
    diagonal = np.diag(matrix)
    return np.sqrt(np.where(diagonal > 0, diagonal, 1.0))


def _pivots(matrix: Array, name: str) -> tuple[semidefinite.Factor, Array]:
    """Return the factor of a matrix scaled to a diagonal of ones, and the scale, ``(coordinate,)``."""
    scale = _scale(matrix)
    least = 10 * matrix.shape[0] * np.finfo(float).eps  # rounding of assembled entries, after numpy's matrix_rank
    factor = _pivoted(matrix / scale / scale[:, None], least)
    if not factor.rest <= _INDEFINITE * least:
        raise UnusableMatricesError(
            f"{name} is not positive semi-definite", "check signs and that it was assembled in full"
        )
    return factor, scale


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
