"""A stiffness K and an inertia M of one kind, the tip last: static answers and modes, with the tip held and free.

Mechanical K is K1 and M its mass, thermal K is K2 and M = C2. Modes are K φ = λ M φ, φᵀ M φ = 1, with λ = ω² or λ = μ.
Rigid motions and even warming of adiabatic parts have λ = 0 exactly: ranks decide it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from workflow.kernels import Array

if TYPE_CHECKING:
    from workflow.models._dense_pair import DensePair

MOST_FULL = 2000
"""Coordinates up to which a structure can be kept full: a matrix of more holds 32 MB and more, modes take a minute."""

UNBALANCED = 1e-9
"""Share of the loads above which what is left of them on a part that nothing holds moves it for ever: far above the
rounding of their sum, far below a load that somebody meant."""


class TooManyCoordinatesError(ValueError):
    """A structure has too many coordinates for what would be built of n x n matrices."""

    def __init__(self, size: int, most: int):
        super().__init__(
            f"a structure of {size} coordinates cannot be kept full (at most {MOST_FULL} can): "
            f"write `mechanical_modes` and `thermal_modes` of up to {most}, or `auto` with a `tolerance`"
        )


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes y = shapes · amplitudes that diagonalise an inertia and a stiffness.

    Attributes
    ----------
    values
        λ of a pair, ascending; ω [rad/s] of :func:`~workflow.models.mechanical_modes`. Shape ``(mode,)``.
    shapes
        Columns with shapesᵀ · inertia · shapes = 1, shape ``(coordinate, mode)``.
    has_static
        Whether the last column is the static deformation by a force on a tip without mass: its inertia is 0 and its
        λ its stiffness, N/m, so that shapesᵀ · stiffness · shapes = λ holds for it too.
    """

    values: Array
    shapes: Array
    has_static: bool = False

    @property
    def tip(self) -> Array:
        """Participation of the tip (the last coordinate) in each mode, shape ``(mode,)``."""
        return np.asarray(self.shapes[-1])

    @property
    def inertia(self) -> Array:
        """shapesᵀ · inertia · shapes: 1, and 0 of a static deformation, shape ``(mode,)``."""
        inertia = np.ones(self.values.size)
        inertia[self.values.size - self.has_static :] = 0.0
        return inertia

    def with_tip_held(self) -> Modes:
        """Return modes of what is beside the tip as those of the whole, 0 at the tip."""
        return Modes(self.values, np.vstack([self.shapes, np.zeros(self.values.size)]))


class Pair(Protocol):
    """What is asked of a stiffness and an inertia, whatever they are kept as.

    Displacements u deform springs or conductors by d = D u, and K u = forces(d): K = Dᵀ diag(weights) D. Where there
    are none, d are the forces K u themselves.
    """

    @property
    def size(self) -> int:
        """Number of coordinates."""
        ...

    @property
    def most_modes(self) -> int:
        """Most modes or vectors that are found where the structure cannot be kept full."""
        ...

    @property
    def weights(self) -> Array:
        """Springs [N/m] or conductors [W/K], ``(spring,)``."""
        ...

    @property
    def stiffness(self) -> Any:
        """K as a matrix, dense or sparse, ``(coordinate, coordinate)``."""
        ...

    @property
    def dense(self) -> DensePair:
        """The same by dense matrices.

        Raises
        ------
        TooManyCoordinatesError
            They would be too large.
        """
        ...

    def inertia_of(self, u: Array) -> Array:
        """Return M u, ``(coordinate, …)``: inertia forces [N] of accelerations, or heat contents [J]."""
        ...

    def deformation_of(self, u: Array) -> Array:
        """Return d = D u, ``(spring, …)``: elongations [m], or temperature differences [K]."""
        ...

    def forces(self, deformation: Array) -> Array:
        """Return Dᵀ diag(weights) d, ``(coordinate, …)``."""
        ...

    def work(self, u: Array, deformation: Array, expansion: Any) -> Array:
        """Return uᵀ forces(e) for free expansions e, ``(spring, …)``, dense or sparse; ``deformation`` is D u."""
        ...

    def energies(self, u: Array) -> Array:
        """Return terms whose sum is uᵀ K u, for one u ``(coordinate,)``."""
        ...

    @property
    def constraint(self) -> Array:
        """ψ, 1 at the tip, without load elsewhere, ``(coordinate,)``; parts not linked to the tip stay at 0."""
        ...

    @property
    def deformed(self) -> Array:
        """D ψ, ``(spring,)``, exactly 0 where ψ deforms nothing."""
        ...

    @property
    def tip_stiffness(self) -> float:
        """σ = ψᵀ K ψ = 1/(e_nᵀ K⁻¹ e_n); exactly 0 where the tip moves freely."""
        ...

    def modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip free, all if not said."""
        ...

    def held_modes(self, count: int | None = None) -> Modes:
        """Return the lowest modes with the tip held, all if not said; their tip is 0."""
        ...

    def answer_held(self, load: Array) -> Array:
        """Return K⁻¹ f with the tip held, ``(coordinate,)``; loads on a part that nothing holds are left out."""
        ...

    def answers_held_shifted(self) -> Callable[[Array, float], Array]:
        """Return what gives (K + s M)⁻¹ f, ``(coordinate,)``, with the tip held by f and s > 0."""
        ...

    def static_answers(self, loads: Array) -> Array:
        """Return K⁻¹ f for every case, ``(case, coordinate)``.

        On a part that nothing holds loads are balanced by its inertia first, f - M r with r its rigid motion, so that a
        deformation is left that the loads alone do not determine up to a rigid motion (inertia relief).
        """
        ...

    def moves(self, load: Array, held: bool = False) -> bool:
        """Tell whether a load ``(coordinate,)`` moves for ever what nothing holds, with the tip free or ``held``."""
        ...

    def spectrum(self) -> Array:
        """Return λ of all modes, ascending, infinite of a static deformation; of large pairs the lowest and highest."""
        ...

    def largest(self) -> float:
        """Return the largest λ; of sparse matrices about that."""
        ...
