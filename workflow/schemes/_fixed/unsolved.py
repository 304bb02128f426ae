"""What is said of cases whose contact has no unique solution in a step."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from workflow.models import Array, ContactBasis, stops_together
from workflow.schemes._fixed.blocks import Step
from workflow.schemes._fixed.contact import Contact
from workflow.schemes._fixed.step_limits import largest_step, limit_text

_MOST_GROWTH = 300.0
"""Logarithm of the largest growth within a run whose squares are still finite (355), with a margin of 1e24 for loads
and units."""


def matrices(step: Step, modal: ContactBasis, contact: Contact) -> Array:
    """Return W_ij, and what it has per -µ and per α, 1/kg, ``(3, contact, contact)``.

    Of compliant contacts it is what stands for W where places do for velocities: L/(hθ), or L at θ = 0.
    """
    if not modal.contacts.is_compliant:
        return step.delassus(modal)
    sinking = step.sinking(modal, contact.force_weight(step.tip.theta))
    return step.delassus(modal) + sinking / step.lever if step.lever > 0 else sinking


def divisors(step: Step, modal: ContactBasis, contact: Contact, alpha: Array, friction: Array) -> Array:
    """Return the divisor of the law of each contact, ``(case, contact)``: it has one solution where it is > 0."""
    cold, slid, warm = matrices(step, modal, contact).diagonal(axis1=1, axis2=2)
    w = cold + np.multiply.outer(alpha, warm) - np.multiply.outer(friction, slid)
    return np.asarray(contact.factor(step.tip.h, w))


def explained(operator: Any, alpha: Array, friction: Array, duration: float, at: Array) -> Callable[[int], str]:
    """Return the message of a case with α and µ, ``(case,)``, whose laws had no solution at the time ``at``.

    A law is affine, with the matrix a + b W of the step, ``factor(h, W_ii)`` on its diagonal.
    """
    modal, h, contact, theta = operator.blocks.modal, operator.h, operator.contact, operator.blocks.step.theta
    contacts = modal.contacts
    alone, together = contacts.is_one_with_mass, stops_together(contacts)

    def is_unique(h: float, alpha: float, friction: float) -> bool:
        cold, slid, warm = matrices(operator.method.step(modal, h), modal, contact)
        own = contact.factor(h, 0.0)
        w = (contact.factor(h, 1.0) - own) * (cold + alpha * warm - friction * slid)
        matrix = own * np.eye(len(w)) + w
        return all(np.linalg.eigvalsh(one + one.T)[0] > 0 for one in (matrix[np.ix_(s, s)] for s in together))

    @cache  # a limit takes hundreds of trials
    def advice(alpha: float, friction: float) -> str:
        limit = largest_step(lambda step: is_unique(step, alpha, friction), h)
        if limit == 0 and friction != 0:
            return (
                "friction pushes the tip into the casing more than the contact force pushes it out; lower the "
                f"coefficient of friction, {friction:.6g}"
            )
        if alone and alpha * theta > 0:
            return _admissible_step(limit, theta, duration)
        holds = f"{contact.name} > 0" if alone else "the symmetric part of its matrix is positive definite"
        return f"{holds} up to h = {limit_text(limit)} s"

    def message(case: int) -> str:
        own = float(alpha[case]), float(friction[case])
        when = f", t = {at[case]:.6g} s, contacts {', '.join(contacts.labels)}"
        if alone:
            when = f" ({contact.name} <= 0 at alpha = {own[0]:.6g}, friction coefficient {own[1]:.6g})"
        return f"contact has no unique solution at h = {h:.6g} s{when}: {advice(*own)}"

    return message


def _admissible_step(limit: float, theta: float, duration: float) -> str:
    """Return the text on the largest admissible step of a case without a unique solution; W > 0 up to ``limit``.

    Friction heat that stays at the tip expands it, so that W falls to 0 about linearly, as 1 - r at h = r ``limit``.
    The heat of a pressed tip then grows by the factor (1 + r (1 - θ)/θ)/(1 - r) in each step, which has no bound at the
    limit itself. Half of the limit is recommended, or a smaller fraction where the squares of that growth over the
    duration would not be finite; as r → 0 the growth is that of the model.
    """
    for share in (0.5, 0.1, 0.01) if limit > 0 else ():
        factor = (1 + share * (1 - theta) / theta) / (1 - share)
        if np.log(factor) * duration / (share * limit) < _MOST_GROWTH:
            return (
                f"{limit:.6g} s is the limit, near which the heat of a step multiplies itself; "
                f"the largest admissible h is {share * limit:.6g} s"
            )
    return (
        f"{limit:.6g} s is the limit, but there is no largest admissible h, as the heat of a pressed tip overflows "
        "within the duration; shorten the duration, or lower alpha"
    )
