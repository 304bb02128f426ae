"""Lumps on a line as they are: the full structure of every model, small or large."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from workflow.kernels import Array
from workflow.models._chain_pair import MOST_NODES_WITH_MATRICES, ChainPair
from workflow.models._structure import Matrices, Rayleigh, Structure

MOST_NODES = 200_000


@dataclass(frozen=True, eq=False)
class Chain(Structure):
    """n lumps in line, spring i joining nodes i-1 and i; node 0 is the clamped, cold root.

    The matrices of a :class:`~workflow.models.Structure` are built when something asks for them.

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
        return ChainPair(self.springs, self.masses)

    @cached_property
    def thermal(self) -> ChainPair:  # type: ignore[override]
        """K2 and C2."""
        return ChainPair(self.conduction, self.heat_capacities, self.convection)

    @property
    def has_matrices(self) -> bool:
        """Whether the chain is short enough for matrices."""
        return self.mechanical_size <= MOST_NODES_WITH_MATRICES

    @property
    def has_massless_tip(self) -> bool:
        """Never: every node has mass."""
        return False

    @property
    def mechanical_size(self) -> int:
        """Number of nodes."""
        return self.masses.size

    @property
    def thermal_size(self) -> int:
        """Number of nodes."""
        return self.masses.size

    def matrices(self) -> Matrices:
        """Return the same structure by its matrices.

        Raises
        ------
        TooManyNodesError
            They would be too large.
        """
        names = set(Matrices.__dataclass_fields__) - {"tip_growth", "load", "damper", "coordinates"}
        return Matrices(**{name: getattr(self, name) for name in names})

    @property
    def mass(self) -> Array:  # type: ignore[override]
        """M, kg."""
        return self.mechanical.dense.inertia

    @property
    def elongation(self) -> Array:  # type: ignore[override]
        """Elongation of each spring per displacement."""
        return self.mechanical.dense.deformation

    @cached_property
    def expansion(self) -> Array:  # type: ignore[override]
        """Free thermal elongation of each spring, at the mean temperature of its ends, m/K."""
        return self.free_expansion[:, None] * (np.abs(self.elongation) / 2)

    @property
    def heat_capacity(self) -> Array:  # type: ignore[override]
        """C2, J/K."""
        return self.thermal.dense.inertia

    @property
    def difference(self) -> Array:  # type: ignore[override]
        """Temperature difference across each conductor: springs, then surroundings."""
        return self.thermal.dense.deformation

    @property
    def conductors(self) -> Array:  # type: ignore[override]
        """κ and b, W/K."""
        return np.concatenate([self.conduction, self.convection])

    @property
    def even_rise(self) -> Array:  # type: ignore[override]
        """1 at each node."""
        return np.ones(self.mechanical_size)

    def elongations(self, displacements: Array) -> Array:
        """Return x_i - x_{i-1}, m, ``(spring, …)``, for displacements ``(node, …)``."""
        return np.asarray(np.diff(displacements, axis=0, prepend=0.0))

    def forces_of(self, tensions: Array) -> Array:
        """Return N_i - N_{i+1}, N, ``(node, …)``, for spring forces N ``(spring, …)``."""
        beyond = np.zeros_like(tensions)
        beyond[:-1] = tensions[1:]
        return tensions - beyond

    def expansions(self, temperatures: Array) -> Array:
        """Return a ℓ_i (θ_{i-1} + θ_i)/2, m, ``(spring, …)``, for temperatures ``(node, …)``."""
        below = np.zeros_like(temperatures)
        below[1:] = temperatures[:-1]
        return np.asarray((self.free_expansion * ((temperatures + below) / 2).T).T)

    def differences(self, temperatures: Array) -> Array:
        """Return θ_i - θ_{i-1} of the springs, then θ_i to the surroundings, K, ``(conductor, …)``."""
        return np.asarray(np.concatenate([np.diff(temperatures, axis=0, prepend=0.0), temperatures]))

    def inertia_forces(self, accelerations: Array) -> Array:
        """Return m_i a_i, N, ``(node, …)``."""
        return np.asarray((self.masses * accelerations.T).T)

    def heat_contents(self, temperatures: Array) -> Array:
        """Return c_i θ_i, J, ``(node, …)``."""
        return np.asarray((self.heat_capacities * temperatures.T).T)

    def spring_forces(self, temperature: Array) -> Array:
        """Return what temperatures add to the spring forces N, ``(spring,)``, N: -k a ℓ (θ_{i-1}+θ_i)/2."""
        mean = (temperature + np.append(0.0, temperature[:-1])) / 2
        return np.asarray(-self.springs * self.free_expansion * mean)
