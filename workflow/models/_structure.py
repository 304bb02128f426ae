"""The thermo-elastic structure that every model assembles and every scheme steps."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from workflow.declare import quantity
from workflow.kernels import Array
from workflow.models._cases import Cases, EndState, project
from workflow.models._contacts import Contacts, the_tip
from workflow.models._pair import MOST_FULL, Pair
from workflow.models._sensors import Sensors
from workflow.models._sparse_pair import SparsePair


@dataclass(frozen=True)
class Rayleigh:
    """Rayleigh damping C1 = a_M M + a_K K1, or the same damping ratio for every mode with the tip free."""

    mass: float = quantity("1/s", "mass-proportional damping a_M", default=0.0, at_least=0)
    stiffness: float = quantity("s", "stiffness-proportional damping a_K", default=0.0, at_least=0)
    ratio: float = quantity(
        "1", "damping ratio of every mode with the tip free, instead of both", default=0.0, at_least=0, later=True
    )

    def of_modes(self, frequency: Array) -> Array:
        """Return c = a_M + a_K ω² + 2 ζ ω of modes with the tip free, ω in rad/s."""
        damping = self.mass + self.stiffness * frequency**2
        return np.asarray(damping if self.ratio == 0 else damping + 2 * self.ratio * frequency)


COLD = 1e30
"""Heat capacity [J/K] of the temperature of a structure that has none: it stays cold."""


def stays_cold(shares: Array) -> bool:
    """Tell by the thermal modes' shares in contacts, 1/√(J/K), whether a structure has no temperatures."""
    return bool(np.all(shares**2 <= 2 / COLD))


@dataclass(frozen=True, eq=False)
class Transforms:
    """Transforms between the coordinates of a structure and those of another, or of its source."""

    displacement_basis: Array
    displacement_projection: Array
    """``displacement_basis``, ``displacement_projection``: transforms from own displacements to the given ones and
    back, ``(given, mechanical)`` and ``(mechanical, given)``; SciPy's sparse arrays where the source has many
    coordinates."""
    temperature_basis: Array
    temperature_projection: Array
    """``temperature_basis``, ``temperature_projection``: the same for temperatures."""

    def transformed(self, cases: Cases) -> Cases:
        """Return cases in given coordinates in those of the structure."""
        return replace(
            cases,
            steady=_brought(self.displacement_basis.T, cases.steady),
            heating=_brought(self.temperature_basis.T, cases.heating),
            displacement=_brought(self.displacement_projection, cases.displacement),
            velocity=_brought(self.displacement_projection, cases.velocity),
            temperature=_brought(self.temperature_projection, cases.temperature),
        )

    def given(self, state: EndState) -> EndState:
        """Return states of the structure in the given coordinates."""
        x, v = (_brought(self.displacement_basis, each) for each in state[:2])
        return EndState(x, v, _brought(self.temperature_basis, state.temperature))


@dataclass(frozen=True, eq=False)
class Coordinates(Transforms):
    """Coordinates of a structure's source, such as a file of matrices, where they differ from its own."""

    steady: Array
    heating: Array
    """``steady``, ``heating``: constant loads [N] and heat loads [W] of the source, ``(given,)``."""
    expansive: Array
    """Constant force by heat loads on temperatures without heat capacity, N, ``(given,)``."""
    held: tuple[int, int] = (0, 0)
    """Numbers of displacements and temperatures that the source holds at 0."""

    def transformed(self, cases: Cases) -> Cases:
        """Transform cases from these coordinates to the structure's, and add the constant loads of the source."""
        steady, heating = cases.steady + (self.steady + self.expansive), cases.heating + self.heating
        return super().transformed(replace(cases, steady=steady, heating=heating))

    @property
    def condensed(self) -> tuple[int, int]:
        """Numbers of displacements and temperatures condensed statically, without mass or heat capacity."""
        mechanical, thermal = self.displacement_basis.shape, self.temperature_basis.shape
        return mechanical[0] - mechanical[1] - self.held[0], thermal[0] - thermal[1] - self.held[1]


