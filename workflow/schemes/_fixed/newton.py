"""Contact of a tip with mass in a step of the θ-method: Newton's law at velocity level.

p = max(0, (v_free,n + e v_n,k)/W)  where x_n,k + h/2 v_n,k >= d,  else 0;   v_n,k+1 = -e v_n,k where p > 0
"""

from __future__ import annotations

from typing import Any, NamedTuple

from workflow.kernels.compiled import defines
from workflow.schemes._fixed.contact import Contact, Response, Tip, count_no_rebound, count_rebound
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


defines(count_rebound, Newton)(count_no_rebound)  # e is given
NEWTON = Contact(lambda cases: Newton(cases.e))
"""The contact of a tip with mass."""
