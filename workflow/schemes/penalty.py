"""Regularised contact: a spring and a damper that act where the tip has passed the casing.

    λ = max(0, κ (x_n - d) + c v_n)  where x_n > d,  else 0.

``explicit`` steps by central differences with v_n,k = (x_n,k+1 - x_n,k-1)/2h, stable below h = 2/ω_max
(:mod:`workflow.schemes._central`); with the tip in contact ω_max is that of the structure with κ at its
tip, which grows with κ. ``implicit`` is the θ-method (:mod:`workflow.schemes._penalty_implicit`). There is no
restitution coefficient: without c a single mass leaves as fast as it came. As h → 0 the scheme
converges to the motion with this spring; to that of a rigid casing only as κ → ∞, see :func:`rigid`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from workflow.declare import quantity
from workflow.models import Array, Cases, Structure
from workflow.schemes import _penalty_implicit as theta_method
from workflow.schemes._central import Differences, Law, central_cost, operator, tip_mobility
from workflow.schemes._central import Operator as CentralOperator
from workflow.schemes._central_march import METRICS
from workflow.schemes._central_march import compute as march
from workflow.schemes._decoupled import Decoupled, decouple
from workflow.schemes._interface import Results, Sampling
from workflow.schemes._lanes import WIDE

READS = frozenset({"h", "alpha"})

TOGETHER = WIDE

_CENTRAL = Differences()

_TIMES_STATIC = 10.0
"""The default κ in static stiffnesses of the tip: it yields a tenth of what the structure does."""


@dataclass(frozen=True)
class Options:
    """Options of the scheme.

    Attributes
    ----------
    integration
        ``explicit`` central differences or the ``implicit`` θ-method.
    """

    stiffness: float = quantity(
        "N/m", "contact stiffness; 0: ten times the static stiffness of the tip", default=0.0, at_least=0
    )
    damping: float = quantity("N*s/m", "contact damping", default=0.0, at_least=0)
    integration: Literal["explicit", "implicit"] = "explicit"
    theta: float = quantity(
        "1", "weight of the step's end where implicit, 1: implicit Euler", default=1.0, at_least=0, at_most=1
    )


def contact_stiffness(modal: Decoupled, options: Options) -> float:
    """Return κ: what is given, or ten times the static stiffness of the tip against its rigid motion.

    Raises
    ------
    ValueError
        None is given and the structure is a free mass.
    """
    if options.stiffness > 0:
        return options.stiffness
    elastic = modal.frequency > 0
    flexibility = float(np.sum((modal.tip[elastic] / modal.frequency[elastic]) ** 2))
    if flexibility == 0:
        raise ValueError("a free mass has no stiffness to take ten times of; give the scheme's `stiffness` in N/m")
    return _TIMES_STATIC / flexibility


def rigid(structure: Structure, h: float) -> Options:
    """Return options with which the scheme converges to a rigid casing with e = 0 as h → 0.

    κ and c are those that stop the free tip mass within a few steps: κ = 1/(4 h² W), c = 1/(h W), an
    overdamped contact (damping ratio 1) that stays far below the limit of the step.
    """
    mobility = tip_mobility(decouple(structure), h, _CENTRAL)
    return Options(stiffness=1 / (4 * h**2 * mobility), damping=1 / (h * mobility))


def contact_limit(structure: Structure, options: Options) -> float:
    """Return the step up to which no motion grows with the tip in contact, s: 2/ω_max of K1 with κ at the tip.

    Central damping does not move it. The implicit scheme has none of its own.
    """
    if options.integration == "implicit":
        return float("inf")
    modal = decouple(structure)
    stiffened = np.diag(modal.frequency**2) + contact_stiffness(modal, options) * np.outer(modal.tip, modal.tip)
    return float(2 / np.sqrt(np.linalg.eigvalsh(stiffened)[-1]))


def init(structure: Structure, h: float, options: Options) -> CentralOperator | theta_method.Operator:
    """Diagonalise the structure once for a batch."""
    modal = decouple(structure)
    stiffness, damping = contact_stiffness(modal, options), float(options.damping)
    if options.integration == "implicit":
        return theta_method.Operator(structure, float(h), float(options.theta), modal, stiffness, damping)
    mobility = tip_mobility(modal, h, _CENTRAL)
    share = h / (1 + 0.5 * h * damping * mobility)
    law = Law(stiffness * share, 0.5 * damping * share, 0.5 * damping * share, 0.0, holds=False, stiffness=stiffness)
    return operator(structure, float(h), _CENTRAL, modal, law)


def compute(operator: CentralOperator | theta_method.Operator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; ``e`` is not read."""
    if isinstance(operator, CentralOperator):
        return march(operator, cases, sampling)
    return theta_method.compute(operator, cases, sampling)


def amplification(frequency: Array, damping: Array, h: float, options: Options) -> Any:
    """Return the eigenvalues of the free step of each mode."""
    if options.integration == "implicit":
        return theta_method.amplification(frequency, damping, h, options.theta)
    return _CENTRAL.amplification(frequency, damping, h)


def thermal_amplification(rate: Array, h: float, options: Options) -> Array:
    """Return the factor of the free heat step of each thermal mode."""
    if options.integration == "implicit":
        return theta_method.thermal_amplification(rate, h, options.theta)
    return _CENTRAL.decay(h, rate)


def cost(structure: Structure, h: float, options: Options, sampling: Sampling) -> float:
    """Return estimated seconds per heated case."""
    return central_cost(structure, h, sampling)


__all__ = [
    "METRICS",
    "READS",
    "Options",
    "amplification",
    "compute",
    "contact_limit",
    "cost",
    "init",
    "rigid",
    "thermal_amplification",
]
