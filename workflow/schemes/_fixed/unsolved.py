"""What is said of cases whose contact has no unique solution in a step."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np

from workflow.models import Array, ContactBasis, Structure, stops_together
from workflow.schemes._fixed.blocks import Step
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.step_limits import largest_step, limit_text


def matrices(step: Step, modal: ContactBasis, contact: Contact) -> Array:
    """Return W_ij, and what it has per -µ and per α, 1/kg, ``(3, contact, contact)``.

    Of compliant contacts it is what stands for W where places do for velocities: L/(hθ), or L at θ = 0.
    """
    if not modal.contacts.is_compliant:
        return step.delassus(modal)
    sinking = step.sinking(modal, contact.force_weight(step.tip.theta))
    return step.delassus(modal) + sinking / step.lever if step.lever > 0 else sinking


def divisors(step: Step, modal: ContactBasis, contact: Contact, alpha: Array, friction: Array | float) -> Array:
    """Return the divisor of the law of each contact, ``(case, contact)``: it has one solution where it is > 0."""
    cold, slid, warm = matrices(step, modal, contact).diagonal(axis1=1, axis2=2)
    w = cold + np.multiply.outer(alpha, warm) - np.multiply.outer(friction, slid)
    return np.asarray(contact.factor(step.tip.h, w))


def friction_message(h: float, friction: float, name: str) -> str:
    """Return the message of a case whose friction leaves contact without a unique solution."""
    return (
        f"contact has no unique solution at h = {h:.6g} s ({name} <= 0 at friction coefficient {friction:.6g}): "
        "friction pushes the tip into the casing more than the contact force pushes it out; lower the coefficient"
    )


def explained(
    structure: Structure, modal: ContactBasis, contact: Contact, step: Callable[[float], Step], h: float, at: Array
) -> Callable[[float, float, int], str]:
    """Return the message of cases with several contacts, by α, µ and the case, which was lost at the time ``at``.

    A law is affine, with the matrix a + b W of the step, ``factor(h, W_ii)`` on its diagonal.
    """
    labels = structure.contacts.labels

    def is_unique(h: float, alpha: float, friction: float) -> bool:
        cold, slid, warm = matrices(step(h), modal, contact)
        own = contact.factor(h, 0.0)
        w = (contact.factor(h, 1.0) - own) * (cold + alpha * warm - friction * slid)
        matrix = own * np.eye(len(w)) + w
        sets = (matrix[np.ix_(closed, closed)] for closed in stops_together(structure.contacts))
        return all(np.linalg.eigvalsh(one + one.T)[0] > 0 for one in sets)

    @cache  # a limit takes hundreds of trials
    def advice(alpha: float, friction: float) -> str:
        least = largest_step(lambda step: is_unique(step, alpha, friction), h)
        if least > 0:
            return f"the symmetric part of its matrix is positive definite up to h = {limit_text(least)} s"
        return (
            "friction pushes them into the casing more than contact forces push them out; lower the coefficient of "
            f"friction, {friction:.6g}"
        )

    def message(alpha: float, friction: float, case: int) -> str:
        when = f"h = {h:.6g} s, t = {at[case]:.6g} s, contacts {', '.join(labels)}"
        return f"contact has no unique solution at {when}: {advice(alpha, friction)}"

    return message
