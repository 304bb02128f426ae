"""Freedoms that a program holds by a huge number on the diagonal: 1e36 of Abaqus, 1e20 or 1e30 of others.

Beside such a number nothing else of the matrix is left in floating point, and no rank can be decided: the freedoms are
left out, with their rows and columns, and stay 0.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from workflow.models._from_matrices import GivenMatrices
from workflow.models._semidefinite import UnusableMatricesError
from workflow.models._sparse import Sparse
from workflow.models._structure import Matrices

_HUGE = 1e17
"""Stiffness [N/m] or conductance [W/K] that no part of a machine has: 1e20 in mW/K."""

_BESIDE = 1e-12
"""Largest other entry of the row over the diagonal: what is left out changes the answers relatively by this."""


def with_held_left_out(given: GivenMatrices, build: Callable[[GivenMatrices], Matrices | Sparse]) -> Matrices | Sparse:
    """Return what ``build`` makes of the matrices without held freedoms, for cases that are given with them.

    Raises
    ------
    UnusableMatricesError
        The contact, its heat or the load act on nothing else.
    """
    moving, warming = ~_is_held(given.stiffness), ~_is_held(given.conductance)
    if moving.all() and warming.all():
        return build(given)
    left: dict[str, Any] = {"labels": tuple(np.array(given.labels)[moving]) if given.labels else ()}
    for name in ("mass", "stiffness", "damper", "contact", "load", "tangent", "steady"):
        left[name] = _part(getattr(given, name), moving, name)
    for name in ("heat_capacity", "conductance", "thermal_contact", "heating"):
        left[name] = _part(getattr(given, name), warming, name)
    structure = build(replace(given, coupling=given.coupling[moving][:, warming], **left))
    own = structure.coordinates
    assert own is not None
    into, heat_into = (scipy.sparse.eye_array(each.size, format="csr")[:, each] for each in (moving, warming))
    coordinates = replace(
        own,
        displacement_basis=into @ own.displacement_basis,
        displacement_projection=own.displacement_projection @ into.T,
        temperature_basis=heat_into @ own.temperature_basis,
        temperature_projection=own.temperature_projection @ heat_into.T,
        steady=given.steady,
        heating=given.heating,
        expansive=into @ own.expansive,
        held=(int((~moving).sum()), int((~warming).sum())),
    )
    return replace(structure, coordinates=coordinates)


def _is_held(matrix: Any) -> NDArray[np.bool_]:
    """Tell which freedoms of a sparse matrix are held, ``(freedom,)``."""
    diagonal = matrix.diagonal()
    beside = abs(matrix - scipy.sparse.diags_array(diagonal)).max(axis=0).toarray().ravel()
    return np.asarray((diagonal >= _HUGE) & (beside <= _BESIDE * diagonal))


def _part(value: Any, kept: NDArray[np.bool_], name: str) -> Any:
    """Return a matrix or a vector for the freedoms that are kept."""
    if value is None or value.ndim == 2:
        return None if value is None else value[kept][:, kept]
    if np.any(value) and not np.any(value[kept]) and name not in ("steady", "heating"):
        raise UnusableMatricesError(
            f"`{name}` acts on what is held by {_HUGE:g} or more on the diagonal", "choose what moves"
        )
    return value[kept]
