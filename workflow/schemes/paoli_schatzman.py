"""Central differences with Newton's law of restitution between the positions two steps apart.

Paoli, Schatzman, SIAM J. Numer. Anal. 40 (2002) 702–733, 734–768. With the distance s = x_n - d from the casing,
negative in flight,

    s_k+1 = -e s_k-1  where the free step has s_k+1 + e s_k-1 > 0,
    p_k = max(0, (s_k+1,free + e s_k-1)/(h W)),   W = e_nᵀ (M + h/2 C1)⁻¹ (e_n - µ t),

of several contacts 0 <= p ⊥ W p - (s_k+1,free + e s_k-1)/h >= 0 (:mod:`workflow.schemes._fixed.law`).

The tip may pass the casing by e times the way of one step before an impact. With e = 0 the scheme is
:mod:`~workflow.schemes.carpenter`. Stable below h = 2/ω_max and, with explicit heat, 2/μ_max: see
:mod:`workflow.schemes._fixed.central`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels.lanes import FEWEST_LANES
from workflow.models import Structure
from workflow.schemes._fixed import operator
from workflow.schemes._fixed.central import Differences as Options
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import Response, Tip
from workflow.schemes._fixed.march import contact_law
from workflow.schemes._fixed.operator import amplification as amplification
from workflow.schemes._fixed.operator import compute as compute
from workflow.schemes._fixed.operator import operator_name as operator_name
from workflow.schemes._fixed.operator import thermal_amplification as thermal_amplification

READS = frozenset({"e", "h", "alpha"})
GENERAL = frozenset({"contacts", "damping", "depth", "friction", "load"})
HARMONICS = frozenset({"load", "casing"})
TOGETHER = FEWEST_LANES
STEP_SECONDS = 1.3e-10


class Newton(NamedTuple):
    """Newton's law."""

    e: Any
    """A number, or one for each case, ``(case,)``."""


@contact_law(Newton)
def respond(law: Newton, tip: Tip, h: float, theta: float) -> Response:
    """Return the impulse p_k, and the velocity from t_k to t_k+1; ``tip.velocity`` is that from t_k-1 to t_k."""
    closing = (1.0 + law.e) * ((tip.place - tip.gap) / h) + tip.free - law.e * tip.velocity
    if closing <= 0.0:
        return 0.0, tip.free, 0.0
    p = closing / tip.mobility
    return p, tip.free - tip.mobility * p, p


CONTACT = Contact(lambda cases: Newton(cases.e))


def init(structure: Structure, h: float, options: Options) -> operator.Operator:
    """Diagonalise the structure once for a batch."""
    return operator.init(structure, float(h), options, CONTACT)
