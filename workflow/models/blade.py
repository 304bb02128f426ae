"""Uniform blade from geometry and material, lumped in n cells with half a cell at the tip."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from workflow.declare import Values, quantity
from workflow.models._structure import Rayleigh
from workflow.models.chain import MOST_NODES, Chain


@dataclass(frozen=True)
class Parameters:
    """Geometry and material of a uniform blade."""

    nodes: int = quantity(
        "1",
        "number of cells, the tip's half cell included; largest temperatures grow with it until cells are thinner than "
        "heat enters in a contact",
        at_least=1,
        at_most=MOST_NODES,
    )
    length: float = quantity("m", "length from root to tip", above=0)
    width: float = quantity("m", "width of the section", above=0)
    thickness: float = quantity("m", "thickness of the section", above=0)
    density: float = quantity("kg/m**3", "density", above=0)
    specific_heat: float = quantity("J/kg/K", "specific heat", above=0)
    conductivity: float = quantity("W/m/K", "thermal conductivity", at_least=0)
    tip_stiffness: float | None = quantity(
        "N/m", "static stiffness of the tip, normal to the casing; or youngs_modulus", default=None, at_least=0
    )
    youngs_modulus: float | None = quantity(
        "Pa",
        "of a blade that is a rod pressed along its length: tip_stiffness = E · width · thickness / length",
        default=None,
        at_least=0,
        later=True,
    )
    convection: float = quantity("W/m**2/K", "film coefficient over the perimeter", default=0.0, at_least=0)
    expansion: float = quantity("1/K", "thermal expansion coefficient", default=0.0)
    damping: Rayleigh = field(default_factory=Rayleigh)
    heating: Values = quantity("W", "constant heat load", default=0.0, per="node")

    @property
    def stiffness(self) -> float:
        """Static stiffness of the tip, N/m, as given or E · width · thickness / length."""
        if self.tip_stiffness is not None:
            return self.tip_stiffness
        assert self.youngs_modulus is not None, "one of the two is given, see EITHER"
        return self.youngs_modulus * self.width * self.thickness / self.length

    @property
    def wave_speed(self) -> float:
        """Speed of sound along a rod of this stiffness, m/s."""
        return float(np.sqrt(self.stiffness * self.length / (self.density * self.width * self.thickness)))


EITHER = ("tip_stiffness", "youngs_modulus")
"""Parameters of which a study gives exactly one."""


def assemble(parameters: Parameters) -> Chain:
    """Lump the blade in n cells of length ℓ = length/n, so that results converge as n grows.

    The tip node has half a cell of mass, heat capacity and convection; k_i = n · tip stiffness, and
    κ_i = conductivity · section / ℓ.
    """
    n = parameters.nodes
    cell = parameters.length / n
    section = parameters.width * parameters.thickness
    perimeter = 2 * (parameters.width + parameters.thickness)
    share = np.ones(n)
    share[-1] = 0.5
    mass = parameters.density * section * cell * share
    return Chain(
        masses=mass,
        springs=np.full(n, n * parameters.stiffness),
        damping=parameters.damping,
        free_expansion=np.full(n, parameters.expansion * cell),
        heat_capacities=parameters.specific_heat * mass,
        conduction=np.full(n, parameters.conductivity * section / cell),
        convection=parameters.convection * perimeter * cell * share,
    )
