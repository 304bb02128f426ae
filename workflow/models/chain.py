"""Chain of lumped masses and heat capacities, given as they are; its equations are those of ARCHITECTURE."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from workflow.declare import Values, quantity
from workflow.kernels import Array
from workflow.models._chain import MOST_NODES, Chain
from workflow.models._structure import Rayleigh


@dataclass(frozen=True)
class Parameters:
    """Lumps of the chain, root to tip; each a scalar or one value per node or spring."""

    nodes: int = quantity("1", "number of nodes, the tip included", at_least=1, at_most=MOST_NODES)
    mass: Values = quantity("kg", "lumped masses m_i", above=0, per="node")
    stiffness: Values = quantity("N/m", "spring stiffnesses k_i", at_least=0, per="spring")
    heat_capacity: Values = quantity("J/K", "lumped heat capacities c_i", above=0, per="node")
    damping: Rayleigh = field(default_factory=Rayleigh)
    spacing: Values = quantity("m", "rest lengths of the springs", default=0.0, at_least=0, per="spring")
    expansion: Values = quantity("1/K", "thermal expansion coefficient", default=0.0, per="spring")
    conductance: Values = quantity("W/K", "conduction through a spring", default=0.0, at_least=0, per="spring")
    convection: Values = quantity("W/K", "loss to the surroundings", default=0.0, at_least=0, per="node")
    heating: Values = quantity("W", "constant heat load", default=0.0, per="node")


def assemble(parameters: Parameters) -> Chain:
    """Return the structure of equations (1a) and (1b)."""
    n = parameters.nodes

    def each(value: Values) -> Array:
        return np.broadcast_to(np.asarray(value, dtype=np.float64), (n,)).copy()

    return Chain(
        masses=each(parameters.mass),
        springs=each(parameters.stiffness),
        damping=parameters.damping,
        free_expansion=each(parameters.expansion) * each(parameters.spacing),
        heat_capacities=each(parameters.heat_capacity),
        conduction=each(parameters.conductance),
        convection=each(parameters.convection),
    )
