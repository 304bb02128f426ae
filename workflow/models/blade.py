"""Uniform blade from geometry and material, lumped in n cells, equal or finer towards the tip."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from workflow.declare import Values, quantity, speed
from workflow.kernels import Array
from workflow.models._pair import UnusableMatricesError
from workflow.models._structure import Rayleigh
from workflow.models.chain import MOST_NODES, Chain, Spin, depends_on_speed, turned

__all__ = ["EITHER", "Parameters", "assemble", "depends_on_speed"]

_TIP_CELL = "length of the cell at the tip; others grow from it to the root by one factor; left out: all are equal"


@dataclass(frozen=True)
class Parameters:
    """Geometry and material of a uniform blade."""

    nodes: int = quantity(
        "1",
        "number of cells; the largest temperature grows with it until the cell at the tip (see tip_cell) is thinner "
        "than the depth to which heat enters in a contact",
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
    tip_cell: float | None = quantity("m", _TIP_CELL, default=None, above=0, later=True)
    spin: Spin | None = field(default=None, metadata={"later": True})
    speed: float = speed()

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


def _fill(parameters: Parameters) -> Array:
    """Return how many cells like each would fill the blade, length/ℓ_i from root to tip, ``(cell,)``."""
    n, length, cell = parameters.nodes, parameters.length, parameters.tip_cell
    if cell is None or cell == length / n:
        return np.full(n, float(n))
    if cell > length / n or n == 1:
        remedy = f"write less than {length / n:.6g} m, or leave it out"
        raise UnusableMatricesError(f"of {cell:g} m is too long for {n} cells that grow to {length:g} m", remedy)
    before = np.arange(n - 1, -1, -1.0)
    rate = np.log(length / cell) / (n - 1)  # too fast: the cell at the root alone would be as long as the blade
    for _ in range(30):  # Newton's method on the logarithm of the sum, which is convex
        grown = np.exp(before * rate)
        rate -= np.log(grown.sum() * cell / length) * grown.sum() / (before @ grown)
    return np.asarray(length / cell * np.exp(-before * rate))


def assemble(parameters: Parameters) -> Chain:
    """Lump the blade in n cells of lengths ℓ_i, half of each at either end, so that results converge as n grows.

    The tip node has half a cell of mass, heat capacity and convection; k_i = tip stiffness · length/ℓ_i, and
    κ_i = conductivity · section/ℓ_i. With a ``tip_cell`` cells grow by one factor from it to the root, else all are
    equal.
    """
    fill = _fill(parameters)
    lengths = parameters.length / fill
    section = parameters.width * parameters.thickness
    perimeter = 2 * (parameters.width + parameters.thickness)
    shares = 0.5 * (lengths + np.append(lengths[1:], 0.0))
    mass = parameters.density * section * shares
    chain = Chain(
        masses=mass,
        springs=fill * parameters.stiffness,
        damping=parameters.damping,
        free_expansion=parameters.expansion * lengths,
        heat_capacities=parameters.specific_heat * mass,
        conduction=parameters.conductivity * section / lengths,
        convection=parameters.convection * perimeter * shares,
        lengths=lengths,
    )
    return turned(chain, parameters.spin, parameters.speed)
