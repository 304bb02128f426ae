"""Contact by Hunt and Crossley's law: a force κ δ^{3/2} (1 + c δ') where the tip has passed the casing by δ."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

from workflow.declare import quantity
from workflow.models import Structure
from workflow.schemes import Contact, Response, Tip, contact_law, init_theta, step_theta

READS = frozenset({"h", "alpha"})
HARMONICS = frozenset({"load", "casing"})
GENERAL = frozenset({"damping", "depth", "friction", "load"})


@dataclass(frozen=True)
class Options:
    """Options of the scheme."""

    stiffness: float = quantity("N/m**1.5", "contact stiffness", default=1e9, at_least=0)
    damping: float = quantity("s/m", "contact damping", default=0.0, at_least=0)


class HuntCrossley(NamedTuple):
    """κ [N/m^{3/2}] and c [s/m]; each a number, or an array of one for each case."""

    stiffness: Any
    damping: Any


@contact_law(HuntCrossley)
def respond(law: HuntCrossley, tip: Tip, h: float, theta: float) -> Response:
    """Return impulse, velocity and force, with δ at the step's beginning and δ' = v_free - W p at its end."""
    depth = tip.place - tip.gap
    if depth <= 0.0:
        return 0.0, tip.free, 0.0
    spring = h * law.stiffness * depth**1.5
    p = spring * (1.0 + law.damping * tip.free) / (1.0 + spring * law.damping * tip.mobility)
    if p <= 0.0:  # contact pushes, never pulls
        return 0.0, tip.free, 0.0
    return p, tip.free - tip.mobility * p, p / h


def init(structure: Structure, h: float, options: Options) -> Any:
    """Diagonalise the structure once for a batch; all else by implicit Euler, θ = 1."""
    law = HuntCrossley(options.stiffness, options.damping)
    return init_theta(structure, float(h), 1.0, Contact(lambda cases: law))


compute = step_theta
