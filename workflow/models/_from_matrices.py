"""A structure from its matrices M, K1, K12, C2, K2 and a contact x_n = wᵀx, in any coordinates, dense or sparse.

Two steps transform them to the equations. First, motions N without mass, M N = 0, are eliminated by static
condensation, z = -(NᵀK1 N)⁻¹ Nᵀ (K1 x + K12 θ), and temperatures without heat capacity likewise; damping of them must
satisfy NᵀC1 = a NᵀK1. Heat loads on temperatures without heat capacity exert the constant force
-K12 N (NᵀK2 N)⁻¹ Nᵀq on the structure. Then the last coordinate is made the tip: with the largest |w_j|,
y = (x without x_j, wᵀx) and

    x = E y,   M ← Eᵀ M E,   K1 ← Eᵀ K1 E,   K12 ← Eᵀ K12 E_θ,   C2 ← E_θᵀ C2 E_θ,   K2 ← E_θᵀ K2 E_θ,

so that the contact force is -λ e_n and its heat α λ e_n, as in equations (1a) and (1b). Large structures stay sparse:
E is the identity except one row, and nothing is condensed; their expansion is -K12.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray
from scipy.linalg import solve_triangular
from threadpoolctl import threadpool_limits

from workflow.kernels import Array
from workflow.models._contact_coordinates import rows_last, sparse_pair
from workflow.models._contacts import Contacts
from workflow.models._factors import NotHeldError, factorised, is_definite, warn_of_fill
from workflow.models._pair import (
    BALANCED_IN_FILES,
    MOST_FULL,
    DensePair,
    Part,
    UnusableMatricesError,
    congruent,
    factored,
    pivots,
    scale_of,
    symmetric,
)
from workflow.models._sparse_pair import SparsePair, sparse_congruent
from workflow.models._structure import Coordinates, Matrices, Rayleigh

ASYMMETRY = 1e-10
"""Accepted asymmetry, over the largest entry of the row and the column: rounding of assembly in another order, or of
files with eleven digits. The mean of both halves is used."""


@dataclass(frozen=True, eq=False)
class GivenMatrices:
    """Matrices, dense or sparse, in SI and in coordinates of their own; all are symmetric but K12."""

    mass: Array
    stiffness: Array
    """``mass``, ``stiffness``: M [kg] and K1 [N/m], ``(displacement, displacement)``."""
    coupling: Array
    """K12 [N/K], ``(displacement, temperature)``."""
    heat_capacity: Array
    conductance: Array
    """``heat_capacity``, ``conductance``: C2 [J/K] and K2 [W/K], ``(temperature, temperature)``."""
    contact: Array
    """w with x_n = wᵀx, ``(displacement,)``; the casing is at x_n = d."""
    thermal_contact: Array
    """Weights s of the contact heat on the temperatures, ``(temperature,)``, with the sum 1; θ_n = sᵀθ."""
    steady: Array
    heating: Array
    """``steady``, ``heating``: constant loads [N] and heat loads [W], ``(displacement,)`` and ``(temperature,)``."""
    damping: Rayleigh = field(default_factory=Rayleigh)
    damper: Array | None = None
    """``damping``, ``damper``: modal or Rayleigh damping; and a damping matrix [N s/m], ``(displacement,
    displacement)``."""
    load: Array | None = None
    """Direction of the load, ``(displacement,)``; that of the contact where ``None``."""
    uniform_rise: Array | None = None
    """Temperatures of a uniform rise by 1 K, ``(temperature,)``: 1 each where ``None``. They weight the heat
    balance."""
    labels: tuple[str, ...] = ()
    """Labels of the displacements; their indices where there are none."""


def structure_from_matrices(given: GivenMatrices) -> Matrices:
    """Return the structure of dense matrices; its ``coordinates`` hold the transforms from the given ones and back.

    Raises
    ------
    UnusableMatricesError
        The matrices do not describe a structure.
    """
    sparse = {name: value for name, value in vars(given).items() if hasattr(value, "toarray")}
    matrices = replace(given, **{name: value.toarray() for name, value in sparse.items()})
    basis, projection = _contact_last(matrices.mass, matrices.stiffness, matrices.contact, "mass", "stiffness")
    heat_basis, heat_projection = _contact_last(
        matrices.heat_capacity, matrices.conductance, matrices.thermal_contact, "heat_capacity", "conductance"
    )
    refuse_dashpots(matrices, *_without_inertia(matrices.mass, "mass")[1:])
    expansive = -(matrices.coupling @ _instantaneous_rise(matrices))
    loads = matrices.steady, matrices.heating, expansive
    coordinates = Coordinates(basis, projection, heat_basis, heat_projection, *loads)
    springs = factored(matrices.stiffness, "stiffness", basis)
    conductors = factored(matrices.conductance, "conductance", heat_basis)
    even = np.ones(matrices.heat_capacity.shape[0]) if matrices.uniform_rise is None else matrices.uniform_rise
    return Matrices(
        mechanical=_pair(congruent(matrices.mass, basis), springs),
        thermal=_pair(congruent(matrices.heat_capacity, heat_basis), conductors),
        expansion=springs.expansion(basis.T @ matrices.coupling @ heat_basis),
        uniform_rise=heat_projection @ even,
        damping=matrices.damping,
        damper=None if matrices.damper is None else congruent(matrices.damper, basis),
        load=_load_direction(matrices.load, basis),
        coordinates=coordinates,
    )


def structure_of_forms(mass: Array, stiffness: Array, coupling: Array, capacity: Array, conductance: Array) -> Matrices:
    """Return the structure of M, K1, K12, C2 and K2, such as a projection Xᵀ M X."""
    springs, conductors = factored(stiffness, "stiffness"), factored(conductance, "conductance")
    pairs = _pair(symmetric(mass), springs), _pair(symmetric(capacity), conductors)
    return Matrices(*pairs, springs.expansion(coupling), np.ones(len(capacity)))


def _pair(inertia: Array, part: Part) -> DensePair:
    return DensePair(inertia, np.ones(len(part.deformation)), part.deformation)


def refuse_dashpots(matrices: GivenMatrices, loose: NDArray[np.int64], null: Any) -> None:
    """Raise where damping excludes the static condensation of massless motions N: no a >= 0 has NᵀC1 = a NᵀK1.

    N may be sparse; ``loose`` is the displacement that is 1 in each column of N.
    """
    if matrices.damper is None or not loose.size:
        return
    damped, held = null.T @ matrices.damper, null.T @ matrices.stiffness
    apart = abs(damped - max(0.0, (damped * held).sum() / (held * held).sum()) * held)
    if apart.max() > BALANCED_IN_FILES * abs(matrices.damper).max():
        worst = int(loose[apart.argmax() // apart.shape[1]])
        raise UnusableMatricesError(
            f"`damping` acts on displacement {matrices.labels[worst] if matrices.labels else worst}, which has no mass",
            "give it mass, or damp all massless displacements by one multiple of `stiffness`",
        )


def _instantaneous_rise(matrices: GivenMatrices) -> Array:
    """Return N (NᵀK2 N)⁻¹ Nᵀq, the rise of temperatures N without heat capacity by the heat loads on them."""
    _, loose, null = _without_inertia(matrices.heat_capacity, "heat_capacity")
    if not loose.size:
        return np.zeros(matrices.heating.size)
    return (null @ _static_response(matrices.conductance, null, matrices.heating[:, None], "conductance"))[:, 0]


def _load_direction(load: Array | None, basis: Array) -> Array | None:
    """Return the load's direction in the structure's coordinates, ``None`` where it is that of the contact."""
    if load is None:
        return None
    direction = basis.T @ load
    tip = np.zeros(direction.size)
    tip[-1] = 1.0
    return None if np.abs(direction - tip).max() <= BALANCED_IN_FILES * np.abs(direction).max() else direction


def _contact_last(inertia: Array, stiffness: Array, contact: Array, *names: str) -> tuple[Array, Array]:
    """Return the basis E and the projection to its coordinates: those with inertia, the contact last.

    Shapes ``(given, own)`` and ``(own, given)``; given = E own.
    """
    inertial, loose, null = _without_inertia(inertia, names[0])
    share = contact @ null
    if np.abs(share).max(initial=0.0) > BALANCED_IN_FILES * np.abs(contact).max():
        problem = "the contact moves without mass: there is no impact law for it"
        if names[0] != "mass":
            problem = "the contact heats a temperature without heat capacity, which an impact would raise without bound"
        raise UnusableMatricesError(problem, f"choose a degree of freedom that has {names[0].replace('_', ' ')}")
    into, projection = np.zeros((contact.size, inertial.size)), np.zeros((inertial.size, contact.size))
    into[inertial], projection[:, inertial] = (matrix.toarray() for matrix in rows_last(contact[None, inertial])[:2])
    projection[:, loose] = -projection @ null
    projection[-1] = contact
    if loose.size:
        into -= null @ _static_response(stiffness, null, stiffness @ into, names[1])
    return into, projection


def _without_inertia(inertia: Array, name: str) -> tuple[NDArray[np.int64], NDArray[np.int64], Array]:
    """Return the coordinates with inertia, the others, and the motions without inertia, ``(given, other)``.

    A motion without inertia has 1 in one of the others and 0 in the rest of them. Mostly it is that coordinate alone,
    with a row of zeros in M; but where incompatible modes of an element share a mass it is a difference of theirs.
    """
    scale = scale_of(inertia)
    upper, order = pivots(inertia, name, scale)
    (first, loose), null = np.split(order, [len(upper)]), np.zeros((order.size, order.size - len(upper)))
    null[first] = -solve_triangular(*np.split(upper, [len(upper)], axis=1))
    null *= scale[loose] / scale[:, None]
    null[loose, np.arange(loose.size)] = 1.0
    return np.sort(first), loose, null


def _static_response(stiffness: Array, null: Array, forces: Array, name: str) -> Array:
    """Return (NᵀK N)⁻¹ Nᵀf, the static response of motions N without inertia to forces f."""
    try:
        root = np.linalg.cholesky(null.T @ stiffness @ null)
    except np.linalg.LinAlgError:
        raise UnusableMatricesError(
            f"{null.shape[1]} degrees of freedom have no inertia, and {name} does not hold them",
            "leave out degrees of freedom that are not held and have no inertia",
        ) from None
    halfway = solve_triangular(root, null.T @ forces, lower=True)
    return np.asarray(solve_triangular(root, halfway, lower=True, trans="T"))


_SINGULAR = 1e-10
"""Smallest pivot of an inertia with unit diagonal above which it is definite: consistent masses have 1e-2."""

_SUMMED = 1e-13
"""Sum of a piece's conductances over that of their magnitudes up to which it is the rounding of zero."""

