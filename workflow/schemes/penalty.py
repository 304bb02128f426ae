"""Regularised contact: a spring and a damper that act where the tip has penetrated the casing.

    λ = max(0, κ (x_n - d) + c (v_n - ḋ))  where x_n > d,  else 0.

``explicit`` steps by central differences with v_n,k = (x_n,k+1 - x_n,k-1)/2h, stable below h = 2/ω_max
(:mod:`workflow.schemes._fixed.central`); with the tip in contact ω_max is that of the structure with κ at its
tip, which grows with κ; ``implicit`` is the θ-method with λ at the step's end. Both laws are in
:mod:`workflow.schemes._fixed.spring`. There is no restitution coefficient: without c a single mass leaves as fast as it
came. Several contacts have a spring and a damper each (:mod:`workflow.schemes._fixed.law`).

As h → 0 the scheme converges to the motion with this spring, and to that with a rigid casing only as κ → ∞, see
:func:`rigid`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Literal

from workflow.declare import quantity
from workflow.kernels.lanes import FEWEST_LANES
from workflow.models import Structure
from workflow.schemes._fixed import operator, spring, step_limits
from workflow.schemes._fixed.central import Differences
from workflow.schemes._fixed.contact import METRICS as METRICS
from workflow.schemes._fixed.operator import amplification as amplification
from workflow.schemes._fixed.operator import compute as compute
from workflow.schemes._fixed.operator import operator_name as operator_name
from workflow.schemes._fixed.operator import thermal_amplification as thermal_amplification
from workflow.schemes._fixed.theta_method import ThetaMethod
from workflow.schemes._interface import NEEDS_MASS, RefusedStructureError

READS = frozenset({"h", "alpha"})
GENERAL = frozenset({"contacts", "damping", "depth", "friction", "load", "massless"})
HARMONICS = frozenset({"load", "casing"})
TOGETHER = FEWEST_LANES
STEP_SECONDS = 1.3e-10


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    stiffness: float = quantity(
        "N/m", "contact stiffness; 0: ten times the static stiffness of the tip", default=0.0, at_least=0
    )
    damping: float = quantity("N*s/m", "contact damping", default=0.0, at_least=0)
    integration: Literal["explicit", "implicit"] = "explicit"
    """``explicit`` central differences or the ``implicit`` θ-method."""
    theta: float = quantity(
        "1", "weight of the step's end where implicit, 1: implicit Euler", default=1.0, at_least=0, at_most=1
    )

    @property
    def method(self) -> operator.Method:
        """The method of the scheme."""
        return Differences(heat="explicit") if self.integration == "explicit" else ThetaMethod(float(self.theta))


def contact_stiffness_of(structure: Structure, options: Options) -> float:
    """Return κ [N/m]: the given one, or ten times the static stiffness of the tip relative to its rigid motion.

    Of several contacts that is the stiffest.

    Raises
    ------
    RefusedStructureError
        A free mass has no stiffness; or contacts are without mass, and the step is explicit or has no force at its end.
    """
    if structure.contacts.is_massless and options.integration == "explicit":
        raise RefusedStructureError(NEEDS_MASS)
    if structure.contacts.is_massless and options.theta == 0:
        raise RefusedStructureError("contacts without mass need a force at the step's end; give it a `theta` above 0")
    return options.stiffness if options.stiffness > 0 else spring.default_stiffness(structure)


def rigid(structure: Structure, h: float) -> Options:
    """Return options with which the scheme converges to a rigid casing with e = 0 as h → 0.

    κ and c are those that stop the free tip mass within a few steps: κ = 1/(4 h² W), c = 1/(h W), W = e_nᵀ M⁻¹ e_n, an
    overdamped contact (damping ratio 1) about at the limit of the step.
    """
    w = step_limits.mobility(step_limits.contact_modes(structure))
    return Options(stiffness=1 / (4 * h * h * w), damping=1 / (h * w))


def contact_limit(structure: Structure, options: Options, friction: float = 0.0) -> float:
    """Return the largest step that is stable in intermittent contact, s: infinite where implicit with θ >= 0.75.

    So it is for contacts without mass. Measured, see :mod:`~workflow.schemes._fixed.step_limits`; ``friction`` is µ.
    """
    if options.integration == "explicit":
        return step_limits.switching_limit(structure, contact_stiffness_of(structure, options), friction)
    if options.theta >= step_limits.DISSIPATES or structure.contacts.is_massless:
        return float("inf")
    return step_limits.implicit_limit(structure, contact_stiffness_of(structure, options), friction)


def init(structure: Structure, h: float, options: Options) -> operator.Operator:
    """Diagonalise the structure once for a batch."""
    stiffness, damping = contact_stiffness_of(structure, options), float(options.damping)
    explicit = options.integration == "explicit"
    of_spring = spring.central_contact if explicit else partial(spring.theta_contact, float(options.theta))
    return operator.init(structure, float(h), options.method, of_spring(stiffness, damping))
