"""Lumps on a line as they are: the full structure of every model, small or large."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import scipy

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
    """

    masses: Array
    springs: Array
    free_expansion: Array
    heat_capacities: Array
    conduction: Array
    convection: Array
    damping: Rayleigh = field(default_factory=Rayleigh)

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
        """Free thermal elongation of each spring, at the mean temperature a ℓ_i (θ_{i-1} + θ_i)/2 of its ends, m/K."""
        half = self.free_expansion / 2
        if self.has_matrices:
            return np.diag(half) + np.diag(half[1:], -1)
        return scipy.sparse.diags_array([half, half[1:]], offsets=[0, -1], format="csr")

    @property
    def even_rise(self) -> Array:  # type: ignore[override]
        """1 at each node."""
        return np.ones(self.masses.size)