MOST_SHARES = 300
"""Largest number of degrees of freedom of a contact: it fills as many rows of the matrices."""


def structure_from_sparse(matrices: GivenMatrices) -> Matrices:
    """Return the structure of sparse matrices; a small one without support or with massless parts has dense ones.

    Raises
    ------
    UnusableMatricesError
        The matrices do not describe a structure, or a large one without support.
    """
    size = max(matrices.mass.shape[0], matrices.heat_capacity.shape[0])
    is_small = size <= MOST_FULL
    if is_small and not (_is_definite(matrices.mass) and _is_definite(matrices.heat_capacity)):
        return structure_from_matrices(matrices)
    try:
        with threadpool_limits(limits=1, user_api="blas"):  # the same bits for any number of threads
            return _sparse_structure(matrices)
    except NotHeldError as error:
        if not is_small:
            raise UnusableMatricesError(
                f"a structure of {size} degrees of freedom must be held and have definite matrices: {error}",
                "hold it and let its heat leave, or check signs and that it was assembled in full",
            ) from None
        return structure_from_matrices(matrices)


def _is_definite(inertia: Any) -> bool:
    """Tell whether an inertia is definite by more than rounding, so that nothing needs condensation."""
    diagonal = inertia.diagonal()
    if not np.all(diagonal > 0):
        return False
    root = scipy.sparse.diags_array(1 / np.sqrt(diagonal))
    return is_definite(scipy.sparse.csc_array(root @ inertia @ root), _SINGULAR)


