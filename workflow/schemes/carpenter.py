"""Central differences with forward-increment Lagrange multipliers: no penetration at the next step's end.

Carpenter, Taylor, Katona, IJNME 32 (1991) 103–128. The multiplier λ_k of the step at t_k is the smallest
that keeps x_n,k+1 <= d (d_k+1 where the casing moves); its impulse is p_k = hλ_k:

    p_k = max(0, (x_n,k - d_k+1)/h + w_free) / W,   W = e_nᵀ (M + h/2 C1)⁻¹ (e_n - µ t),

with w_free the tip's velocity from t_k to t_k+1 without contact. There is no restitution
coefficient: a single mass reaches the casing in one step, loses its velocity in the next and leaves
with none. Several contacts take their impulses together, 0 <= p ⊥ W p - ((x_i,k - d_i,k+1)/h + w_i,free) >= 0
(:mod:`workflow.schemes._fixed.law`).

Stable below h = 2/ω_max and, with explicit heat, 2/μ_max: see :mod:`workflow.schemes._fixed.central`.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.lanes import FEWEST_LANES
from workflow.models import Structure
from workflow.schemes._fixed import operator
from workflow.schemes._fixed.central import Differences as Options
from workflow.schemes._fixed.contact import METRICS as METRICS
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import Response, Tip
from workflow.schemes._fixed.march import contact_law
from workflow.schemes._fixed.operator import amplification as amplification
from workflow.schemes._fixed.operator import compute as compute
from workflow.schemes._fixed.operator import operator_name as operator_name
from workflow.schemes._fixed.operator import thermal_amplification as thermal_amplification

READS = frozenset({"h", "alpha"})

GENERAL = frozenset({"contacts", "damping", "depth", "friction", "load"})

HARMONICS = frozenset({"load", "casing"})

TOGETHER = FEWEST_LANES
STEP_SECONDS = 1.3e-10


class Multiplier(NamedTuple):
    """Parameters: none, but numba needs one."""

    unused: float = 0.0


@contact_law(Multiplier)
def respond(law: Multiplier, tip: Tip, h: float, theta: float) -> Response:
    """Return the impulse p_k, and the velocity from t_k to t_k+1."""
    closing = (tip.place - tip.gap) / h + tip.free
    if closing <= 0.0:
        return 0.0, tip.free, 0.0
    p = closing / tip.mobility
    return p, tip.free - tip.mobility * p, p


CONTACT = Contact(lambda cases: Multiplier(), holds=True, rebounds=True)


def init(structure: Structure, h: float, options: Options) -> operator.Operator:
    """Diagonalise the structure once for a batch."""
    return operator.init(structure, float(h), options, CONTACT)
