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
    into, heat_into = (scipy.sparse.eye_array(each.size, format="csc")[:, each] for each in (moving, warming))
    vectors = {name: getattr(given, name) for name in ("contact", "load", "tangent", "steady")}
    left: dict[str, Any] = {name: value if value is None else into.T @ value for name, value in vectors.items()}
    left["thermal_contact"] = heat_into.T @ given.thermal_contact
    for name in ("contact", "load", "tangent", "thermal_contact"):
        if left[name] is not None and not np.any(left[name]):
            raise UnusableMatricesError(f"`{name}` acts on nothing but what is held by {_HUGE:g}", "choose what moves")
    rest = replace(
        given,
        mass=into.T @ given.mass @ into,
        stiffness=into.T @ given.stiffness @ into,
        damper=None if given.damper is None else into.T @ given.damper @ into,
        coupling=into.T @ given.coupling @ heat_into,
        heat_capacity=heat_into.T @ given.heat_capacity @ heat_into,
        conductance=heat_into.T @ given.conductance @ heat_into,
        heating=heat_into.T @ given.heating,
        labels=tuple(np.array(given.labels)[moving]) if given.labels else (),
        **left,
    )
    structure = build(rest)
    own = structure.coordinates
    assert own is not None
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
    diagonal = matrix.diagonal()
    beside = abs(matrix - scipy.sparse.diags_array(diagonal)).max(axis=0).toarray().ravel()
    return np.asarray((diagonal >= _HUGE) & (beside <= _BESIDE * diagonal))
