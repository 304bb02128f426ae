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
from workflow.models import ContactBasis
from workflow.schemes._exact.expansion import SUM_ROUNDING

PAIR = np.dtype([(name, "f8") for name in ("mobility", "drag", "closing", "warming")])
"""W, 1/kg, or m/N of compliant contacts; Γ without heat, 1/(kg s); w G sᵀ; H."""


class Between(NamedTuple):
    """What contacts do to each other at one µ."""

    compliant: bool
    pairs: Any
    """:data:`PAIR`, ``(contact, contact)``."""
    jumps: Array
    """Changes of X = [y, y', τ] by w - µ t and by s of each contact, ``(2, contact, N)``."""


def between(basis: ContactBasis, friction: float) -> Between:
    """Return what the contacts of a basis do to each other at a coefficient of friction."""
    own, w, t, s, n = basis.contacts, basis.normal, basis.tangent, basis.heat, basis.frequency.size
    pairs, jumps = np.zeros((len(w), len(w)), dtype=PAIR), np.zeros((2, len(w), basis.size))
    damped = w * basis.damping if basis.damping_matrix is None else w @ basis.damping_matrix
    if own.is_compliant:
        pairs["mobility"] = own.compliance(friction)
    else:
        pairs["mobility"] = _products(w, w) - friction * _products(w, t)
    pairs["drag"] = damped @ w.T - friction * (damped @ t.T)
    pairs["closing"], pairs["warming"] = w @ basis.coupling @ s.T, basis.recorded @ s.T
    jumps[0, :, n : 2 * n], jumps[1, :, 2 * n :] = w - friction * t, s
    return Between(own.is_compliant, pairs, jumps)


def _products(rows: Array, others: Array) -> Array:
    """Return rows · othersᵀ, ``(contact, contact)``, 0 where it is the rounding of its terms."""
    products, sizes = rows @ others.T, np.linalg.norm(rows, axis=1)[:, None] * np.linalg.norm(others, axis=1)
    return np.where(np.abs(products) <= SUM_ROUNDING * sizes, 0.0, products)
