"""Lumps on a line as they are: the full structure of every model, small or large."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from workflow.kernels import Array
from workflow.models._structure import Matrices, Rayleigh, Structure

MOST_NODES = 200_000

MOST_NODES_WITH_MATRICES = 2000
"""Above, a chain has no matrices: one of them would hold 32 MB and more, its modes take a minute."""


class TooManyNodesError(ValueError):
    """A chain is too long for what would be built of n x n matrices."""

    def __init__(self, nodes: int):
        super().__init__(
            f"a chain of {nodes} nodes cannot be kept full (at most {MOST_NODES_WITH_MATRICES} can): "
            "write counts of modes, or `auto` with a `tolerance`"
        )


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

    def _shifted(self, offset: int) -> Array:
        if not self.has_matrices:
            raise TooManyNodesError(self.mechanical_size)
        return np.eye(self.mechanical_size, k=offset)

    @cached_property
    def mass(self) -> Array:  # type: ignore[override]
        """M, kg."""
        return self._shifted(0) * self.masses

    @cached_property
    def elongation(self) -> Array:  # type: ignore[override]
        """Elongation of each spring per displacement."""
        return self._shifted(0) - self._shifted(-1)

    @cached_property
    def expansion(self) -> Array:  # type: ignore[override]
        """Free thermal elongation of each spring, at the mean temperature of its ends, m/K."""
        return self.free_expansion[:, None] * ((self._shifted(0) + self._shifted(-1)) / 2)

    @property
    def stiffness_matrix(self) -> Array:
        """K1, N/m."""
        return self._tridiagonal(self.springs, np.zeros(self.mechanical_size))

    @property
    def coupling_matrix(self) -> Array:
        """K12, N/K: N_i contains -k_i a ℓ_i (θ_{i-1} + θ_i)/2, and K12 θ is N_i - N_{i+1} at node i."""
        half = self.springs * self.free_expansion / 2
        beyond = np.append(half[1:], 0.0)
        matrix = self._shifted(0) * (beyond - half)
        matrix += self._shifted(1) * np.append(0.0, half[1:]) - (self._shifted(1) * np.append(0.0, half[1:])).T
        return matrix

    @property
    def conductance_matrix(self) -> Array:
        """K2, W/K."""
        return self._tridiagonal(self.conduction, self.convection)

    def _tridiagonal(self, joints: Array, grounds: Array) -> Array:
        """Return the matrix of joints between neighbours (the first to the root) and of grounds."""
        beside = self._shifted(1) * np.append(0.0, joints[1:])
        return np.asarray(self._shifted(0) * (joints + np.append(joints[1:], 0.0) + grounds) - beside - beside.T)

    @cached_property
    def heat_capacity(self) -> Array:  # type: ignore[override]
        """C2, J/K."""
        return self._shifted(0) * self.heat_capacities

    @cached_property
    def difference(self) -> Array:  # type: ignore[override]
        """Temperature difference across each conductor: springs, then surroundings."""
        return np.concatenate([self.elongation, self._shifted(0)])

    @property
    def conductors(self) -> Array:  # type: ignore[override]
        """κ and b, W/K."""
        return np.concatenate([self.conduction, self.convection])

    @property
    def even_rise(self) -> Array:  # type: ignore[override]
        """1 at each node."""
        return np.ones(self.mechanical_size)

    def last(self, count: int) -> Chain:
        """Return the chain of the last ``count`` nodes, clamped and cold at the node before them."""
        own = slice(max(self.mechanical_size - count, 0), None)
        return Chain(
            masses=self.masses[own],
            springs=self.springs[own],
            free_expansion=self.free_expansion[own],
            heat_capacities=self.heat_capacities[own],
            conduction=self.conduction[own],
            convection=self.convection[own],
            damping=self.damping,
        )

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