def _sparse_structure(matrices: GivenMatrices) -> Matrices:
    for name in ("contact", "thermal_contact"):
        shares = np.count_nonzero(getattr(matrices, name))
        if shares > MOST_SHARES:
            remedy = f"let it act on {MOST_SHARES} at most in a structure this large"
            raise UnusableMatricesError(f"`{name}` acts on {shares} degrees of freedom", remedy)
    rows, heat_rows = rows_last(matrices.contact[None]), rows_last(matrices.thermal_contact[None])
    (basis, projection, _), (heat_basis, heat_projection, _) = rows, heat_rows
    mechanical = sparse_pair(matrices.stiffness, matrices.mass, rows)
    thermal = sparse_pair(matrices.conductance, matrices.heat_capacity, heat_rows)
    for pair, kind in ((mechanical, "displacements"), (thermal, "temperatures")):
        warn_of_fill(pair.stiffness, kind)
        pair.refuse_unusable(kind)
    if _is_loose(thermal.stiffness):
        raise NotHeldError("heat cannot leave some temperatures, nor reach the contact's")
    if mechanical.tip_stiffness == 0:
        raise NotHeldError("nothing holds the part that the contact acts on")
    damping, damper = matrices.damping, None
    if matrices.damper is not None:
        loose = np.flatnonzero(matrices.mass.diagonal() == 0)
        refuse_dashpots(matrices, loose, scipy.sparse.eye_array(matrices.mass.shape[0], format="csc")[:, loose])
        damper = sparse_congruent(matrices.damper, basis)
        rayleigh = _as_rayleigh(damper, mechanical)
        damping, damper = (damping, damper) if rayleigh is None else (rayleigh, None)
    given = matrices.steady, matrices.heating, -np.asarray(matrices.coupling @ _rise_without_capacity(matrices))
    return Matrices(
        mechanical=mechanical,
        thermal=thermal,
        uniform_rise=np.ones(thermal.size),
        expansion=scipy.sparse.csc_array(-basis.T @ scipy.sparse.csc_array(matrices.coupling) @ heat_basis),
        damping=damping,
        load=None if matrices.load is None else np.asarray(basis.T @ matrices.load),
        damper=damper,
        coordinates=Coordinates(basis, projection, heat_basis, heat_projection, *given),
    )


