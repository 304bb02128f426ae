"""Regularised contact: a spring and a damper that act where the tip has passed the casing.

    λ = max(0, κ (x_n - d) + c (v_n - ḋ))  where x_n > d,  else 0.

``explicit`` steps by central differences with v_n,k = (x_n,k+1 - x_n,k-1)/2h, stable below h = 2/ω_max
(:mod:`workflow.schemes._fixed.central`); with the tip in contact ω_max is that of the structure with κ at its
tip, which grows with κ. λ_k is linear in the tip's motion, its impulse hλ_k

    p_k = max(0, s κ (x_n,k - d) + s c/2 (w_k-½ + w_free)),   s = h / (1 + hcW/2)
    W = e_nᵀ (M + h/2 C1)⁻¹ (e_n - µ t),

with w_k-½ the tip's velocity in the step before and w_free that in the step from t_k on without contact.
``implicit`` is the θ-method with λ at the step's end (:mod:`workflow.schemes._fixed.spring`). There is no
restitution coefficient: without c a single mass leaves as fast as it came. As h → 0 the scheme
converges to the motion with this spring; to that of a rigid casing only as κ → ∞, see :func:`rigid`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

from workflow.declare import quantity
from workflow.kernels.lanes import WIDE
from workflow.kernels.sums import product, total
from workflow.models import Array, Cases, Structure, mechanical_modes, needs_matrices
from workflow.schemes._fixed import central_march, dense, outcome, spring, spring_limits, theta_method
from workflow.schemes._fixed.central import NEEDS_MASS, Differences, Linear, delassus, divisor, operator
from workflow.schemes._fixed.central import Operator as CentralOperator
from workflow.schemes._fixed.costs import central_cost
from workflow.schemes._fixed.decoupled import decouple
from workflow.schemes._fixed.dense import DenseOperator
from workflow.schemes._fixed.spring import SpringOperator
from workflow.schemes._interface import Results, Sampling

METRICS = outcome.METRICS

READS = frozenset({"h", "alpha"})

GENERAL = frozenset({"damping", "friction", "load"})

HARMONICS = frozenset({"load", "casing"})

TOGETHER = WIDE

_CENTRAL = Differences()

_FACTOR = "1 + hcW/2"
"""What contact divides by, as messages write it."""

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


def contact_stiffness_of(structure: Structure, options: Options) -> float:
    """Return κ [N/m]: what is given, or ten times the static stiffness of the tip against its rigid motion.

    Raises
    ------
    ValueError
        None is given and the structure is a free mass.
    """
    if options.stiffness > 0:
        return options.stiffness
    modes = mechanical_modes(structure)
    elastic = modes.values > 0
    flexibility = total((modes.tip[elastic] / modes.values[elastic]) ** 2)
    if flexibility == 0:
        raise ValueError("a free mass has no stiffness to take ten times of; give the scheme's `stiffness` in N/m")
    return _TIMES_STATIC / flexibility


def rigid(structure: Structure, h: float) -> Options:
    """Return options with which the scheme converges to a rigid casing with e = 0 as h → 0.

    κ and c are those that stop the free tip mass within a few steps: κ = 1/(4 h² W), c = 1/(h W), an
    overdamped contact (damping ratio 1) about at the limit of the step.
    """
    w = delassus(decouple(structure), h, _CENTRAL)
    return Options(stiffness=1 / (4 * h * h * w), damping=1 / (h * w))


def contact_limit(structure: Structure, options: Options, friction: float = 0.0) -> float:
    """Return the step up to which the scheme holds while contact comes and goes, s: none where implicit with θ >= 0.75.

    Measured, see :mod:`~workflow.schemes._fixed.spring_limits`. ``friction`` is µ along the
    structure's tangent.
    """
    if options.integration == "explicit":
        return spring_limits.switching_limit(*_spring_at_tip(structure, options, friction))
    if options.theta >= spring_limits.DISSIPATES or structure.has_massless_tip:
        return float("inf")
    _, tip, stiffness, push = _spring_at_tip(structure, options, friction)
    return spring_limits.implicit_limit(options.theta, tip, stiffness, push)


def lasting_contact_limit(structure: Structure, options: Options, friction: float = 0.0) -> float:
    """Return the step up to which no motion grows while the tip stays in contact, s; for the explicit scheme only."""
    return spring_limits.lasting_limit(*_spring_at_tip(structure, options, friction))


def _spring_at_tip(structure: Structure, options: Options, friction: float) -> tuple[Array, Array, float, Array | None]:
    """Return ω and φ_n of each mode, κ, and φ_n - µ φᵀt where friction acts."""
    modes, stiffness = mechanical_modes(structure), contact_stiffness_of(structure, options)
    if structure.tangent is None or friction == 0:
        return modes.values, modes.tip, stiffness, None
    return modes.values, modes.tip, stiffness, modes.tip - friction * product(modes.shapes.T, structure.tangent)


def init(structure: Structure, h: float, options: Options) -> CentralOperator | SpringOperator | DenseOperator:
    """Diagonalise the structure once for a batch, or invert its matrices."""
    h, stiffness, damping = float(h), contact_stiffness_of(structure, options), float(options.damping)
    if options.integration == "implicit":
        theta = float(options.theta)
        if needs_matrices(structure):
            return spring.in_matrices(structure, h, theta, stiffness, damping)
        return SpringOperator(structure, h, theta, decouple(structure), stiffness, damping)

    def factor(w: Any) -> Any:
        return 1 + 0.5 * h * damping * w

    def law(w: Array | float) -> Linear:
        by, doubt = divisor(factor(w))
        share = h / by
        return Linear(stiffness * share, 0.5 * damping * share, 0.5 * damping * share, 0.0, False, stiffness, w, doubt)

    if needs_matrices(structure):
        return central_march.in_matrices(structure, h, _CENTRAL, law, factor, _FACTOR)
    return operator(structure, h, _CENTRAL, decouple(structure), law, _FACTOR)


def compute(operator: CentralOperator | SpringOperator | DenseOperator, cases: Cases, sampling: Sampling) -> Results:
    """Step a whole batch; ``e`` is not read."""
    if isinstance(operator, DenseOperator):
        return dense.compute(operator, cases, sampling)
    if isinstance(operator, CentralOperator):
        return central_march.compute(operator, cases, sampling)
    return spring.compute(operator, cases, sampling)


def operator_name(structure: Structure) -> str:
    """Return what a structure is stepped by, as ``plan`` says it."""
    return dense.operator_name(structure)


def massless_tip(options: Options) -> str | None:
    """Return why a tip without mass cannot be stepped: it takes an implicit step."""
    if options.integration == "explicit":
        return NEEDS_MASS
    return None if options.theta > 0 else theta_method.NEEDS_IMPLICIT


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
    if needs_matrices(structure):
        return dense.cost(structure, h, sampling)
    return central_cost(structure, h, sampling)
