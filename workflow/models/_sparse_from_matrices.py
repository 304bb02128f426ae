"""A sparse structure from matrices in any coordinates, with its contact as the last one.

As in :mod:`workflow.models._from_matrices`, x = E y with y = (x without x_j, wᵀx); E is the identity except one row,
and all products are sparse.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy
from threadpoolctl import threadpool_limits

from workflow.kernels import Array
from workflow.models._factors import NotHeldError, factorised, warn_of_fill
from workflow.models._from_matrices import GivenMatrices, refuse_dashpots, structure_from_matrices
from workflow.models._matrix_entries import ASYMMETRY
from workflow.models._pair import MOST_FULL
from workflow.models._semidefinite import UnusableMatricesError
from workflow.models._sparse import Sparse
from workflow.models._sparse_pair import SparsePair
from workflow.models._structure import Coordinates, Matrices, Rayleigh

_SINGULAR = 1e-10
"""Smallest pivot of an inertia with unit diagonal above which it is definite: consistent masses have 1e-2."""

_SUMMED = 1e-13
"""Sum of a piece's conductances over that of their magnitudes up to which it is the rounding of zero."""

MOST_SHARES = 300
"""Largest number of degrees of freedom of a contact: it fills as many rows of the matrices."""


def structure_from_sparse(matrices: GivenMatrices) -> Matrices | Sparse:
    """Return the structure of sparse matrices; a small one without support or with massless parts has dense ones.

    Raises
    ------
    UnusableMatricesError
        The matrices do not describe a structure, or a large one without support.
    """
    size = max(matrices.mass.shape[0], matrices.heat_capacity.shape[0])
    is_small = size <= MOST_FULL
    plain = matrices.damper is None and matrices.load is None
    if is_small and not (plain and _is_definite(matrices.mass) and _is_definite(matrices.heat_capacity)):
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
    """Tell whether a small inertia is definite by more than rounding, so that nothing needs condensation."""
    diagonal = inertia.diagonal()
    if not np.all(diagonal > 0):
        return False
    scaled = inertia.toarray() / np.sqrt(np.multiply.outer(diagonal, diagonal))
    try:
        return bool(np.diag(np.linalg.cholesky(scaled)).min() ** 2 > _SINGULAR)
    except np.linalg.LinAlgError:
        return False


def _sparse_structure(matrices: GivenMatrices) -> Sparse:
    basis, projection = _tip_last(matrices.contact, "contact")
    heat_basis, heat_projection = _tip_last(matrices.thermal_contact, "thermal_contact")
    mechanical = SparsePair(_congruent(matrices.stiffness, basis), _congruent(matrices.mass, basis))
    thermal = SparsePair(_congruent(matrices.conductance, heat_basis), _congruent(matrices.heat_capacity, heat_basis))
    for pair, kind in ((mechanical, "displacements"), (thermal, "temperatures")):
        warn_of_fill(pair.stiffness, kind)
        fault = pair.fault()
        if fault is not None:
            raise NotHeldError(f"{fault}, among {kind}")
    if _is_loose(thermal.stiffness):
        raise NotHeldError("heat cannot leave some temperatures, nor reach the contact's")
    if mechanical.tip_stiffness == 0:
        raise NotHeldError("nothing holds the part that the contact acts on")
    damping, damper = matrices.damping, None
    if matrices.damper is not None:
        loose = np.flatnonzero(matrices.mass.diagonal() == 0)
        refuse_dashpots(matrices, loose, scipy.sparse.eye_array(matrices.mass.shape[0], format="csc")[:, loose])
        damper = _congruent(matrices.damper, basis)
        rayleigh = _as_rayleigh(damper, mechanical)
        damping, damper = (damping, damper) if rayleigh is None else (rayleigh, None)
    given = matrices.steady, matrices.heating, -np.asarray(matrices.coupling @ _instantaneous_rise(matrices))
    return Sparse(
        mechanical=mechanical,
        thermal=thermal,
        expansion=scipy.sparse.csc_array(-basis.T @ scipy.sparse.csc_array(matrices.coupling) @ heat_basis),
        tangent=None if matrices.tangent is None else np.asarray(basis.T @ matrices.tangent),
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


def _instantaneous_rise(matrices: GivenMatrices) -> Array:
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


def _tip_last(contact: Array, name: str) -> tuple[scipy.sparse.csr_array, scipy.sparse.csr_array]:
    """Return E, from coordinates with the tip last to the given ones, and its inverse."""
    size, shares = contact.size, np.flatnonzero(contact)
    if shares.size > MOST_SHARES:
        raise UnusableMatricesError(
            f"`{name}` acts on {shares.size} degrees of freedom",
            f"it may act on up to {MOST_SHARES} of a structure of {size}",
        )
    tip = int(np.argmax(np.abs(contact)))
    others, each = np.delete(np.arange(size), tip), scipy.sparse.eye_array(size, format="csr")
    projection = scipy.sparse.vstack([each[others], scipy.sparse.csr_array(contact[None])], format="csr")
    row = scipy.sparse.csr_array(np.append(-contact[others], 1.0)[None] / contact[tip])
    beside = scipy.sparse.hstack([each[:, others], scipy.sparse.csr_array((size, 1))])
    basis = scipy.sparse.csr_array(beside + each[:, [tip]] @ row)
    return basis, projection


def _congruent(matrix: Any, basis: scipy.sparse.csr_array) -> scipy.sparse.csc_array:
    """Return basisᵀ · matrix · basis, symmetric to the bit."""
    transformed = scipy.sparse.csc_array(basis.T @ scipy.sparse.csc_array(matrix) @ basis)
    transformed = scipy.sparse.csc_array((transformed + transformed.T) / 2)
    transformed.sort_indices()
    return transformed