def _brought(matrix: Any, states: Array) -> Array:
    """Return matrix · state for every case, with bits that do not depend on other cases; the matrix may be sparse."""
    if isinstance(matrix, np.ndarray):
        return project(matrix, states)
    return np.ascontiguousarray((matrix @ states.T).T)


@dataclass(frozen=True, eq=False, kw_only=True)
class _OptionalParts:
    """Parts that a structure may lack, documented with :class:`Structure`."""

    load: Array | None = None
    damper: Any = None
    coordinates: Coordinates | None = None
    contacts: Contacts = None  # type: ignore[assignment]  # the tip, see below
    sensors: Sensors | None = None


class Structure(_OptionalParts):
    """Equations (1a) and (1b) of a structure, full or reduced; the tip is the last coordinate.

    A pair keeps stiffness and conductance as springs and conductors with the maps that deform them, so that rank is
    decided on singular values (not on their squares) and positive semi-definiteness cannot be lost to rounding:

        spring forces  N = k (D x - expansion θ),   K1 = Dᵀ diag(k) D,   K12 = -Dᵀ diag(k) expansion

    Attributes
    ----------
    mechanical
        K1 [N/m] and M [kg].
    thermal
        K2 [W/K] and C2 [J/K].
    expansion
        Free thermal elongation of each spring per temperature, m/K, ``(spring, thermal)``, dense or sparse; -K12 [N/K]
        where there are no springs.
    uniform_rise
        Temperatures p of a uniform rise by 1 K, shape (thermal,), the tip's 1: 1 at each node, or the closest to that
        in a reduction basis. The heat balance is pᵀ (1b).
    damping
        Rayleigh coefficients of C1 = a_M M + a_K K1, or a damping ratio of the modes with the tip free.
    load
        Direction b of the load F0 + F1 sin(2π f t + φ), shape (mechanical,); ``None`` for that of the first contact.
    damper
        Damping matrix D that C1 has besides, shape (mechanical, mechanical), N s/m; ``None`` for 0.
    coordinates
        Coordinates of given loads and initial states, ``None`` where they are its own.
    contacts
        Rows of its contacts, by default of one, the tip.
    sensors
        Rows that schemes record besides; ``None`` for none.
    """

    mechanical: Pair
    thermal: Pair
    expansion: Any
    uniform_rise: Array
    damping: Rayleigh

    def __post_init__(self) -> None:
        """Make the tip the one contact where none is given."""
        if self.contacts is None:
            object.__setattr__(self, "contacts", the_tip(self.mechanical_size, self.thermal_size))

    @property
    def mechanical_size(self) -> int:
        """Number of mechanical coordinates, the tip included."""
        return self.mechanical.size

    @property
    def thermal_size(self) -> int:
        """Number of thermal coordinates, the tip included."""
        return self.thermal.size

    @property
    def has_matrices(self) -> bool:
        """Whether the structure is small enough for dense matrices."""
        return max(self.mechanical_size, self.thermal_size) <= MOST_FULL

    @property
    def load_direction(self) -> Array:
        """b, (mechanical,): w where the load acts on the contact."""
        return self.contacts.normal[0] if self.load is None else self.load

    @property
    def input_sizes(self) -> tuple[int, int]:
        """Numbers of displacements and temperatures in which cases are given."""
        if self.coordinates is None:
            return self.mechanical_size, self.thermal_size
        return self.coordinates.displacement_basis.shape[0], self.coordinates.temperature_basis.shape[0]

    @property
    def input_contacts(self) -> Array:
        """Rows w_i of all contacts in the displacements in which cases are given, ``(contact, given)``."""
        normal = self.contacts.normal
        return normal if self.coordinates is None else (self.coordinates.displacement_projection.T @ normal.T).T

    def received(self, cases: Cases) -> Cases:
        """Return cases as they are given in the structure's coordinates, with the constant loads of its source."""
        return cases if self.coordinates is None else self.coordinates.transformed(cases)

    def on_casing(self, flexibility: float) -> Structure:
        """Return the structure with an elastic casing of this flexibility, m/N; 0 is a rigid one."""
        if flexibility == 0:
            return self
        return replace(self, contacts=replace(self.contacts, casing_flexibility=flexibility))

    @property
    def is_sparse(self) -> bool:
        """Whether stiffness and inertia are sparse matrices."""
        return isinstance(self.mechanical, SparsePair)

    def matrices(self) -> Matrices:
        """Return the same structure with dense matrices.

        Raises
        ------
        TooManyCoordinatesError
            They would be too large.
        """
        beside = {entry.name: getattr(self, entry.name) for entry in fields(_OptionalParts)}
        pairs, expansion = (self.mechanical.dense, self.thermal.dense), self.mechanical.expansion_of_springs
        if isinstance(self, Matrices) and pairs == (self.mechanical, self.thermal):
            return self
        if self.is_sparse and self.damper is not None:
            beside["damper"] = self.damper.toarray()
        return Matrices(*pairs, expansion(self.expansion), self.uniform_rise, self.damping, **beside)

    def sensed(self, shapes: Array, heat_shapes: Array) -> Array:
        """Return the rows of the sensors of modal coordinates, ``(sensor, mode + thermal mode)``."""
        if self.sensors is None:
            return np.zeros((0, shapes.shape[1] + heat_shapes.shape[1]))
        return self.sensors.in_modes(shapes, heat_shapes)

    def expansions(self, temperatures: Array) -> Array:
        """Return the free thermal elongation of each spring, m, ``(spring, …)``, for temperatures ``(thermal, …)``."""
        return np.asarray(self.expansion @ temperatures)

    def thermal_forces(self, temperatures: Array) -> Array:
        """Return -K12 θ, N, ``(mechanical, …)``, for temperatures ``(thermal, …)``."""
        return self.mechanical.forces(self.expansions(temperatures))

    @property
    def mass(self) -> Array:
        """M, kg."""
        return self.mechanical.dense.inertia

    @property
    def stiffness_matrix(self) -> Array:
        """K1, N/m."""
        return self.mechanical.dense.stiffness

    @property
    def coupling_matrix(self) -> Array:
        """K12, N/K: the forces per temperature rise in equation (1a)."""
        return -self.thermal_forces(np.eye(self.thermal_size))

    @property
    def damping_matrix(self) -> Array:
        """C1 = a_M M + a_K K1 + M Φ diag(2ζω) Φᵀ M + damper, N s/m, Φ the modes with the tip free."""
        whole = self.damping.mass * self.mass + self.damping.stiffness * self.stiffness_matrix
        if self.damping.ratio != 0:
            modes = self.mechanical.modes()
            moved = self.mass @ modes.shapes
            whole = whole + moved @ (2 * self.damping.ratio * np.sqrt(modes.values) * moved).T
        return np.asarray(whole if self.damper is None else whole + self.damper)

    @property
    def heat_capacity(self) -> Array:
        """C2, J/K."""
        return self.thermal.dense.inertia

    @property
    def conductance_matrix(self) -> Array:
        """K2, W/K."""
        return self.thermal.dense.stiffness

    @property
    def content(self) -> Array:
        """Heat content C2 p per thermal coordinate, J/K: over nodes Σ c_i θ_i."""
        return self.thermal.inertia_of(self.uniform_rise)

    @property
    def loss_row(self) -> Array:
        """Heat flow K2 p out of the structure per thermal coordinate, W/K: for a chain κ_1 θ_1 + Σ b_i θ_i."""
        return self.thermal.forces(self.thermal.deformation_of(self.uniform_rise))


@dataclass(frozen=True, eq=False)
class Matrices(Structure):
    """A structure of given pairs, such as one of matrices of a file or a reduced one."""

    mechanical: Pair
    thermal: Pair
    expansion: Any
    uniform_rise: Array
    damping: Rayleigh = field(default_factory=Rayleigh)
