"""The thermo-elastic structure that every model assembles and every scheme steps."""

from __future__ import annotations

from dataclasses import dataclass, field

from workflow.declare import quantity
from workflow.kernels import Array
from workflow.models._dense import product


@dataclass(frozen=True)
class Rayleigh:
    """Rayleigh damping C1 = a_M M + a_K K1."""

    mass: float = quantity("1/s", "mass-proportional damping a_M", default=0.0, at_least=0)
    stiffness: float = quantity("s", "stiffness-proportional damping a_K", default=0.0, at_least=0)


class Structure:
    """Equations (1a) and (1b) of a structure, full or reduced; the tip is the last coordinate.

    Stiffness and conductance are kept as springs and conductors with the maps that deform them,
    so that rank is decided on singular values (not on their squares) and positive
    semi-definiteness cannot be lost to rounding:

        spring forces  N = k (elongation x - expansion θ)
        K1  =  elongationᵀ diag(k) elongation
        K12 = -elongationᵀ diag(k) expansion
        K2  =  differenceᵀ diag(κ) difference

    Attributes
    ----------
    mass
        M, shape (mechanical, mechanical), kg.
    springs
        k, shape (spring,), N/m.
    elongation
        Elongation of each spring per displacement, shape (spring, mechanical).
    expansion
        Free thermal elongation of each spring, shape (spring, thermal), m/K.
    damping
        Rayleigh coefficients of C1 = a_M M + a_K K1.
    heat_capacity
        C2, shape (thermal, thermal), J/K.
    conductors
        κ and b, shape (conductor,), W/K.
    difference
        Temperature difference across each conductor, shape (conductor, thermal).
    content
        Heat content Σ c_i θ_i over the nodes per thermal coordinate, shape (thermal,), J/K.
    grounded
        Temperature difference across each conductor at a uniform temperature rise of 1 K: 1 where
        it leads to the root or the surroundings, 0 within the structure, shape (conductor,).
        Content and losses sum over the nodes in any basis.
    """

    mass: Array
    springs: Array
    elongation: Array
    expansion: Array
    heat_capacity: Array
    conductors: Array
    difference: Array
    content: Array
    grounded: Array
    damping: Rayleigh

    def matrices(self) -> Matrices:
        """Return the same structure by its matrices."""
        raise NotImplementedError

    def elongations(self, displacements: Array) -> Array:
        """Return the elongation of each spring, m, ``(spring, …)``, for displacements ``(mechanical, …)``."""
        return product(self.elongation, displacements)

    def forces_of(self, tensions: Array) -> Array:
        """Return elongationᵀ N, N, ``(mechanical, …)``: what spring forces ``(spring, …)`` ask of the coordinates."""
        return product(self.elongation.T, tensions)

    def expansions(self, temperatures: Array) -> Array:
        """Return the free thermal elongation of each spring, m, ``(spring, …)``, for temperatures ``(thermal, …)``."""
        return product(self.expansion, temperatures)

    def differences(self, temperatures: Array) -> Array:
        """Return the temperature difference across each conductor, K, ``(conductor, …)``."""
        return product(self.difference, temperatures)

    def inertia_forces(self, accelerations: Array) -> Array:
        """Return M a, N, ``(mechanical, …)``."""
        return product(self.mass, accelerations)

    def heat_contents(self, temperatures: Array) -> Array:
        """Return C2 θ, J, ``(thermal, …)``."""
        return product(self.heat_capacity, temperatures)

    @property
    def stiffness_matrix(self) -> Array:
        """K1, N/m."""
        return product(self.elongation.T, self.springs[:, None] * self.elongation)

    @property
    def coupling_matrix(self) -> Array:
        """K12, N/K: the spring forces of a temperature rise, equation (1a)."""
        return -product(self.elongation.T, self.springs[:, None] * self.expansion)

    @property
    def damping_matrix(self) -> Array:
        """C1, N s/m."""
        return self.damping.mass * self.mass + self.damping.stiffness * self.stiffness_matrix

    @property
    def conductance_matrix(self) -> Array:
        """K2, W/K."""
        return product(self.difference.T, self.conductors[:, None] * self.difference)

    @property
    def loss_row(self) -> Array:
        """Heat flow κ_1 θ_1 + Σ b_i θ_i out of the structure per thermal coordinate, W/K."""
        return product(self.conductors * self.grounded, self.difference)

    @property
    def mechanical_size(self) -> int:
        """Number of mechanical coordinates, the tip included."""
        return int(self.mass.shape[0])

    @property
    def thermal_size(self) -> int:
        """Number of thermal coordinates, the tip included."""
        return int(self.heat_capacity.shape[0])


@dataclass(frozen=True, eq=False)
class Matrices(Structure):
    """A structure that is given by its matrices, such as a reduced one."""

    mass: Array
    springs: Array
    elongation: Array
    expansion: Array
    heat_capacity: Array
    conductors: Array
    difference: Array
    content: Array
    grounded: Array
    damping: Rayleigh = field(default_factory=Rayleigh)
    tip_growth: Array | None = None
    """Quasi-static tip displacement per temperature, m/K, ``(thermal,)``, where it is known from a fuller structure."""

    def matrices(self) -> Matrices:
        """Return it as it is."""
        return self
