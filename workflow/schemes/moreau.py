"""Moreau–Jean θ-method with Newton's law at velocity level and implicitly coupled heat.

    Ŵ (v_free - v_k) = h (f_θ - C1 v_k - K1 (x_k + hθ v_k) - K12 (T_k + θ δT)),   Ŵ = M + hθC1 + h²θ²K1
    T̂ δT = h (q - K2 T_k) + α p e_n,   T̂ = C2 + hθK2
    p = max(0, (v_free,n + e v_n,k) / W)  where x_n,k + h/2 v_n,k >= d,  else 0
    W = e_nᵀ Ŵ⁻¹ (e_n - µ t + α hθ K12 T̂⁻¹ e_n)
    v_k+1 = v_free - Ŵ⁻¹ (e_n - µ t) p,   x_k+1 = x_k + h (θ v_k+1 + (1-θ) v_k)

with temperatures T and v_free,n the tip's velocity without contact. Acary & Brogliato (2008), chapters 8 and 10; θ = 1
is the implicit Euler scheme of Thorin, Guérin and Legrand. Several contacts take their impulses together; contacts
without mass have no impacts: contact is the complementarity of gap and force, and e is not read
(:mod:`workflow.schemes._fixed.newton`). A structure is stepped in its modes (:mod:`workflow.schemes._fixed`).
"""

from __future__ import annotations

from dataclasses import dataclass

from workflow.declare import quantity
from workflow.kernels.lanes import FEWEST_LANES
from workflow.models import Structure
from workflow.schemes._fixed import operator
from workflow.schemes._fixed.newton import NEWTON, REST
from workflow.schemes._fixed.operator import amplification as amplification
from workflow.schemes._fixed.operator import compute as compute
from workflow.schemes._fixed.operator import operator_name as operator_name
from workflow.schemes._fixed.operator import thermal_amplification as thermal_amplification
from workflow.schemes._fixed.theta_method import ThetaMethod

READS = frozenset({"e", "h", "alpha"})
GENERAL = frozenset({"coating", "contacts", "damping", "depth", "elastic", "friction", "load", "massless"})
HARMONICS = frozenset({"load", "casing"})
TOGETHER = FEWEST_LANES
STEP_SECONDS = 1.2e-10


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    theta: float = quantity("1", "weight of the step's end, 1: implicit Euler", default=1.0, at_least=0, at_most=1)

    @property
    def method(self) -> ThetaMethod:
        """The method of the scheme."""
        return ThetaMethod(float(self.theta))


def init(structure: Structure, h: float, options: Options) -> operator.Operator:
    """Diagonalise the structure once for a batch."""
    contact = REST if structure.contacts.is_compliant else NEWTON
    return operator.init(structure, float(h), options.method, contact)
