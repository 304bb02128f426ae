"""Contact by a spring and a damper: in a step of the θ-method, with an implicit force, or of central differences.

In the θ-method the impulse of a step is p = h (θ λ' + (1-θ) λ), with both forces by λ = max(0, κ (x_n - d) + c v_n)
where x_n > d. With the tip at (x_a, v_a) for λ' = 0 there are two branches:

    open       λ' = 0,                                            consistent where x_a <= d or λ' below is not > 0
    in contact λ' = (κ (x_a - d) + c v_a) / (1 + hθW (hθκ + c)),  consistent where then x_n' > d

The force jumps by c v_n at the casing: where neither is consistent (the damper alone would push the
tip out again) λ' is the force between the two that puts the tip on the casing. A contact without mass sinks besides, by
its residual and its force there.

In central differences λ_k is linear in the tip's motion, and its impulse hλ_k is

    p_k = max(0, s κ (x_n,k - d) + s c/2 (w_k-½ + w_free)),   s = h / (1 + hcW/2)
    W = e_nᵀ (M + h/2 C1)⁻¹ (e_n - µ t),

with w_k-½ the tip's velocity in the step before and w_free its velocity in the step from t_k without contact.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from workflow.models import Structure
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.law import Response, Tip
from workflow.schemes._fixed.march import contact_law
from workflow.schemes._fixed.step_limits import contact_modes
from workflow.schemes._interface import RefusedStructureError

_TIMES_STATIC = 10.0
"""The default κ over the static stiffness of the tip: the spring deflects a tenth as far as the structure."""


class Spring(NamedTuple):
    """A contact spring κ [N/m] and a damper c [N s/m] in the θ-method."""

    stiffness: Any
    damping: Any


class CentralSpring(NamedTuple):
    """A contact spring κ [N/m] and a damper c [N s/m] in central differences."""

    stiffness: Any
    damping: Any


@contact_law(Spring)
def _respond(law: Spring, tip: Tip, h: float, theta: float) -> Response:
    lever, begun = h * theta, h * (1.0 - theta) * tip.force
    speed = tip.free - tip.mobility * begun if begun > 0.0 else tip.free
    depth = tip.place + h * (theta * speed + (1.0 - theta) * tip.velocity) - tip.gap - tip.sinking * begun
    force = law.stiffness * depth + law.damping * speed
    if depth <= 0.0 or force <= 0.0:
        return begun, speed, 0.0
    gives = lever * (lever * tip.mobility + tip.sinking)
    over = 1.0 + law.stiffness * gives + lever * tip.mobility * law.damping
    if force * gives > depth * over:
        force, over = depth, gives
    force /= over
    return begun + lever * force, speed - tip.mobility * (lever * force), force


@contact_law(CentralSpring)
def _respond_centrally(law: CentralSpring, tip: Tip, h: float, theta: float) -> Response:
    depth = tip.place - tip.gap
    if depth <= 0.0:
        return 0.0, tip.free, 0.0
    force = law.stiffness * depth + 0.5 * law.damping * (tip.velocity + tip.free)
    p = h * force / (1.0 + 0.5 * h * law.damping * tip.mobility)
    if p <= 0.0:
        return 0.0, tip.free, 0.0
    return p, tip.free - tip.mobility * p, p


def default_stiffness(structure: Structure) -> float:
    """Return ten times the static stiffness of the tip relative to its rigid motion, N/m.

    Of several contacts it is that of the stiffest, each alone; without mass its residual flexibility counts.

    Raises
    ------
    RefusedStructureError
        The structure is a free mass.
    """
    frequency, rows, _ = contact_modes(structure)
    elastic, residual = frequency > 0, structure.contacts.flexibility(0.0).diagonal()
    flexibility = float(np.min(np.sum((rows[:, elastic] / frequency[elastic]) ** 2, axis=1) + residual))
    if flexibility == 0:
        text = "a free mass has no stiffness to take ten times of; give the scheme's `stiffness` in N/m"
        raise RefusedStructureError(text)
    return _TIMES_STATIC / flexibility


def theta_contact(theta: float, stiffness: float, damping: float) -> Contact:
    """Return the contact with a spring κ [N/m] and a damper c [N s/m] in steps of the θ-method."""

    def factor(h: float, w: Any) -> Any:
        return 1 + h * theta * w * (h * theta * stiffness + damping)

    return Contact(
        lambda cases: Spring(stiffness, damping),
        factor,
        "1 + hθW (hθκ + c)",
        stiffness=stiffness,
        damping=damping,
        rebounds=True,
    )


def central_contact(stiffness: float, damping: float) -> Contact:
    """Return the contact with a spring κ [N/m] and a damper c [N s/m] in central differences."""
    return Contact(
        lambda cases: CentralSpring(stiffness, damping),
        lambda h, w: 1 + 0.5 * h * damping * w,
        "1 + hcW/2",
        stiffness=stiffness,
        damping=damping,
        rebounds=True,
    )
