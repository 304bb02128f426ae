"""Chain of lumped masses and heat capacities: the structure of every model of lumps on a line."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from workflow.declare import Values, quantity
from workflow.kernels import Array
from workflow.models._chain_pair import ChainPair
from workflow.models._structure import Rayleigh, Structure

MOST_NODES = 200_000


@dataclass(frozen=True, eq=False)
class Chain(Structure):
    """n lumps in line, spring i joining nodes i-1 and i; node 0 is the clamped, cold root.

    Attributes
    ----------
    masses, heat_capacities, convection
        m_i [kg], c_i [J/K] and b_i [W/K] of the nodes 1 … n, shape (n,).
    springs, conduction
        k_i [N/m] and κ_i [W/K] of the springs 1 … n, shape (n,).
    free_expansion
        a ℓ_i, free thermal elongation of a spring per kelvin [m/K], shape (n,).
    damping
        Rayleigh coefficients.
    lengths
        ℓ_i of the springs, m, shape (n,); empty where they are not known.
    """

    masses: Array
    springs: Array
    free_expansion: Array
    heat_capacities: Array
    conduction: Array
    convection: Array
    damping: Rayleigh = field(default_factory=Rayleigh)
    lengths: Array = field(default_factory=lambda: np.zeros(0))
    observed: Array | None = None

    @cached_property
    def mechanical(self) -> ChainPair:  # type: ignore[override]
        """K1 and M."""
        return ChainPair(self.springs, self.masses, np.zeros(self.masses.size))

    @cached_property
    def thermal(self) -> ChainPair:  # type: ignore[override]
        """K2 and C2."""
        return ChainPair(self.conduction, self.heat_capacities, self.convection)

    @cached_property
    def expansion(self) -> Any:
        """Free thermal elongation a ℓ_i (θ_{i-1} + θ_i)/2 of each spring per temperature, m/K."""
        half = self.free_expansion / 2
        if self.has_matrices:
            return np.diag(half) + np.diag(half[1:], -1)
        return scipy.sparse.diags_array([half, half[1:]], offsets=[0, -1], format="csr")

    def mean_over(self, depth: float) -> Array:
        """Return the weights of the nodes, ``(node,)``, in the mean temperature over a depth [m] from the tip.

        It is linear between nodes. All lengths together are at least the depth.
        """
        beyond = np.append(np.cumsum(self.lengths[:0:-1])[::-1], 0.0)  # of each spring, towards the tip
        covered = np.clip(depth - beyond, 0.0, self.lengths)
        far = np.divide(covered**2, 2 * self.lengths, out=np.zeros(covered.size), where=self.lengths > 0)
        return np.asarray((covered - far + np.append(far[1:], 0.0)) / depth)

    @property
    def uniform_rise(self) -> Array:  # type: ignore[override]
        """1 at each node."""
        return np.ones(self.masses.size)


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
        lengths=each(parameters.spacing),
    )
