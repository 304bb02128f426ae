"""How contacts act on each other: all that an event needs to know of a structure, besides the signals.

An impulse p_j at contact j changes the velocity of contact i by -W_ij p_j and its temperature by α H_ij p_j; a force
λ_j its acceleration by -W_ij λ_j and the rate of that by -W_ij λ_j' + Γ_ij λ_j, with

    W = w (w - µ t)ᵀ,   Γ = w C (w - µ t)ᵀ - α w G sᵀ,   H = s sᵀ.

Of compliant contacts W is R - µ R^t + c: a force λ_j opens the gap i by W_ij λ_j.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.kernels import Array
from workflow.kernels.compiled import inlined
from workflow.models import ContactBasis
from workflow.schemes._exact.expansion import SUM_ROUNDING
from workflow.schemes._exact.set_motion import Case

PAIR = np.dtype(
    [(name, "f8") for name in ("delassus", "tangential", "damping", "damping_tangential", "closing", "warming")]
)
"""w wᵀ or R + c, and its decrease per friction coefficient; w C wᵀ, and its decrease; w G sᵀ; H."""


class Between(NamedTuple):
    """What contacts do to each other."""

    compliant: bool
    pairs: Any
    """:data:`PAIR`, ``(contact, contact)``."""
    jumps: Array
    """Changes of X = [y, y', τ] by w, by t and by s of each contact, ``(3, contact, N)``."""


def between(basis: ContactBasis) -> Between:
    """Return what the contacts of a basis do to each other."""
    own, (w, t, s), m, n = (
        basis.contacts,
        (basis.normal, basis.tangent, basis.heat),
        len(basis.normal),
        basis.frequency.size,
    )
    pairs, jumps = np.zeros((m, m), dtype=PAIR), np.zeros((3, m, basis.size))
    damped = w * basis.damping if basis.damping_matrix is None else w @ basis.damping_matrix
    pairs["delassus"], pairs["tangential"] = _products(w, w), _products(w, t)
    if own.is_compliant:
        pairs["delassus"], pairs["tangential"] = own.compliance(0.0), own.flexibility(0.0) - own.flexibility(1.0)
    pairs["damping"], pairs["damping_tangential"] = damped @ w.T, damped @ t.T
    pairs["closing"], pairs["warming"] = w @ basis.coupling @ s.T, basis.recorded @ s.T
    jumps[0, :, n : 2 * n], jumps[1, :, n : 2 * n], jumps[2, :, 2 * n :] = w, t, s
    return Between(own.is_compliant, pairs, jumps)


def _products(rows: Array, others: Array) -> Array:
    """Return rows · othersᵀ, ``(contact, contact)``, 0 where it is the rounding of its terms."""
    products, sizes = rows @ others.T, np.linalg.norm(rows, axis=1)[:, None] * np.linalg.norm(others, axis=1)
    return np.where(np.abs(products) <= SUM_ROUNDING * sizes, 0.0, products)


@inlined
def mobility(own: Between, case: Case, i: int, j: int) -> float:
    """Return W of a pair, 1/kg, or m/N of compliant contacts."""
    return float(own.pairs[i, j].delassus - case.friction * own.pairs[i, j].tangential)


@inlined
def drag(own: Between, case: Case, i: int, j: int) -> float:
    """Return the damping part of Γ of a pair, 1/(kg s)."""
    return float(own.pairs[i, j].damping - case.friction * own.pairs[i, j].damping_tangential)
