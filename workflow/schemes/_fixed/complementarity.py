"""Contact of a tip without mass in a step of the θ-method: complementarity of gap and impulse at the step's end.

A tip without mass has no impact, and the restitution coefficient is not read. The impulse is the smallest that keeps
the tip from penetrating the casing,

    0 <= d - x_n,k+1  ⊥  p >= 0:   p = max(0, (x_free - d)/(hθW)),   x_free = x_n,k + h (θ v_free + (1-θ) v_n,k),

and a tip in contact is on the casing to the bit. Contact dissipates: its work -p (x_n,k+1 - x_n,k)/h is not positive
from a start outside the casing, so that the energy of unloaded cold motion does not grow for θ >= 1/2. Newton's law at
velocity level does not have this property without a mass at the tip.

Source: Monjaraz Tec, Gross, Krack, Computers & Structures 2022 (arXiv 2111.07693), whose step is explicit.
"""

from __future__ import annotations

from typing import NamedTuple

from workflow.kernels.compiled import defines
from workflow.schemes._fixed.contact import Contact, Law, Response, Tip, count_rebound
from workflow.schemes._fixed.march import contact_law
from workflow.schemes._fixed.rows import Own


class Complementarity(NamedTuple):
    """Parameters: none, but numba needs one."""

    unused: float = 0.0


@contact_law(Complementarity)
def _respond(law: Complementarity, tip: Tip, h: float, theta: float) -> Response:
    depth = tip.place + h * (theta * tip.free + (1.0 - theta) * tip.velocity) - tip.gap
    if depth <= 0.0:
        return 0.0, tip.free, 0.0
    p = depth / (h * theta * tip.mobility)
    return p, tip.free - depth / (h * theta), p


@defines(count_rebound, Complementarity)
def count_no_rebound(law: Law, tip: Tip, velocity: float, force: float, own: Own, lane: int) -> None:
    """Count nothing: the restitution is given, or there are no impacts."""


BY_POSITION = Contact(lambda cases: Complementarity(), holds=True)
"""The contact of a tip without mass in steps with θ > 0."""
