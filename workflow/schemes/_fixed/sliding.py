"""Friction of a casing that slides, in a fixed step: what an impulse along n - µt does beside one along n.

A contact impulse p acts on a mode by -p (φ_n - µ φᵀt).
"""

from __future__ import annotations

import numpy as np

from workflow.models import Array, Cases
from workflow.schemes._fixed.decoupled import Decoupled
from workflow.schemes._fixed.modal_balance import inverse_square
from workflow.schemes._fixed.modal_lanes import Sliding


def slides(modal: Decoupled, cases: Cases) -> bool:
    """Tell whether friction acts in some cases."""
    return modal.along is not None and bool(cases.friction.any())


def sliding(modal: Decoupled, inertia: Array) -> Sliding:
    """Return what friction does in a step in which the modes have an ``inertia``."""
    along = modal.along
    assert along is not None, "a structure with a direction of friction"
    return Sliding(
        np.ascontiguousarray(modal.tip * along / inertia),
        np.ascontiguousarray(0.5 * modal.tip * along * inverse_square(modal.tip)),
    )


def friction_message(h: float, friction: float, name: str) -> str:
    """Return what is said of a case whose friction leaves contact without a unique solution."""
    return (
        f"contact has no unique solution at h = {h:.6g} s ({name} <= 0 at friction coefficient {friction:.6g}): "
        "friction pushes the tip into the casing more than the contact force pushes it out; lower the coefficient"
    )