def _is_loose(conductance: scipy.sparse.csc_array) -> bool:
    """Tell whether a piece without the last temperature conducts to nothing: the sum of its entries is 0."""
    links = conductance.copy()
    links.eliminate_zeros()
    pieces, piece = scipy.sparse.csgraph.connected_components(links, directed=False)
    beyond, largest = (np.bincount(piece, each.sum(axis=0), pieces) for each in (links, abs(links)))
    return bool(np.any(np.delete(beyond <= _SUMMED * largest, piece[-1])))


def _rise_without_capacity(matrices: GivenMatrices) -> Array:
    """Return the rise of temperatures without heat capacity by the heat loads on them, K, ``(given,)``."""
    loose, rise = np.flatnonzero(matrices.heat_capacity.diagonal() == 0), np.zeros(matrices.heating.size)
    rise[loose] = factorised(scipy.sparse.csc_array(matrices.conductance)[loose][:, loose])(matrices.heating[loose])
    return rise


def _as_rayleigh(damper: scipy.sparse.csc_array, pair: SparsePair) -> Rayleigh | None:
    """Return a_M and a_K where C1 = a_M M + a_K K1, which couples no modes; else ``None``."""
    scale = float(abs(damper).max()) or 1.0
    parts = [abs(matrix).max() for matrix in (pair.inertia, pair.stiffness)]
    entries = [matrix / size for matrix, size in zip((pair.inertia, pair.stiffness), parts, strict=True)]
    normal = np.array([[float((a * b).sum()) for b in entries] for a in entries])
    shares = np.linalg.solve(normal, [float((a * damper).sum()) for a in entries])
    left = damper - shares[0] * entries[0] - shares[1] * entries[1]
    if float(abs(left).max()) > ASYMMETRY * scale or np.any(shares < -ASYMMETRY * scale):
        return None
    mass, stiffness = (max(0.0, float(share / size)) for share, size in zip(shares, parts, strict=True))
    return Rayleigh(mass=mass, stiffness=stiffness)


def with_contacts(structure: Matrices, contacts: Contacts) -> Matrices:
    """Return a structure of given matrices with contacts in their coordinates; the first is its tip.

    Raises
    ------
    UnusableMatricesError
        A contact acts or slides on what is held, or moves without mass.
    """
    own = structure.coordinates
    assert own is not None
    tip, projection = structure.contacts, own.displacement_projection
    moving = contacts.transformed(own.displacement_basis, own.temperature_basis)
    normal, heat = (np.vstack([a[:1], b[1:]]) for a, b in ((tip.normal, moving.normal), (tip.heat, moving.heat)))
    moving = replace(moving, normal=normal, heat=heat)  # the tip's without rounding
    seen = np.asarray(abs(projection).sum(axis=0)).ravel() > 0
    apart = np.abs(contacts.normal - (projection.T @ moving.normal.T).T)[:, seen]
    for label, row, beyond in zip(contacts.labels, moving.normal, apart, strict=True):
        if not np.any(row):
            raise UnusableMatricesError(f"contact {label} acts only on what is held", "choose what moves")
        if beyond.max() > BALANCED_IN_FILES * np.abs(row).max():
            remedy = "choose degrees of freedom that have mass"
            raise UnusableMatricesError(f"contact {label} moves a part without mass: there is no impact law", remedy)
    if np.any(contacts.tangent.any(axis=1) & ~moving.tangent.any(axis=1)):
        raise UnusableMatricesError("`tangent` acts only on what is held", "choose what moves")
    if own.expansive.any():
        grown = structure.mechanical.solve(own.displacement_basis.T @ own.expansive)
        moving = replace(moving, growth_at_once=moving.normal @ grown)
    return replace(structure, contacts=moving)
