"""The linear system of a structure with a set of its contacts closed, in modes with all contacts open.

In free modes, y'' + c y' + ω² y + G τ = g - Σ λ_i (w_i - µ t_i), τ' + μ τ = q + α Σ λ_i s_i, with g = φᵀ(f̄ + F b).
With the contacts S closed:

- **with mass** they follow the casing, w_S y = d_S: y = P d_S + Z z with Z an orthonormal basis of the null space of
  w_S, P = w_Sᵀ(w_S w_Sᵀ)⁻¹, and

      λ = D⁻¹ (w_S (g - c y' - ω² y - G τ) - d_S''),   D = w_S (w_S - µ t_S)ᵀ,   z'' = Zᵀ (g - … + µ t_Sᵀ λ);

- **without mass**, or on an elastic casing c, their forces are linear in all modes, which stay,

      λ = Q (w_S y - r_S τ + ρ_S F - d_S),   Q = (R - µ R^t + c)_SS⁻¹.

  Where they crush a coating of hardening H > 0 it is c + 1/H in the place of c, besides a constant force.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from workflow.kernels import Array
from workflow.kernels.algebra import singular
from workflow.models._contact_basis import ContactBasis

_RIGID = 1e-13
"""Part of a row, over the whole, up to which it is 0: the rounding of some hundred terms."""


class ContactSystem(NamedTuple):
    """X_S' = A X_S + B w, signals = rows X_S + inputs w, X_S = [z, z', τ] with y = Z z + Pᵀ d."""

    A: Array
    B: Array
    signals: Array
    inputs: Array
    null: Array
    """Z, ``(mode, constrained mode)``."""
    place: Array
    """P, ``(contact, mode)``; 0 for open contacts."""


def contact_system(
    basis: ContactBasis, closed: NDArray[Any], alpha: float, friction: float, hardening: float = 0.0
) -> ContactSystem | None:
    """Return the system with some contacts closed; ``None`` where their forces are not unique.

    ``closed`` is 0 for an open contact, 1 for a closed one, 2 where it crushes a coating of a ``hardening`` [N/m],
    ``(contact,)``.
    """
    contacts, S = basis.contacts, np.flatnonzero(closed)
    n, heats, m = basis.frequency.size, basis.rate.size, contacts.count
    push, lift = (friction * basis.tangent - basis.normal)[S].T, np.zeros((n, S.size))
    try:
        if contacts.is_compliant:
            compliance = contacts.compliance(friction)[np.ix_(S, S)]
            crushing = np.flatnonzero(closed[S] == 2)
            compliance[crushing, crushing] += 1 / hardening if crushing.size else 0.0
            inverse = np.linalg.inv(compliance)  # Q
            null, still = _turned(basis, S)
            squares = (basis.frequency @ null) ** 2
        else:
            inverse = np.linalg.inv(-basis.normal[S] @ push)  # D⁻¹
            lift = basis.normal[S].T @ np.linalg.inv(basis.normal[S] @ basis.normal[S].T)  # P
            null, squares = _constrained(basis, S)
            still, push = null.shape[1], friction * basis.tangent[S].T  # w Z = 0
    except np.linalg.LinAlgError:
        return None
    modes = null.shape[1]
    z, u, tau = slice(0, modes), slice(modes, 2 * modes), slice(2 * modes, 2 * modes + heats)
    F, size = n + heats, 2 * modes + heats
    d, rate, bend = (F + 1 + k * m + S for k in range(3))
    C = np.diag(basis.damping) if basis.damping_matrix is None else basis.damping_matrix
    moved, given = np.zeros((n, size)), np.zeros((n, basis.inputs))  # y'' without forces per [z, z', τ], per input
    moved[:, z], moved[:, u], moved[:, tau] = -(basis.frequency[:, None] ** 2) * null, -C @ null, -basis.coupling
    given[:, :n], given[:, F] = np.eye(n), basis.load
    given[:, d], given[:, rate] = -(basis.frequency[:, None] ** 2) * lift, -C @ lift
    depth, depth_inputs = np.zeros((m, size)), np.zeros((m, basis.inputs))  # x_i - d_i without forces
    depth[:, z], depth[:, tau] = basis.normal @ null, -basis.residual_coupling
    depth[S, :still] = 0.0
    depth_inputs[:, F], depth_inputs[:, d] = contacts.residual_load, basis.normal @ lift
    depth_inputs[:, F + 1 : F + 1 + m] -= np.eye(m)
    if contacts.is_compliant:
        force, force_inputs = inverse @ depth[S], inverse @ depth_inputs[S]
    else:
        force, force_inputs = inverse @ basis.normal[S] @ moved, inverse @ basis.normal[S] @ given
        force_inputs[:, bend] -= inverse
    A, B = np.zeros((size, size)), np.zeros((size, basis.inputs))
    A[z, u], A[u], A[tau, tau] = np.eye(modes), null.T @ moved, -np.diag(basis.rate)
    A[u, z], A[u, u] = -np.diag(squares), _without_rounding(A[u, u])
    B[u], B[tau, n:F] = null.T @ given, np.eye(heats)
    for rows, acts in ((u, null.T @ push), (tau, alpha * basis.heat[S].T)):
        A[rows] += acts @ force
        B[rows] += acts @ force_inputs
    flexibility = contacts.flexibility(friction)[:, S]
    signals, inputs = flexibility @ force - depth, flexibility @ force_inputs - depth_inputs
    signals[S], inputs[S] = force, force_inputs
    place = np.zeros((m, n))
    place[S] = lift.T
    return ContactSystem(A, B, signals, inputs, null, place)


def _turned(basis: ContactBasis, S: Any) -> tuple[Array, int]:
    """Return the modes, ``(mode, mode)``, and how many come first: rigid motions that do not move the contacts S.

    Rigid ones are turned, and have exact zeros in other modes, so that no force depends on the place of the first.
    """
    rigid, rows = basis.frequency == 0, basis.normal[S]
    if not rigid.any():
        return np.eye(rigid.size), 0
    seen, turn = singular(rows[:, rigid] / np.linalg.norm(rows, axis=1, keepdims=True))
    each = np.eye(rigid.size)
    return np.hstack([each[:, rigid] @ turn[:, ::-1], each[:, ~rigid]]), int(np.sum(seen <= _RIGID))


def _constrained(basis: ContactBasis, S: Any) -> tuple[Array, Array]:
    """Return Z, the modes of the structure with the contacts S held, and their ω²; rigid motions that stay come first.

    They are singular values of diag(ω) Z: eigenvalues of Zᵀ diag(ω²) Z would lose the digits of low modes.
    """
    if S.size == 0:
        return np.eye(basis.frequency.size), basis.frequency**2
    modes, still = _turned(basis, S)
    seen, shapes = singular(basis.normal[S] @ modes[:, still:], graded=False)
    null = modes[:, still:] @ shapes[:, seen <= _RIGID * seen.max(initial=0.0)]
    values, vectors = singular(basis.frequency[:, None] * null, graded=False)
    return np.hstack([modes[:, :still], null @ vectors[:, ::-1]]), np.append(np.zeros(still), values[::-1] ** 2)


def _without_rounding(matrix: Array) -> Array:
    """Return a matrix that is diagonal but for rounding as a diagonal one: Rayleigh's damping of constrained modes."""
    diagonal = np.diag(np.diag(matrix))
    is_rounding = np.abs(matrix - diagonal).max(initial=0.0) <= _RIGID * np.abs(diagonal).max(initial=0.0)
    return diagonal if is_rounding else matrix
