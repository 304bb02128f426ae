"""A chain whose lumps stand in a text file: a row for each node, root to tip."""

from dataclasses import dataclass

import numpy as np

from workflow.declare import File, file, quantity, word
from workflow.models import Chain, Rayleigh


@dataclass(frozen=True)
class Parameters:
    """The table and what it does not hold."""

    table: File = file("text file with columns mass [kg], stiffness [N/m], heat capacity [J/K]")
    conductance: float = quantity("W/K", "conduction through each spring", default=0.5, at_least=0)
    material: str = word("name of the material, for the record", default="unknown")


def assemble(parameters: Parameters) -> Chain:
    """Return the chain, without thermal expansion."""
    masses, springs, capacities = np.loadtxt(parameters.table.place, unpack=True, ndmin=2)
    none = np.zeros(masses.size)
    conduction = np.full(masses.size, parameters.conductance)
    return Chain(masses, springs, none, capacities, conduction, none, Rayleigh(mass=10.0))
