"""Residual of initial states and constant loads in the bases of a reduction."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from workflow.models import Array, Cases, Pair, Structure, distinct_rows, project
from workflow.reduction._reduction import Reduction


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
    return _residual(structure, reduction, cases.take(first))[which]


def _residual(structure: Structure, reduction: Reduction, cases: Cases) -> Array:
    """Return the projection residual of distinct cases."""
    small = reduction.project(cases)
    loads = cases.steady + cases.mean[:, None] * structure.load_direction
    carried = 0.0 if reduction.carried is None else project(reduction.carried, small.temperature)
    displacements = (
        (cases.displacement, small.displacement, carried),
        (
            structure.mechanical.static_solutions(loads),
            reduction.structure.mechanical.static_solutions(project(reduction.displacement_basis.T, loads)),
            0.0,
        ),
    )
    steady = (
        structure.thermal.static_solutions(cases.heating),
        reduction.structure.thermal.static_solutions(small.heating),
    )
    velocity, temperature = (cases.velocity, small.velocity), (cases.temperature, small.temperature)
    x, theta = reduction.displacement_basis, reduction.temperature_basis
    lost = [
        *(_lost(full, reduced, x, structure.mechanical.energies, beside) for full, reduced, beside in displacements),
        _lost(*velocity, x, _in_inertia(structure.mechanical)),
        _lost(*temperature, theta, _in_inertia(structure.thermal)),
        _lost(*steady, theta, structure.thermal.energies),
    ]
    return np.asarray(np.max(lost, axis=0))


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
