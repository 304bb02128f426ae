"""Contact in a step of the θ-method: Newton's law at velocity level; of contacts without mass the law of their place.

p = max(0, (v_free + e v_k)/W)  where x_k + h/2 v_k >= d,  else 0;   v_k+1 = -e v_k where p > 0
p = h λ = max(0, (x_free - d)/L),   L = hθ W + (R - µ R^t + c)/h + α r T̂⁻¹ s   of compliant contacts

On a coating d is the surface as it is worn, d + w, and where λ would exceed its level F_y + H w it crushes:

λ = F_y + H w' = (F_y + H w + H (x_free - d - w))/(1 + H h L),   w' - w = x_free - d - w - L p
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import Response, Tip
from workflow.schemes._fixed.march import contact_law


class Newton(NamedTuple):
    """Newton's law."""

    e: Any
    """A number, or one for each case, ``(case,)``."""


@contact_law(Newton)
def respond(law: Newton, tip: Tip, h: float, theta: float) -> Response:
    """Return the impulse and the velocity, -e v_n,k to the bit and without the rounding of v_free - W p.

    A tip at rest on its casing stays there, in active contact, for any number of steps.
    """
    if tip.place + 0.5 * h * tip.velocity < tip.gap:
        return 0.0, tip.free, 0.0
    p = (tip.free + law.e * tip.velocity) / tip.mobility
    if p <= 0.0:
        return 0.0, tip.free, 0.0
    return p, -law.e * tip.velocity, p


NEWTON = Contact(lambda cases: Newton(cases.e))
"""The contact of a tip with mass."""


class Rest(NamedTuple):
    """The law of a compliant contact: its place is that of the casing."""

    hardening: Any = 0.0
    """H of the coating of a casing that has one, N/m."""


@contact_law(Rest)
def _rest(law: Rest, tip: Tip, h: float, theta: float) -> Response:
    """Return the impulse, the velocity of the modes, and the force at the end."""
    depth = tip.place + h * (theta * tip.free + (1.0 - theta) * tip.velocity) - tip.gap
    if depth <= 0.0:
        return 0.0, tip.free, 0.0
    gives = h * theta * tip.mobility + tip.sinking
    p = depth / gives
    if p > h * tip.level:
        force = (tip.level + law.hardening * depth) / (1.0 + law.hardening * h * gives)
        return h * force, tip.free - tip.mobility * (h * force), force
    return p, tip.free - tip.mobility * p, p / h


REST = Contact(
    lambda cases: Rest() if cases.coating is None else Rest(cases.coating.hardening), holds=True, by_place=True
)
"""That of a contact without mass, or on an elastic casing."""
