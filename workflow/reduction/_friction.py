"""The additional vector of a basis for friction: the static response to a force along the sliding direction.

A contact force acts along n - µt, the gap is measured along n. By its constraint mode every basis contains the static
response to a force along n at the tip; the response to t with the tip held, K_ii⁻¹ t_i, is added as one more interior
vector, orthonormal to the others in M. With both S = nᵀK1⁻¹(n - µt) is exact for every µ.
"""

from __future__ import annotations

from workflow.models import Array, Structure, UnusableMatricesError
from workflow.reduction._bases import Orthonormal
from workflow.reduction._reduction import Vectors, mechanical_vectors


def with_friction(structure: Structure, tangent: Array, mechanical: Vectors) -> Vectors:
    """Return a basis with the static response to a force along the tangent added, if it is not contained.

    Raises
    ------
    UnusableMatricesError
        The basis leaves the tip without mass.
    """
    if mechanical.has_massless_tip:
        raise UnusableMatricesError(
            "the basis leaves the tip without mass, and friction acts along a direction of its own",
            "what that deforms cannot be left without inertia; choose craig_bampton, rubin or krylov",
        )
    pair, interior = structure.mechanical, mechanical.shapes[:, :-1]
    span = Orthonormal(pair.size, min(interior.shape[1] + 1, pair.size - 1), pair.inertia_of)
    span.add_each(interior)
    if span.add(pair.solve(tangent, held=True)) is None:
        return mechanical
    return mechanical_vectors(structure, span.all())
